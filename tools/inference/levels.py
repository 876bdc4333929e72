"""Noise levels: how strong disturbance and sensors' noise are, beside what the vehicle file and the case say.

The filter's own likelihood (squared innovations and the logarithms of what they may miss) is maximised over the
logarithm of every level by Newton's method, its curvature taken by differences. That asks for a model that is right.
Before there is one, a sensor's white noise shows in what is left of its readings when all that a vehicle does within
four samples is taken off.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from glider.firmware.core.maths.rotations import wrap
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import Gains, Problem, variances

DISTURBANCE = {"disturbance_linear": slice(0, 3), "disturbance_angular": slice(3, 6)}  # of the spectral densities
SENSORS = {
    "attitude": slice(0, 3), "gyro": slice(3, 6), "depth": slice(6, 7), "slider": slice(7, 8), "ballast": slice(8, 9),
    "mocap_position": slice(ef.Y_MOCAP_X, ef.Y_MOCAP_ROLL), "mocap_attitude": slice(ef.Y_MOCAP_ROLL, ef.N_Y),
}  # fmt: skip
ANGLES = (0, 1, 2, ef.Y_MOCAP_ROLL, ef.Y_MOCAP_PITCH, ef.Y_MOCAP_YAW)  # readings that may wrap
WIDTH = 2.0  # prior 1 sigma of a level's logarithm
DIFFERENCES = 3  # taken of readings: of a vehicle's motion in four samples next to nothing is left
SPREAD_OF_DIFFERENCE = 20.0**0.5  # 1 sigma of the third difference of white noise of 1
MEDIAN_OF_NORMAL = 0.6745  # median size of a normal deviate of 1 sigma
MIN_DIFFERENCES = 200  # differences that say anything
COLOURED = 0.2  # logarithm by which noise of every second sample may be more than that of all
MOST_HELD = 0.2  # share of samples that repeat the one before, from which a reading is held or coarse
DIFFERENCE_STEP, LARGEST_STEP, CLOSE = 0.05, 0.8, 0.02
ROUNDS = 8


@dataclass(frozen=True)
class Levels:
    """Factors on the standard deviations that the case names, by name, and 1 sigma of their logarithms."""

    names: tuple[str, ...]
    log: np.ndarray
    sd: np.ndarray
    width: float = WIDTH  # prior 1 sigma of a logarithm

    def applied(self, problem: Problem) -> Problem:
        """The problem with its noise at these levels."""
        spectral, R = problem.spectral.copy(), problem.R.copy()
        for name, log in zip(self.names, self.log, strict=True):
            if name in DISTURBANCE:
                spectral[DISTURBANCE[name]] *= np.exp(2.0 * log)
            else:
                R[:, SENSORS[name]] *= np.exp(2.0 * log)
        recorded = None if problem.recorded is None else self.applied(problem.recorded)
        return replace(problem, spectral=spectral, R=R, recorded=recorded)

    @property
    def odds(self) -> np.ndarray:
        """Nat by which each level says that the case names it rightly, rather than that it may be anything."""
        right, free = DIAGNOSIS.noise_accurate**2 + self.sd**2, DIAGNOSIS.noise_free**2 + self.sd**2
        return 0.5 * (np.log(free / right) - self.log**2 * (1.0 / right - 1.0 / free))

    def believed(self, well_specified: float) -> "Levels":
        """The mean of what each may be; well_specified: the probability that the case names all rightly."""
        return self.moved(self.log * (1.0 - well_specified) * expit(-self.odds))

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


def disturbance(problem: Problem, width: float = WIDTH) -> Levels:
    """The levels of the disturbance alone."""
    names = [name for name, part in DISTURBANCE.items() if problem.spectral[part].any()]
    return Levels(tuple(names), np.zeros(len(names)), np.full(len(names), width), width)


def as_said(problem: Problem) -> Problem:
    """The problem with the noise that its case names."""
    kind, spectral = problem.kind, problem.spectral.copy()
    spectral[kind.accelerations] = [
        getattr(problem.case.disturbance, name) ** 2 * kind.hold for name in kind.disturbance
    ]
    R = np.tile(variances(kind, problem.case.sensors), (len(problem.runs), 1))
    return replace(problem, spectral=spectral, R=R)


def factors(problem: Problem) -> dict[str, float]:
    """By level, how many times what its case names a problem's standard deviations are."""
    said = as_said(problem)
    found = {name: float(np.sqrt(problem.spectral[part] / said.spectral[part]).mean())
             for name, part in DISTURBANCE.items() if said.spectral[part].all()}  # fmt: skip
    return found | {
        name: float(np.sqrt(problem.R[:, part] / said.R[:, part]).mean())
        for name, part in SENSORS.items() if problem.seen[part].any()
    }  # fmt: skip


