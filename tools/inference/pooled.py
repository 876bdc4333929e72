"""Runs pooled: shared values, deviations of runs, their sizes; evidence in closed form.

With -2 log likelihood of run n expanded to second order, curvature A_n and slope g_n at x_n:

    x_n = s + d_n,  s ~ N(0, V),  d_n ~ N(0, (diag(v)^-1 + sum over channels of A_y / effect_y)^-1)

d_n is integrated out of every run, s of their sum. A variance in v has an inverse gamma prior about what is usual,
worth `prior_runs` runs; A_y is the curvature of a run by channel y, so that effect_y holds what all deviations together
do to that channel: numbers that make up for each other may each scatter far. Values are counted in the spreads of what
may differ.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import minimize

from glider.tools.inference.hyperparameters import HEALTHY

LEAST_VARIANCE, MOST_VARIANCE = 1e-12, 1e6  # squared spreads
STARTS = (0.0, 0.03, 0.3)  # spreads, at least: of scatter, from which the most probable is looked for
# effects of deviations all together, over what their sizes alone would do: to begin with, and limits
FIRST_EFFECTS, EFFECT_LIMITS = np.geomspace(1e-4, 1.0, 9), (1e-6, 100.0)
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


@dataclass(frozen=True)
class Scatter:
    """How runs differ: normal deviations of numbers whose size is not 0.

    Numbers that make up for each other may each scatter far and do little together.
    """

    sizes: np.ndarray  # (k,) 1 sigma
    correlation: np.ndarray | None = None  # (k, k); None: numbers scatter by themselves

    @classmethod
    def of(cls, covariance: np.ndarray) -> "Scatter":
        """By its covariance (k, k)."""
        sizes = np.sqrt(np.diag(covariance))
        unit = np.where(sizes > 0.0, sizes, 1.0)
        return cls(sizes, covariance / np.outer(unit, unit))

    @cached_property
    def free(self) -> np.ndarray:
        """Places of numbers that differ."""
        return np.flatnonzero(self.sizes)

    @cached_property
    def _correlation(self) -> np.ndarray:
        """Of numbers that differ, (free, free)."""
        return np.eye(len(self.free)) if self.correlation is None else self.correlation[np.ix_(self.free, self.free)]

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the deviations, (k, k)."""
        found = np.zeros((len(self.sizes), len(self.sizes)))
        found[np.ix_(self.free, self.free)] = self._correlation * np.outer(self.sizes[self.free], self.sizes[self.free])
        return found

    @cached_property
    def root(self) -> np.ndarray:
        """(k, free), root root' the covariance."""
        found = np.zeros((len(self.sizes), len(self.free)))
        found[self.free] = self.sizes[self.free, None] * np.linalg.cholesky(self._correlation)
        return found

    def distance(self, deviations: np.ndarray) -> np.ndarray:
        """-2 log density, up to a constant, of deviations (..., k); others than those of `free` are none."""
        apart = deviations / np.maximum(self.sizes, 1e-6)
        if self.correlation is not None:
            apart = np.linalg.solve(
                np.linalg.cholesky(self._correlation), apart[..., self.free].reshape(-1, len(self.free)).T
            )
            return np.asarray((apart**2).sum(axis=0).reshape(deviations.shape[:-1]))
        return np.asarray((apart**2).sum(axis=-1))

    def half_way(self, other: "Scatter") -> "Scatter":
        """Half of the way, in logarithms of the sizes, to another one."""
        return Scatter(np.sqrt(self.sizes * other.sizes), other.correlation)

    def beside(self, sizes: np.ndarray) -> "Scatter":
        """The same, and after these numbers others of some sizes, by themselves."""
        every, correlation = np.append(self.sizes, sizes), None
        if self.correlation is not None:
            correlation = np.eye(len(every))
            correlation[: len(self.sizes), : len(self.sizes)] = self.correlation
        return Scatter(every, correlation)

    def only(self, kept: np.ndarray) -> "Scatter":
        """Of some of the numbers alone (k,), bool, the others being what they are in all runs."""
        return Scatter(self.sizes[kept], None if self.correlation is None else self.correlation[np.ix_(kept, kept)])


def marginalised(one: P, scatter: Scatter) -> P:
    """A run with its deviation integrated out."""
    return without(one, scatter.root)


def without(one: P, root: np.ndarray) -> P:
    """A run with deviations N(0, root root') integrated out, root (k, m)."""
    A_root, g_root = root.T @ one.curvature, root.T @ one.slope
    inner = np.eye(root.shape[1]) + A_root @ root
    solved = np.linalg.solve(inner, np.column_stack([A_root, g_root]))
    A, g = one.curvature - A_root.T @ solved[:, :-1], one.slope - A_root.T @ solved[:, -1]
    value = one.value - float(g_root @ solved[:, -1]) + float(np.linalg.slogdet(inner)[1])
    return replace(one, value=value, slope=g, curvature=0.5 * (A + A.T))


