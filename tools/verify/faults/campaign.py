"""The fault campaign: every row of the fault table, in every way it breaks, in every phase that fits, judged.

A row passes if each of its cases is noticed within its time and two ticks, asks for the reaction expected, and no
flight ends other than at the surface or safe (never left it, or refused before).
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from glider.firmware.faults import FAULTS
from glider.tools.study.workers import end_with_parent
from glider.tools.verify.faults.cases import FaultCase, Show
from glider.tools.verify.faults.flights import flown
from glider.tools.verify.faults.scene import build_scene, fly
from glider.tools.verify.faults.shows import shows

TWO_TICKS_S = 2 * 0.02
SEED = 1
GOOD = ("surfaced", "safe")


@dataclass(frozen=True)
class FaultOutcome:
    """One case in one phase."""

    row: int
    case: str
    phase: str
    noticed_s: float | None
    allowed_s: float
    reaction: str
    expected: str
    ended: str

    @property
    def passed(self) -> bool:
        noticed = self.noticed_s is not None and -1e-9 <= self.noticed_s <= self.allowed_s + TWO_TICKS_S + 1e-9
        return noticed and self.reaction == self.expected and self.ended in GOOD


def jobs(only: int | None = None) -> list[tuple[int, str]]:
    """Every case and phase, as index and phase; shows have the phase "-"."""
    found = []
    for index, case in enumerate(everything()):
        if only is None or case.row == only:
            found += [(index, phase) for phase in (case.phases if isinstance(case, FaultCase) else ("-",))]
    return found


def everything() -> list[FaultCase | Show]:
    return [*shows(), *flown()]


def run(job: tuple[int, str], disabled: int | None = None) -> FaultOutcome:
    """One case in one phase, in this process; `disabled`: the row whose detector is switched off."""
    index, phase = job
    case = everything()[index]
    with tempfile.TemporaryDirectory(prefix="glider-faults-") as folder:
        if isinstance(case, Show):
            noticed, reaction, ended = case.run(disabled == case.row, Path(folder))
            return FaultOutcome(case.row, case.name, phase, noticed, case.allowed_s, reaction, case.expected, ended)
        scene = build_scene(phase, case.begin, case.setting, SEED, Path(folder, "mission.toml"))
        scene.late = case.late
        observed = fly(scene, case.row, allowed_s=case.allowed_s, disabled=disabled)
        scene.finish()
    return FaultOutcome(
        case.row, case.name, phase, observed.noticed_s, case.allowed_s, observed.reaction.name, case.expected.name,
        observed.ended,
    )  # fmt: skip


def _muted() -> None:
    """Workers hold their tongue, what the parts under test say is not the campaign's, and end with it."""
    end_with_parent()
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    os.close(null)


def run_all(
    only: int | None, disabled: int | None, workers: int, advance: Callable[[int], None]
) -> Iterator[FaultOutcome]:
    """Every outcome, in the order of the jobs."""
    wanted = jobs(only)
    with ProcessPoolExecutor(workers, initializer=_muted) as pool:
        futures = [pool.submit(run, job, disabled) for job in wanted]
        for future in futures:
            yield future.result()
            advance(1)


def summary(outcomes: list[FaultOutcome]) -> dict[str, Any]:
    """The campaign as JSON: per row the slowest notice against its time, the reactions, the worst end."""
    faults = []
    for number, name in FAULTS.items():
        of_row = [outcome for outcome in outcomes if outcome.row == number]
        if of_row:
            faults.append(_row(number, name, of_row))
    passed = sum(fault["pass"] for fault in faults)
    ends = [outcome.ended for outcome in outcomes]
    return {
        "faults": faults, "passed": passed, "failed": len(faults) - passed,
        "cases": len(outcomes), "neither_surfaced_nor_safe": sum(end not in GOOD for end in ends),
    }  # fmt: skip


def _row(number: int, name: str, outcomes: list[FaultOutcome]) -> dict[str, Any]:
    def margin(outcome: FaultOutcome) -> float:
        return float("inf") if outcome.noticed_s is None else outcome.noticed_s - outcome.allowed_s

    worst = max(outcomes, key=margin)
    bad = [outcome.ended for outcome in outcomes if outcome.ended not in GOOD]
    ended = bad[0] if bad else "surfaced" if any(outcome.ended == "surfaced" for outcome in outcomes) else "safe"
    return {
        "number": number,
        "name": name,
        "noticed_s": worst.noticed_s,
        "allowed_s": worst.allowed_s,
        "reaction": ", ".join(dict.fromkeys(outcome.reaction for outcome in outcomes)),
        "expected": ", ".join(dict.fromkeys(outcome.expected for outcome in outcomes)),
        "ended": ended,
        "pass": all(outcome.passed for outcome in outcomes),
        "cases": [{**asdict(outcome), "pass": outcome.passed} for outcome in outcomes],
    }
