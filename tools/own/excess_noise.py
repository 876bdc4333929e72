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

from glider.tools.own.effects import Effect
from glider.tools.own.hierarchy import ChannelErrors, Expansion
from glider.tools.own.observer import Observer

SEGMENTS = 12  # of a window, over each of which a force that stands for white noise is held
PERIODS = tuple(np.geomspace(2.0, 10.0, 8))  # s; surface waves and strokes of fins
NOISE_SIZES = np.array([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])  # tolerances, rms over the windows
SIZE_STEPS = np.geomspace(1.0 / 512.0, 1.0, 37)  # of the largest size looked for


@dataclass(frozen=True)
class Responses:
    """What forces of one size within windows do to a run: the same rows as its errors."""

    patterns: np.ndarray  # (patterns, rows, outputs) of one noise behind the other, in tolerances
    errors: np.ndarray  # (rows, outputs)
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


def responses(observer: Observer, n: int, horizon: float) -> Responses:
    """What a density's forces at every noise do to run n, about the observer's own model."""
    starts, ends = observer.windows(n, horizon)
    shapes = patterns_of(observer.runs[n].t, starts, ends)
    pushes = np.zeros(
        (1 + len(observer.declared.noises) * len(shapes), len(observer.runs[n].t), len(observer.declared.noises))
    )
    for j, one in enumerate(observer.declared.noises):
        pushes[1 + j * len(shapes) : 1 + (j + 1) * len(shapes), :, j] = max(one.density, 1e-6) * shapes
    errors = observer.pushed(n, pushes, horizon)
    rows = ends - starts - 1
    return Responses(errors[1:] - errors[0], errors[0], np.append(0, np.cumsum(rows)))


def blocks_of(place: int) -> list[slice]:
    """Patterns of the label at a place of noise_effects: of the noise's segments, or of each period."""
    first = (place // 2) * (SEGMENTS + 2 * len(PERIODS))
    if place % 2 == 0:
        return [slice(first, first + SEGMENTS)]
    return [slice(first + SEGMENTS + 2 * k, first + SEGMENTS + 2 * k + 2) for k in range(len(PERIODS))]


class NoisyWindows:
    """Forces in some patterns over the windows of all runs, in the directions in which they are independent."""

    def __init__(self, found: Sequence[Responses], block: slice, healthy: ChannelErrors, eta: float):
        self.found, self.block, self.scales = found, block, healthy.scales
        self.weight = 1.0 / (healthy.weight * eta)
        self.d, self.U, self.g = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
        squares, samples = 0.0, 0
        for one in found:
            K, seen = one.patterns[block], np.abs(one.errors).max(axis=0) > 0.0
            squares, samples = squares + float((K[:, :, seen] ** 2).sum()), samples + K.shape[1] * int(seen.sum())
            for a, b in itertools.pairwise(one.cuts):
                flat = (K[:, a:b] * self.weight).reshape(len(K), -1)
                d, U = np.linalg.eigh(flat @ K[:, a:b].reshape(len(K), -1).T)
                self.d.append(np.maximum(d, 0.0))
                self.U.append(U)
                self.g.append(U.T @ (flat @ one.errors[a:b].ravel()))
        self.reach = float(np.sqrt(squares / max(samples, 1)))  # tolerances a density, rms over the windows

    def gain(self, size: float) -> float:
        """Log evidence over none of a size (densities), the model's values held."""
        d, g = np.array(self.d), np.array(self.g)
        return 0.5 * float((g**2 / (size**-2 + d) - np.log1p(size**2 * d)).sum())

    @property
    def windows(self) -> int:
        """How many windows there are in all runs."""
        return len(self.d)

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
        found, w = [], 0
        for run, one in zip(runs, self.found, strict=True):
            assert run.derivatives is not None
            A, g, value, volume = run.curvature.copy(), run.slope.copy(), run.value, 0.0
            K = one.patterns[self.block] * self.weight
            for a, b in itertools.pairwise(one.cuts):
                C = self.U[w].T @ np.tensordot(K[:, a:b], run.derivatives[:, a:b], axes=([1, 2], [1, 2]))
                S = 1.0 / (size**-2 + self.d[w])
                A -= C.T @ (S[:, None] * C)
                g -= C.T @ (S * self.g[w])
                value -= float((S * self.g[w] ** 2).sum())
                volume += float(np.log1p(size**2 * self.d[w]).sum())
                w += 1
            there = at_level(replace(run, curvature=0.5 * (A + A.T), slope=g, value=value))
            found.append(replace(there, value=there.value + volume))
        return found

    def left(self, size: float) -> np.ndarray:
        """Mean squares (runs,) beside the most probable forces of a size, in units of what healthy runs leave."""
        left, w = np.zeros(len(self.found)), 0
        for n, one in enumerate(self.found):
            e = one.errors.copy()
            for a, b in itertools.pairwise(one.cuts):
                forces = self.U[w] @ (self.g[w] / (size**-2 + self.d[w]))
                e[a:b] -= np.tensordot(forces, one.patterns[self.block, a:b], axes=1)
                w += 1
            seen = np.abs(one.errors).max(axis=0) > 0.0
            left[n] = float(((e / self.scales)[:, seen] ** 2).mean())
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
