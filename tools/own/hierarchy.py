"""One model of all runs: shared values, deviations of sessions and runs, sizes of effects; evidence in closed form.

With e_n + J_n (x - at_n) the errors of windows of run n flown open loop, in units of what healthy runs leave of their
channel, A_n = J_n J_n' / eta, g_n = J_n e_n / eta:

    x_n = s + d_n + c,  s ~ N(0, V),  d_n ~ N(0, diag(scatter^2)),  c_l ~ N(0, tau_l^2)

d_n is integrated out of every run, s and c of their sum. eta, the variance inflation, is what errors within
a window have in common. All values are counted in the effects' spreads.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.own.effects import NOISE, Effect, moved
from glider.tools.own.observer import Observer

STEP, LONG_STEP, SHORTENED = 0.1, 3.0, 0.5  # spreads; rms errors that a step may move, and to what it is shortened
PARTS = 1, 4  # of a window, in each of which errors may be the same
UNSEEN_STEP = 1.0  # spreads: step of an effect that begins at a kink
SCATTER_PRIOR_RUNS, LEAST_VARIANCE = 1.0, 1e-12
ITERATIONS, CONVERGED = 200, 1e-3


@dataclass
class Expansion:
    """-2 log likelihood of a run at x: value + 2 slope (x - at) + (x - at) curvature (x - at)."""

    at: np.ndarray  # (k,)
    value: float
    slope: np.ndarray  # (k,)
    curvature: np.ndarray  # (k, k)
    squares: np.ndarray  # (y,) by channel
    samples: np.ndarray  # (y,)
    blocks: np.ndarray  # (PARTS, y + 1, k) sums over parts of windows of (J e)^2, by channel, and of all together
    diagonal: np.ndarray  # (y + 1, k) what they would be, were errors independent
    reach: np.ndarray  # (k,) mean square that a spread moves the channels, tolerances
    derivatives: np.ndarray | None = None  # (k, rows, y) of the errors in tolerances, where they are kept

    def tempered(self, eta: float) -> "Expansion":
        return replace(self, value=self.value / eta, slope=self.slope / eta, curvature=self.curvature / eta)

    @property
    def offset(self) -> np.ndarray:
        """Slope of the same parabola at x = 0."""
        return self.slope - self.curvature @ self.at

    @property
    def constant(self) -> float:
        """Value of the same parabola at x = 0."""
        return float(self.value - 2.0 * self.slope @ self.at + self.at @ self.curvature @ self.at)


@dataclass(frozen=True)
class ChannelErrors:
    """What healthy runs leave of each channel: rms in tolerances, and how far successive errors are the same."""

    scales: np.ndarray  # (y,)
    inflation: np.ndarray  # (y,)

    @property
    def weight(self) -> np.ndarray:
        """Variance (y,) in squared tolerances that an error counts against."""
        return self.scales**2 * self.inflation


def expand(
    observer: Observer, n: int, effects: Sequence[Effect], at: np.ndarray, healthy: ChannelErrors, horizon: float,
    keep: bool = False,
) -> Expansion:  # fmt: skip
    """Run n about the model at `at` (effects,) spreads: windows' errors in units of what healthy runs leave.

    keep: the derivatives stay with it.
    """
    base, declared, scales = observer.point, observer.declared, healthy.scales
    by = observer.filter(n, moved(declared, base, effects, at))
    begins = np.array([one.one_sided and abs(x) < STEP for one, x in zip(effects, at, strict=True)], dtype=bool)
    steps = np.where(begins, UNSEEN_STEP, STEP)
    steps = np.where(at + steps > [one.high for one in effects], -steps, steps)

    def errors(places: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        points = []
        for k, size in zip(places, sizes, strict=True):
            there = at.copy()
            if k >= 0:
                there[k] += size
            points.append(moved(declared, base, effects, there))
        return observer.residuals(n, points, by, horizon) / scales

    moving = np.array([k for k, one in enumerate(effects) if one.family != NOISE], dtype=int)
    E = errors(np.append(-1, moving), np.append(0.0, steps[moving]))
    shape = E[0].shape
    E = E.reshape(len(E), -1)
    e, J = E[0], np.zeros((len(effects), E.shape[1]))
    J[moving] = (E[1:] - E[0]) / steps[moving, None]
    size = np.sqrt((J**2).mean(axis=1)) * np.abs(steps)
    far = np.flatnonzero((size > LONG_STEP) & ~begins)
    if len(far):
        shorter = steps[far] * SHORTENED / size[far]
        J[far] = (errors(far, shorter).reshape(len(far), -1) - e) / shorter[:, None]
    J[~np.isfinite(J).all(axis=1)] = 0.0
    seen = np.isfinite(observer.runs[n].outputs).any(axis=0)
    J, e = J.reshape(len(effects), *shape), e.reshape(shape)
    weight = 1.0 / healthy.inflation
    weighted = (J * weight).reshape(len(effects), e.size)
    flat = J.reshape(len(effects), e.size)
    score = J * (weight * e)  # (k, rows, y)
    starts, ends = observer.windows(n, horizon)
    rows = ends - starts - 1
    first = np.cumsum(rows) - rows
    blocks = []
    for parts in PARTS:
        cuts = np.unique((first[:, None] + rows[:, None] * np.arange(parts) // parts).ravel())
        sums = np.add.reduceat(score, cuts, axis=1)  # (k, blocks, y)
        blocks.append(np.concatenate([(sums**2).sum(axis=1).T, (sums.sum(axis=2) ** 2).sum(axis=1)[None]]))
    diagonal = np.concatenate([(score**2).sum(axis=1).T, (score * J * e).sum(axis=(1, 2))[None]])
    return Expansion(
        at.copy(), float((weight * e * e).sum()), weighted @ e.ravel(), weighted @ flat.T, (e**2).sum(axis=0),
        np.where(seen, shape[0], 0), np.array(blocks), diagonal, ((J * scales) ** 2).mean(axis=1)[:, seen].mean(axis=1),
        J * scales if keep else None,
    )  # fmt: skip


def inflation(found: Sequence[Expansion]) -> np.ndarray:
    """Variance inflation (y + 1,) by channel, and of all together beside it: what channels have in common.

    What scores of windows or of parts of them vary by, whichever is more, over what independent errors' would: values
    of a run's own bring the score of a whole window to nothing.
    """
    blocks = np.sum([one.blocks for one in found], axis=0)
    diagonal = np.sum([one.diagonal for one in found], axis=0)
    out = np.ones(len(diagonal))
    for row in range(len(out)):
        seen = diagonal[row] > 1e-9 * max(float(diagonal[row].max(initial=0.0)), 1e-300)
        if seen.any():
            out[row] = max(1.0, float(np.median(blocks[:, row, seen] / diagonal[row, seen], axis=1).max()))
    return out


def marginalised(one: Expansion, scatter: np.ndarray) -> Expansion:
    """A run with its deviation, of 1 sigma `scatter` (k,), integrated out."""
    root = scatter[:, None] * one.curvature
    inner = np.eye(len(scatter)) + root * scatter[None, :]
    solved = np.linalg.solve(inner, np.column_stack([root, scatter * one.slope]))
    A, g = one.curvature - root.T @ solved[:, :-1], one.slope - root.T @ solved[:, -1]
    value = one.value - float((scatter * one.slope) @ solved[:, -1]) + float(np.linalg.slogdet(inner)[1])
    return replace(one, value=value, slope=g, curvature=0.5 * (A + A.T))


@dataclass
class Pooled:
    """The sum of marginalised runs, and what it says of values with a prior N(0, V)."""

    H: np.ndarray  # (k, k)
    r: np.ndarray  # (k,) minus half the slope of -2 log likelihood at 0
    constant: float
    V: np.ndarray

    @classmethod
    def of(cls, found: Sequence[Expansion], V: np.ndarray) -> "Pooled":
        return cls(np.sum([one.curvature for one in found], axis=0), -np.sum([one.offset for one in found], axis=0),
                   sum(one.constant for one in found), V)  # fmt: skip

    def covariance(self, V: np.ndarray | None = None) -> np.ndarray:
        """Posterior covariance (k, k)."""
        V = self.V if V is None else V
        M = np.linalg.solve(np.eye(len(V)) + V @ self.H, V)
        return 0.5 * (M + M.T)

    def mean(self, V: np.ndarray | None = None) -> np.ndarray:
        return self.covariance(V) @ self.r

    def log_evidence(self, V: np.ndarray | None = None) -> float:
        """Log marginal likelihood, values integrated out."""
        V = self.V if V is None else V
        logdet = float(np.linalg.slogdet(np.eye(len(V)) + V @ self.H)[1])
        return -0.5 * (self.constant - float(self.r @ self.covariance(V) @ self.r) + logdet)


def learn_scatter(found: Sequence[Expansion], V: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """1 sigma (k,) of how runs differ, most probable with an inverse gamma prior about `usual` (k,) squared; 0 stays 0.

    Minorisation and maximisation of the marginal likelihood, from a small and a large start; the better is kept.
    """
    free = usual > 0.0

    def cost(sizes: np.ndarray) -> float:
        pooled = Pooled.of([marginalised(one, sizes) for one in found], V)
        variance, middle = np.maximum(sizes[free] ** 2, LEAST_VARIANCE), usual[free] ** 2
        prior = 0.5 * SCATTER_PRIOR_RUNS * float((np.log(variance) + middle / variance).sum())
        return prior - pooled.log_evidence()

    tried = [_mm(found, V, usual, np.where(free, np.maximum(usual, least), 0.0)) for least in (0.0, 0.3)]
    return min(tried, key=cost)


def _mm(found: Sequence[Expansion], V: np.ndarray, usual: np.ndarray, start: np.ndarray) -> np.ndarray:
    middle, v, free = usual**2, start**2, usual > 0.0
    weight = 0.5 * SCATTER_PRIOR_RUNS
    for _ in range(ITERATIONS):
        runs = [marginalised(one, np.sqrt(v)) for one in found]
        pooled = Pooled.of(runs, V)
        M = pooled.covariance()
        x = M @ pooled.r
        squares, traces = np.zeros(len(v)), np.zeros(len(v))
        for one in runs:
            A = one.curvature
            squares += (one.slope + A @ (x - one.at)) ** 2
            traces += np.maximum(np.diag(A) - np.einsum("ij,jk,ki->i", A, M, A), 0.0)
        before, v = v, v.copy()
        at = before[free]
        v[free] = np.sqrt((0.5 * at**2 * squares[free] + weight * middle[free]) / (0.5 * traces[free] + weight / at))
        if np.abs(np.log(v[free] / at)).max(initial=0.0) < CONVERGED:
            break
    return np.sqrt(v)


def run_values(one: Expansion, shared: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Most probable values (k,) of a run whose expansion this is, given the shared ones."""
    own = np.diag(scatter**2)
    slope = one.slope + one.curvature @ (shared - one.at)
    return shared - np.linalg.solve(np.eye(len(own)) + own @ one.curvature, own @ slope)
