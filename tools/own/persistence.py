"""How far the errors of a channel are the same in all windows of a run.

Errors that go with how a run was flown, or with the day, repeat from window to window: of such a channel a run with ten
windows says no more than one with one. A blimp's track drifts its own way in every flight, its pitch is what the place
of the mass makes it. Therefore every channel has a variance inflation of its own, beside what errors within a window
have in common (`hierarchy.inflation`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glider.tools.inference.pooled import Parabola, Pooled, Scatter, marginalised, run_values
from glider.tools.own.effects import Effect, moved
from glider.tools.own.hierarchy import ChannelErrors, Expansion
from glider.tools.own.observer import Observer

PERSISTENCE_ROUNDS = 10  # each goes half the way, in logarithms


@dataclass(frozen=True)
class ChannelScores:
    """A run's likelihood about its values, channel by channel."""

    at: np.ndarray  # (k,)
    slope: np.ndarray  # (y, k)
    curvature: np.ndarray  # (y, k, k)

    def tempered(self, inflation: float) -> "ChannelScores":
        return ChannelScores(self.at, self.slope / inflation, self.curvature / inflation)

    def pooled(self, inflation: np.ndarray) -> Parabola:
        """All channels, each with its variance inflation (y,)."""
        return Parabola(self.at, 0.0, (self.slope / inflation[:, None]).sum(axis=0),
                        (self.curvature / inflation[:, None, None]).sum(axis=0))  # fmt: skip


def channel_scores(
    observer: Observer, n: int, effects: Sequence[Effect], one: Expansion, errors: ChannelErrors
) -> ChannelScores:
    """Run n by its expansion in the effects' values, which has kept its derivatives."""
    assert one.derivatives is not None
    assert one.filtered is not None
    point = moved(observer.declared, observer.point, effects, one.at)
    e = errors.independent(n, observer.residuals(n, [point], one.filtered, observer.horizon)[0])
    J = np.moveaxis(one.derivatives, 2, 0)  # (y, k, rows)
    slope = np.einsum("ykr,ry->yk", J, e) / errors.inflation[:, None]
    return ChannelScores(one.at, slope, J @ J.transpose(0, 2, 1) / errors.inflation[:, None, None])


def persistence(runs: Sequence[ChannelScores], V: np.ndarray, scatter: Scatter, of: np.ndarray) -> np.ndarray:
    """Variance inflation (y,) of what runs say channel by channel, at least 1: variance of their scores over what
    independent errors would have, median over some values.

    Scores are taken at each run's most probable deviations from what all runs share (prior V: k, k). With H_y the
    curvature of a channel and M the covariance of the deviations, independent errors' would have the variance
    H_y - H_y M H_y; of (k,), bool: the values that count.
    """
    found = np.ones(len(runs[0].slope))
    for _ in range(PERSISTENCE_ROUNDS):
        whole = [one.pooled(found) for one in runs]
        shared = Pooled.of([marginalised(one, scatter) for one in whole], V).mean()
        seen, expected = np.zeros((len(found), len(V))), np.zeros((len(found), len(V)))
        for one, all_channels in zip(runs, whole, strict=True):
            own = run_values(all_channels, shared, scatter)
            inner = np.eye(len(V)) + scatter.covariance @ all_channels.curvature
            M = np.linalg.solve(inner, scatter.covariance)  # of its deviation
            seen += (one.slope + one.curvature @ (own - one.at)) ** 2 / found[:, None]
            H = one.curvature
            expected += np.diagonal(H, axis1=1, axis2=2) - np.einsum("yki,ij,yjk->yk", H, M, H) / found[:, None]
        ratio = seen[:, of] / np.maximum(expected[:, of], 1e-12)
        found = np.maximum(1.0, found * np.sqrt(np.median(ratio, axis=1)))
    return found
