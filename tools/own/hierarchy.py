"""Runs of a user's model expanded about its values, to be pooled (tools/inference/pooled.py).

With e_n + J_n (x - at_n) the errors of windows of run n flown open loop, made independent as healthy runs' are
(error_components.py), A_n = J_n J_n' / eta, g_n = J_n e_n / eta. eta, the variance inflation, is what errors within a
window have in common all the same. Sizes of effects, c_l ~ N(0, tau_l^2), stand beside the shared values. All values
are counted in spreads.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glider.tools.inference.pooled import Parabola
from glider.tools.own.declare import Declaration
from glider.tools.own.driven import driven_inputs
from glider.tools.own.effects import FORM, NOISE, PUSH, Effect, moved
from glider.tools.own.near import errors_near
from glider.tools.own.observer import NO_LINEAR, Filtered, Observer
from glider.tools.own.operating_points import point_weights

STEP, LONG_STEP, SHORTENED = 0.1, 3.0, 0.5  # spreads; rms errors that a step may move, and to what it is shortened
PARTS = 1, 4  # of a window, in each of which errors may be the same
LEVEL_ROUNDS, LEVEL_AT_REST = 30, 1e-9  # of Newton's method for log r
UNSEEN_STEP = 1.0  # spreads: step of an effect that begins at a kink
LEAST_REACH = 1e-4  # tolerances a spread: less is not seen
NO_SCORES = np.zeros(0)
LONGEST_MOVE, LONGEST_REACH = 4.0, 4.0  # spreads of a number a round; tolerances, where these are more


@dataclass
class Expansion(Parabola):
    """A run's windows about x, and what tells how far their errors have something in common."""

    squares: np.ndarray  # (y,) by channel, of the independent errors
    samples: np.ndarray  # (y,)
    gap_squares: np.ndarray  # (y,) of the errors themselves, tolerances
    blocks: np.ndarray  # (PARTS, y + 1, k) sums over parts of windows of (J e)^2, by channel, and of all together
    diagonal: np.ndarray  # (y + 1, k) what they would be, were errors independent; both empty where not asked for
    reach: np.ndarray  # (k,) mean square that a spread moves the channels, tolerances
    by_channel: np.ndarray  # (y, k, k) curvature by channel, untempered; empty where scores are not asked for
    derivatives: np.ndarray | None = None  # (k, rows, y) of the independent errors, where they are kept
    filtered: Filtered | None = None  # the run's filter there, where it is kept

    def only(self, columns: np.ndarray) -> "Expansion":
        """The same in some columns; the others' rows are 0."""
        slope, curvature = np.zeros_like(self.slope), np.zeros_like(self.curvature)
        slope[columns], block = self.slope[columns], np.ix_(columns, columns)
        curvature[block] = self.curvature[block]
        return replace(self, slope=slope, curvature=curvature)

    def weighted(self, share: float) -> "Expansion":
        """The same with its squared errors counted by a share."""
        return replace(self, value=share * self.value, slope=share * self.slope, curvature=share * self.curvature,
                       squares=share * self.squares, gap_squares=share * self.gap_squares,
                       blocks=share**2 * self.blocks, diagonal=share**2 * self.diagonal)  # fmt: skip


@dataclass(frozen=True)
class ChannelErrors:
    """What healthy runs leave of each channel: rms in tolerances, and how far successive errors are the same."""

    scales: np.ndarray  # (y,)
    inflation: np.ndarray  # (y,)
    whitenings: Sequence[Callable[[np.ndarray], np.ndarray]] = ()  # by run; none: errors are thought independent
    # by run: times as large as `scales` all of its errors are; none: as large
    levels: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def level(self, n: int) -> float:
        """By how much all errors of run n are larger."""
        return float(self.levels[n]) if len(self.levels) else 1.0

    def independent(self, n: int, errors: np.ndarray) -> np.ndarray:
        """Errors (..., rows, y) of run n, in tolerances, independent and of variance 1 as far as is known."""
        return (self.whitenings[n](errors) if self.whitenings else errors / self.scales) / self.level(n)

    def misfit(self, n: int, errors: np.ndarray) -> np.ndarray:
        """Sum of squares (...) that errors (..., rows, y) of run n, in tolerances, count."""
        return (self.independent(n, errors) ** 2 / self.inflation).sum(axis=(-2, -1))


