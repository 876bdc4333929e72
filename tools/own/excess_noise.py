"""Excess noise and oscillations at the noises of a model, as causes: what no constant number does to the windows.

Within window w of a run, forces at one noise are b_w ~ N(0, size^2), each window's its own: white noise is a force held
over each of its parts, an oscillation the two quadratures of a period. They are integrated out of the run's errors:
with K_w what they do, J_w what the values of the model do, and S_w = (size^-2 + K_w W K_w')^-1,

    A' = A - sum J_w W K_w' S_w K_w W J_w',   g' = g - sum J_w W K_w' S_w K_w W e_w,
    value' = value - sum e_w W K_w' S_w K_w W e_w + log det(1 + size^2 K_w W K_w')
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from glider.tools.own.declare import Declaration
from glider.tools.own.effects import Effect
from glider.tools.own.hierarchy import ChannelErrors, Expansion
from glider.tools.own.near import errors_pushed
from glider.tools.own.observer import Observer

NOISE_SEED = 1
LEAST_DENSITY = 1e-6  # of a noise that the file has none of
SEGMENTS = 12  # of a window, over each of which a force that stands for white noise is held
PERIODS = tuple(np.geomspace(2.0, 10.0, 8))  # s; surface waves and strokes of fins
NOISE_SIZES = np.array([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])  # tolerances, rms over the windows
SIZE_STEPS = np.geomspace(1.0 / 512.0, 1.0, 37)  # of the largest size looked for


@dataclass(frozen=True)
class Responses:
    """What forces of one size within windows do to a run: the same rows as its errors, made independent as these."""

    patterns: np.ndarray  # (patterns, rows, outputs) of one noise behind the other
    errors: np.ndarray  # (rows, outputs)
    moves: np.ndarray  # (patterns,) mean squares over the channels, tolerances
    within: np.ndarray  # (noises, outputs) mean squares of what white noise does beside its means over the segments
    cuts: np.ndarray  # (windows + 1,) rows at which windows begin


def patterns_of(t: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Forces of one size (patterns, rows): segments of every window, then cosine and sine of every period."""
    found = np.zeros((SEGMENTS + 2 * len(PERIODS), len(t)))
    for a, b in zip(starts, ends, strict=True):
        edges = a + (b - a) * np.arange(SEGMENTS + 1) // SEGMENTS
        for k in range(SEGMENTS):
            # white noise of one density: a mean over the segment of 1 / sqrt(its seconds)
            found[k, edges[k] : edges[k + 1]] = 1.0 / np.sqrt(max(t[min(edges[k + 1], b - 1)] - t[edges[k]], 1e-3))
        for k, period in enumerate(PERIODS):
            phase = 2.0 * np.pi * (t[a:b] - t[a]) / period
            found[SEGMENTS + 2 * k, a:b], found[SEGMENTS + 2 * k + 1, a:b] = np.cos(phase), np.sin(phase)
    return found


