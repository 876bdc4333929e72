"""Which terms beside equation (4) a vehicle keeps: those that are more probable to be there than not.

The fit by prediction error has them all free. The term with the least evidence (`Fitted.evidence`) goes first, the
others then stand where they are most probable without it.
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


def places(names: list[str], terms: list[tuple[str, ...]]) -> np.ndarray:
    """Where the parameters of terms stand."""
    wanted = {name for term in terms for name in term}
    return np.array([n for n, name in enumerate(names) if name in wanted], dtype=np.int64)


def unearned(found: Fitted, fitting: PredictionError) -> list[tuple[str, ...]]:
    """The terms that go."""
    names, at = fitting.free.names, fitting.file_values
    left = [term for term in TERMS if len(places(names, [term]))]
    gone: list[tuple[str, ...]] = []
    while left:
        odds = [found.evidence(at, places(names, [term]), places(names, gone)) for term in left]
        if min(odds) > 0.0:
            break
        gone.append(left.pop(int(np.argmin(odds))))
    return gone
