"""Every case of a blind test diagnosed, each by a process of its own, here or on a cluster; what is there is kept."""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tools.data.errors import InputError
from tools.data.runs.csvfile import write_bytes
from tools.study.challenge.diagnosis import FILE, TIMING
from tools.study.challenge.judge import case_folders
from tools.study.challenge.seal import as_json
from tools.study.challenge.watch_answer import IDENTIFIED, REFERENCE, VELOCITY, WATCH_FILE
from tools.study.workers import check_reachable, work_through

LONGEST = 900.0  # s of a command
DIAGNOSIS, WATCH, MISSION = "diagnosis", "watch", "mission"  # kinds of blind tests
ANSWERS = {DIAGNOSIS: FILE, WATCH: WATCH_FILE, MISSION: WATCH_FILE}


def commands(case: Path, part: Path, extra: tuple[str, ...], kind: str) -> list[list[str]]:
    """What is asked of a case in turn, each a `glider` command without its name; the answers go into `part`.

    A mission's vehicle is identified on the dives before anything changed; with it follow watch and velocity.
    """
    if kind == DIAGNOSIS:
        return [["gap", "diagnose", str(case), "--out", str(part), *extra]]
    before = str(case.parent.parent / REFERENCE / case.name)
    watch = ["gap", "watch", str(case), "--out", str(part), *extra, "--reference", before]
    if kind == WATCH:
        return [watch]
    vehicle = str(part / IDENTIFIED / "identified.toml")
    return [
        ["identify", before, "--out", str(part / IDENTIFIED)],
        [*watch, "--vehicle", vehicle],
        ["gap", "velocity", str(case), "--model", vehicle, "--out", str(part / VELOCITY)],
    ]


@dataclass(frozen=True)
class Asked:
    """A case and all its files, by their path beside the other cases of a blind test: another computer may answer."""

    name: str
    files: dict[str, bytes]
    extra: tuple[str, ...]
    kind: str


@dataclass(frozen=True)
class Told:
    """What came of it: the files of the answer, or what went wrong."""

    files: dict[str, bytes]
    wrong: str | None = None


def files_of(folder: Path, root: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path below the root."""
    return {str(path.relative_to(root)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def asked_of(case: Path, extra: tuple[str, ...], kind: str) -> Asked:
    """A case of a blind test, and its reference where a kind needs one."""
    root = case.parent.parent
    found = {f"cases/{name}": content for name, content in files_of(case, case.parent).items()}
    if kind != DIAGNOSIS:
        found |= files_of(root / REFERENCE / case.name, root)
    return Asked(case.name, found, extra, kind)


def answer(asked: Asked) -> Told:
    """What is asked of a case, in a folder of its own that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="glider-") as folder:
        root = Path(folder)
        for name, content in asked.files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        part, file, begun = root / "answer", ANSWERS[asked.kind], time.perf_counter()
        for command in commands(root / "cases" / asked.name, part, asked.extra, asked.kind):
            program = [sys.executable, "-m", "tools.cli.main", *command]
            try:
                ended = subprocess.run(program, capture_output=True, text=True, timeout=LONGEST)
            except subprocess.TimeoutExpired:
                return Told({}, f"{asked.name}: not done after {LONGEST:.0f} s")
            if ended.returncode != 0:
                break
        seconds = time.perf_counter() - begun
        if ended.returncode != 0 or not (part / file).is_file():
            lines = ended.stderr.replace(f"{root / 'cases'}{os.sep}", "").strip().splitlines() or [f"no {file}"]
            return Told({}, f"{asked.name}: exit {ended.returncode}: {lines[-1]}")
        timing = as_json({"seconds": seconds, "cores": len(os.sched_getaffinity(0))})
        return Told(files_of(part, part) | {TIMING: timing})


def keep(told: Told, out: Path, name: str) -> None:
    """An answer's files into out/<case>, whole or not at all."""
    part, done = out / f".{name}.part", out / name
    shutil.rmtree(part, ignore_errors=True)
    for path, content in told.files.items():
        (part / path).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(part / path, content)
    shutil.rmtree(done, ignore_errors=True)
    part.rename(done)


def run(
    cases: Path,
    out: Path,
    extra: tuple[str, ...] = (),
    jobs: int = 1,
    advance: Callable[[int], None] = lambda n: None,
    only: tuple[str, ...] = (),
    kind: str = DIAGNOSIS,
    dask: str | None = None,
) -> tuple[int, list[str]]:
    """Diagnose what has not been; how many were, and what failed.

    jobs: cases at a time, 0 for one a core, each a process that takes all cores; dask: address of a scheduler, whose
    workers then get them instead. Answers do not depend on either.
    """
    folder, _ = case_folders(cases)
    found = sorted(path for path in folder.iterdir() if (path / "case.toml").is_file())
    if only:
        missing = sorted(set(only) - {path.name for path in found})
        if missing:
            raise InputError(f"no case {missing[0]}", source=folder)
        found = [path for path in found if path.name in only]
    if not found:
        raise InputError("no cases in this folder", source=folder)
    if dask:
        check_reachable(dask)
    out.mkdir(parents=True, exist_ok=True)
    todo = [case for case in found if not (out / case.name / ANSWERS[kind]).is_file()]
    advance(len(found) - len(todo))
    wrong = []
    with contextlib.closing(work_through(answer, (asked_of(case, extra, kind) for case in todo), jobs, dask)) as work:
        for asked, told in work:
            if told.wrong:
                wrong.append(told.wrong)
            else:
                keep(told, out, asked.name)
            advance(1)
    return len(todo) - len(wrong), sorted(wrong)


def count_cases(cases: Path) -> int:
    """How many cases there are."""
    folder, _ = case_folders(cases)
    return sum((path / "case.toml").is_file() for path in folder.iterdir())
