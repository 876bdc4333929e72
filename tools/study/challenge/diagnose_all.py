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
from tools.study.challenge.watch_answer import REFERENCE, WATCH_FILE

LONGEST = 900.0  # s


def diagnose_one(case: Path, out: Path, extra: tuple[str, ...], watch: bool = False) -> str | None:
    """`glider gap diagnose` (or watch) of a case into out/<case>, whole or not at all; what went wrong, if anything."""
    part, done = out / f".{case.name}.part", out / case.name
    shutil.rmtree(part, ignore_errors=True)
    asked, file = ("watch", WATCH_FILE) if watch else ("diagnose", FILE)
    command = [sys.executable, "-m", "tools.cli.main", "gap", asked, str(case), "--out", str(part), *extra]
    if watch:
        command += ["--reference", str(case.parent.parent / REFERENCE / case.name)]
    begun = time.perf_counter()
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return f"{case.name}: not done after {LONGEST:.0f} s"
    seconds = time.perf_counter() - begun
    if not (part / file).is_file():
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
    watch: bool = False,
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
    todo = [case for case in found if not (out / case.name / (WATCH_FILE if watch else FILE)).is_file()]
    advance(len(found) - len(todo))
    wrong = []
    with ThreadPoolExecutor(jobs) as pool:
        for error in pool.map(lambda case: diagnose_one(case, out, extra, watch), todo):
            if error:
                wrong.append(error)
            advance(1)
    return len(todo) - len(wrong), wrong


def count_cases(cases: Path) -> int:
    """How many cases there are."""
    folder, _ = case_folders(cases)
    return sum((path / "case.toml").is_file() for path in folder.iterdir())