def sensor_noise(problem: Problem, least: float, most: float) -> Levels:
    """The levels of the sensors' white noise, within factors `least` and `most`, by their readings alone.

    The median size of third differences within runs: steps of a command, blind spells and outliers are few. A reading
    that is held, coarse or short says nothing, nor one whose noise is not white (smoothed, resampled: every second
    sample then has more of it); they keep what their file says.
    """
    names, logs, sds = [], [], []
    for name, part in SENSORS.items():
        sizes, apart = (_relative(problem, part, stride) for stride in (1, 2))
        if min(len(sizes), len(apart)) < MIN_DIFFERENCES:
            continue
        log, other = (float(np.log(max(np.median(found), 1e-9) / MEDIAN_OF_NORMAL)) for found in (sizes, apart))
        if other - log > COLOURED:
            continue
        names.append(name)
        logs.append(min(max(log, np.log(least)), np.log(most)))
        sds.append(1.2 / np.sqrt(len(sizes) / (DIFFERENCES + 1)))
    return Levels(tuple(names), np.array(logs), np.array(sds))


def _relative(problem: Problem, part: slice, stride: int) -> np.ndarray:
    """Sizes of a sensor's third differences over every `stride`-th sample, in the sigma that the case gives them."""
    found = [sizes for m in range(part.start, part.stop) for sizes in _differences(problem, m, stride)]
    return np.concatenate(found) if found else np.zeros(0)


def _differences(problem: Problem, reading: int, stride: int) -> list[np.ndarray]:
    """The same of one reading, run by run."""
    found = []
    for n, (a, b) in enumerate(itertools.pairwise(problem.recording.bounds)):
        values = problem.z[a:b, reading]
        steps = values[stride:] - values[:-stride]
        steps = wrap(steps) if reading in ANGLES else steps
        given = np.isfinite(steps)
        if given.sum() < MIN_DIFFERENCES // 4 or (steps[given] == 0.0).mean() > MOST_HELD:
            continue
        left = steps
        for _ in range(DIFFERENCES - 1):
            left = left[stride:] - left[:-stride]
        sigma = SPREAD_OF_DIFFERENCE * np.sqrt(problem.R[n, reading])
        found.append(np.abs(left[np.isfinite(left)]) / sigma)
    return found


def deviance(problem: Problem, gains: Gains) -> float:
    """-2 log likelihood of the filter without its constant, over all rows."""
    weight = np.einsum("imm->im", gains.W)[problem.valid]
    return float(np.square(gains.E[problem.valid]).sum() - 2.0 * np.log(weight).sum())


def estimate(problem: Problem, filtered, levels: Levels, rounds: int = ROUNDS) -> Levels:
    """The most probable levels; filtered(problem) -> Gains filters with the model at hand."""

    def objective(log: np.ndarray) -> float:
        changed = levels.moved(log).applied(problem)
        return deviance(changed, filtered(changed)) + float(log @ log) / levels.width**2

    log, at = levels.log.copy(), objective(levels.log)
    sd = np.full(len(log), levels.width)
    for _ in range(rounds):
        slope, bend = np.empty(len(log)), np.empty(len(log))
        for i, row in enumerate(np.eye(len(log)) * DIFFERENCE_STEP):
            above, below = objective(log + row), objective(log - row)
            slope[i] = (above - below) / (2.0 * DIFFERENCE_STEP)
            bend[i] = max(
                (above - 2.0 * at + below) / DIFFERENCE_STEP**2, 2.0 / levels.width**2, abs(slope[i]) / LARGEST_STEP
            )
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
