"""Motion capture beside an onboard log: the two clocks' offset, and poses at the log's rows."""

from dataclasses import dataclass, replace

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.errors import InputError
from glider.tools.data.importers.qualisys import Capture
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run

STEP = 0.05  # s, of the search
MIN_OVERLAP_S = 5.0  # s that both must have in common
WORST = 0.5  # of the signals' variance, that may be left unexplained at the best offset


@dataclass(frozen=True)
class Offset:
    """Seconds to add to the capture's time for the log's, 1 sigma, and the share of variance left unexplained."""

    seconds: float
    sd: float
    left: float


def _grid(t: np.ndarray, x: np.ndarray, at: np.ndarray) -> np.ndarray:
    seen = np.isfinite(x)
    return np.interp(at, t[seen], x[seen], left=np.nan, right=np.nan)


def find_offset(run: Run, capture: Capture) -> Offset:
    """By cross-correlation of depth, pitch and roll; InputError where they do not fit together anywhere."""
    pairs = [(name, 3 + n) for n, name in enumerate(names.ATTITUDE[:2])] + [(names.DEPTH, 2)]
    pairs = [(name, n) for name, n in pairs if name in run.columns and np.isfinite(run.columns[name]).sum() > 20]
    if not pairs:
        raise InputError("the log has neither depth nor attitude to align motion capture with", source=run.path)
    t = np.arange(run.t[0], run.t[-1], STEP)
    log = [_grid(run.t, run.columns[name], t) for name, _ in pairs]
    own = np.arange(0.0, capture.t[-1], STEP)
    seen = [_grid(capture.t, capture.pose[:, n], own) for _, n in pairs]
    count, lags = (
        int(MIN_OVERLAP_S / STEP),
        range(-len(own) + int(MIN_OVERLAP_S / STEP), len(t) - int(MIN_OVERLAP_S / STEP) + 1),
    )
    left = np.full(len(lags), np.inf)
    for k, lag in enumerate(lags):
        a, b = max(lag, 0), min(lag + len(own), len(t))
        if b - a < count:
            continue
        total, parts = 0.0, 0
        for x, y in zip(log, seen, strict=True):
            d = x[a:b] - y[a - lag : b - lag]
            d = d[np.isfinite(d)]
            if len(d) >= count:
                spread = np.nanvar(x[a:b])
                total += float(np.var(d) / max(spread, 1e-4))
                parts += 1
        if parts:
            left[k] = total / parts
    best = int(np.argmin(left))
    if not left[best] < WORST:
        raise InputError("motion capture and log do not fit together at any offset of their clocks", source=run.path)
    seconds, sd = lags[best] * STEP, STEP
    if 0 < best < len(left) - 1 and np.isfinite(left[best - 1 : best + 2]).all():
        bend = (left[best - 1] - 2.0 * left[best] + left[best + 1]) / STEP**2
        if bend > 0.0:
            seconds += (left[best - 1] - left[best + 1]) / (2.0 * bend * STEP)
            independent = max((b - a) * STEP * len(pairs), 1.0)  # errors last about a second
            sd = max(float(np.sqrt(2.0 * left[best] / bend / independent)), 1e-3)
    return Offset(float(seconds), float(sd), float(left[best]))


def aligned(run: Run, capture: Capture, offset: Offset) -> Run:
    """The run with the capture's poses at its rows, interpolated between neighbours that were both seen."""
    t, columns = capture.t + offset.seconds, dict(run.columns)
    row = np.searchsorted(t, run.t, side="right") - 1
    inside = (row >= 0) & (row < len(t) - 1)
    row = row.clip(0, len(t) - 2)
    share = (run.t - t[row]) / (t[row + 1] - t[row])
    for n, name in enumerate(names.MOCAP):
        x = capture.pose[:, n]
        change = x[row + 1] - x[row]
        if n >= 3:
            change = wrap(change)
        value = x[row] + share * change
        if n >= 3:
            value = wrap(value)
        columns[name] = np.where(inside, value, np.nan)
    return replace(run, columns=columns)
