"""`glider` commands on many cases, each by a process of its own, here or on a cluster; what is answered is kept."""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from glider.hal.strict import ConfigError, decode
from glider.tools.data.errors import InputError
from glider.tools.data.files import check_writable, write_bytes
from glider.tools.data.runs.case import CASE_FILE, CaseTable
from glider.tools.data.sources import name_or_path, read_text
from glider.tools.data.vehicle_kinds import shipped_vehicles
from glider.tools.study.workers import check_reachable, work_through

TIMEOUT_S = 900.0  # s of a command
CASES, REFERENCE, VEHICLE, ANSWER = Path("cases"), Path("reference"), Path("vehicle.toml"), Path("answer")
Word = str | Path  # a path is below the folder in which a case is worked on
Advance = Callable[[int], None]


@dataclass(frozen=True)
class CaseJob:
    """A case, what is asked of it, and every file that takes, by its path: another computer may answer."""

    name: str
    files: dict[str, bytes]
    commands: list[list[Word]]  # in turn, without the program's name; their answers go into ANSWER
    answer: str  # the file in it without which there is no answer


@dataclass(frozen=True)
class Result:
    """Outcome: the files of the answer, or what went wrong."""

    files: dict[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0
    cores: int = 0
    wrong: str | None = None


def files_of(folder: Path, below: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path in `below`."""
    found = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(below / path.relative_to(folder)): path.read_bytes() for path in found}


def answer(asked: CaseJob) -> Result:
    """What is asked of a case, in a folder of its own that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="glider-") as folder:
        root, begun = Path(folder), time.perf_counter()
        for name, content in asked.files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        for command in asked.commands:
            words = [str(root / word) if isinstance(word, Path) else word for word in command]
            program = [sys.executable, "-m", "glider.tools.cli.main", *words]
            try:
                ended = subprocess.run(program, capture_output=True, text=True, timeout=TIMEOUT_S)
            except subprocess.TimeoutExpired:
                return Result(wrong=f"{asked.name}: not done after {TIMEOUT_S:.0f} s")
            if ended.returncode != 0:
                break
        seconds = time.perf_counter() - begun
        if ended.returncode != 0 or not (root / ANSWER / asked.answer).is_file():
            lines = _without(root, ended.stderr).strip().splitlines() or [f"no {asked.answer}"]
            return Result(wrong=f"{asked.name}: exit {ended.returncode}: {lines[-1]}")
        return Result(files_of(root / ANSWER, Path()), seconds, len(os.sched_getaffinity(0)))


def _without(root: Path, text: str) -> str:
    """A text without the folder that is gone."""
    for inner in (root / CASES, root):
        text = text.replace(f"{inner}{os.sep}", "")
    return text


def keep(files: dict[str, bytes], out: Path, name: str) -> None:
    """An answer's files into out/<case>, whole or not at all."""
    part, done = out / f".{name}.part", out / name
    shutil.rmtree(part, ignore_errors=True)
    for path, content in files.items():
        (part / path).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(part / path, content)
    shutil.rmtree(done, ignore_errors=True)
    part.rename(done)


@dataclass(frozen=True)
class Many:
    """Many cases by their folders, and where the answers go: a folder a case in `out`, named as the case's.

    jobs: cases at a time, 0 for one a core, each a process that takes all cores; dask: address of a scheduler, whose
    workers then get them instead. Answers do not depend on either.
    """

    cases: Sequence[Path]
    out: Path
    answer: str  # the file that says a case is answered
    jobs: int = 1
    dask: str | None = None
    again: bool = False  # answered cases too

    def todo(self) -> dict[str, Path]:
        """Cases that have no answer yet, by name; InputError where two are called alike or an answer covers a case."""
        found: dict[str, Path] = {}
        for case in self.cases:
            name = case.resolve().name
            if name in found:
                raise InputError(f"{name}: another case is called so too", source=case)
            if (self.out / name / CASE_FILE).exists():
                raise InputError("would overwrite a case: name another folder", source=self.out / name)
            found[name] = case
        there = (self.out / name / self.answer for name in found)
        return {name: case for (name, case), file in zip(found.items(), there, strict=True)
                if self.again or not file.is_file()}  # fmt: skip


def run_batch(
    many: Many,
    asked_of: Callable[[str, Path], CaseJob],
    kept: Callable[[Result], dict[str, bytes]] = lambda result: result.files,
    advance: Advance = lambda n: None,
) -> tuple[int, list[str]]:
    """Ask what has not been answered; how many were, and what failed, a line each.

    asked_of: what is asked of a case (name, folder); kept: the files that are left of its outcome.
    """
    todo = many.todo()
    if many.dask:
        check_reachable(many.dask)
    check_writable(many.out)
    many.out.mkdir(parents=True, exist_ok=True)
    advance(len(many.cases) - len(todo))
    wrong: list[str] = []
    pieces = _readable(todo, asked_of, wrong, advance)
    with contextlib.closing(work_through(answer, pieces, many.jobs, many.dask)) as work:
        for asked, result in work:
            if result.wrong:
                wrong.append(result.wrong)
            else:
                keep(kept(result), many.out, asked.name)
            advance(1)
    return len(todo) - len(wrong), sorted(wrong)


def _readable(
    todo: dict[str, Path], asked_of: Callable[[str, Path], CaseJob], wrong: list[str], advance: Advance
) -> Iterator[CaseJob]:
    """What is asked of each case; one whose files cannot be read goes to what is wrong, and stops no other."""
    for name, case in todo.items():
        try:
            if not case.is_dir():
                raise InputError("no such folder", source=case)
            yield asked_of(name, case)
        except (InputError, OSError) as error:
            wrong.append(f"{name}: {error}")
            advance(1)


@dataclass(frozen=True)
class OneCommand:
    """`glider WORDS CASE --out ... OPTIONS` of any case, for `run_batch`; files that it names beside the case go
    along.
    """

    words: Sequence[str]
    answer: str
    options: Sequence[str] = ()
    vehicle: str | None = None  # a shipped name or a file, in the place of each case's
    reference: Path | None = None  # a case that all are compared with

    def __call__(self, name: str, case: Path) -> CaseJob:
        """What is asked of a case; InputError where a file is not there."""
        command: list[Word] = [*self.words, CASES / name, "--out", ANSWER, *self.options]
        files = files_of(case, CASES / name)
        vehicle = self.vehicle or outside_vehicle(case)
        if vehicle is not None and vehicle in shipped_names():
            command += ["--vehicle", vehicle]
        elif vehicle is not None:
            text, _ = name_or_path(vehicle, "vehicle", "model/vehicles", None if self.vehicle else case)
            files[str(VEHICLE)] = text.encode()
            command += ["--vehicle", VEHICLE]
        if self.reference is not None:
            if not self.reference.is_dir():
                raise InputError("no such folder", source=self.reference)
            command += ["--reference", REFERENCE]
            files |= files_of(self.reference, REFERENCE)
        return CaseJob(name, files, [command], self.answer)


def shipped_names() -> set[str]:
    """Names of the shipped vehicles of all kinds."""
    return set(shipped_vehicles())


def outside_vehicle(case: Path) -> str | None:
    """A case's vehicle where it is neither shipped nor in the case's folder, as the case names it; else None."""
    try:
        named = decode(read_text(case / CASE_FILE), CaseTable, str(case / CASE_FILE)).vehicle
    except (ConfigError, InputError):
        return None  # the command says what is wrong
    inside = (case / named).is_file() and (case / named).resolve().is_relative_to(case.resolve())
    return None if inside or named in shipped_names() else named
