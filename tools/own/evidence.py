"""Evidence of sizes, by parabolas of the likelihood: labels alone, and under priors of several sigmas."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.data.intervals import NINETY
from glider.tools.inference.pooled import Pooled
from glider.tools.own.decision import SIZES, Deviations
from glider.tools.own.effects import Effect
from glider.tools.own.hierarchy import Expansion


@dataclass(frozen=True)
class Place:
    """Where runs are expanded: values that they share (k,), their own (runs, k), and what they have there."""

    shared: np.ndarray
    own: np.ndarray
    found: list[Expansion]

    def cost(self, by: Deviations, places: Sequence[int]) -> float:
        """-2 log posterior, sizes of labels at some places left free."""
        return sum(one.value for one in self.found) + by.prior(self.shared, self.own, places)


def interval(effect: Effect, size: float, sd: float) -> list[float]:
    """90 % of a size (spreads) within what the effect can be, in the effect's unit."""
    ends = np.clip((size - NINETY * sd, size + NINETY * sd), effect.low, effect.high)
    return [float(end * effect.spread) for end in ends]


def alone(pooled: Pooled) -> tuple[np.ndarray, np.ndarray]:
    """Slope and precision (k,) of the size of each label in all runs, what they share integrated out."""
    M = pooled.covariance()
    return pooled.r - pooled.H @ (M @ pooled.r), np.maximum(np.diag(pooled.H - pooled.H @ M @ pooled.H), 0.0)


def under_priors(slope: np.ndarray, precision: np.ndarray, variances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log evidence (priors,) that sizes N(0, diag(d)) bring, (q' S q - log det(1 + d Q)) / 2, and their covariances
    S = (d^-1 + Q)^-1 (priors, v, v); q slope (v,), Q precision (v, v), d variances (priors, v)."""
    inner = np.eye(len(slope)) + variances[:, :, None] * precision
    S = np.linalg.solve(inner, variances[:, :, None] * np.eye(len(slope)))
    return 0.5 * (np.einsum("a,nab,b->n", slope, S, slope) - np.linalg.slogdet(inner)[1]), S


def size_evidence(slope, precision, reach, one_sided) -> np.ndarray:
    """Log evidence of a label's size over none, from its slope and precision with all else integrated out.

    All may be arrays of one shape.
    """
    slope, precision, reach, one_sided = (np.asarray(one)[..., None] for one in (slope, precision, reach, one_sided))
    tau2 = (SIZES / reach) ** 2
    total = 1.0 + tau2 * np.maximum(precision, 0.0)
    gain = 0.5 * (slope**2 * tau2 / total - np.log(total))
    halved = np.log(2.0) + norm.logcdf(slope * np.sqrt(tau2 / total))
    return logsumexp(gain + np.where(one_sided, halved, 0.0), axis=-1) - np.log(len(SIZES))


def size_posterior(
    slope: np.ndarray, precision: np.ndarray, variances: np.ndarray, one_sided: bool
) -> tuple[float, float, float]:
    """Log evidence of a label's size over none, its mean and 1 sigma, of the most probable of its priors.

    slope (v,), precision (v, v) of the label and what may stand beside it; variances (priors, v), equally probable.
    """
    nat, S = under_priors(slope, precision, variances)
    mean, sd = S[:, 0] @ slope, np.sqrt(np.maximum(S[:, 0, 0], 1e-30))
    if one_sided:
        nat = nat + np.log(2.0) + norm.logcdf(mean / sd)
    best = int(np.argmax(nat))
    return float(logsumexp(nat) - np.log(len(nat))), float(mean[best]), float(sd[best])
