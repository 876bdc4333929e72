"""Depth at the surface against everything else: there it has to read the same, whatever the vehicle does.

Rows at the surface are compared with the tank, sin(pitch), the temperature of the run's time: what moves the reading
there moves it in the dive too. A gauge that is vented into the hull reads the hull's pressure as well, which changes
with the water in the tank; a port away from the origin goes with the pitch. Waves and the hull's own bobbing are the
noise: means over SLICE seconds are compared.
"""

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.readings.findings import CERTAIN_SIGMA, TOLERANCE, Finding, spoken
from glider.tools.readings.regression import Estimate
from glider.tools.readings.stretches import states

SLICE = 2.0  # s
LEAST_SLICES = 8
LEAST_CHANGE = {"ballast_kg": 0.03, "pitch": 0.1, "time": 120.0}  # kg, sin, s: less has not been tried
UNITS = {"ballast_kg": "m/kg", "pitch": "m", "time": "m/s"}


def slices(run: Run) -> np.ndarray:
    """Means over SLICE s at the surface: depth, ballast, -sin(pitch), time, (slices, 4); NaN where not recorded."""
    if names.DEPTH not in run.columns:
        return np.empty((0, 4))
    at = states(run)["at the surface"] if names.DEPTH in run.columns else np.zeros(run.rows, dtype=bool)
    missing = np.full(run.rows, np.nan)
    table = np.column_stack([
        run.columns[names.DEPTH], run.columns.get("ballast_kg", missing),
        -np.sin(run.columns.get("pitch_rad", missing)), run.t,
    ])[at]  # fmt: skip
    if not len(table):
        return np.empty((0, 4))
    group = np.floor(run.t[at] / SLICE)
    with np.errstate(invalid="ignore"):
        rows = [np.nanmean(table[group == n], axis=0) for n in np.unique(group) if np.isfinite(table[group == n]).any()]
    return np.array(rows)


def judge_surface(runs: list[Run]) -> list[Finding]:
    """What the depth goes with at the surface, strongest first; each beside those before it."""
    table = [slices(run) for run in runs]
    run = np.repeat(np.arange(len(runs)), [len(part) for part in table])
    rows = np.concatenate(table) if table else np.empty((0, 4))
    if len(rows) < LEAST_SLICES:
        return []
    candidates = {"ballast_kg": rows[:, 1], "pitch": rows[:, 2], "time": rows[:, 3]}
    usable = {
        name: values
        for name, values in candidates.items()
        if np.isfinite(values).all() and np.ptp(values) >= LEAST_CHANGE[name]
    }
    found: list[Finding] = []
    taken: list[str] = []
    while len(taken) < len(usable):
        best = None
        for name in usable:
            if name in taken:
                continue
            estimate = slope(rows[:, 0], [usable[other] for other in (*taken, name)], run)
            moves = abs(estimate.value) * float(np.ptp(usable[name]))
            if estimate.sigma() >= CERTAIN_SIGMA and moves >= 0.5 * TOLERANCE[names.DEPTH]:
                best = (name, estimate) if best is None or estimate.sigma() > best[1].sigma() else best
        if best is None:
            break
        taken.append(best[0])
        found.append(_said(*best))
    return found


def slope(depth: np.ndarray, regressors: list[np.ndarray], run: np.ndarray) -> Estimate:
    """Slope on the last regressor, its error widened for neighbouring slices that say the same."""
    X = np.column_stack([np.ones(len(depth)), *regressors])
    solved, *_ = np.linalg.lstsq(X, depth, rcond=None)
    residual = depth - X @ solved
    same = np.diff(run) == 0
    correlation = float((residual[1:] * residual[:-1])[same].sum() / max((residual**2).sum(), 1e-30))
    correlation = min(max(correlation, 0.0), 0.95)
    freedom = max(len(depth) * (1.0 - correlation) / (1.0 + correlation) - X.shape[1], 1.0)
    variance = float((residual**2).sum()) / freedom
    inverse = np.linalg.pinv(X.T @ X)
    error = float(np.sqrt(variance * inverse[-1, -1] * (1.0 + correlation) / (1.0 - correlation)))
    return Estimate(float(solved[-1]), error, max(int(freedom), 1))


def _said(name: str, estimate: Estimate) -> Finding:
    size = spoken(estimate.value, estimate.interval, UNITS[name])
    if name == "pitch":
        text = f"At the surface the depth goes with sin(pitch): the port is {size} ahead of the origin."
        label = "pressure_lever"
    elif name == "time":
        text, label = f"At the surface the depth drifts by {size}.", None
    else:
        text = f"At the surface the depth goes with the water in the tank, {size}: the gauge feels the hull's pressure."
        label = None
    finding = "drift" if name == "time" else "goes_with"
    return Finding(
        names.DEPTH, name, finding, estimate.value, estimate.interval, UNITS[name], label, True, text,
        {name: estimate.value},
    )  # fmt: skip
