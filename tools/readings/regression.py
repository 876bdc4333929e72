"""Least squares on blocks of coloured noise: what stands in a reading for what stands in another.

Readings of a vehicle are held, quantised and filtered, so that neighbouring samples say the same thing several times.
Residuals are therefore taken as exchangeable between blocks of BLOCK seconds only: the covariance is the
cluster-robust sandwich (Liang and Zeger 1986) with the small-sample factor G / (G - 1), quantiles are Student's t with
G - 1 degrees of freedom, G the number of blocks.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from glider.tools.data.intervals import NINETY

BLOCK = 10.0  # s; longer than the autocorrelation of attitude and depth residuals on the flights tried (3 to 6 s)
LEAST_BLOCKS = 5


@dataclass(frozen=True)
class Estimate:
    """A coefficient with its standard error and the degrees of freedom behind it."""

    value: float
    error: float
    freedom: int

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval."""
        half = float(stdtrit(self.freedom, 0.95)) * self.error
        return self.value - half, self.value + half

    def sigma(self, null: float = 0.0) -> float:
        """Distance from `null` in standard errors, made comparable over degrees of freedom by their quantiles."""
        return abs(self.value - null) / max(self.error, 1e-300) * NINETY / float(stdtrit(self.freedom, 0.95))

    def scaled(self, factor: float) -> "Estimate":
        """The estimate in another unit."""
        return Estimate(self.value * factor, self.error * abs(factor), self.freedom)


@dataclass(frozen=True)
class Fit:
    """A least-squares fit: coefficients (k,), their covariance (k, k), residuals (rows,)."""

    coefficients: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    blocks: int

    def __getitem__(self, index: int) -> Estimate:
        error = float(np.sqrt(max(self.covariance[index, index], 0.0)))
        return Estimate(float(self.coefficients[index]), error, self.blocks - 1)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residual**2)))


def blocks_of(t: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Block of every row, (rows,): run and BLOCK seconds together; t in s from the run's start."""
    return run * 1_000_000 + np.floor(t / BLOCK).astype(np.int64)


def within(values: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Values (rows,) or (rows, k) less their mean over each block."""
    if not len(values):
        return values
    _, at = np.unique(block, return_inverse=True)
    count = np.bincount(at).astype(float)
    columns = values.reshape(len(values), -1)
    means = np.column_stack([np.bincount(at, column) / count for column in columns.T])
    return (columns - means[at]).reshape(values.shape)


def fit(y: np.ndarray, X: np.ndarray, block: np.ndarray) -> Fit | None:
    """y (rows,) on X (rows, k); rows with a missing value are left out. None where there is not enough to say."""
    used = np.isfinite(y) & np.isfinite(X).all(axis=1)
    y, X = y[used], X[used]
    labels, at = np.unique(block[used], return_inverse=True)
    if len(labels) < LEAST_BLOCKS or len(y) < 3 * X.shape[1] + 10:
        return None
    scale = np.sqrt((X**2).mean(axis=0))
    if (scale <= 1e-12).any():
        return None
    Z = X / scale
    normal = Z.T @ Z
    if np.linalg.cond(normal) > 1e10:
        return None
    inverse = np.linalg.inv(normal)
    solved = inverse @ (Z.T @ y)
    residual = y - Z @ solved
    scores = np.zeros((len(labels), X.shape[1]))
    np.add.at(scores, at, Z * residual[:, None])
    factor = len(labels) / (len(labels) - 1)
    covariance = factor * inverse @ (scores.T @ scores) @ inverse
    return Fit(solved / scale, covariance / np.outer(scale, scale), residual, len(labels))
