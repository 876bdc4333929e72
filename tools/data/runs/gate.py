"""What no run of a glider can hold: refused by every command that reads a case, and by every import, in one line.

Units, sizes, speeds and times alone; that two readings disagree is for glider.tools.readings to weigh. Limits lie well
beyond every flight recorded so far (gliders of a pool, a lake and the ocean; a blimp), a wrong unit far beyond them.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run

LARGEST_ROLL, LARGEST_PITCH = np.pi + 0.1, 1.65  # rad: beyond, an angle is in degrees
LARGEST_YAW = 60.0  # rad; a continuous heading may have turned farther, but it gets there by turning
ONE_TURN = 7.0  # rad
FASTEST = 2.5  # m/s
SPEED_SPAN = 3.0  # s over which a speed is taken: the noise of a gauge is none
WIDEST = 60.0  # m; no capture sees farther
HIGHEST, LOW = -1.0, 0.3  # m, of depths: the zero of a gauge is not off by as much, and no dive is as shallow
SLOWEST_ROWS, FASTEST_ROWS = 3.0, 1e-4  # s between two rows
JUMP = 30.0  # s that a clock jumps by, at least, if it is no hole
RATE_OFF = 1.5  # times that the rate of the rows may be off what case.toml says
LEAST_SAMPLES = 20  # of a column: fewer say nothing
MOST = 0.9  # of the samples that tell: a tenth may be wild
LIMITS = {
    **dict.fromkeys(names.RATES, (3.0, "rad/s", "degrees a second?")),
    **dict.fromkeys((names.DRAW_WIRES[0], names.COMMANDS[1]), (1.0, "m", "millimetres or centimetres?")),
    **dict.fromkeys((names.DRAW_WIRES[1], names.COMMANDS[2]), (5.0, "kg", "grams?")),
    names.COMMANDS[0]: (2.0, "rad", "degrees?"),
    names.OIL: (0.05, "m3", "litres or cubic centimetres?"),
    names.BATTERY: (1.0, "m", "millimetres, centimetres or inches?"),
    names.FIN: (2.0, "rad", "degrees?"),
}


@dataclass(frozen=True)
class LeftOut:
    """A run that cannot be used, and why."""

    run: str
    path: Path | None
    column: str
    reason: str

    def __str__(self) -> str:
        return str(self.error())

    def error(self, of: int = 0) -> InputError:
        """The refusal, of a case of `of` runs none of which can be used."""
        reason = self.reason + (f" (none of {of} runs can be used)" if of else "")
        return InputError(reason, source=self.path or self.run, column=self.column)


def impossible(run: Run, sparse_rows: bool = False) -> tuple[str, str] | None:
    """The first column of a run that holds what it cannot, and what that probably is; None where all is possible.

    sparse_rows: rows may be as rare as they like.
    """
    found = None if sparse_rows or names.OIL in run.columns else wrong_times(run.t)
    if found is not None:
        return names.TIME, found
    for name in (column for column in names.ALL if column in run.columns):
        seen = np.isfinite(run.columns[name])
        if seen.sum() >= LEAST_SAMPLES:
            reason = _wrong(name, run.t[seen], run.columns[name][seen])
            if reason is not None:
                return name, reason
    return None


def wrong_times(t: np.ndarray) -> str | None:
    """What is wrong with the times of rows (rows,), s."""
    step = np.diff(t)
    if len(t) < LEAST_SAMPLES:
        return None
    usual, longest = float(np.median(step)), float(step.max())
    if usual > SLOWEST_ROWS:
        return f"rows {usual:.4g} s apart: is the time's unit right (milliseconds called seconds?)"
    if usual < FASTEST_ROWS:
        return f"rows {usual:.4g} s apart: is the time's unit right (seconds called milliseconds?)"
    covered = float(np.minimum(step, 5.0 * usual).sum())
    if longest > max(JUMP, covered):
        at = float(t[int(np.argmax(step))])
        return f"jumps by {longest:.4g} s at {at:.4g} s, where all rows last {covered:.4g} s: was the clock set?"
    return None


def _wrong(name: str, t: np.ndarray, values: np.ndarray) -> str | None:
    """What is wrong with the samples of a column, all there, at their times."""
    size = float(np.quantile(np.abs(values), MOST))
    most = f"{np.abs(values).max():.4g}"
    if name in names.WRAPPING:
        return _wrong_angle(name, values, size, most)
    if name in (names.DEPTH, *names.MOCAP_POSITION):
        return _wrong_length(name, t, values)
    if name == names.DENSITY and not 900.0 < float(np.median(values)) < 1300.0:
        return f"{np.median(values):.4g} kg/m3 is no water: grams a cubic centimetre, or less 1000?"
    limit, unit, what = LIMITS.get(name, (np.inf, "", ""))
    return f"up to {most} {unit}: {what}" if size > limit else None


def _wrong_angle(name: str, values: np.ndarray, size: float, most: str) -> str | None:
    if name in (names.ATTITUDE[2], names.MOCAP_ATTITUDE[2]):
        return wrong_heading(values)
    if size <= (LARGEST_ROLL if name in (names.ATTITUDE[0], names.MOCAP_ATTITUDE[0]) else LARGEST_PITCH):
        return None
    what = "degrees?" if np.abs(values).max() > ONE_TURN else "no roll or pitch: axes swapped, or degrees?"
    return f"up to {most} rad: {what}"


def wrong_heading(values: np.ndarray) -> str | None:
    """What is wrong with an angle that may turn on and on, rad."""
    turned = abs(values[0]) < ONE_TURN and np.abs(np.diff(values)).max(initial=0.0) < ONE_TURN
    if np.quantile(np.abs(values), MOST) <= LARGEST_YAW or turned:
        return None
    return f"up to {np.abs(values).max():.4g} rad, not by turning: degrees?"


def _wrong_length(name: str, t: np.ndarray, values: np.ndarray) -> str | None:
    speed = _speed(t, values)
    if speed > FASTEST:
        # 0.15 m/s is what gliders do, and halfway between the two units on a scale of factors
        return f"moves at {speed:.4g} m/s: {'centimetres' if speed / 0.15 < 10.0**2.5 else 'millimetres'}?"
    if name != names.DEPTH:
        wide = float(np.ptp(values))
        return f"spans {wide:.4g} m, more than a capture sees: millimetres?" if wide > WIDEST else None
    high, low = np.quantile(values, (1.0 - MOST, MOST)).tolist()
    return f"down to {high:.4g} m, which is above the water: counted upwards?" if high < HIGHEST and low < LOW else None


def _speed(t: np.ndarray, values: np.ndarray) -> float:
    """The speed over SPEED_SPAN that all but a tenth of the samples keep below, m/s."""
    ahead = np.searchsorted(t, t + SPEED_SPAN)
    there = np.flatnonzero(ahead < len(t))
    if not there.size:
        return 0.0
    then = ahead[there]
    return float(np.quantile(np.abs(values[then] - values[there]) / (t[then] - t[there]), MOST))


def renamed(run: Run, runs: Sequence[Run]) -> tuple[str, str] | None:
    """A column that all other runs have and this one has not, where it has one that none of them has."""
    others = [{*other.columns, *other.extra} for other in runs if other is not run]
    return misnamed(names.ALL, [*run.columns, *run.extra], others)


def misnamed(known: Sequence[str], here: Sequence[str], others: Sequence[Collection[str]]) -> tuple[str, str] | None:
    """One of the known columns that all other files have and this one has not, where it has one that none of them has;
    and what to do."""
    own = {name.lower(): name for name in here if name not in known and not any(name in other for other in others)}
    lost = [name for name in known if others and name not in here and all(name in other for other in others)]
    if not own or not lost:
        return None
    close = {name: get_close_matches(name, own, 1, 0.0)[0] for name in lost}
    name = max(lost, key=lambda one: SequenceMatcher(None, one, close[one]).ratio())
    shown = own[close[name]]
    return name, f"the other runs have it; here is '{shown}', which they have not: name it {name}, or leave it out"


def wrong_rate(runs: Sequence[Run], rate: float) -> str | None:
    """How the rows of the runs contradict the rate that the case gives, Hz."""
    steps = [float(np.median(np.diff(run.t))) for run in runs if run.rows >= LEAST_SAMPLES]
    if not steps:
        return None
    rows = 1.0 / float(np.median(steps))
    return None if 1.0 / RATE_OFF < rows / rate < RATE_OFF else f"{rate:g} expected, the rows come at {rows:.4g} Hz"


def parted(runs: Sequence[Run], sparse_rows: bool = False) -> tuple[list[Run], list[LeftOut]]:
    """The runs that are possible, and those that are not, with the first reason of each."""
    good, out = [], []
    for run in runs:
        found = impossible(run, sparse_rows) or renamed(run, runs)
        if found is None:
            good.append(run)
        else:
            out.append(LeftOut(run.name, run.path, *found))
    return good, out


def refuse_impossible(runs: Sequence[Run], sparse_rows: bool = False) -> None:
    """InputError, naming the first run and column, where any run holds what it cannot."""
    _, out = parted(runs, sparse_rows)
    if out:
        raise out[0].error()
