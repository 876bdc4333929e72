"""Which terms beside equation (4) a vehicle keeps: those that are more probable to be there than not.

The fit by prediction error has them all free. The evidence of a term is the ratio of its prior's density to its
posterior's at the file's value (Savage and Dickey's), by Laplace's approximation, with as many independent residuals as
the fit counts; the term with the least goes first, the others then stand where they are most probable without it.
"""

import numpy as np

from glider.tools.inference.prediction_error import Fitted, PredictionError
from glider.tools.inference.vehicle_parameters import FIRST_EFFECTS, GAUGE, LINEAR_DAMPING

TERMS = (tuple(LINEAR_DAMPING), ("x_b",), *((name,) for name in FIRST_EFFECTS), (GAUGE,))
SCATTER = 0.2  # of the logarithm of two models' gaps from run to run, before any run was seen: as much as one run
CLEAR = 2.0  # standard errors of its mean from which one flies runs left out better than another


def mean_and_error(less: np.ndarray) -> tuple[float, float]:
    """Mean of differences of logarithms (runs,), and its standard error."""
    return float(less.mean()), float(np.sqrt(SCATTER**2 + np.square(less - less.mean()).sum()) / len(less))


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


def evidence(found: Fitted, at: np.ndarray, term: np.ndarray, gone: np.ndarray) -> float:
    """Log odds (nat) that a term is there, parameters `term` (indices), where those `gone` (indices) are not.

    at (n,): values of a vehicle without them, in units of the priors.
    """
    kept = np.setdiff1d(np.arange(len(at)), gone)
    off = (conditional(found, at, gone) - at)[term]
    own = np.searchsorted(kept, term)
    covariance = np.linalg.inv(found.normal[np.ix_(kept, kept)])[np.ix_(own, own)]
    prior = -0.5 * float(at[term] @ at[term])
    return prior + 0.5 * float(np.linalg.slogdet(covariance)[1] + off @ np.linalg.solve(covariance, off))


def unearned(found: Fitted, fitting: PredictionError) -> list[tuple[str, ...]]:
    """The terms that go."""
    names, at = fitting.free.names, fitting.file_values
    left = [term for term in TERMS if len(places(names, [term]))]
    gone: list[tuple[str, ...]] = []
    while left:
        odds = [evidence(found, at, places(names, [term]), places(names, gone)) for term in left]
        if min(odds) > 0.0:
            break
        gone.append(left.pop(int(np.argmin(odds))))
    return gone
