"""A run's misfit about a model, to second order in everything that runs may share or change in."""

from dataclasses import dataclass

import numpy as np

from tools.inference.fit import NUISANCE_STEP, THRESHOLD_STEP
from tools.inference.problem import Problem
from tools.watch.shared_parameters import SharedParameters

STEP = 0.1  # of a label's spread: difference step
HIDDEN = 1.0  # squared sigma: a whole spread that moves less may be a threshold that was not reached


@dataclass
class Expansion:
    """-2 log likelihood of a run at x: value + 2 slope (x - at) + (x - at) curvature (x - at), in spreads."""

    at: np.ndarray  # (count,)
    value: float
    slope: np.ndarray  # (count,)
    curvature: np.ndarray  # (count, count)
    nis: float  # mean squared innovation at `at`, of the filter of that model
    samples: int

    @property
    def offset(self) -> np.ndarray:
        """Slope at x = 0 of the same parabola."""
        return self.slope - self.curvature @ self.at

    @property
    def constant(self) -> float:
        """Value at x = 0."""
        return float(self.value - 2.0 * self.slope @ self.at + self.at @ self.curvature @ self.at)

    def cooled(self, heat: float) -> "Expansion":
        """The same with squared innovations that count for less."""
        return Expansion(self.at, self.value / heat, self.slope / heat, self.curvature / heat, self.nis, self.samples)


def difference_steps(shared: SharedParameters, x: np.ndarray) -> np.ndarray:
    """Step of each derivative at x, away from the nearer limit; a whole spread where an effect begins at a kink."""
    steps = np.where(shared.groups == 2, STEP * np.maximum(1.0, np.abs(x)), NUISANCE_STEP)
    begins = shared.kinked & (x == 0.0)
    steps[begins] = np.minimum(1.0, np.maximum(shared.high, -shared.low)[begins])
    return np.where(x + steps > shared.high, -steps, steps)


def expand(part: Problem, shared: SharedParameters, x: np.ndarray, roughness: float = 1.0) -> Expansion:
    """A run (a problem of its own) about the model at x, by the gains of that model's filter."""
    gains = part.filter(*shared.model(part, x), roughness=roughness, begin=True)
    steps = difference_steps(shared, x)
    points = [x, *(x + np.diag(steps))]
    E = part.follow([shared.model(part, point) for point in points], gains)
    e, J = E[0], (E[1:] - E[0]) / steps[:, None]
    hidden = np.flatnonzero(shared.kinked & (x == 0.0) & ((J**2).sum(axis=1) < HIDDEN))
    if len(hidden):
        sizes = np.clip(THRESHOLD_STEP, shared.low[hidden], shared.high[hidden])
        sizes = np.where(shared.high[hidden] > 0.0, sizes, np.maximum(-THRESHOLD_STEP, shared.low[hidden]))
        more = []
        for k, size in zip(hidden, sizes, strict=True):
            point = x.copy()
            point[k] += size
            more.append(shared.model(part, point))
        J[hidden] = (part.follow(more, gains) - e) / sizes[:, None]
    return Expansion(
        x.copy(), float(gains.misfit[0]), J @ e, J @ J.T, float(e @ e) / max(1, len(e)), len(e)
    )
