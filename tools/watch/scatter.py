"""How much runs differ from each other though nothing changed, learned from the reference.

A run's own values are the shared ones and a deviation, normal with a size for each group of parameters (the vehicle's,
the sensors' biases, effects), in spreads. The sizes are the most probable ones, about what is usual; what a wrong form
of the model leaves in a run shows as such a deviation too. A run's parabola without its deviation is what events are
judged by.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from glider.tools.inference.expansion import Expansion
from glider.tools.inference.shared_parameters import SharedParameters

USUAL = np.array([0.05, 0.3, 0.01])  # spreads, by group
USUAL_WIDTH = 1.0  # e-folds
PRIOR_RUNS = 1.0
STARTS = (0.0, 0.03, 0.3)  # spreads, at least: of single sizes, from which the most probable are looked for
ITERATIONS, CONVERGED_LOG_VARIANCE = 120, 1e-3  # at most; e-folds of a variance by which a step moves none any more
LEAST_VARIANCE = 1e-12  # squared spreads
LEAST_RUNS = 2  # with fewer nothing can be learned
MIN_SCATTER_RUNS = 3  # with fewer it cannot be known what runs differ by


def without_deviation(one: Expansion, sizes: np.ndarray) -> Expansion:
    """The run with its deviation of 1 sigma `sizes` (count,) integrated out."""
    root = sizes[:, None] * one.curvature
    inner = np.eye(len(sizes)) + root * sizes[None, :]
    solved = np.linalg.solve(inner, np.column_stack([root, sizes * one.slope]))
    logdet = float(np.linalg.slogdet(inner)[1])
    A, g = root.T @ solved[:, :-1], root.T @ solved[:, -1]
    value = one.value - float((sizes * one.slope) @ solved[:, -1]) + logdet
    return Expansion(one.at, value, one.slope - g, one.curvature - A, one.nis, one.samples)


def log_marginal(found: Sequence[Expansion], shared: SharedParameters, sizes: np.ndarray) -> float:
    """Log probability of the reference for deviations of 1 sigma `sizes` (count,), the shared values integrated out."""
    H, r, constant = np.diag(shared.prior**-2.0), np.zeros(shared.count), 0.0
    for one in (without_deviation(run, sizes) for run in found):
        H, r, constant = H + one.curvature, r + one.offset, constant + one.constant
    return -0.5 * (constant - float(r @ np.linalg.solve(H, r)) + float(np.linalg.slogdet(H)[1]))


def learn_scatter(found: Sequence[Expansion], shared: SharedParameters) -> np.ndarray:
    """1 sigma of a run's deviation, (count,) spreads; what is usual where there is one run only."""
    groups = shared.groups
    if len(found) < LEAST_RUNS:
        return USUAL[groups]

    def cost(shift: np.ndarray) -> float:
        sizes = (USUAL * np.exp(shift))[groups]
        return -log_marginal(found, shared, sizes) + 0.5 * float(shift @ shift) / USUAL_WIDTH**2

    start = np.vstack([np.zeros(len(USUAL)), np.eye(len(USUAL))])  # e-folds
    options = {"initial_simplex": start, "maxfev": 60, "xatol": 0.1, "fatol": 0.1}
    best = minimize(cost, start[0], method="Nelder-Mead", options=options)
    return each_by_itself(found, shared, (USUAL * np.exp(best.x))[groups])


def each_by_itself(found: Sequence[Expansion], shared: SharedParameters, sizes: np.ndarray) -> np.ndarray:
    """Sizes of single parameters where the reference asks for more than their group has, or less.

    A form that is not the model's shows in few parameters. Each variance has an inverse gamma prior about its group's,
    worth PRIOR_RUNS runs: one that is far too small for a run may be as probable, near by, as one that holds it, so
    several starts are made.
    """
    tried = [mm_iterate(found, shared, sizes, np.maximum(sizes, least)) for least in STARTS]
    return max(tried, key=lambda one: log_marginal(found, shared, one) + log_prior(one, sizes))


def log_prior(sizes: np.ndarray, usual: np.ndarray) -> float:
    """Of single sizes about their groups', both (count,): inverse gamma in the variance."""
    variance = sizes**2
    return -0.5 * PRIOR_RUNS * float((np.log(variance) + np.maximum(usual**2, LEAST_VARIANCE) / variance).sum())


def mm_iterate(
    found: Sequence[Expansion], shared: SharedParameters, usual: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Sizes (count,) led from `start` to the most probable near by: minorisation and maximisation for variances."""
    middle, v, weight = np.maximum(usual**2, LEAST_VARIANCE), np.maximum(start**2, LEAST_VARIANCE), 0.5 * PRIOR_RUNS
    for _ in range(ITERATIONS):
        runs = [without_deviation(one, np.sqrt(v)) for one in found]
        H = np.diag(shared.prior**-2.0) + sum(one.curvature for one in runs)
        x = -np.linalg.solve(H, sum(one.offset for one in runs))
        squares, traces = np.zeros(shared.count), np.zeros(shared.count)
        inverse = np.linalg.inv(H)
        for one in runs:
            A = one.curvature
            squares += (one.slope + A @ (x - one.at)) ** 2
            traces += np.maximum(np.diag(A) - np.einsum("ij,jk,ki->i", A, inverse, A), 0.0)
        before, v = v, np.sqrt((0.5 * v**2 * squares + weight * middle) / (0.5 * traces + weight / v))
        if np.abs(np.log(v / before)).max() < CONVERGED_LOG_VARIANCE:
            break
    return np.sqrt(v)
