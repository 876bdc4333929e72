"""Which terms beside equation (4) a vehicle keeps: those without which runs left out are flown clearly worse.

The fit by prediction error has them all free. What becomes of it without a term is the posterior's conditional mean at
the term's value in the file, flown in the runs that its fit has not seen; the term that is missed least goes first.
"""

from dataclasses import dataclass

import numpy as np

from glider.tools.inference.prediction_error import HORIZONS, Fitted, PredictionError
from glider.tools.inference.vehicle_parameters import FIRST_EFFECTS, GAUGE, LINEAR_DAMPING

TERMS = (tuple(LINEAR_DAMPING), ("x_b",), *((name,) for name in FIRST_EFFECTS), (GAUGE,))
SCATTER = 0.2  # of the logarithm of two models' gaps from run to run, before any run was seen: as much as one run
CLEAR = 2.0  # standard errors of its mean from which one flies runs left out better than another


def mean_and_error(less: np.ndarray) -> tuple[float, float]:
    """Mean of differences of logarithms (runs,), and its standard error."""
    return float(less.mean()), float(np.sqrt(SCATTER**2 + np.square(less - less.mean()).sum()) / len(less))


@dataclass
class Fold:
    """A fit to a part of the runs, and the others: the same parameters free."""

    inside: Fitted
    outside: PredictionError


def conditional(found: Fitted, at: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Values (n,) where those at `fixed` (indices) stand at `at`, and the others where they then are most probable."""
    values = found.values.copy()
    if not len(fixed):
        return values
    free = np.setdiff1d(np.arange(len(values)), fixed)
    moved = at[fixed] - values[fixed]
    values[fixed] = at[fixed]
    values[free] -= np.linalg.solve(found.normal[np.ix_(free, free)], found.normal[np.ix_(free, fixed)] @ moved)
    return values


def places(names: list[str], terms: list[tuple[str, ...]]) -> np.ndarray:
    """Where the parameters of terms stand."""
    wanted = {name for term in terms for name in term}
    return np.array([n for n, name in enumerate(names) if name in wanted], dtype=np.int64)


def missed(folds: list[Fold], sets: list[list[tuple[str, ...]]]) -> np.ndarray:
    """By fold and set of terms, the logarithm of the gap of runs left out without those terms, (folds, sets)."""
    horizon, offsets = HORIZONS[-1]
    out = np.empty((len(folds), len(sets)))
    for k, fold in enumerate(folds):
        fitting, names = fold.outside, fold.outside.free.names
        points = [
            fitting.clipped(conditional(fold.inside, fitting.file_values, places(names, terms))) for terms in sets
        ]
        window = fitting.windows(horizon, offsets[0])
        Y = fitting.fly(points, fitting.gains(fold.inside.values), [window])
        out[k] = [0.5 * np.log(max(fitting.weights(e)[1], 1e-9)) for e in fitting.residuals(Y[:, 0], window)]
    return out


def unearned(folds: list[Fold]) -> list[tuple[str, ...]]:
    """The terms that go."""
    names = folds[0].outside.free.names
    left = [term for term in TERMS if len(places(names, [term]))]
    gone: list[tuple[str, ...]] = []
    while left:
        found = missed(folds, [[], *([*gone, term] for term in left)])
        more = found[:, 1:] - found[:, :1]
        least = int(np.argmin(more.mean(axis=0)))
        mean, error = mean_and_error(more[:, least])
        if mean > CLEAR * error:
            break
        gone.append(left.pop(least))
    return gone
