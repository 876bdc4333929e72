"""Sufficient statistics of a linearised likelihood: what the sampler needs of the recordings, and no more."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

LEVEL_WIDTH = 0.5  # prior 1 sigma of the logarithm of what is left of a noise level


@dataclass
class Quadratic:
    """Log posterior of d = values - at and of noise levels, by groups of samples (core/metropolis has the formula).

    A (G, n, n), b (G, n), c (G,), count (G,): of the likelihood; the prior is |at + d|^2 / 2, and d >= low - at.
    `inflation` is by what the likelihood's logarithm was divided, because errors along a run are correlated.
    """

    at: np.ndarray
    low: np.ndarray
    A: np.ndarray
    b: np.ndarray
    c: np.ndarray
    count: np.ndarray
    groups: tuple[str, ...]
    inflation: float = 1.0

    @property
    def normal(self) -> np.ndarray:
        """Of likelihood and prior at noise levels of 1, (n, n)."""
        return self.A.sum(axis=0) + np.eye(len(self.at))

    @property
    def slope(self) -> np.ndarray:
        """Of misfit / 2 at d = 0, (n,)."""
        return self.b.sum(axis=0) + self.at

    @property
    def covariance(self) -> np.ndarray:
        return np.linalg.inv(self.normal)

    @property
    def mode(self) -> np.ndarray:
        """Most probable values at noise levels of 1, without limits."""
        return self.at - np.linalg.solve(self.normal, self.slope)

    def tempered(self, inflation: float) -> "Quadratic":
        """The same with the likelihood's logarithm divided by `inflation`."""
        return Quadratic(
            self.at, self.low, self.A / inflation, self.b / inflation, self.c / inflation, self.count / inflation,
            self.groups, self.inflation * inflation,
        )  # fmt: skip

    def centred(self) -> "Quadratic":
        """The same with its mode at `at` itself: Laplace's approximation about the best values that were found."""
        b = np.zeros_like(self.b)
        b[0] = -self.at
        return Quadratic(self.at, self.low, self.A, b, self.c, self.count, self.groups, self.inflation)

    def misfit(self, values: np.ndarray) -> np.ndarray:
        """The likelihood's part of -2 log posterior at values (k, n), noise levels of 1: (k,)."""
        d = values - self.at
        return self.c.sum() + 2.0 * d @ self.b.sum(axis=0) + np.einsum("ki,ij,kj->k", d, self.A.sum(axis=0), d)


def collect(
    values: np.ndarray, low: np.ndarray, e: np.ndarray, J: np.ndarray, group: np.ndarray, names: tuple[str, ...]
) -> Quadratic:
    """Statistics of residuals e (samples,) with columns J (n, samples); `group` (samples,): each one's noise group."""
    order = np.argsort(group, kind="stable")
    edges = np.searchsorted(group[order], np.arange(len(names) + 1))
    kept = [g for g in range(len(names)) if edges[g] < edges[g + 1]]
    A, b, c = [], [], []
    for g in kept:
        part = order[edges[g] : edges[g + 1]]
        columns, rest = np.take(J, part, axis=1), e[part]
        A.append(columns @ columns.T)
        b.append(columns @ rest)
        c.append(float(rest @ rest))
    count = np.diff(edges)[kept].astype(np.float64)
    return Quadratic(values, low, np.array(A), np.array(b), np.array(c), count, tuple(names[g] for g in kept))


def inflation(e: np.ndarray, J: np.ndarray, block: np.ndarray) -> float:
    """How much more the likelihood's slope varies from block to block of the recordings than independent errors would.

    1 for white residuals of unit variance. `block` (samples,) numbers stretches of runs. In coordinates in which the
    normal matrix is the identity, the mean square of the blocks' slopes over what their own normal matrices predict
    once the parameters are fitted to these same residuals: the block bootstrap's variance of the estimate, averaged
    over all directions. Samples of a block stand together.
    """
    count = int(block.max()) + 1
    slopes = np.array([np.bincount(block, row * e, count) for row in J])  # (n, blocks)
    values, vectors = np.linalg.eigh(J @ J.T)
    known = values > 1e-6 * values[-1]
    W = (vectors[:, known] / np.sqrt(values[known])).T
    edges = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [len(block)]])
    fitted = 0.0  # sum of tr(S S) over the blocks' shares S of the normal matrix
    for first, last in pairwise(edges):
        share = W @ (J[:, first:last] @ J[:, first:last].T) @ W.T
        fitted += float(np.square(share).sum())
    return float(np.square(W @ slopes).sum() / max(known.sum() - fitted, 0.1 * known.sum()))