def within_segments(t: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """White noise of one density at rows t (rows,), less its mean over each segment (`shapes`: of `patterns_of`)."""
    dt = np.append(np.diff(t), t[-1] - t[-2])
    found = np.random.default_rng(NOISE_SEED).standard_normal(len(t)) / np.sqrt(dt)
    for segment in shapes[:SEGMENTS]:
        for rows in np.split(np.flatnonzero(segment), np.flatnonzero(np.diff(np.flatnonzero(segment)) > 1) + 1):
            if len(rows):
                found[rows] -= found[rows].mean()
    return found


def at_noises(declared: Declaration, shapes: np.ndarray) -> np.ndarray:
    """Forces (noises x shapes, rows, noises): of every noise's density one after the other in shapes (shapes, rows)."""
    found = np.zeros((len(declared.noises), len(shapes), shapes.shape[1], len(declared.noises)))
    for j, one in enumerate(declared.noises):
        found[j, :, :, j] = max(one.density, LEAST_DENSITY) * shapes
    return found.reshape(-1, *found.shape[2:])


def responses(observer: Observer, n: int, horizon: float, healthy: ChannelErrors) -> Responses:
    """What a density's forces at every noise do to run n, about the observer's own model."""
    starts, ends = observer.windows(n, horizon)
    shapes = patterns_of(observer.runs[n].t, starts, ends)
    fast, declared = within_segments(observer.runs[n].t, shapes), observer.declared
    pushes = np.concatenate([at_noises(declared, shapes), at_noises(declared, fast[None])])
    errors = errors_pushed(observer, n, pushes, horizon)
    moves, seen = errors[1:] - errors[0], np.isfinite(observer.runs[n].outputs).any(axis=0)
    each = healthy.independent(n, moves)
    count = len(declared.noises)
    within = (each[len(each) - count :] ** 2).mean(axis=1)
    return Responses(each[: len(each) - count], healthy.independent(n, errors[0]),
                     (moves[: len(each) - count, :, seen] ** 2).mean(axis=(1, 2)), within,
                     np.append(0, np.cumsum(ends - starts - 1)))  # fmt: skip


def blocks_of(place: int) -> list[slice]:
    """Patterns of the label at a place of noise_effects: of the noise's segments, or of each period."""
    first = (place // 2) * (SEGMENTS + 2 * len(PERIODS))
    if place % 2 == 0:
        return [slice(first, first + SEGMENTS)]
    return [slice(first + SEGMENTS + 2 * k, first + SEGMENTS + 2 * k + 2) for k in range(len(PERIODS))]


class NoisyWindows:
    """Forces in some patterns over the windows of all runs, in the directions in which they are independent.

    White noise of a size moves rows beside its means over the segments, too: the variance of a channel's rows is
    1 + size^2 `within`, in which all else is counted.
    """

    def __init__(self, found: Sequence[Responses], block: slice, healthy: ChannelErrors, eta: float):
        self.found, self.block = found, block
        self.weight = 1.0 / (healthy.inflation * eta)
        noise, at = divmod(block.start, SEGMENTS + 2 * len(PERIODS))
        self.within = [one.within[noise] * (at == 0) for one in found]
        moves, rows = [one.moves[block].sum() for one in found], [one.cuts[-1] for one in found]
        self.reach = float(np.sqrt(np.average(moves, weights=rows)))  # tolerances a density, rms over the windows
        self._kept: dict[float, tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]] = {}

    def weights(self, size: float) -> list[np.ndarray]:
        """Weight of a squared error, of every run by channel."""
        return [self.weight / (1.0 + size**2 * within) for within in self.within]

    def _directions(self, size: float) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Of every window: precisions of the forces in the directions that are independent, these, and scores."""
        key = size if any(within.any() for within in self.within) else 0.0
        if key not in self._kept:
            d, U, g = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
            for one, weight in zip(self.found, self.weights(key), strict=True):
                K = one.patterns[self.block]
                for a, b in itertools.pairwise(one.cuts):
                    flat = (K[:, a:b] * weight).reshape(len(K), -1)
                    sizes, axes = np.linalg.eigh(flat @ K[:, a:b].reshape(len(K), -1).T)
                    d.append(np.maximum(sizes, 0.0))
                    U.append(axes)
                    g.append(axes.T @ (flat @ one.errors[a:b].ravel()))
            self._kept[key] = d, U, g
        return self._kept[key]

    def _rows(self, size: float, n: int) -> tuple[float, float]:
        """What -2 log likelihood of run n has more than without noise, no force in it: of squares, of the variance."""
        one, within = self.found[n], size**2 * self.within[n]
        counts = one.cuts[-1] * self.weight * (np.abs(one.errors).max(axis=0) > 0.0)
        squares = (one.errors**2).sum(axis=0)
        return float(squares @ (self.weights(size)[n] - self.weight)), float(counts @ np.log1p(within))

    def gain(self, size: float) -> float:
        """Log evidence over none of a size (densities), the model's values held."""
        d, _, g = (np.array(one) for one in self._directions(size))
        rows = sum(sum(self._rows(size, n)) for n in range(len(self.found)))
        return 0.5 * float((g**2 / (size**-2 + d) - np.log1p(size**2 * d)).sum() - rows)

    @property
    def windows(self) -> int:
        """How many windows there are in all runs."""
        return sum(len(one.cuts) - 1 for one in self.found)

    def size(self, largest: float) -> tuple[float, float]:
        """Size and its 1 sigma, densities, up to `largest` tolerances."""
        grid = SIZE_STEPS * largest / self.reach
        nat = np.array([self.gain(size) for size in grid])
        chance = np.exp(nat - logsumexp(nat))
        mean = float((chance * grid).sum())
        return mean, float(np.sqrt(max((chance * (grid - mean) ** 2).sum(), 1e-30)))

    def marginalised(
        self, runs: Sequence[Expansion], size: float, at_level: Callable[[Expansion], Expansion] = lambda one: one
    ) -> list[Expansion]:
        """Expansions of the runs, with their derivatives kept, with forces of a size (densities) integrated out."""
        found, w, (d, U, scores) = [], 0, self._directions(size)
        for n, (run, one, weight) in enumerate(zip(runs, self.found, self.weights(size), strict=True)):
            assert run.derivatives is not None
            (squares, volume), A, g = self._rows(size, n), run.curvature.copy(), run.slope.copy()
            value = run.value + squares
            if self.within[n].any():
                moved = np.flatnonzero(run.derivatives.any(axis=(1, 2)))
                J, less = run.derivatives[moved], weight - self.weight
                flat = (J * less).reshape(len(J), -1)
                A[np.ix_(moved, moved)] += flat @ J.reshape(len(J), -1).T
                g[moved] += flat @ one.errors.ravel()
            K = one.patterns[self.block] * weight
            for a, b in itertools.pairwise(one.cuts):
                C = U[w].T @ np.tensordot(K[:, a:b], run.derivatives[:, a:b], axes=([1, 2], [1, 2]))
                S = 1.0 / (size**-2 + d[w])
                A -= C.T @ (S[:, None] * C)
                g -= C.T @ (S * scores[w])
                value -= float((S * scores[w] ** 2).sum())
                volume += float(np.log1p(size**2 * d[w]).sum())
                w += 1
            there = at_level(replace(run, curvature=0.5 * (A + A.T), slope=g, value=value))
            found.append(replace(there, value=there.value + volume))
        return found

    def left(self, size: float) -> np.ndarray:
        """Mean squares (runs,) beside the most probable forces of a size, in units of what healthy runs leave."""
        left, w, (d, U, scores) = np.zeros(len(self.found)), 0, self._directions(size)
        for n, one in enumerate(self.found):
            e = one.errors.copy()
            for a, b in itertools.pairwise(one.cuts):
                forces = U[w] @ (scores[w] / (size**-2 + d[w]))
                e[a:b] -= np.tensordot(forces, one.patterns[self.block, a:b], axes=1)
                w += 1
            seen = np.abs(one.errors).max(axis=0) > 0.0
            left[n] = float((e**2 / (1.0 + size**2 * self.within[n]))[:, seen].mean())
        return left


def usual_gains(
    found: Sequence[Responses], noises: Sequence[Effect], sizes: np.ndarray, healthy: ChannelErrors, eta: float
) -> dict[str, float]:
    """Nat a window, by label, that healthy runs gain by the most probable size: what there is without a change."""
    usual = {}
    for place, one in enumerate(noises):
        gains = [0.0]
        for block in blocks_of(place):
            windows = NoisyWindows(found, block, healthy, eta)
            if windows.reach > 0.0:
                gains += [windows.gain(size / windows.reach) / windows.windows for size in sizes]
        usual[one.label] = max(gains)
    return usual
