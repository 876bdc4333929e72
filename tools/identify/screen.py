"""Runs that cannot be fitted, beside the impossible (gate.py): swapped axes, a frozen capture, clocks far apart."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.gate import LeftOut, impossible
from glider.tools.data.runs.run import Run

LEAST_HULL_SPEED = 0.08  # m/s, below which the way a hull moves says nothing about its axes
FROZEN = 0.5  # s for which a pose may stand still to the last digit
AHEAD = 0.6  # of the motion's energy, along the hull, at least; the slowest of sound glides had 0.76
EARLIEST = 1.0  # s that the two clocks may be apart
FULL = 0.2  # of a run's rows with a whole pose, at least


def _finite(run: Run, name: str) -> np.ndarray:
    values = run.columns.get(name, np.zeros(0))
    return values[np.isfinite(values)]


def _poses(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Times and whole poses (rows, 6) of motion capture."""
    if not run.has(*names.MOCAP):
        return np.zeros(0), np.zeros((0, 6))
    table = np.column_stack([run.columns[name] for name in names.MOCAP])
    whole = np.isfinite(table).all(axis=1)
    return run.t[whole], table[whole]


def frozen(run: Run) -> tuple[str, str] | None:
    """A capture that repeats one pose, or one of its coordinates, to the last digit."""
    t, poses = _poses(run)
    for n, name in enumerate(names.MOCAP if len(t) > 2 else ()):
        same = np.diff(poses[:, n]) == 0.0
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            if t[last] - t[first] > FROZEN and last - first >= 5:
                return (
                    name,
                    f"stands still to the last digit for {t[last] - t[first]:.1f} s from {t[first]:.2f} s: frozen",
                )
    return None


def swapped(run: Run) -> tuple[str, str] | None:
    """A hull that seems to move sideways, backwards or upright: axes or signs of the capture are not those of NED."""
    t, poses = _poses(run)
    if len(t) < 20:
        return None
    every = max(1, round(0.3 / float(np.median(np.diff(t)))))
    t, poses = t[::every], poses[::every]
    if len(t) < 4:
        return None
    velocity = np.diff(poses[:, :3], axis=0) / np.diff(t)[:, None]
    middle = Rotation.from_euler("ZYX", poses[:-1, :2:-1])
    body = middle.inv().apply(velocity)
    speed = np.linalg.norm(body, axis=1)
    moving = speed > LEAST_HULL_SPEED
    if moving.sum() < 5:
        return None
    ahead = float(np.sum(np.sign(body[moving, 0]) * body[moving, 0] ** 2) / np.sum(speed[moving] ** 2))
    if ahead < AHEAD:
        said = "backwards" if ahead < -AHEAD else f"only {100 * max(ahead, 0):.0f} % ahead"
        return "mocap pose", f"the hull would move {said}: axes swapped or signs turned (NED, ZYX angles wanted)"
    return None


def _smooth(t: np.ndarray, x: np.ndarray, grid: np.ndarray) -> np.ndarray:
    seen = np.isfinite(x)
    return np.interp(grid, t[seen], x[seen]) if seen.sum() > 1 else np.full(len(grid), np.nan)


def clock_offset(run: Run) -> tuple[float, float] | None:
    """Seconds by which the capture lags the onboard log and 1 sigma of it, from depth, pitch and roll; None if unknown.

    The peak of the cross-correlation of all channels that both have; its width and height give the uncertainty.
    """
    pairs = [(names.DEPTH, names.MOCAP[2]), *zip(names.ATTITUDE[:2], names.MOCAP_ATTITUDE[:2], strict=True)]
    pairs = [(a, b) for a, b in pairs if len(_finite(run, a)) > 20 and len(_finite(run, b)) > 20]
    if not pairs:
        return None
    step = max(0.02, float(np.median(np.diff(run.t))))
    grid = np.arange(run.t[0], run.t[-1], step)
    most = int(0.6 * len(grid))
    lags = np.arange(-most, most + 1)
    error, weight = np.zeros(len(lags)), 0
    for a, b in pairs:
        x, y = _smooth(run.t, run.columns[a], grid), _smooth(run.t, run.columns[b], grid)
        scale = max(float(np.std(x)), 1e-6)
        for n, lag in enumerate(lags.tolist()):
            d = y[max(lag, 0) : len(y) + min(lag, 0)] - x[max(-lag, 0) : len(x) - max(lag, 0)]
            error[n] += float(np.var(d)) / scale**2
        weight += 1
    best = int(np.argmin(error))
    if best in (0, len(lags) - 1):
        return float(lags[best] * step), np.inf
    bend = (error[best - 1] - 2.0 * error[best] + error[best + 1]) / step**2
    shift = (error[best - 1] - error[best + 1]) / (2.0 * bend * step) if bend > 0.0 else 0.0
    independent = max(len(grid) * weight / 25.0, 1.0)
    sd = np.sqrt(max(error[best] / weight, 1e-9) / independent / max(0.5 * bend / weight, 1e-9))
    return float(lags[best] * step + shift), float(sd)


def clocks_apart(run: Run) -> tuple[str, str] | None:
    """Clocks that differ by more than the fit can take."""
    found = clock_offset(run)
    if found is None or abs(found[0]) < EARLIEST:
        return None
    return "mocap pose", f"motion capture is {found[0]:+.1f} s from the onboard log: align the clocks first"


def empty(run: Run, mocap: bool) -> tuple[str, str] | None:
    """Too little to fit: no rows, no poses where the case has motion capture."""
    if run.rows < 20:
        return "", f"{run.rows} rows are too few"
    if mocap and len(_poses(run)[0]) < FULL * run.rows:
        return "mocap pose", f"only {len(_poses(run)[0])} of {run.rows} rows have a pose: a clock far off?"
    return None


def screen(runs: list[Run], mocap: bool) -> tuple[list[Run], list[LeftOut]]:
    """The runs that may be fitted, and those that may not with the first reason found."""
    kept, out = [], []
    for run in runs:
        found = impossible(run) or empty(run, mocap) or frozen(run) or swapped(run) or clocks_apart(run)
        if found is None:
            kept.append(run)
        else:
            out.append(LeftOut(run.name, run.path, *found))
    return kept, out


def despiked(run: Run) -> tuple[Run, int]:
    """The run with single wild samples taken out (NaN), and how many: more than 8 sigma from the median of 7 beside."""
    columns, count = dict(run.columns), 0
    for name in (*names.MOCAP, *names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES):
        x = columns.get(name)
        if x is None or np.isfinite(x).sum() < 20:
            continue
        seen = np.isfinite(x)
        values = np.unwrap(x[seen]) if name in names.WRAPPING else x[seen]
        beside = np.lib.stride_tricks.sliding_window_view(np.pad(values, 3, mode="edge"), 7)
        off = values - np.median(beside, axis=1)
        sigma = 1.4826 * np.median(np.abs(off))
        wild = np.abs(off) > 8.0 * max(sigma, 2e-3)
        if wild.any():
            changed = x.copy()
            changed[np.flatnonzero(seen)[wild]] = np.nan
            columns[name], count = changed, count + int(wild.sum())
    return replace(run, columns=columns), count
