"""How much runs differ from each other though nothing changed, learned from the reference.

A run's own values are the shared ones and a deviation, normal with a size for each group of parameters (the vehicle's,
the sensors' biases, effects), in spreads. The sizes are the most probable ones, about what is usual; what a wrong form
of the model leaves in a run shows as such a deviation too. A run's parabola without its deviation is what events are
judged by.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from glider.tools.inference import pooled
from glider.tools.inference.expansion import Expansion
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.shared_parameters import SharedParameters

USUAL = np.array([WATCH.scatter_vehicle, WATCH.scatter_bias, WATCH.scatter_effect])  # spreads, by group
LEAST_RUNS = 2  # with fewer nothing can be learned


def learn_scatter(found: Sequence[Expansion], shared: SharedParameters) -> np.ndarray:
    """1 sigma of a run's deviation, (count,) spreads; what is usual where there is one run only.

    First by group, then of single parameters about their group's: a form that is not the model's shows in few.
    """
    groups, V = shared.groups, np.diag(shared.prior**2)
    if len(found) < LEAST_RUNS:
        return USUAL[groups]

    def cost(shift: np.ndarray) -> float:
        sizes = (USUAL * np.exp(shift))[groups]
        return (
            -pooled.log_evidence(found, V, pooled.Scatter(sizes)) + 0.5 * float(shift @ shift) / WATCH.scatter_width**2
        )

    start = np.vstack([np.zeros(len(USUAL)), np.eye(len(USUAL))])  # e-folds
    options = {"initial_simplex": start, "maxfev": 60, "xatol": 0.1, "fatol": 0.1}
    best = minimize(cost, start[0], method="Nelder-Mead", options=options)
    return pooled.learn_scatter(found, V, pooled.Scatter((USUAL * np.exp(best.x))[groups])).sizes
