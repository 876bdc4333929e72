"""Regimes of flight: every sample of a run is of one side of each of four pairs, by what was measured alone.

Where a model of a vehicle is wrong it seldom is so everywhere: gaps are reported by regime.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from glider.firmware.core.vehicle import layout
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import RunGap, run_gap, with_total
from glider.tools.inference.channels import Measures
from glider.tools.inference.windows import Window

PAIRS = (("dive", "climb"), ("turning", "straight"), ("moving", "held"), ("fast", "slow"))  # moving: an actuator
REGIMES = tuple(name for pair in PAIRS for name in pair)
ALL = "all"
RATE_SMOOTHING_S = 1.0  # s, over which rates are taken
TURNING = np.radians(2.0)  # rad/s of heading; half a circle in a window and a half
MOVING = 0.1  # of an actuator's largest rate
FAST = 0.1  # m/s of depth


def _rate(t: np.ndarray, values: np.ndarray, wraps: bool = False) -> np.ndarray:
    """Rate of change (rows,) of a reading, smoothed; 0 where there is too little of it."""
    seen = np.isfinite(values)
    if seen.sum() < 3:
        return np.zeros(len(t))
    whole = np.interp(t, t[seen], np.unwrap(values[seen]) if wraps else values[seen])
    width = max(1, round(RATE_SMOOTHING_S / max(float(np.median(np.diff(t))), 1e-3)))
    smooth = uniform_filter1d(whole, width, mode="nearest")
    return np.asarray(np.gradient(smooth, t))


def regimes_of(measures: Measures, run: Run, P: np.ndarray) -> dict[str, np.ndarray]:
    """By regime, which rows of a run are of it, bool of shape (rows,); P: a vehicle, for its actuators' rates."""
    table = measures.measured(run)
    read = {name: table[:, n] for n, name in enumerate(measures.columns)}
    sinking = _rate(run.t, read[names.DEPTH])
    turning = np.abs(_rate(run.t, read[names.ATTITUDE[2]], wraps=True)) > TURNING
    moving = np.zeros(run.rows, dtype=bool)
    servo, slider, ballast = names.COMMANDS
    for name, column, at in (
        (servo, servo, layout.SERVO_RATE), (names.DRAW_WIRES[0], slider, layout.SLIDER_RATE),
        (names.DRAW_WIRES[1], ballast, layout.BALLAST_RATE),
    ):  # fmt: skip
        values = run.columns.get(name, run.columns.get(column))
        if values is not None:
            moving |= np.abs(_rate(run.t, values)) > MOVING * P[at]
    first = {"dive": sinking > 0.0, "turning": turning, "moving": moving, "fast": np.abs(sinking) > FAST}
    return first | {other: ~first[name] for name, other in PAIRS}


def gaps_by_regime(
    measures: Measures, runs: list[Run], flown: list[np.ndarray], listed: list[list[Window]], P: np.ndarray
) -> dict[str, dict[str, float]]:
    """By regime, ALL first, the gap of each channel over the runs that have it there, `total` among them."""
    parts: dict[str, list[RunGap]] = {name: [] for name in (ALL, *REGIMES)}
    for run, Y, windows in zip(runs, flown, listed, strict=True):
        masks = {ALL: np.ones(run.rows, dtype=bool)} | regimes_of(measures, run, P)
        for name, mask in masks.items():
            parts[name].append(run_gap(measures, run, Y, windows, only=mask))
    return {name: with_total(gaps) for name, gaps in parts.items() if any(gap.channels for gap in gaps)}