def run_values(one: Parabola, shared: np.ndarray, scatter: Scatter) -> np.ndarray:
    """Most probable values (k,) of a run whose expansion this is, given the shared ones."""
    root = scatter.root
    inner = np.eye(root.shape[1]) + root.T @ one.curvature @ root
    return shared - root @ np.linalg.solve(inner, root.T @ (one.slope + one.curvature @ (shared - one.at)))


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


def log_evidence(found: Sequence[Parabola], V: np.ndarray, scatter: Scatter) -> float:
    """Log probability of runs, deviations and shared values N(0, V) integrated out."""
    return Pooled.of([marginalised(one, scatter) for one in found], V).log_evidence()


def log_prior(
    variance: np.ndarray | float, usual: np.ndarray | float, prior_runs: float = HEALTHY.prior_runs
) -> np.ndarray:
    """Log density of variances about usual ones, both of one shape: inverse gamma, up to a constant.

    prior_runs: runs that say as much as what is usual.
    """
    return -0.5 * prior_runs * np.asarray(np.log(variance) + usual / variance)


def learn_scatter(
    found: Sequence[Parabola], V: np.ndarray, usual: Scatter, sessions: Sequence[int] | None = None,
    learned_from: int = 0,
) -> Scatter:  # fmt: skip
    """How runs differ, sizes the most probable about the usual ones; where these are 0 they stay 0, correlations are
    the usual ones.

    sessions: counts of successive runs that have N(0, V) in common; without them all have. learned_from: runs, other
    than these, that the usual ones were learned from, beside what the prior is worth. A variance that is far too small
    for a run may be as probable, near by, as one that holds it: of several starts the best is kept.
    """
    runs = _Runs(_parts(found, sessions), V, usual.sizes, HEALTHY.prior_runs + learned_from)
    best = max((runs.near(np.maximum(usual.sizes, least)) for least in STARTS), key=runs.log_posterior)
    return best if usual.correlation is None else runs.with_correlation(replace(usual, sizes=best.sizes))


def learn_scatter_together(
    found: Sequence[Parabola], V: np.ndarray, usual: np.ndarray, A: np.ndarray, sessions: Sequence[int] | None = None,
    least: np.ndarray | float = 0.0,
) -> tuple[Scatter, np.ndarray]:  # fmt: skip
    """How runs differ, as `learn_scatter` has it, and the effects (y,) on channels of all deviations together: at least
    `least` (y,), all equally probable before; inf where numbers by themselves are more probable.

    usual (k,): sizes; A (y, k, k): curvature of a run, the mean, by channel.
    """
    runs = _Runs(_parts(found, sessions), V, usual, HEALTHY.prior_runs)
    alone = learn_scatter(found, V, Scatter(usual), sessions)
    A = np.where(np.outer(usual, usual) > 0.0, A, 0.0)
    of_sizes = np.einsum("k,ykk->y", alone.sizes**2, A)
    seen, every = of_sizes > 0.0, np.full(len(of_sizes), np.inf)
    if np.count_nonzero(usual) < 2 or not seen.any():  # a single number does what its size says
        return alone, every
    (low, high), A, most, least = EFFECT_LIMITS, A[seen], of_sizes[seen], np.broadcast_to(least, of_sizes.shape)[seen]
    tried = [np.maximum(share * most, least) for share in FIRST_EFFECTS]
    begin = max(tried, key=lambda effects: runs.log_likelihood(_together(alone.sizes, A, effects)))
    scores, together, effects = runs.led(alone.sizes, A, begin, np.maximum(least, low * most), high * most)
    if scores <= runs.log_posterior(alone):
        return alone, every
    every[seen] = effects
    return together, every


def _together(sizes: np.ndarray, A: np.ndarray, effects: np.ndarray) -> Scatter:
    """Deviations of which sizes (k,) alone and the effects (y,) on channels of curvature A (y, k, k) are so large."""
    free, found = np.flatnonzero(sizes), np.zeros((len(sizes), len(sizes)))
    s, P = sizes[free], np.einsum("ykl,y->kl", A, 1.0 / effects)[np.ix_(free, free)]
    inner = np.linalg.inv(np.eye(len(free)) + np.outer(s, s) * P)
    found[np.ix_(free, free)] = np.outer(s, s) * 0.5 * (inner + inner.T)
    return Scatter.of(found)


def _parts(found: Sequence[Parabola], sessions: Sequence[int] | None) -> list[Sequence[Parabola]]:
    """Runs of each session, all one where no counts of successive runs are given."""
    ends = np.cumsum(sessions or [len(found)])
    return [found[a:b] for a, b in zip([0, *ends[:-1]], ends, strict=True)]


