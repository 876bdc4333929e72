"""Runs pooled: shared values, deviations of runs, their sizes; evidence in closed form.

With -2 log likelihood of run n expanded to second order, curvature A_n and slope g_n at x_n:

    x_n = s + d_n,  s ~ N(0, V),  d_n ~ N(0, diag(scatter^2))

d_n is integrated out of every run, s of their sum. A variance in scatter^2 has an inverse gamma prior about what is
usual, worth `prior_runs` runs. Values are counted in the spreads of what may differ.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from glider.tools.inference.hyperparameters import HEALTHY

LEAST_VARIANCE = 1e-12  # squared spreads
STARTS = (0.0, 0.03, 0.3)  # spreads, at least: of scatter, from which the most probable is looked for
ITERATIONS, CONVERGED_LOG_VARIANCE = 200, 1e-3  # at most; e-folds of a variance by which a step moves none any more


@dataclass
class Parabola:
    """-2 log likelihood of a run at x: value + 2 slope (x - at) + (x - at) curvature (x - at), in spreads."""

    at: np.ndarray  # (k,)
    value: float
    slope: np.ndarray  # (k,)
    curvature: np.ndarray  # (k, k)

    @property
    def offset(self) -> np.ndarray:
        """Slope at x = 0 of the same parabola."""
        return self.slope - self.curvature @ self.at

    @property
    def constant(self) -> float:
        """Value at x = 0."""
        return self.at_place(np.zeros(len(self.at)))

    def at_place(self, x: np.ndarray) -> float:
        """-2 log likelihood at x (k,)."""
        apart = x - self.at
        return float(self.value + 2.0 * self.slope @ apart + apart @ self.curvature @ apart)

    def tempered(self, inflation: float) -> Any:
        """The same with squared errors that count for less."""
        return replace(
            self, value=self.value / inflation, slope=self.slope / inflation, curvature=self.curvature / inflation
        )


P = TypeVar("P", bound=Parabola)


def marginalised(one: P, scatter: np.ndarray) -> P:
    """A run with its deviation, of 1 sigma `scatter` (k,), integrated out."""
    free = np.flatnonzero(scatter)
    return without(one, np.eye(len(scatter))[:, free] * scatter[free])


def without(one: P, root: np.ndarray) -> P:
    """A run with deviations N(0, root root') integrated out, root (k, m)."""
    A_root, g_root = root.T @ one.curvature, root.T @ one.slope
    inner = np.eye(root.shape[1]) + A_root @ root
    solved = np.linalg.solve(inner, np.column_stack([A_root, g_root]))
    A, g = one.curvature - A_root.T @ solved[:, :-1], one.slope - A_root.T @ solved[:, -1]
    value = one.value - float(g_root @ solved[:, -1]) + float(np.linalg.slogdet(inner)[1])
    return replace(one, value=value, slope=g, curvature=0.5 * (A + A.T))


def run_values(one: Parabola, shared: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Most probable values (k,) of a run whose expansion this is, given the shared ones."""
    free = np.flatnonzero(scatter)
    slope = (one.slope + one.curvature @ (shared - one.at))[free]
    variance, found = scatter[free, None] ** 2, shared.copy()
    inner = np.eye(len(free)) + variance * one.curvature[np.ix_(free, free)]
    found[free] -= np.linalg.solve(inner, variance[:, 0] * slope)
    return found


@dataclass
class Pooled:
    """The sum of marginalised runs, and what it says of values with a prior N(0, V)."""

    H: np.ndarray  # (k, k)
    r: np.ndarray  # (k,) minus half the slope of -2 log likelihood at 0
    constant: float
    V: np.ndarray

    @classmethod
    def of(cls, found: Sequence[Parabola], V: np.ndarray) -> "Pooled":
        return cls(np.sum([one.curvature for one in found], axis=0), -np.sum([one.offset for one in found], axis=0),
                   sum(one.constant for one in found), V)  # fmt: skip

    def parabola(self) -> Parabola:
        """The runs as one, about 0: with deviations from what is shared that they have in common."""
        return Parabola(np.zeros(len(self.r)), self.constant, -self.r, self.H)

    def covariance(self, V: np.ndarray | None = None) -> np.ndarray:
        """Posterior covariance (k, k)."""
        V = self.V if V is None else V
        free, M = np.flatnonzero(np.diag(V) > 0.0), np.zeros(V.shape)  # what is known stays as it is, to the digit
        known, H = V[np.ix_(free, free)], self.H[np.ix_(free, free)]
        M[np.ix_(free, free)] = np.linalg.solve(np.eye(len(free)) + known @ H, known)
        return 0.5 * (M + M.T)

    def mean(self, V: np.ndarray | None = None) -> np.ndarray:
        return self.covariance(V) @ self.r

    def log_evidence(self, V: np.ndarray | None = None) -> float:
        """Log marginal likelihood, values integrated out."""
        V = self.V if V is None else V
        logdet = float(np.linalg.slogdet(np.eye(len(V)) + V @ self.H)[1])
        return -0.5 * (self.constant - float(self.r @ self.covariance(V) @ self.r) + logdet)


def log_evidence(found: Sequence[Parabola], V: np.ndarray, scatter: np.ndarray) -> float:
    """Log probability of runs for deviations of 1 sigma `scatter` (k,), shared values N(0, V) integrated out."""
    return Pooled.of([marginalised(one, scatter) for one in found], V).log_evidence()


def log_prior(
    variance: np.ndarray | float, usual: np.ndarray | float, prior_runs: float = HEALTHY.prior_runs
) -> np.ndarray:
    """Log density of variances about usual ones, both of one shape: inverse gamma, up to a constant.

    prior_runs: runs that say as much as what is usual.
    """
    return -0.5 * prior_runs * np.asarray(np.log(variance) + usual / variance)


def learn_scatter(
    found: Sequence[Parabola], V: np.ndarray, usual: np.ndarray, sessions: Sequence[int] | None = None,
    learned_from: int = 0,
) -> np.ndarray:  # fmt: skip
    """1 sigma (k,) of how runs differ, the most probable about `usual` (k,); where that is 0 it stays 0.

    sessions: counts of successive runs that have N(0, V) in common; without them all have. learned_from: runs, other
    than these, that the usual ones were learned from, beside what the prior is worth. A variance that is far too
    small for a run may be as probable, near by, as one that holds it: of several starts the best is kept.
    """
    free, ends, prior_runs = usual > 0.0, np.cumsum(sessions or [len(found)]), HEALTHY.prior_runs + learned_from
    parts = [found[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True)]

    def log_posterior(sizes: np.ndarray) -> float:
        variance = np.maximum(sizes[free] ** 2, LEAST_VARIANCE)
        prior = log_prior(variance, np.maximum(usual[free] ** 2, LEAST_VARIANCE), prior_runs).sum()
        return sum(log_evidence(part, V, sizes) for part in parts) + float(prior)

    tried = [_nearest(parts, V, usual, prior_runs, np.where(free, np.maximum(usual, least), 0.0)) for least in STARTS]
    return max(tried, key=log_posterior)


def _nearest(
    parts: Sequence[Sequence[Parabola]], V: np.ndarray, usual: np.ndarray, prior_runs: float, start: np.ndarray
) -> np.ndarray:
    """Sizes (k,) led from `start` to the most probable near by: minorisation and maximisation for variances."""
    free, weight = usual > 0.0, 0.5 * prior_runs
    middle, v = np.maximum(usual[free] ** 2, LEAST_VARIANCE), np.where(free, np.maximum(start**2, LEAST_VARIANCE), 0.0)
    for _ in range(ITERATIONS):
        squares, traces = np.zeros(len(v)), np.zeros(len(v))
        for part in parts:
            runs = [marginalised(one, np.sqrt(v)) for one in part]
            pooled = Pooled.of(runs, V)
            M = pooled.covariance()
            x = M @ pooled.r
            for one in runs:
                A = one.curvature
                squares += (one.slope + A @ (x - one.at)) ** 2
                traces[free] += np.maximum(np.diag(A)[free] - ((A[free] @ M) * A[free]).sum(axis=1), 0.0)
        at = v[free]
        v[free] = np.sqrt((0.5 * at**2 * squares[free] + weight * middle) / (0.5 * traces[free] + weight / at))
        if np.abs(np.log(v[free] / at)).max(initial=0.0) < CONVERGED_LOG_VARIANCE:
            break
    return np.sqrt(v)
