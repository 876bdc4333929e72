"""Pictures of findings: what the instrument reads beside what the other readings say it should."""

from dataclasses import dataclass

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.readings.findings import Finding
from glider.tools.readings.signals import body_increments, steps, table_of
from glider.tools.readings.stretches import flying
from glider.tools.readings.surface import slices

RATE_SMOOTHING_S = 0.5  # s over which rates are averaged, of both alike
SPAN = 60.0  # s that are drawn: the stretch that moves most
MIN_POINTS = 10  # points, below which nothing is drawn


@dataclass(frozen=True)
class Shown:
    """Lines over x (points,): read, what it should be, and as corrected; NaN where there is none."""

    title: str
    x: np.ndarray
    read: np.ndarray
    expected: np.ndarray
    mended: np.ndarray


def pictures_of(findings: list[Finding], runs: list[Run]) -> list[Shown]:
    """The pictures of the findings that have one, in their order; one a channel."""
    found: dict[tuple[str, str], Shown] = {}
    for one in findings:
        if (one.channel, one.against) in found:
            continue
        shown = None
        if one.channel in names.RATES and one.finding in ("scale", "offset", "sign", "units"):
            shown = _rate(one, runs)
        elif one.channel == names.DEPTH and one.against == "ballast_kg":
            shown = _surface(one, runs)
        if shown is not None and len(shown.x) >= MIN_POINTS:
            found[one.channel, one.against] = shown
    return list(found.values())


def _averaged(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over RATE_SMOOTHING_S: times and values."""
    group = np.floor(t / RATE_SMOOTHING_S).astype(np.int64)
    ok = np.isfinite(values)
    count, total = np.bincount(group, ok), np.bincount(group, np.where(ok, values, 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        return (np.arange(len(count)) + 0.5) * RATE_SMOOTHING_S, np.where(count > 0.0, total / count, np.nan)


def _rate(one: Finding, runs: list[Run]) -> Shown | None:
    axis = names.RATES.index(one.channel)
    best: tuple[float, Run, np.ndarray] | None = None
    for run in runs:
        if not run.has(*names.ATTITUDE, one.channel):
            continue
        table = table_of([run], [flying(run)])
        turned = body_increments(np.column_stack([table.columns[name] for name in names.ATTITUDE]))[:, axis]
        rate = table.flown(turned / steps(table))
        size = float(np.nanstd(rate)) if np.isfinite(rate).any() else 0.0
        if best is None or size > best[0]:
            best = size, run, rate
    if best is None:
        return None
    _, run, rate = best
    t = run.t - run.t[0]
    at, expected = _averaged(t, rate)
    _, read = _averaged(t, run.columns[one.channel])
    moving = np.convolve(np.nan_to_num(np.abs(expected)), np.ones(max(1, int(SPAN / RATE_SMOOTHING_S))), "valid")
    first = int(np.argmax(moving)) if len(moving) else 0
    part = slice(first, first + int(SPAN / RATE_SMOOTHING_S))
    mended = (read - one.values.get("offset", 0.0)) / one.values.get("gain", 1.0)
    degrees = 180.0 / np.pi
    title = f"{one.channel} of {run.name} beside the rate of the attitude, deg/s over s"
    return Shown(title, at[part], degrees * read[part], degrees * expected[part], degrees * mended[part])


def _surface(one: Finding, runs: list[Run]) -> Shown | None:
    rows = np.concatenate([slices(run) for run in runs])
    rows = rows[np.isfinite(rows[:, :2]).all(axis=1)] if len(rows) else rows
    if len(rows) < MIN_POINTS or np.ptp(rows[:, 1]) < 0.01:
        return None
    rows = rows[np.argsort(rows[:, 1], kind="stable")]
    line = float(np.mean(rows[:, 0])) + one.size * (rows[:, 1] - float(np.mean(rows[:, 1])))
    title = "depth_m at the surface over the water in the tank, m over kg"
    return Shown(title, rows[:, 1], rows[:, 0], line, np.full(len(rows), np.nan))
