"""Answers sealed apart: one archive, whose SHA-256 stands in a manifest that may be published beforehand."""

import hashlib
import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glider.tools.data.errors import InputError
from glider.tools.data.files import whole, write_bytes

MANIFEST, ARCHIVE = "manifest.json", "answers.zip"
PLAN = "plan.json"
OF_A_DIAGNOSIS = ("labels", "places", "before", "oracle", "runs")  # keys of an answer
FORMAT = 1
_EPOCH = (1980, 1, 1, 0, 0, 0)  # no time inside: equal answers are equal archives
MAX_BYTES = 100_000_000


@dataclass
class Answers:
    """What an archive or a folder of answers holds."""

    source: Path
    cases: dict[str, dict[str, Any]]  # by name
    plan: dict[str, Any] | None  # seed and counts, of an archive
    sha256: str | None  # of an archive


def digest(data: bytes) -> str:
    """SHA-256, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def folder_digest(folder: Path) -> str:
    """SHA-256 over the names and bytes of a case's files, in the order of their names."""
    found = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        found.update(f"{path.name}\n{digest(path.read_bytes())}\n".encode())
    return found.hexdigest()


def as_json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True) + "\n").encode()


def seal(path: Path, plan: dict[str, Any], answers: dict[str, dict[str, Any]]) -> str:
    """Write the archive; its SHA-256. The same answers give the same bytes."""
    with whole(path) as (part,), zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        for name, value in [(PLAN, plan), *((f"{case}.json", answers[case]) for case in sorted(answers))]:
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), as_json(value))
    return digest(path.read_bytes())


def write_manifest(path: Path, archive: Path, sha256: str, cases: Path, *others: Path) -> None:
    """The part that is published: hashes of the answers and of every case, and nothing of what they hold.

    others: the folders of the other runs of each case, by whose names the manifest knows them.
    """
    names = sorted(folder.name for folder in cases.iterdir())
    manifest = {
        "format": FORMAT,
        "answers": {"file": archive.name, "sha256": sha256},
        "cases": {
            name: {"cases": folder_digest(cases / name)} | {one.name: folder_digest(one / name) for one in others}
            for name in names
        },
    }
    write_bytes(path, as_json(manifest))


def read_object(data: bytes, source: object) -> dict[str, Any]:
    try:
        value = json.loads(data)
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(f"not JSON: {error}", source=source) from None
    if not isinstance(value, dict):
        raise InputError("not a JSON object", source=source)
    return value


def read_manifest(path: Path) -> dict[str, Any]:
    """The manifest; InputError where it is none."""
    manifest = read_object(path.read_bytes(), path)
    answers = manifest.get("answers")
    if manifest.get("format") != FORMAT or not isinstance(answers, dict) or not isinstance(answers.get("sha256"), str):
        raise InputError("not a manifest of a blind test", source=path)
    return manifest


def check_seal(answers: Answers, manifest: Path) -> None:
    """InputError unless the archive is the one that the manifest declares."""
    declared = read_manifest(manifest)["answers"]["sha256"]
    if answers.sha256 != declared:
        raise InputError(f"SHA-256 {answers.sha256}, but {manifest} declares {declared}", source=answers.source)


def open_answers(path: Path, needed: tuple[str, ...] = OF_A_DIAGNOSIS) -> Answers:
    """Answers of an archive, or of a folder of caseNNN.json, with the keys needed; InputError where there are none."""
    if path.is_dir():
        files = sorted(path.glob("*.json"))
        if not files:
            raise InputError("no answers (*.json) in this folder", source=path)
        cases = {file.stem: _checked(read_object(file.read_bytes(), file), file, needed) for file in files}
        return Answers(path, cases, None, None)
    if not path.is_file():
        raise InputError("no such file or folder", source=path)
    cases, plan = {}, None
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MAX_BYTES:
                raise InputError(f"longer than {MAX_BYTES} bytes", source=path)
            for name in sorted(archive.namelist()):
                value = read_object(archive.read(name), f"{path}:{name}")
                if name == PLAN:
                    plan = value
                else:
                    cases[name.removesuffix(".json")] = _checked(value, f"{path}:{name}", needed)
    except zipfile.BadZipFile as error:
        raise InputError(f"not an archive of answers: {error}", source=path) from None
    if not cases:
        raise InputError("no answers in this archive", source=path)
    return Answers(path, cases, plan, digest(path.read_bytes()))


def _checked(answer: dict[str, Any], source: object, needed: tuple[str, ...]) -> dict[str, Any]:
    for key in needed:
        if key not in answer:
            raise InputError("the key is missing", source=source, column=key)
    return answer
