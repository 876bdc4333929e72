"""An ocean glider's steady rows: measured depth rate beside the one that the model would have there.

See docs/explanation/ocean.md.
"""

from dataclasses import dataclass

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.tools.data.runs import columns as names
from glider.tools.inference.core.ocean import steady_glide
from glider.tools.inference.ocean_inputs import drawn
from glider.tools.inference.parameters import FreeParameter
from glider.tools.inference.problem import Problem

HALF_WINDOW_S = 30.0  # s either way, over which the depth rate is taken
MIN_SAMPLES = 3  # samples of it
TRANSIENT_ROWS = 4000  # are enough for a first guess
TRANSIENT_VOLUMES = np.linspace(-0.02, 0.02, 81)  # share of the volume


@dataclass
class Steady:
    """Rows where the vehicle glides steadily, all runs behind each other."""

    rows: np.ndarray  # (n,) of the problem's table
    run: np.ndarray  # (n,)
    rate: np.ndarray  # (n,) m/s, measured, down positive


def _sums(values: np.ndarray, first: np.ndarray, end: np.ndarray) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return total[end] - total[first]


def depth_rate(t: np.ndarray, depth: np.ndarray, half: float = HALF_WINDOW_S) -> np.ndarray:
    """Slope of the depth (rows,) m over `half` s either way by least squares, m/s; NaN where there are too few."""
    given = np.isfinite(depth)
    if given.sum() < MIN_SAMPLES:
        return np.full(len(t), np.nan)
    s, z = t[given] - t[given][0], depth[given]
    first, end = np.searchsorted(t[given], t - half), np.searchsorted(t[given], t + half, side="right")
    count = np.maximum(end - first, 1)
    mean_s, mean_z = _sums(s, first, end) / count, _sums(z, first, end) / count
    around = _sums(s * s, first, end) - count * mean_s**2
    slope = (_sums(s * z, first, end) - count * mean_s * mean_z) / np.maximum(around, 1e-9)
    centred = np.abs(mean_s + t[given][0] - t) < half / 3.0
    return np.where((end - first >= MIN_SAMPLES) & centred, slope, np.nan)


def steady_rows(problem: Problem) -> Steady:
    """The steady rows of a problem of ocean gliders."""
    r = problem.recording
    rates = np.concatenate([depth_rate(run.t, run.columns[names.DEPTH]) for run in problem.runs])
    rows = np.flatnonzero((r.inputs[:, at.U_UNSTEADY] == 0.0) & np.isfinite(rates))
    return Steady(rows, problem.run_of[rows], rates[rows])


def depths(problem: Problem) -> np.ndarray:
    """Depth of every row, missing samples drawn in, m."""
    return np.concatenate([drawn(run.t, run.columns[names.DEPTH])[0] for run in problem.runs])


def glides(
    problem: Problem, P: np.ndarray, F: np.ndarray, rows: np.ndarray, depth: np.ndarray | None = None
) -> np.ndarray:
    """Speed along the path and its angle at rows, (n, 2); depth: depths(problem), where they are known."""
    out = np.empty((len(rows), 2))
    depth = depths(problem) if depth is None else depth
    steady_glide(P, F, depth, problem.since, problem.recording.inputs, rows, out)
    return out


def vertical_water(problem: Problem, P: np.ndarray, F: np.ndarray, steady: Steady) -> np.ndarray:
    """Vertical velocity of the water at the steady rows, down positive, m/s (n,): measured less modelled depth rate."""
    found = glides(problem, P, F, steady.rows)
    return np.asarray(steady.rate + found[:, 0] * np.sin(found[:, 1]))


def first_values(problem: Problem, free: list[FreeParameter]) -> np.ndarray:
    """Values (count,) of free parameters, in their spreads, at the first guess; 0 of what it does not find."""
    guess, P = first_guess(problem), problem.model.P
    return np.array([
        (guess[f.entry] - P[f.entry]) / f.spread if f.entry >= 0 and f.vector == "P" else 0.0 for f in free
    ])  # fmt: skip


def first_guess(problem: Problem) -> np.ndarray:
    """P with volume and drag as steady rows ask for: the one by search, the other by the median ratio of speeds."""
    steady = steady_rows(problem)
    P, F = problem.model.P.copy(), np.zeros(at.N_F)
    if len(steady.rows) < MIN_SAMPLES:
        return P
    chosen = np.linspace(0, len(steady.rows) - 1, min(TRANSIENT_ROWS, len(steady.rows))).astype(int)
    rows, rate = steady.rows[chosen], steady.rate[chosen]
    best, least, depth = P, np.inf, depths(problem)
    for share in TRANSIENT_VOLUMES:
        moved = P.copy()
        moved[at.VOLUME] *= 1.0 + share
        found = glides(problem, moved, F, rows, depth)
        down = -found[:, 0] * np.sin(found[:, 1])
        gliding = np.abs(down) > 2.0 * at.LEAST_FLOW_SPEED
        if gliding.mean() < 0.8:
            continue
        ratio = float(np.median(np.abs(rate[gliding]) / np.abs(down[gliding])))
        miss = float(np.median(np.abs(rate - ratio * down)))
        if miss < least:
            least = miss
            best = moved.copy()
            best[at.DRAG_0] = P[at.DRAG_0] * np.clip(ratio**-2.0, 0.2, 8.0)
    return best
