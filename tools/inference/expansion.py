"""A run's misfit about a model, to second order in everything that runs may share or change in."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from glider.tools.inference.fit import NUISANCE_STEP, THRESHOLD_STEP
from glider.tools.inference.pooled import Parabola
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.shared_parameters import BOUND_TOLERANCE, SharedParameters

STEP = 0.1  # of a label's spread: difference step
HIDDEN = 1.0  # sigma: a whole spread that moves less may be a threshold that was not reached
LONG_STEP_SIGMA, SHORTENED_STEP_SIGMA = (
    30.0,
    8.0,
)  # sigma in all: steps that move more are too long, and how far they go instead
PAST_THRESHOLD = 0.1  # of a long step's derivative: a short one that sees less has not reached a threshold
Moved = Callable[[int, float], tuple[np.ndarray, np.ndarray]]


@dataclass
class Expansion(Parabola):
    """A run's innovations about x."""

    nis: float  # mean squared innovation at `at`, of the filter of that model
    samples: int
    parts: "list[Expansion]" = field(default_factory=list)  # of strata of its samples, where they were asked


def at_bound(shared: SharedParameters, x: np.ndarray) -> np.ndarray:
    """Of each parameter, whether it has a kink and is hardly past it, (count,) bool."""
    return shared.one_sided & (np.abs(x) < BOUND_TOLERANCE)


def difference_steps(shared: SharedParameters, x: np.ndarray) -> np.ndarray:
    """Step of each derivative at x, away from the nearer limit; a whole spread where an effect begins at a kink."""
    steps = np.where(shared.groups == 2, STEP * np.maximum(1.0, np.abs(x)), NUISANCE_STEP)
    begins = at_bound(shared, x)
    steps[begins] = np.minimum(1.0, np.maximum(shared.high, -shared.low)[begins])
    return np.where(x + steps > shared.high, -steps, steps)


def columns_at(
    part: Problem, gains: Gains, models: Moved, begins: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations (samples,) of a run by kept gains, and their derivatives (parameters, samples) by difference.

    models(k, size): the model with parameter k moved by a size, none moved for k = -1. A step that moves the
    innovations by more than FAR sigma in all is taken again shorter: the sizes that can be seen differ a hundredfold.
    One that moves nothing where the effect begins (`begins`) is taken longer; one that has to reach a threshold stays.
    """
    E = part.follow([models(-1, 0.0), *(models(k, float(size)) for k, size in enumerate(steps))], gains)
    e, J = E[0], (E[1:] - E[0]) / steps[:, None]
    norms = np.sqrt((J**2).sum(axis=1))
    far = np.flatnonzero(norms * np.abs(steps) > LONG_STEP_SIGMA)
    hidden = np.flatnonzero(begins & (norms < HIDDEN))
    again = np.concatenate([far, hidden]).astype(int)
    if len(again):
        scales = np.concatenate(
            [SHORTENED_STEP_SIGMA / (norms[far] * np.abs(steps[far])), np.full(len(hidden), THRESHOLD_STEP)]
        )
        sizes = steps[again] * scales
        moved = part.follow([models(int(k), float(size)) for k, size in zip(again, sizes, strict=True)], gains)
        new = (moved - e) / sizes[:, None]
        reached = (new**2).sum(axis=1) > (PAST_THRESHOLD * norms[again]) ** 2
        kept = reached | ~begins[again]
        J[again[kept]] = new[kept]
    return e, J


def expand(
    part: Problem,
    shared: SharedParameters,
    x: np.ndarray,
    process_noise_scale: float = 1.0,
    strata: np.ndarray | None = None,
) -> Expansion:
    """A run (a problem of its own) about the model at x, by the gains of that model's filter.

    strata: a number of every row (rows,); the samples of each number make a part of the expansion.
    """
    gains, e, J = linear(part, shared, x, process_noise_scale)
    found = _parabola(x, float(gains.misfit[0]), e, J)
    if strata is not None:
        of_sample = strata[np.nonzero(part.valid)[0]]
        chosen = [of_sample == number for number in range(int(strata.max()) + 1)]
        found.parts = [_parabola(x, float(e[own] @ e[own]), e[own], J[:, own]) for own in chosen]
    return found


def linear(
    part: Problem, shared: SharedParameters, x: np.ndarray, process_noise_scale: float = 1.0
) -> tuple[Gains, np.ndarray, np.ndarray]:
    """A run's filter at x, its innovations (samples,) and their derivatives (count, samples) by kept gains."""
    gains = part.filter(*shared.model(part, x), process_noise_scale=process_noise_scale, begin=True)

    def moved(k: int, size: float) -> tuple[np.ndarray, np.ndarray]:
        point = x.copy()
        if k >= 0:
            point[k] += size
        return shared.model(part, point)

    return gains, *columns_at(part, gains, moved, at_bound(shared, x), difference_steps(shared, x))


def _parabola(x: np.ndarray, value: float, e: np.ndarray, J: np.ndarray) -> Expansion:
    """Of innovations e (samples,) and their derivatives J (count, samples) at x."""
    return Expansion(x.copy(), value, J @ e, J @ J.T, float(e @ e) / max(1, len(e)), len(e))
