"""Commands that a log does not hold, rebuilt by a rule: a drive that runs to one of its two stops, or is stopped.

When it runs is what the log says in a column of its own (on and off, a word for its state), or what its own reading
shows. While it runs, the command is the stop that it runs to; from where it ends, the stop if it got there, else where
it came to rest. Before it first runs, the command is where it stands.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec
import numpy as np

from glider.hal.strict import Table

STOP_TOLERANCE = 0.05  # of the way between the stops: as near to one counts as there

SI = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class StateTable(Table):
    """[commands.NAME.to_low], [commands.NAME.to_high]: the words of a column that say that it runs there."""

    source: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    words: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]


class CommandTable(Table):
    """[commands.NAME]: a drive between two stops."""

    follows: str  # the column of run data that shows where it is
    low: SI  # stops, SI
    high: SI
    to_low: StateTable | None = None
    to_high: StateTable | None = None
    rate: Positive | None = None  # SI a second, at which it runs: seen from `follows`
    over_s: Positive = 1.0  # s of reading that show that it runs

    def __post_init__(self):
        if not self.low < self.high:
            raise ValueError(f"high: expected more than low = {self.low:g}, got {self.high:g}")
        said = [self.to_low is not None, self.to_high is not None]
        if any(said) != all(said) or any(said) == (self.rate is not None):
            raise ValueError("expected `to_low` and `to_high` (columns say when it runs) or `rate` (its reading does)")


@dataclass(frozen=True)
class Rebuilt:
    """A command at the log's rows, and how many runs got to their stop, and how many did not."""

    command: np.ndarray
    to_a_stop: int
    ended_between: int


def says(texts: list[str], state: StateTable) -> np.ndarray:
    """Where a column says that it runs to that stop, bool of shape (rows,)."""
    return np.array([text.strip() in state.words for text in texts])


def seen_direction(t: np.ndarray, where: np.ndarray, rate: float, over_s: float) -> np.ndarray:
    """-1 where a reading runs to the low stop, 1 to the high, 0 where it stands, (rows,): it runs where its mean speed
    over `over_s` around a row is more than half the rate.

    At half the rate, half of that time lies within the run: a run's ends are not moved. What lasts less than half of
    `over_s` is the reading's noise, and no run and no rest.
    """
    known = np.isfinite(where)
    if np.count_nonzero(known) < 2:
        return np.zeros(len(t), dtype=np.int64)
    ahead, behind = (np.interp(t + side * over_s / 2.0, t[known], where[known]) for side in (1.0, -1.0))
    speed = (ahead - behind) / over_s
    direction = np.where(np.abs(speed) > 0.5 * rate, np.sign(speed), 0.0).astype(np.int64)
    for of_a_run in (False, True):  # rests within a run first, then what is left of runs
        for begin, end in spans(direction):
            if t[end - 1] - t[begin] < 0.5 * over_s and bool(direction[begin]) == of_a_run and begin > 0:
                direction[begin:end] = direction[begin - 1]
    return direction


def spans(direction: np.ndarray) -> list[tuple[int, int]]:
    """First row and the one behind the last of every stretch of one direction."""
    edges = (np.flatnonzero(np.diff(direction)) + 1).tolist()
    return list(zip([0, *edges], [*edges, len(direction)], strict=True))


def rebuild(table: CommandTable, direction: np.ndarray, where: np.ndarray) -> Rebuilt:
    """The command, from the directions and readings (SI, NaN where missing) at the log's rows."""
    command, near = np.empty(len(where)), STOP_TOLERANCE * (table.high - table.low)
    known = where[np.isfinite(where)]
    now, arrived, short = (float(known[0]) if known.size else np.nan), 0, 0
    for n, (begin, end) in enumerate(spans(direction)):
        if direction[begin]:
            now = table.high if direction[begin] > 0 else table.low
        elif n:
            rest = where[begin:end][np.isfinite(where[begin:end])]
            there = float(np.median(rest)) if rest.size else now
            if abs(there - now) > near:
                now, short = there, short + 1
            else:
                arrived += 1
        command[begin:end] = now
    return Rebuilt(command, arrived, short)
