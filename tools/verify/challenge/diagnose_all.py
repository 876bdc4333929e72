"""Every case of a blind test diagnosed, each by a process of its own, here or on a cluster; what is there is kept."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from glider.tools.cli.many_cases import ANSWER, CASES, CaseJob, Many, Result, Word, files_of, run_batch
from glider.tools.data.errors import InputError
from glider.tools.data.version import commit
from glider.tools.verify.challenge.diagnosis import FILE, TIMING
from glider.tools.verify.challenge.judge import case_folders
from glider.tools.verify.challenge.seal import as_json
from glider.tools.verify.challenge.watch_answer import IDENTIFIED, REFERENCE, VEHICLE_FILE, VELOCITY, WATCH_FILE

DIAGNOSIS, WATCH, MISSION, FORM = "diagnosis", "watch", "mission", "form"  # kinds of blind tests
ANSWERS = {DIAGNOSIS: FILE, WATCH: WATCH_FILE, MISSION: WATCH_FILE, FORM: FILE}


def commands(case: Path, part: Path, extra: tuple[str, ...], kind: str) -> list[list[Word]]:
    """What is asked of a case in turn, each a `glider` command without its name; the answers go into `part`.

    A mission's vehicle is identified on the dives before anything changed; with it follow watch and velocity. A
    vehicle of another form is identified on its healthy runs, then diagnosed against them as the vehicle that was
    identified.
    """
    if kind == DIAGNOSIS:
        diagnose: list[Word] = ["gap", "diagnose", case, "--out", part, *extra]
        return [diagnose]
    before = case.parent.parent / REFERENCE / case.name
    vehicle = part / IDENTIFIED / VEHICLE_FILE
    identify: list[Word] = ["identify", before, "--out", part / IDENTIFIED]
    if kind == FORM:
        return [
            identify, ["gap", "diagnose", case, "--vehicle", vehicle, "--reference", before, "--out", part, *extra]
        ]  # fmt: skip
    watch: list[Word] = ["gap", "watch", case, "--out", part, *extra, "--reference", before]
    if kind == WATCH:
        return [watch]
    return [
        identify,
        [*watch, "--vehicle", vehicle],
        ["gap", "velocity", case, "--model", vehicle, "--out", part / VELOCITY],
    ]


def asked_of(name: str, case: Path, extra: tuple[str, ...], kind: str) -> CaseJob:
    """What is asked of a case of a blind test, with its reference where a kind needs one."""
    found = files_of(case, CASES / name)
    if kind != DIAGNOSIS:
        found |= files_of(case.parent.parent / REFERENCE / name, Path(REFERENCE) / name)
    return CaseJob(name, found, commands(CASES / name, ANSWER, extra, kind), ANSWERS[kind])


def timed(result: Result) -> dict[str, bytes]:
    """An answer's files, how long it took, and by which version."""
    return result.files | {TIMING: as_json({"seconds": result.seconds, "cores": result.cores, "commit": commit()})}


def run(
    cases: Path,
    out: Path,
    extra: tuple[str, ...] = (),
    jobs: int = 1,
    advance: Callable[[int], None] = lambda n: None,
    only: tuple[str, ...] = (),
    kind: str = DIAGNOSIS,
    dask: str | None = None,
    again: bool = False,
) -> tuple[int, list[str]]:
    """Diagnose what has not been; how many were, and what failed. jobs, dask, again: as in many_cases.Many."""
    folder, _ = case_folders(cases)
    found = sorted(path for path in folder.iterdir() if (path / "case.toml").is_file())
    if only:
        missing = sorted(set(only) - {path.name for path in found})
        if missing:
            raise InputError(f"no case {missing[0]}", source=folder)
        found = [path for path in found if path.name in only]
    if not found:
        raise InputError("no cases in this folder", source=folder)
    asked = partial(asked_of, extra=extra, kind=kind)
    return run_batch(Many(found, out, ANSWERS[kind], jobs, dask, again), asked, timed, advance)


def count_cases(cases: Path) -> int:
    """How many cases there are."""
    folder, _ = case_folders(cases)
    return sum((path / "case.toml").is_file() for path in folder.iterdir())
