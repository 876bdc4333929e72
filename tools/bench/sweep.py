"""A sweep of an actuator: what it is commanded, in which order, and what its answers say of it.

Five parts. A step from end to end and back gives the travel time. Slow triangles at two speeds give lag and backlash:
going up and coming down, the position follows the command late by `lag` seconds and, backlash between them, lies on
either side, so at speed v both ways are 2 v lag + backlash apart; two speeds tell the two from each other. Small
reversals of growing size give the dead band: the largest that did not show. In the actuator's own unit (deg, mm).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

REVERSALS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # deg, mm
REST_S = 0.8
HOLD_S = 0.7  # at either end of a reversal
UPDATE_S = 0.04  # between two targets of a ramp
IN_WORDS = {"up": "step up", "down": "step down", "slow": "slow triangle", "quick": "quick triangle"}
TRAVEL_SHARE = 0.8  # of the way between the limits


@dataclass
class SweepPlan:
    """Targets (s, unit) of a sweep, and when its parts begin and end."""

    targets: list[tuple[float, float]]
    parts: dict[str, tuple[float, float]]

    @property
    def seconds(self) -> float:
        return self.targets[-1][0] + REST_S

    def part(self, t: float) -> str:
        """The part under way at time t (s), in words."""
        name = next((name for name, (begin, end) in reversed(self.parts.items()) if begin <= t <= end), "on its way")
        return IN_WORDS.get(name, name)


@dataclass
class SweepResult:
    """What a sweep found; NaN where it could not be found."""

    actuator: str
    unit: str
    low: float
    high: float
    travel_s: float = math.nan  # from 5 to 95 % of the way, either way's mean, over 0.9
    speed: float = math.nan  # unit/s
    lag_s: float = math.nan
    backlash: float = math.nan
    dead_band: float = math.nan
    noise: float = math.nan  # 1 sigma of the reading at rest


def plan(low: float, high: float, speed: float) -> SweepPlan:
    """A sweep between two positions of an actuator that can do `speed` (unit/s)."""
    targets: list[tuple[float, float]] = []
    parts: dict[str, tuple[float, float]] = {}
    now, travel = 0.0, (high - low) / speed

    def go(value: float, wait: float) -> None:
        nonlocal now
        targets.append((now, value))
        now += wait

    def ramp(start: float, end: float, rate: float) -> None:
        nonlocal now
        steps = max(2, round(abs(end - start) / rate / UPDATE_S))
        for i in range(1, steps + 1):
            go(start + (end - start) * i / steps, UPDATE_S)

    go(low, 1.5 * travel + REST_S)
    for name, value in (("up", high), ("down", low)):
        begin = now
        go(value, 1.5 * travel + REST_S)
        parts[name] = begin, now
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    for name, share in (("slow", 0.15), ("quick", 0.45)):
        go(middle - quarter, travel + REST_S)
        begin = now
        ramp(middle - quarter, middle + quarter, share * speed)
        ramp(middle + quarter, middle - quarter, share * speed)
        parts[name] = begin, now
        now += REST_S
    go(middle - quarter, REST_S)
    go(middle, travel + REST_S)
    for size in REVERSALS:
        begin = now
        go(middle + size, HOLD_S)
        go(middle, HOLD_S)
        parts[f"reversal {size:g}"] = begin, now
    return SweepPlan(targets, parts)


def analyse(
    result: SweepResult, sweep: SweepPlan, t: np.ndarray, command: np.ndarray, position: np.ndarray
) -> SweepResult:
    """Fill the result from the record: times (s, from the sweep's begin), commands and positions (unit), all (n,)."""
    known = np.isfinite(position) & np.isfinite(command)
    t, command, position = t[known], command[known], position[known]
    if len(t) < 50:
        return result
    travels = [_travel(sweep.parts[name], t, position, result) for name in ("up", "down")]
    result.travel_s = float(np.mean(travels))
    result.speed = 0.9 * (result.high - result.low) / (0.9 * result.travel_s) if result.travel_s > 0 else math.nan
    slow, quick = (_apart(sweep.parts[name], t, position) for name in ("slow", "quick"))
    speeds = [_speed(sweep.parts[name], t, command) for name in ("slow", "quick")]
    if all(math.isfinite(x) for x in (slow, quick, *speeds)) and speeds[1] > speeds[0]:
        result.lag_s = (quick - slow) / (2.0 * (speeds[1] - speeds[0]))
        result.backlash = max(slow - 2.0 * speeds[0] * result.lag_s, 0.0)
    _, end = sweep.parts["down"]
    rest = position[(t > end - 0.8 * REST_S) & (t < end)]
    result.noise = float(np.std(rest)) if len(rest) > 3 else math.nan
    result.dead_band = _dead_band(sweep, t, position)
    return result


def _travel(part: tuple[float, float], t: np.ndarray, position: np.ndarray, result: SweepResult) -> float:
    """Seconds for the whole way, from those between 5 and 95 % of it."""
    inside = (t >= part[0]) & (t < part[1])
    when, where = t[inside], position[inside]
    if len(where) < 5:
        return math.nan
    way = np.clip((where - where[0]) / (where[-1] - where[0]) if where[-1] != where[0] else where * np.nan, -1, 2)
    if not np.isfinite(way).all() or abs(where[-1] - where[0]) < 0.5 * (result.high - result.low):
        return math.nan
    return float((when[np.argmax(way > 0.95)] - when[np.argmax(way > 0.05)]) / 0.9)


def _halves(part: tuple[float, float], t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the middle 60 % of the way up, and of the way down."""
    begin, end = part
    half = 0.5 * (end - begin)
    up = (t > begin + 0.25 * half) & (t < begin + 0.9 * half)
    down = (t > begin + 1.25 * half) & (t < begin + 1.9 * half)
    return up, down


def _apart(part: tuple[float, float], t: np.ndarray, position: np.ndarray) -> float:
    """Mean distance between the way up and the way down at equal commands, by straight lines through both."""
    up, down = _halves(part, t)
    if up.sum() < 10 or down.sum() < 10:
        return math.nan
    begin, end = part
    half = 0.5 * (end - begin)
    rising = np.polyfit(t[up] - begin, position[up], 1)
    falling = np.polyfit(t[down] - begin, position[down], 1)
    places = np.linspace(0.35, 0.85, 20) * half  # on the way up; the command is there again at 2 half - place
    return float(np.mean(np.polyval(falling, 2.0 * half - places) - np.polyval(rising, places)))


def _speed(part: tuple[float, float], t: np.ndarray, command: np.ndarray) -> float:
    up, _ = _halves(part, t)
    return float(np.polyfit(t[up], command[up], 1)[0]) if up.sum() > 10 else math.nan


def _dead_band(sweep: SweepPlan, t: np.ndarray, position: np.ndarray) -> float:
    """The largest reversal less than half of which showed; 0 where the smallest showed already."""
    largest = 0.0
    for size in REVERSALS:
        begin, end = sweep.parts[f"reversal {size:g}"]
        out = position[(t > begin + 0.6 * HOLD_S) & (t < begin + HOLD_S)]
        back = position[(t > end - 0.4 * HOLD_S) & (t < end)]
        if len(out) > 3 and len(back) > 3 and abs(float(np.mean(out) - np.mean(back))) < 0.5 * size:
            largest = size
    return largest


def picture(path: Any, result: SweepResult, t: np.ndarray, command: np.ndarray, position: np.ndarray) -> None:
    """Command and position over time, and over each other, as a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    over_time, loop = figure.subplots(1, 2, width_ratios=(2, 1))
    over_time.plot(t, command, color="0.6", label="command")
    over_time.plot(t, position, color="tab:blue", label="position")
    over_time.set(xlabel="time, s", ylabel=f"{result.actuator}, {result.unit}")
    over_time.legend(loc="upper right")
    loop.plot(command, position, lw=0.7)
    loop.set(xlabel=f"command, {result.unit}", ylabel=f"position, {result.unit}")
    figure.suptitle(
        f"travel {result.travel_s:.2f} s, lag {result.lag_s:.3f} s, backlash {result.backlash:.2f} {result.unit}, "
        f"dead band {result.dead_band:g} {result.unit}"
    )
    figure.savefig(path, dpi=110)
