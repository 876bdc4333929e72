"""What errors of windows are made of: noise of rows, forces at the noises, and where the filter has a window begin.

Errors of a window flown open loop are no white noise: a disturbance early in it moves all that follows. With K_w what
forces over parts of window w and its start, 1 sigma of the filter off, do to its errors e_w,

    e_w ~ N(0, D + K_w Q K_w'),   D = diag(white^2),   Q = diag(variances),

the variances, two for the forces at each noise, white and held over a window, and one for starts in units of what the
vehicle file and the filter have, and the noise of rows by channel are learned from healthy runs. Everything about
windows is counted in these errors made independent and of variance 1, (D + K_w Q K_w')^-1/2 e_w: the symmetric root
leaves a channel's errors the channel's, as far as it can.

A vehicle whose form is not the model's has errors that are none of these: whether they are, runs themselves say
(`independence`).
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.own.declare import Declaration
from glider.tools.own.effects import with_run_numbers
from glider.tools.own.excess_noise import SEGMENTS, at_noises, patterns_of
from glider.tools.own.near import errors_pushed, errors_unsettled
from glider.tools.own.observer import Observer

RATIOS, RATIO_SCALE = np.geomspace(1.0, 100.0, 60), 1.0  # of variances; prior 1 sigma of their logarithm
COMPONENT_ROUNDS, COMPONENT_AT_REST = 100, 1e-3  # at most; e-folds of a variance
LEAST_WHITE = 1e-3  # tolerances: less than that no row is known to
LEAST_DIRECTION = 1e-9  # of the largest variance of directions: less is none
LEAST_COMPONENT = 1e-8  # of a variance in units of the file's


@dataclass(frozen=True)
class Components:
    """Variances of what errors of windows are made of."""

    white: np.ndarray  # (y,) 1 sigma of a row's own errors, tolerances
    forces: np.ndarray  # (noises,) of white forces, squared densities of the vehicle file
    held: np.ndarray  # (noises,) of forces held over a window, of what such white ones have as their mean there
    start: float  # of windows' starts, of the filter's covariance

    def said(self, declared: Declaration) -> str:
        """In words."""
        rows = ", ".join(f"{one.name} {size:.2g}" for one, size in zip(declared.outputs, self.white, strict=True))
        forces = ", ".join(f"{one.name} {size:.2g}" for one, size in zip(declared.noises, self.forces, strict=True))
        held = ", ".join(f"{one.name} {size:.2g}" for one, size in zip(declared.noises, self.held, strict=True))
        return (f"of rows {rows} tolerances; of forces {forces}, of held ones {held}, of starts {self.start:.2g} times "
                "the file's variance")  # fmt: skip

    @property
    def variances(self) -> np.ndarray:
        """(2 noises + 1,) of white forces, held ones, starts."""
        return np.concatenate([self.forces, self.held, [self.start]])


@dataclass(frozen=True)
class Patterns:
    """What forces over the parts of windows, and their starts, do to the errors of a run, in tolerances."""

    errors: np.ndarray  # (rows, y) of the model itself
    columns: np.ndarray  # (patterns, rows, y)
    cuts: np.ndarray  # (windows + 1,) rows at which windows begin
    of: np.ndarray  # (patterns,) which of the components' variances each has


def patterns(observer: Observer, n: int, horizon: float) -> Patterns:
    """Those of run n about the observer's own model."""
    noises = observer.declared.noises
    starts, ends = observer.windows(n, horizon)
    shapes = patterns_of(observer.runs[n].t, starts, ends)[:SEGMENTS]
    # what a filter along the run would not know of its numbers is not known where a window begins either
    begun = errors_unsettled(observer.about(with_run_numbers(observer.declared, observer.point)), n, horizon)
    pushed = errors_pushed(observer, n, at_noises(observer.declared, shapes), horizon)
    forced, started = pushed[1:] - pushed[0], begun[1:] - begun[0]
    held = forced.reshape(len(noises), SEGMENTS, *begun.shape[1:]).sum(axis=1) / np.sqrt(SEGMENTS)
    each = [SEGMENTS] * len(noises) + [1] * len(noises) + [len(started)]
    return Patterns(pushed[0], np.concatenate([forced, held, started]), np.append(0, np.cumsum(ends - starts - 1)),
                    np.repeat(np.arange(len(each)), each))  # fmt: skip


