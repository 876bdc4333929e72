"""Noise levels: how strong disturbance and sensors' noise are, beside what the vehicle file and the case say.

The filter's own likelihood (squared innovations and the logarithms of what they may miss) is maximised over the
logarithm of every level by Newton's method, its curvature taken by differences.
"""

from dataclasses import dataclass, replace

import numpy as np

from sim_backend.core.effects import effect_layout as ef
from tools.inference.problem import Gains, Problem

DISTURBANCE = {"disturbance_linear": slice(0, 3), "disturbance_angular": slice(3, 6)}  # of the spectral densities
SENSORS = {
    "attitude": slice(0, 3), "gyro": slice(3, 6), "depth": slice(6, 7), "slider": slice(7, 8), "ballast": slice(8, 9),
    "mocap_position": slice(ef.Y_MOCAP_X, ef.Y_MOCAP_ROLL), "mocap_attitude": slice(ef.Y_MOCAP_ROLL, ef.N_Y),
}  # fmt: skip
WIDTH = 2.0  # prior 1 sigma of a level's logarithm
NUDGE, LARGEST_STEP, CLOSE = 0.05, 0.8, 0.02
ROUNDS = 8


@dataclass(frozen=True)
class Levels:
    """Factors on the standard deviations that the case names, by name, and 1 sigma of their logarithms."""

    names: tuple[str, ...]
    log: np.ndarray
    sd: np.ndarray

    def applied(self, problem: Problem) -> Problem:
        """The problem with its noise at these levels."""
        spectral, R = problem.spectral.copy(), problem.R.copy()
        for name, log in zip(self.names, self.log, strict=True):
            if name in DISTURBANCE:
                spectral[DISTURBANCE[name]] *= np.exp(2.0 * log)
            else:
                R[:, SENSORS[name]] *= np.exp(2.0 * log)
        return replace(problem, spectral=spectral, R=R)

    def moved(self, log: np.ndarray) -> "Levels":
        return replace(self, log=log)


def group_of_reading() -> np.ndarray:
    """The number of each reading's sensor in SENSORS, (N_Y,)."""
    found = np.zeros(ef.N_Y, dtype=np.int64)
    for n, part in enumerate(SENSORS.values()):
        found[part] = n
    return found


def named(problem: Problem) -> Levels:
    """The levels of a problem as the case has them. A disturbance of 0 stays 0."""
    names = [name for name, part in DISTURBANCE.items() if problem.spectral[part].any()]
    names += [name for name, part in SENSORS.items() if problem.seen[part].any()]
    return Levels(tuple(names), np.zeros(len(names)), np.full(len(names), WIDTH))


def deviance(problem: Problem, gains: Gains) -> float:
    """-2 log likelihood of the filter without its constant, over all rows."""
    weight = np.einsum("imm->im", gains.W)[problem.valid]
    return float(np.square(gains.E[problem.valid]).sum() - 2.0 * np.log(weight).sum())


def estimate(problem: Problem, filtered, levels: Levels) -> Levels:
    """The most probable levels; filtered(problem) -> Gains filters with the model at hand."""

    def objective(log: np.ndarray) -> float:
        changed = levels.moved(log).applied(problem)
        return deviance(changed, filtered(changed)) + float(log @ log) / WIDTH**2

    log, at = levels.log.copy(), objective(levels.log)
    sd = np.full(len(log), WIDTH)
    for _ in range(ROUNDS):
        slope, bend = np.empty(len(log)), np.empty(len(log))
        for i, row in enumerate(np.eye(len(log)) * NUDGE):
            above, below = objective(log + row), objective(log - row)
            slope[i] = (above - below) / (2.0 * NUDGE)
            bend[i] = max((above - 2.0 * at + below) / NUDGE**2, 2.0 / WIDTH**2, abs(slope[i]) / LARGEST_STEP)
        sd = np.sqrt(2.0 / bend)
        step = -slope / bend
        moved = objective(log + step)
        if moved >= at:
            step *= 0.3
            moved = objective(log + step)
            if moved >= at:
                break
        log, at = log + step, moved
        if np.all(np.abs(step) < np.maximum(CLOSE, 0.5 * sd)):
            break
    return replace(levels, log=log, sd=sd)