@dataclass
class _Runs:
    """Runs in sessions, from which it is learned how they differ."""

    parts: list[Sequence[Parabola]]
    V: np.ndarray  # (k, k) prior covariance of what a session shares
    usual: np.ndarray  # (k,) sizes
    prior_runs: float

    def __post_init__(self) -> None:
        self.free = self.usual > 0.0
        self.middle = np.maximum(self.usual[self.free] ** 2, LEAST_VARIANCE)

    def log_likelihood(self, scatter: Scatter) -> float:
        return sum(log_evidence(part, self.V, scatter) for part in self.parts)

    def log_posterior(self, scatter: Scatter) -> float:
        """Up to a constant, sizes' prior in it."""
        variance = np.maximum(scatter.sizes[self.free] ** 2, LEAST_VARIANCE)
        return self.log_likelihood(scatter) + float(log_prior(variance, self.middle, self.prior_runs).sum())

    def slopes(self, scatter: Scatter) -> tuple[float, np.ndarray, np.ndarray]:
        """-2 log likelihood, and its derivative by the deviations' covariance as a difference T - S (free, free)."""
        free, count = self.free, int(self.free.sum())
        value, T, S = 0.0, np.zeros((count, count)), np.zeros((count, count))
        for part in self.parts:
            runs = [marginalised(one, scatter) for one in part]
            pooled = Pooled.of(runs, self.V)
            M = pooled.covariance()
            x, value = M @ pooled.r, value - 2.0 * pooled.log_evidence()
            for one in runs:
                A = one.curvature
                s = (one.slope + A @ (x - one.at))[free]
                T += A[np.ix_(free, free)] - A[free] @ M @ A[:, free]
                S += np.outer(s, s)
        return value, T, S

    def near(self, start: np.ndarray) -> Scatter:
        """Sizes (k,) led from `start` to the most probable near by: minorisation and maximisation for variances."""
        free, weight = self.free, 0.5 * self.prior_runs
        v = np.where(free, np.maximum(start**2, LEAST_VARIANCE), 0.0)
        for _ in range(ITERATIONS):
            _, T, S = self.slopes(Scatter(np.sqrt(v)))
            squares, traces, at = np.diag(S), np.maximum(np.diag(T), 0.0), v[free]
            v[free] = np.sqrt((0.5 * at**2 * squares + weight * self.middle) / (0.5 * traces + weight / at))
            if np.abs(np.log(v[free] / at)).max(initial=0.0) < CONVERGED_LOG_VARIANCE:
                break
        return Scatter(np.sqrt(v))

    def prior(self, logs: np.ndarray) -> tuple[float, np.ndarray]:
        """-2 log prior of logarithms of variances (free,), and its derivatives."""
        ratio = self.middle * np.exp(-logs)
        return self.prior_runs * float((logs + ratio).sum()), self.prior_runs * (1.0 - ratio)

    def with_correlation(self, begin: Scatter) -> Scatter:
        """Sizes, correlations being what they are, led to the most probable near by."""
        free = self.free

        def at(y: np.ndarray) -> Scatter:
            sizes = np.zeros(len(self.usual))
            sizes[free] = np.exp(0.5 * y)
            return replace(begin, sizes=sizes)

        def cost(y: np.ndarray) -> tuple[float, np.ndarray]:
            scatter, (prior, slope) = at(y), self.prior(y)
            value, T, S = self.slopes(scatter)
            return value + prior, np.diag(scatter.covariance[np.ix_(free, free)] @ (T - S)) + slope

        return at(_least(cost, *self._logs(begin.sizes)))

    def led(
        self, sizes: np.ndarray, A: np.ndarray, effects: np.ndarray, least: np.ndarray, most: np.ndarray
    ) -> tuple[float, Scatter, np.ndarray]:
        """Sizes (k,), and effects (y,) by channel of curvature A (y, k, k) from `least` to `most`, led to the most
        probable near by: its log posterior, deviations, effects."""
        free, count = self.free, int(self.free.sum())
        inner = A[:, free][:, :, free]

        def at(y: np.ndarray) -> Scatter:
            there = np.zeros(len(self.usual))
            there[free] = np.exp(0.5 * y[:count])
            return _together(there, A, np.exp(y[count:]))

        def cost(y: np.ndarray) -> tuple[float, np.ndarray]:
            scatter, (prior, slope) = at(y), self.prior(y[:count])
            value, T, S = self.slopes(scatter)
            C = scatter.covariance[np.ix_(free, free)]
            G = C @ (T - S) @ C
            of_effects = np.einsum("kl,ykl->y", G, inner) * np.exp(-y[count:])
            return value + prior, np.append(np.diag(G) * np.exp(-y[:count]) + slope, of_effects)

        start, low, high = self._logs(sizes)
        y = _least(cost, np.append(start, np.log(effects)), np.append(low, np.log(least)),
                   np.append(high, np.log(np.maximum(least, most))))  # fmt: skip
        return -0.5 * cost(y)[0], at(y), np.exp(y[count:])

    def _logs(self, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Logarithms of the variances of sizes (k,) that are free, and their limits."""
        start = np.log(np.maximum(sizes[self.free] ** 2, LEAST_VARIANCE))
        return start, np.full(len(start), np.log(LEAST_VARIANCE)), np.full(len(start), np.log(MOST_VARIANCE))


def _least(
    cost: Callable[[np.ndarray], tuple[float, np.ndarray]], start: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Where a cost with its derivatives is least between limits, led from a start."""
    return np.asarray(minimize(cost, start, jac=True, method="L-BFGS-B", bounds=np.column_stack([low, high])).x)