class Whitening:
    """The errors of a run made independent and of variance 1, window by window."""

    def __init__(self, found: Patterns, by: Components):
        self.white, self.cuts = by.white, found.cuts
        root = np.sqrt(by.variances[found.of])[:, None, None]
        self.directions = list[tuple[np.ndarray, np.ndarray]]()
        for a, b in itertools.pairwise(found.cuts):
            K = (root * found.columns[:, a:b] / by.white).reshape(len(root), -1)
            d, V = np.linalg.eigh(K @ K.T)
            kept = d > LEAST_DIRECTION * max(float(d[-1]), 1.0)
            U = (V[:, kept] / np.sqrt(d[kept])).T @ K
            self.directions.append((U, 1.0 - 1.0 / np.sqrt(1.0 + d[kept])))

    def __call__(self, errors: np.ndarray) -> np.ndarray:
        """Errors (..., rows, y) in tolerances."""
        found = errors / self.white
        for (U, share), a, b in zip(self.directions, self.cuts[:-1], self.cuts[1:], strict=True):
            flat = found[..., a:b, :].reshape(-1, U.shape[1])
            found[..., a:b, :] -= ((flat @ U.T * share) @ U).reshape(found[..., a:b, :].shape)
        return found


def learn_components(found: Sequence[Patterns], usual: Components) -> Components:
    """Components the most probable in healthy runs whose errors these are, about usual ones.

    A variance has the prior of `learn_scatter`; steps minorise and maximise as there.
    """
    grams = [_gram(one, a, b) for one in found for a, b in itertools.pairwise(one.cuts)]
    of, weight, usual_v = found[0].of, 0.5 * HEALTHY.prior_runs, usual.variances
    white, v = usual.white**2, np.maximum(usual_v, LEAST_COMPONENT)
    for _ in range(COMPONENT_ROUNDS):
        squares, traces = np.zeros(len(v)), np.zeros(len(v))
        of_rows, rows = np.zeros(len(white)), np.zeros(len(white))
        for one in grams:
            Q = v[of]
            M = np.linalg.inv(np.diag(1.0 / Q) + np.einsum("yij,y->ij", one.K_K, 1.0 / white))
            forces = M @ (one.K_e.T @ (1.0 / white))
            np.add.at(squares, of, (forces / Q) ** 2)
            np.add.at(traces, of, 1.0 / Q - np.diag(M) / Q**2)
            left = one.e_e - 2.0 * one.K_e @ forces + np.einsum("i,yij,j->y", forces, one.K_K, forces)
            of_rows += np.maximum(left, 0.0) / white**2
            rows += one.samples / white - np.einsum("yij,ij->y", one.K_K, M) / white**2
        new = np.sqrt((0.5 * v**2 * squares + weight * usual_v) / (0.5 * np.maximum(traces, 0.0) + weight / v))
        new = np.maximum(new, LEAST_COMPONENT)
        new_white = np.where(rows > 0.0, white * np.sqrt(of_rows / np.maximum(rows, 1e-300)), white)
        new_white = np.maximum(new_white, LEAST_WHITE**2)
        apart = np.abs(np.log(np.append(new / v, new_white / white))).max()
        v, white = new, new_white
        if apart < COMPONENT_AT_REST:
            break
    count = len(usual.forces)
    return Components(np.sqrt(white), v[:count], v[count:-1], float(v[-1]))


@dataclass(frozen=True)
class _Gram:
    """Inner products of a window's errors and patterns, by channel."""

    K_K: np.ndarray  # (y, patterns, patterns)
    K_e: np.ndarray  # (y, patterns)
    e_e: np.ndarray  # (y,)
    samples: np.ndarray  # (y,)


def _gram(found: Patterns, a: int, b: int) -> _Gram:
    K, e = np.moveaxis(found.columns[:, a:b], 2, 0), found.errors[a:b].T
    return _Gram(K @ K.transpose(0, 2, 1), np.einsum("ypr,yr->yp", K, e), (e**2).sum(axis=1),
                 (e != 0.0).sum(axis=1).astype(float))  # fmt: skip


def independence(ratio: float, runs: int) -> float:
    """Probability that errors made independent are: `ratio`, of the variance by which runs differ in what they share
    over what independent errors would have, is 1, against any larger one, log-normal above it; both equally probable
    before. As many numbers that are normal as there are runs have shown it."""

    def nat(true: np.ndarray | float) -> np.ndarray:
        return -0.5 * runs * (np.log(true) + ratio / true)

    logs = np.log(RATIOS)
    prior = np.exp(-0.5 * (logs / RATIO_SCALE) ** 2)
    other = logsumexp(nat(RATIOS), b=prior / prior.sum())
    return float(1.0 / (1.0 + np.exp(np.clip(other - nat(1.0), -500.0, 500.0))))
