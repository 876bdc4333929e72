"""The cases of the fault campaign: which row, how it breaks, in which phases, and what has to come of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from glider.firmware.faults import Reaction
from glider.tools.verify.faults.scene import PHASES, Setting

GroundOutcome = tuple[float | None, str, str]  # of a fault that is shown: noticed after s, reaction, how it ended
SAFE, DAMAGE, LOST = "safe", "damaged", "lost"
UNDER_WAY = ("descent", "level", "ascent")
MOVING = ("descent", "ascent")
ALL = PHASES
IN_WATER = tuple(phase for phase in ALL if phase != "waiting")
PLAIN = Setting()


def observed(good: bool, well: str, ill: str, *, end: str = LOST, after: float = 0.0) -> GroundOutcome:
    """A fault's outcome: noticed `after` s with the reaction `well`, safe; else never, `ill`, ended as `end` says."""
    return (after, well, SAFE) if good else (None, ill, end)


@dataclass(frozen=True)
class FaultCase:
    """A fault that is flown. `expected`: the highest reaction that the row itself has to ask for."""

    row: int
    name: str
    begin: Callable[[Any], None]
    expected: Reaction
    allowed_s: float
    phases: tuple[str, ...] = ALL
    setting: Setting = PLAIN
    late: bool = False  # the clock may be late


@dataclass(frozen=True)
class Show:
    """A fault that no flight is needed for: `run(disabled, folder)` does the real thing, and says its outcome.

    It returns (noticed after s or None, reaction in words, how it ended).
    """

    row: int
    name: str
    run: Callable[[bool, Any], GroundOutcome]
    expected: str
    allowed_s: float