def expand(
    observer: Observer, n: int, effects: Sequence[Effect], at: np.ndarray, healthy: ChannelErrors, horizon: float,
    keep: bool = False, keep_filter: bool = False, scores: bool = True,
) -> Expansion:  # fmt: skip
    """Run n about the model at `at` (effects,) spreads: windows' errors made independent.

    keep: the derivatives and the filter stay with it; keep_filter: the filter alone; scores: what `inflation` asks for.
    """
    base, declared = observer.point, observer.declared
    here = moved(declared, base, effects, at)
    by = observer.filter(n, here, linear=True)
    held = multiples_of_pushes(declared, effects, driven_inputs(observer.runs[n], declared, here))
    begins = np.array([one.one_sided and abs(x) < STEP for one, x in zip(effects, at, strict=True)], dtype=bool)
    steps = np.where(begins, UNSEEN_STEP, STEP)
    steps = np.where(at + steps > [one.high for one in effects], -steps, steps)

    def errors(places: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        there = [moved(declared, here, [effects[k]], np.array([size])) for k, size in zip(places, sizes, strict=True)]
        return errors_near(observer, n, [here, *there], by, horizon)

    moving = np.array([k for k, one in enumerate(effects) if one.family != NOISE and k not in held], dtype=int)
    E = errors(moving, steps[moving])
    shape = E[0].shape
    e, J = E[0], np.zeros((len(effects), *shape))
    J[moving] = (E[1:] - E[0]) / steps[moving, None, None]
    size = np.sqrt(((J / healthy.scales) ** 2).mean(axis=(1, 2))) * np.abs(steps)
    far = np.flatnonzero((size > LONG_STEP) & ~begins)
    if len(far):
        shorter = steps[far] * SHORTENED / size[far]
        J[far] = (errors(far, shorter)[1:] - e) / shorter[:, None, None]
    J[~np.isfinite(J).all(axis=(1, 2))] = 0.0
    for k, (push, times) in held.items():
        J[k] = times * J[push]
    seen = np.isfinite(observer.runs[n].outputs).any(axis=0)
    reach = (J**2).mean(axis=1)[:, seen].mean(axis=1)
    gap_squares = (e**2).sum(axis=0)
    J, e = healthy.independent(n, J), healthy.independent(n, e)
    weight = 1.0 / healthy.inflation
    flat = J.reshape(len(effects), e.size)
    weighted = (J * weight).reshape(flat.shape)
    blocks, diagonal, by_channel = (
        _scores(J, e, weight, observer.windows(n, horizon)) if scores else (NO_SCORES, NO_SCORES, NO_SCORES)
    )
    return Expansion(
        at.copy(), float((weight * e * e).sum()), weighted @ e.ravel(), weighted @ flat.T, (e**2).sum(axis=0),
        np.where(seen, shape[0], 0), gap_squares, blocks, diagonal, reach, by_channel,
        J if keep else None, replace(by, linear=NO_LINEAR) if keep or keep_filter else None,
    )  # fmt: skip


def _scores(
    J: np.ndarray, e: np.ndarray, weight: np.ndarray, windows: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`blocks`, `diagonal` and `by_channel` of an expansion with derivatives J (k, rows, y) of errors e (rows, y) that
    count by weight (y,)."""
    starts, ends = windows
    rows, weighted = ends - starts - 1, weight * e
    first, score, blocks = np.cumsum(rows) - rows, J * weighted, list[np.ndarray]()
    for parts in PARTS:
        cuts = np.unique((first[:, None] + rows[:, None] * np.arange(parts) // parts).ravel())
        sums = np.add.reduceat(score, cuts, axis=1)  # (k, blocks, y)
        blocks.append(np.concatenate([(sums**2).sum(axis=1).T, (sums.sum(axis=2) ** 2).sum(axis=1)[None]]))
    by_channel = np.einsum("kry,kry->yk", score, score)
    diagonal = np.concatenate([by_channel, np.einsum("kry,kry,ry->k", score, J, e)[None]])
    each = np.moveaxis(J, 2, 0)  # (y, k, rows)
    return np.array(blocks), diagonal, weight[:, None, None] * (each @ each.transpose(0, 2, 1))


def room(reach: np.ndarray) -> np.ndarray:
    """Spreads (k,) that a round may move numbers by, of which one spread moves the channels by `reach` (k,) tolerances,
    rms."""
    return np.maximum(LONGEST_MOVE, LONGEST_REACH / np.maximum(reach, LEAST_REACH))


def shortened(steps: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Steps (..., k), each in its direction as far as no number moves further than `most` (k,).

    Where numbers make up for each other, a step that is cut number by number leads uphill.
    """
    longest = np.max(np.abs(steps) / most, axis=-1, keepdims=True, initial=1.0)
    return np.asarray(steps / longest)


def multiples_of_pushes(
    declared: Declaration, effects: Sequence[Effect], driven: np.ndarray
) -> dict[int, tuple[int, float]]:
    """Effects that are, in a run driven by inputs (rows, inputs), so many times a constant force that is among them.

    That is what goes with an operating point, and with an input that stays as it is.
    """
    pushes = {one.name: k for k, one in enumerate(effects) if one.family == PUSH}
    weights, found = point_weights(declared, driven), dict[int, tuple[int, float]]()
    for k, one in enumerate(effects):
        if one.family != FORM or one.name not in pushes:
            continue
        if one.at_point is not None:
            force = float(weights[one.at_point])
        else:
            u = driven[:, declared.index("inputs", one.kind)]
            if np.ptp(u) > 0.0:
                continue
            force = float(u[0]) - declared.usual_inputs[one.kind][0]
        found[k] = pushes[one.name], force * one.spread / effects[pushes[one.name]].spread
    return found


def followed(
    observer: Observer, n: int, effects: Sequence[Effect], at: np.ndarray, healthy: ChannelErrors, horizon: float,
    one: Expansion,
) -> Expansion:  # fmt: skip
    """Run n about the model at another place, its errors flown there by the filter's gains and the derivatives of an
    expansion that has kept them: for the way to a place that is expanded itself."""
    assert one.derivatives is not None
    assert one.filtered is not None
    point = moved(observer.declared, observer.point, effects, at)
    e = healthy.independent(n, observer.residuals(n, [point], one.filtered, horizon)[0])
    slope = np.tensordot(one.derivatives / healthy.inflation, e, axes=([1, 2], [0, 1]))
    return replace(one, at=at.copy(), value=float((e * e / healthy.inflation).sum()), slope=slope,
                   squares=(e**2).sum(axis=0))  # fmt: skip


@dataclass(frozen=True)
class RunLevel:
    """Squared errors of a run may all be larger than healthy runs' by a factor r of the run's own.

    log r is normal, of 1 sigma `scatter`, and at least `least`: with N independent errors whose squares sum to S, -2
    log likelihood is the least of S / r + N log r + (log r / scatter)^2 over r.
    """

    errors: ChannelErrors
    eta: float
    scatter: float
    least: float = 0.0

    def log_level(self, squares: float, count: float) -> float:
        """The most probable log r."""
        if self.scatter <= 0.0 or not np.isfinite(squares) or (squares <= count and self.least == 0.0):
            return 0.0
        level = 0.0
        for _ in range(LEVEL_ROUNDS):
            slope = count + 2.0 * level / self.scatter**2 - squares * np.exp(-level)
            step = slope / (2.0 / self.scatter**2 + squares * np.exp(-level))
            level -= float(np.clip(step, -1.0, 1.0))
            if abs(step) < LEVEL_AT_REST:
                break
        return max(level, self.least)

    def count(self, one: Expansion) -> float:
        """Independent errors of a run."""
        return float((one.samples / self.errors.inflation).sum() / self.eta)

    def value(self, squares: float, count: float) -> float:
        """-2 log likelihood of errors, up to a constant."""
        level = self.log_level(squares, count)
        apart = (level / self.scatter) ** 2 if level else 0.0
        return squares * float(np.exp(-level)) + count * level + apart

    def share(self, one: Expansion) -> float:
        """1 / r of a run, tempered: by how much its squared errors count."""
        return float(np.exp(-self.log_level(one.value, self.count(one))))

    def of(self, one: Expansion) -> Expansion:
        """A run, tempered, at its own level: a parabola that is nowhere below what it has."""
        share = self.share(one)
        return replace(one, value=self.value(one.value, self.count(one)), slope=share * one.slope,
                       curvature=share * one.curvature)  # fmt: skip


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
