"""The model that all runs share, fitted to the reference: Gauss and Newton in everything at once, held by its prior.

As in tools/diagnose/search.py the data's weight is let in by degrees: first a filter that expects a rough disturbance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from glider.tools.inference.expansion import Expansion, expand
from glider.tools.inference.fit import SHORTER_STEPS, bounded_step
from glider.tools.inference.problem import Problem
from glider.tools.inference.shared_parameters import SharedParameters

PROCESS_NOISE_SCALES = (100.0, 10.0, 1.0, 1.0, 1.0)  # of each step
CONVERGED_GAIN = 2.0  # squared sigma that the last step's parabola still predicts: no further step


def misfit(parts: Sequence[Problem], shared: SharedParameters, x: np.ndarray, process_noise_scale: float) -> float:
    """-2 log likelihood of a model's own filters over runs."""
    found = sum(
        float(part.filter(*shared.model(part, x), process_noise_scale=process_noise_scale, begin=True).misfit[0])
        for part in parts
    )
    return found if np.isfinite(found) else np.inf


@dataclass
class About:
    """Expansions of runs about values: those of the last values that were asked for are kept."""

    parts: Sequence[Problem]
    shared: SharedParameters
    found: list[Expansion] = field(default_factory=list)

    def __call__(self, x: np.ndarray) -> list[Expansion]:
        """Of every run about x (count,)."""
        if not self.found or not np.array_equal(self.found[0].at, x):
            self.found = [expand(part, self.shared, x) for part in self.parts]
        return self.found


def fit_shared(
    parts: Sequence[Problem], shared: SharedParameters, start: np.ndarray | None = None, least_inflation: float = 1.0,
    about: About | None = None,
) -> np.ndarray:  # fmt: skip
    """The most probable shared values (count,) of runs, each a problem of its own; from `start`, where there is one.

    least_heat: by which the runs' evidence counts for less at least; about: of these runs and parameters, to be kept.
    """
    about = About(parts, shared) if about is None else about
    x = np.zeros(shared.count) if start is None else start.copy()
    weight = np.diag(shared.prior**-2.0)
    for process_noise_scale in PROCESS_NOISE_SCALES if start is None else PROCESS_NOISE_SCALES[-2:]:
        found = (
            about(x) if process_noise_scale == 1.0 else [expand(part, shared, x, process_noise_scale) for part in parts]
        )
        inflation = max(least_inflation, inflation_of(found))
        normal = sum(one.curvature for one in found) / inflation + weight
        slope = sum(one.slope for one in found) / inflation + weight @ x
        step = bounded_step(normal, slope, np.minimum(shared.low - x, 0.0), np.maximum(shared.high - x, 0.0))
        predicted_gain = -float(2.0 * slope @ step + step @ normal @ step)
        if process_noise_scale == 1.0 and predicted_gain < CONVERGED_GAIN:
            break
        best, least = x, sum(one.value for one in found) / inflation + x @ weight @ x
        for share in (1.0, *SHORTER_STEPS):
            tried = np.clip(x + share * step, shared.low, shared.high)
            value = misfit(parts, shared, tried, process_noise_scale) / inflation + tried @ weight @ tried
            if value < least:
                best, least = tried, value
                break
        x = best
    return x


def inflation_of(found: Sequence[Expansion]) -> float:
    """Mean squared innovation of runs, 1 at least: by so much their evidence counts for less."""
    samples = sum(one.samples for one in found)
    return max(1.0, sum(one.nis * one.samples for one in found) / max(1, samples))
