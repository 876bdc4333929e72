"""Poses of motion capture moved to the rows of the time when they were taken, where its clock is far out.

A filter can look back along the course it has flown, but not ahead, and it corrects its state by an old pose as if it
were of now. Poses that stand near their own time ask for neither. Each is used once, as it was measured.
"""

import itertools
from dataclasses import replace

import numpy as np

from glider.firmware.core.vehicle.layout import X_DOWN, X_POS
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.core.error_layout import E_DOWN, E_POS
from glider.tools.inference.problem import Problem

UNSEEN_SPEED = 0.4  # m/s, by which a vehicle may have left its first pose's place before that was taken
POSE_LAG_S = 0.2  # s behind its own time, at which a pose stands: its clock may wander, and a filter can only look back
POSES = slice(ef.Y_ONBOARD, ef.N_Y)


def capture_times(problem: Problem, F: np.ndarray) -> np.ndarray:
    """When the poses of the rows were taken, by a model's clock, (rows,) s."""
    return np.asarray(problem.recording.t - F[ef.MOCAP_DELAY] - F[ef.CLOCK_SKEW] * problem.since)


def sample_at_row(t: np.ndarray, at: np.ndarray) -> np.ndarray:
    """For each time of `t` (rows,) which sample stands there, -1 for none: `at` (rows,) are their times.

    A sample goes to the nearest row, and of two that would go to one row the nearer.
    """
    stands, apart = np.full(len(t), -1), np.full(len(t), np.inf)
    edges = 0.5 * (t[1:] + t[:-1])
    for k, row in enumerate(np.searchsorted(edges, at)):
        off, reach = abs(at[k] - t[row]), t[min(row + 1, len(t) - 1)] - t[max(row - 1, 0)]
        if off < min(apart[row], reach):
            stands[row], apart[row] = k, off
    return stands


def aligned(problem: Problem, F: np.ndarray) -> Problem:
    """The problem with its poses where the clock of F says; `recorded` keeps the one it was made from."""
    origin = problem.as_recorded
    t, bounds = origin.recording.t, origin.recording.bounds
    at = capture_times(origin, F) + POSE_LAG_S
    z, stamps = origin.z.copy(), t.copy()
    starts, spreads = origin.starts.copy(), origin.spreads.copy()
    z[:, POSES] = np.nan
    for n, (a, b) in enumerate(itertools.pairwise(bounds)):
        stands = sample_at_row(t[a:b], at[a:b])
        rows = np.flatnonzero(stands >= 0)
        z[a + rows, POSES] = origin.z[a + stands[rows], POSES]
        stamps[a + rows] = t[a + stands[rows]]
        seen = np.flatnonzero(np.isfinite(z[a:b, ef.Y_MOCAP_X : ef.Y_MOCAP_X + 2]).all(axis=1))
        if len(seen):
            starts[n, X_POS:X_DOWN] = z[a + seen[0], ef.Y_MOCAP_X : ef.Y_MOCAP_X + 2]
            spreads[n, E_POS:E_DOWN] += UNSEEN_SPEED * (t[a + seen[0]] - t[a])
    return replace(
        origin, z=z, stamps=stamps, starts=starts, spreads=spreads, valid=np.isfinite(z), recorded=origin
    )  # fmt: skip
