"""Each reading against itself: held, missing, saturated, quantised samples, and the clock of the rows."""

import numpy as np

from glider.tools.data.intervals import NINETY
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.data.runs.sampling import expected_samples
from glider.tools.readings.findings import TOLERANCE, Finding

MOVING = (*names.ATTITUDE, *names.RATES, names.DEPTH)  # what does not stand still in flight
HELD_SHARE = 0.2  # of the rows of a moving reading, that repeat the row before
HELD_JUMP = 4.0  # quanta that a reading makes up when it moves again: it was held, not coarse
MISSING_SHARE = 0.02
SATURATED_ROWS, SATURATED_SHARE = 5, 0.01  # rows running at the very same extreme, and of all rows
COARSE = 0.3  # of a tolerance that a quantum may be (a uniform error of a third of it, root mean square)


def judge_samples(runs: list[Run]) -> list[Finding]:
    """What is wrong with the samples, one finding for a column and a kind, over all runs."""
    found = []
    for name in (column for column in names.ALL if any(column in run.columns for run in runs)):
        if name == names.TIME or name in names.COMMANDS:
            continue
        series = [(run.t, run.columns[name]) for run in runs if name in run.columns]
        for judged in (_missing, _held, _saturated, _quantised):
            one = judged(name, series)
            if one is not None:
                found.append(one)
    return found


def _share(count: int, of: int) -> tuple[float, tuple[float, float]]:
    share = count / max(of, 1)
    half = NINETY * np.sqrt(max(share * (1.0 - share), 1e-12) / max(of, 1))
    return share, (max(share - half, 0.0), min(share + half, 1.0))


def _missing(name: str, series) -> Finding | None:
    expected = sum(expected_samples(t, values) for t, values in series)
    size, interval = _share(expected - sum(int(np.isfinite(values).sum()) for _, values in series), expected)
    if size < MISSING_SHARE or name in names.MOCAP:  # cameras lose sight; that is no fault of theirs
        return None
    text = f"{name}: {100.0 * size:.1f} % of the samples are missing."
    return Finding(name, "itself", "held", size, interval, "1", None, False, text)


def quantum(values: np.ndarray) -> float:
    """The step of which (nearly) all changes of a reading are whole multiples; 0 where there is none."""
    step = np.abs(np.diff(values[np.isfinite(values)]))
    step = step[step > 1e-9]
    if len(step) < 20:
        return 0.0
    least = float(np.quantile(step, 0.02))
    unit = float(np.median(step[step < 1.5 * least])) if (step < 1.5 * least).any() else least
    whole = np.round(step / unit)
    regular = np.abs(step / unit - whole) < 0.1
    return unit if regular.mean() > 0.9 and (whole <= 3).mean() > 0.1 else 0.0


def _held(name: str, series) -> Finding | None:
    """Repeated samples of what moves: a sensor slower than the log, or a link that stalls."""
    if name not in MOVING and name not in names.MOCAP:
        return None
    repeated, rows, lengths, jumps = 0, 0, [], []
    for t, values in series:
        good = np.isfinite(values)
        t, values = t[good], values[good]
        if len(values) < 20 or np.ptp(values) == 0.0:
            repeated += len(values)
            rows += len(values)
            continue
        same = np.diff(values) == 0.0
        repeated += int(same.sum())
        rows += len(same)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            lengths.append(t[last] - t[first])
            if last + 1 < len(values):
                jumps.append(abs(values[last + 1] - values[last]))
    if not rows:
        return None
    size, interval = _share(repeated, rows)
    if size >= 0.98:
        text = f"{name} does not move at all: {100.0 * size:.0f} % of the samples repeat the one before."
        return Finding(name, "itself", "held", size, interval, "1", None, False, text)
    if size < HELD_SHARE or not lengths or not jumps:
        return None
    coarse = max(quantum(values) for _, values in series)
    step = float(np.median(jumps))
    if coarse > 0.0 and step < HELD_JUMP * coarse:
        return None
    span = float(np.median(lengths))
    text = f"{name} is held: {100.0 * size:.0f} % of the samples repeat the one before, {span:.2g} s at a time."
    return Finding(name, "itself", "held", span, (float(np.quantile(lengths, 0.05)), float(np.quantile(lengths, 0.95))),
                   "s", None, True, text, {"held": span})  # fmt: skip


def _saturated(name: str, series) -> Finding | None:
    """A reading that stays at its extreme value."""
    if name in names.DRAW_WIRES or name in names.MOCAP:  # actuators stand at their stops
        return None
    values = np.concatenate([values[np.isfinite(values)] for _, values in series])
    if len(values) < 50 or np.ptp(values) == 0.0:
        return None
    for extreme in (values.max(), values.min()):
        at = values == extreme
        edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
        longest = int((edges[1::2] - edges[::2]).max()) if len(edges) else 0
        if longest < SATURATED_ROWS or at.mean() < SATURATED_SHARE:
            continue
        # At the extreme of a slow, coarse movement a reading stands too: what comes before and after must be cut off.
        into = np.abs(np.diff(values))[np.maximum(edges[::2] - 2, 0)]
        if float(np.median(into)) < 2.0 * max(quantum(values), 1e-12):
            continue
        size, interval = _share(int(at.sum()), len(values))
        text = f"{name} stands at {extreme:.4g} for {100.0 * size:.1f} % of the samples, up to {longest} rows running."
        return Finding(name, "itself", "saturated", size, interval, "1", None, False, text)
    return None


def _quantised(name: str, series) -> Finding | None:
    """A quantum that is coarse beside the channel's tolerance: said, since it bounds what can be seen."""
    if name not in TOLERANCE:
        return None
    step = max(quantum(values) for _, values in series)
    if step < COARSE * TOLERANCE[name]:
        return None
    text = f"{name} comes in steps of {step:.3g}."
    return Finding(name, "itself", "held", step, (step, step), name.rpartition("_")[2], None, False, text)


def judge_clock(runs: list[Run]) -> list[Finding]:
    """Rows that are missing or uneven in time."""
    found = []
    for run in runs:
        step = np.diff(run.t)
        if len(step) < 10:
            continue
        usual = float(np.median(step))
        lost = step > max(5.0 * usual, 0.5)
        if lost.any():
            longest = float(step.max())
            text = f"{run.name}: {int(lost.sum())} gaps in time, the longest {longest:.2f} s."
            found.append(Finding("t_s", "itself", "held", longest, (longest, longest), "s", None, False, text))
    return found
