"""Sessions of a watch: successive runs that share what a vehicle is off the identified one by.

Another day's trim, water or battery is no cause (docs/how-to/own-vehicle.md, The method). With x_n = s + t_j + d_n, s ~
N(0, C) as identified and t_j ~ N(0, times^2 T), what is known of a new session is s given the reference's runs, and t_j
beside it; `times`, how far it differs over what identified sessions do, has the prior that so few of them leave
(Student's t), and is taken where it is most probable; a diagnosis sums over it (posterior.py). Of a label over a span S
of a session's runs, all that they share integrated out, slope and precision are r_S - H_S M r and H_S - H_S M H_S, with
H, r the pooled session's and M the covariance that it leaves.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.pooled import Parabola, Pooled, Scatter, marginalised
from glider.tools.own.effects import OUTPUT, Effect
from glider.tools.own.hierarchy import Expansion

TIMES = np.array([1.0, 2.0, 4.0, 8.0])  # that a session differs as far as is known of sessions


@dataclass(frozen=True)
class Session:
    """Runs first to end - 1 of a watch and what is known of the values (k,) that they share."""

    first: int
    end: int
    mean: np.ndarray  # (k,) without its own runs
    V: np.ndarray  # (k, k)
    values: np.ndarray  # (k,) about which its runs are expanded
    log_prior: float = 0.0  # of how far it differs


@dataclass(frozen=True)
class Another:
    """What is known of a session that differs one of TIMES as far as is known of sessions."""

    mean: np.ndarray  # (k,)
    V: np.ndarray  # (k, k)
    log_prior: float  # of these TIMES


def session_share(scatter: Scatter, session: Scatter, effects: Sequence[Effect]) -> float:
    """Variance between sessions over that from run to run, of all effects that differ (geometric mean) but instruments:
    how their biases do, the vehicle file says."""
    runs, sessions = scatter.sizes, session.sizes
    differs = (runs > 0.0) & (sessions > 0.0) & [one.family != OUTPUT for one in effects]
    return float(np.exp(2.0 * np.log(sessions[differs] / runs[differs]).mean())) if differs.any() else 0.0


def split(sessions: Sequence[Session], first: int, another: Another) -> list[Session]:
    """Sessions with another one from run `first` on; themselves where one begins there.

    The first is the reference's: none of the runs that are watched may be left to it.
    """
    found = list[Session]()
    for one in sessions:
        if one.first <= first < one.end and first not in [other.first for other in sessions[1:]]:
            new = Session(first, one.end, another.mean, another.V, another.mean, another.log_prior)
            found += [replace(one, end=first), new]
        else:
            found.append(one)
    return found


def of_another(runs: Sequence[Parabola], V: np.ndarray, session: Scatter, learned_from: int) -> list[Another]:
    """What is known of another session, for each of TIMES: V of the identified vehicle, runs of the reference
    (tempered, their own deviations integrated out), session: what sessions differ by, learned from so many."""
    together, found = Pooled.of(runs, V).parabola(), list[Another]()
    for scatter, log_prior in each_of_times(session, learned_from):
        known = Pooled.of([marginalised(together, scatter)], V)
        found.append(Another(known.mean(), known.covariance() + scatter.covariance, log_prior))
    return found


def each_of_times(session: Scatter, learned_from: int) -> list[tuple[Scatter, float]]:
    """What sessions differ by, learned from so many, at each of TIMES, and the log probability of that."""
    scaled = [replace(session, sizes=times * session.sizes) for times in TIMES]
    return list(zip(scaled, times_log_prior(learned_from).tolist(), strict=True))


def times_log_prior(sessions: int) -> np.ndarray:
    """Log probability of each of TIMES: of a scale learned from so many sessions, what is usual beside them."""
    known_from = sessions - 1 + HEALTHY.prior_runs
    found = -known_from * (np.log(TIMES) + 0.5 / TIMES**2)
    return np.asarray(found - logsumexp(found))


@dataclass
class SessionRuns:
    """A session's runs about its mean, label by label over spans of them."""

    session: Session
    pooled: Pooled
    slopes: np.ndarray  # (runs + 1, k) summed up to each run
    curvatures: np.ndarray  # (runs + 1, k, k)

    @classmethod
    def of(cls, session: Session, runs: Sequence[Expansion]) -> "SessionRuns":
        """Runs of the session, values counted from what they are thought to have without it."""
        about = [replace(one, at=one.at - session.mean) for one in runs]
        slopes = np.cumsum([np.zeros_like(session.mean), *(-one.offset for one in about)], axis=0)
        curvatures = np.cumsum([np.zeros_like(session.V), *(one.curvature for one in about)], axis=0)
        pooled = Pooled(curvatures[-1], slopes[-1], sum(one.constant for one in about), session.V)
        return cls(session, pooled, slopes, curvatures)

    def __post_init__(self) -> None:
        self.M = self.pooled.covariance()
        self.mean = self.M @ self.pooled.r

    def over(self, first: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Slope r_S (k,) and curvature H_S (k, k) of the runs of a span that are of this session."""
        a, b = (int(np.clip(n - self.session.first, 0, len(self.slopes) - 1)) for n in (first, end))
        return self.slopes[b] - self.slopes[a], self.curvatures[b] - self.curvatures[a]

    def alone(self, first: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Slope and precision (k,) of each label's size over a span: diagonal only."""
        r, H = self.over(first, end)
        return r - H @ self.mean, np.diag(H) - ((H @ self.M) * H).sum(axis=1)

    def beside(self, first: int, end: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same of a few labels together, slope (places,) and precision (places, places)."""
        r, H = self.over(first, end)
        return (r - H @ self.mean)[places], H[np.ix_(places, places)] - H[places] @ self.M @ H[:, places]

    def given(self, first: int, end: int, label: int, size: float) -> np.ndarray:
        """Most probable values (k,) of the session, a label of a size being there over a span."""
        _, H = self.over(first, end)
        return self.session.mean + self.mean - self.M @ (H[:, label] * size)

    def log_density(self, first: int, end: int, label: int, size: float) -> float:
        """Log posterior density, up to a constant, of the session's values and of a label's size over a span."""
        (r, H), x = self.over(first, end), self.session.values - self.session.mean
        free = np.diag(self.session.V) > 0.0
        apart = x[free] @ np.linalg.solve(self.session.V[np.ix_(free, free)], x[free]) if x.any() else 0.0
        squares = self.pooled.constant - 2.0 * self.pooled.r @ x + x @ self.pooled.H @ x + apart
        return float(-0.5 * squares + size * (r - H @ x)[label] - 0.5 * size**2 * H[label, label])


def log_evidence(pooled: Sequence[SessionRuns]) -> float:
    """Of all sessions' runs, without a label."""
    return sum(one.pooled.log_evidence() for one in pooled)


def summed(parts: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Slopes and precisions of a label in some sessions, together; precisions of single labels not below 0."""
    slopes, precisions = zip(*parts, strict=True)
    precision = np.sum(precisions, axis=0)
    return np.sum(slopes, axis=0), np.maximum(precision, 0.0) if precision.ndim == 1 else precision
