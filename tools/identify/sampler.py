"""Chains of the posterior and what they say: means, intervals, rank-R-hat and effective sample sizes by ArviZ."""

import time
from dataclasses import dataclass

import numpy as np

from glider.tools.identify.core.metropolis import log_densities, walk_chains
from glider.tools.identify.statistics import LEVEL_WIDTH, Quadratic

CHAINS, WARMUP_DRAWS, DRAWS, THIN = 4, 1000, 2500, 4
START_SIGMA = 2.0  # posterior sigma about the mode from which chains start


@dataclass
class Chains:
    """Draws (chains, draws, n) in units of the priors, logarithms of the noise groups' levels (chains, draws, G)."""

    values: np.ndarray
    levels: np.ndarray
    groups: tuple[str, ...]
    acceptance: np.ndarray  # (chains,)
    seconds: float  # of the walk, warm-up and all
    seed: int

    @property
    def flat(self) -> np.ndarray:
        return self.values.reshape(-1, self.values.shape[-1])


@dataclass
class Whitened:
    """A posterior in coordinates y in which it is about a unit normal: values = mode + root y."""

    mode: np.ndarray
    root: np.ndarray  # (n, n)
    terms: tuple[np.ndarray, ...]  # A0, b0, A, b, c, count
    width: float
    bounds: np.ndarray  # (M, n)
    base: np.ndarray  # (M,)

    @property
    def arguments(self) -> tuple:
        """What the kernels of core/metropolis take behind the point."""
        return (*self.terms, self.width, self.bounds, self.base)

    def log_densities(self, points: np.ndarray) -> np.ndarray:
        """Log posterior at points (N, n + G): whitened parameters and levels."""
        out = np.empty(len(points))
        log_densities(np.ascontiguousarray(points), *self.arguments, out)
        return out


def whiten(quadratic: Quadratic) -> Whitened:
    """The posterior in coordinates of the Cholesky factor of its normal matrix, centred at its mode."""
    mode = np.maximum(quadratic.mode, quadratic.low)
    root = np.linalg.inv(np.linalg.cholesky(quadratic.normal)).T  # root' normal root = 1
    d = mode - quadratic.at
    slope = quadratic.b + quadratic.A @ d
    square = quadratic.c + 2.0 * quadratic.b @ d + np.einsum("i,gij,j->g", d, quadratic.A, d)
    limited = np.isfinite(quadratic.low)
    terms = (
        root.T @ root, root.T @ mode,
        np.ascontiguousarray(root.T @ quadratic.A @ root), np.ascontiguousarray(slope @ root), square, quadratic.count,
    )  # fmt: skip
    return Whitened(
        mode, root, terms, LEVEL_WIDTH, np.ascontiguousarray(root[limited]), (mode - quadratic.low)[limited]
    )


def sample(
    quadratic: Quadratic,
    seed: int,
    chains: int = CHAINS,
    warm: int = WARMUP_DRAWS,
    draws: int = DRAWS,
    thin: int = THIN,
) -> Chains:
    """Metropolis-Hastings chains, one after the other of the seeds; the same draws for the same seed, bit for bit."""
    white = whiten(quadratic)
    n, groups = len(quadratic.at), len(quadratic.groups)
    rng = np.random.default_rng(seed)
    starts = np.zeros((chains, n + groups))
    starts[:, :n] = START_SIGMA * rng.standard_normal((chains, n))
    for start in starts:  # back towards the mode until within the limits
        while np.any(white.bounds @ start[:n] + white.base < 0.0):
            start[:n] *= 0.5
            if np.abs(start[:n]).max() < 1e-3:
                start[:n] = 0.0
                break
    seeds = rng.integers(0, 2**63, chains, dtype=np.uint64)
    out, accepted = np.empty((chains, draws, n + groups)), np.empty(chains)
    before = time.perf_counter()
    walk_chains(seeds, starts, *white.arguments, warm, thin, out, accepted)
    seconds = time.perf_counter() - before
    values = white.mode + out[:, :, :n] @ white.root.T
    return Chains(values, out[:, :, n:], quadratic.groups, accepted, seconds, seed)


@dataclass(frozen=True)
class Summary:
    """One parameter's marginal."""

    name: str
    unit: str
    mean: float
    sd: float
    ci90: tuple[float, float]
    rhat: float
    ess: float  # bulk

    def plain(self) -> dict:
        return {
            "name": self.name, "unit": self.unit, "mean": self.mean, "sd": self.sd, "ci90": list(self.ci90),
            "rhat": self.rhat, "ess": self.ess,
        }  # fmt: skip


def summarise(names: list[str], units: list[str], draws: np.ndarray) -> list[Summary]:
    """Marginals of draws (chains, draws, n), SI."""
    import arviz

    found = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        x = draws[:, :, i]
        low, high = np.quantile(x, [0.05, 0.95])
        rhat, ess = float(arviz.rhat(x, method="rank")), float(arviz.ess(x, method="bulk"))
        found.append(Summary(name, unit, float(x.mean()), float(x.std(ddof=1)), (float(low), float(high)), rhat, ess))
    return found
