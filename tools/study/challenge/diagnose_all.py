"""Every case of a blind test diagnosed, each by a process of its own; what is there is kept."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tools.data.errors import InputError
from tools.data.runs.csvfile import write_bytes
from tools.study.challenge.diagnosis import FILE, TIMING
from tools.study.challenge.judge import case_folders
from tools.study.challenge.seal import as_json
from tools.study.challenge.watch_answer import IDENTIFIED, REFERENCE, VELOCITY, WATCH_FILE

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


def diagnose_one(case: Path, out: Path, extra: tuple[str, ...], kind: str = DIAGNOSIS) -> str | None:
    """What is asked of a case of a kind into out/<case>, whole or not at all; what went wrong, if anything."""
    part, done = out / f".{case.name}.part", out / case.name
    shutil.rmtree(part, ignore_errors=True)
    begun = time.perf_counter()
    for asked in commands(case, part, extra, kind):
        try:
            command = [sys.executable, "-m", "tools.cli.main", *asked]
            ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
        except subprocess.TimeoutExpired:
            return f"{case.name}: not done after {LONGEST:.0f} s"
        if ended.returncode != 0:
            break
    seconds = time.perf_counter() - begun
    file = ANSWERS[kind]
    if ended.returncode != 0 or not (part / file).is_file():
        lines = ended.stderr.strip().splitlines() or [f"no {file}"]
        return f"{case.name}: exit {ended.returncode}: {lines[-1]}"
    write_bytes(part / TIMING, as_json({"seconds": seconds, "cores": len(os.sched_getaffinity(0))}))
    shutil.rmtree(done, ignore_errors=True)
    part.rename(done)
    return None


def run(
    cases: Path,
    out: Path,
    extra: tuple[str, ...] = (),
    jobs: int = 1,
    advance: Callable[[int], None] = lambda n: None,
    only: tuple[str, ...] = (),
    kind: str = DIAGNOSIS,
) -> tuple[int, list[str]]:
    """Diagnose what has not been; how many were, and what failed. jobs: at a time, each taking all cores."""
    folder, _ = case_folders(cases)
    found = sorted(path for path in folder.iterdir() if (path / "case.toml").is_file())
    if only:
        missing = sorted(set(only) - {path.name for path in found})
        if missing:
            raise InputError(f"no case {missing[0]}", source=folder)
        found = [path for path in found if path.name in only]
    if not found:
        raise InputError("no cases in this folder", source=folder)
    out.mkdir(parents=True, exist_ok=True)
    todo = [case for case in found if not (out / case.name / ANSWERS[kind]).is_file()]
    advance(len(found) - len(todo))
    wrong = []
    with ThreadPoolExecutor(jobs) as pool:
        for error in pool.map(lambda case: diagnose_one(case, out, extra, kind), todo):
            if error:
                wrong.append(error)
            advance(1)
    return len(todo) - len(wrong), wrong


def count_cases(cases: Path) -> int:
    """How many cases there are."""
    folder, _ = case_folders(cases)
    return sum((path / "case.toml").is_file() for path in folder.iterdir())
