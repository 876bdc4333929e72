"""Healthy runs fitted: what they share, what each has of its own, how they differ, to windows flown open loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.inference.pooled import Pooled, learn_scatter, log_prior, marginalised, run_values
from glider.tools.own.effects import Effect, moved
from glider.tools.own.hierarchy import ChannelErrors, Expansion, RunLevel, expand, inflation
from glider.tools.own.observer import Observer

ROUNDS, SHARED_ROUNDS = 40, 10  # at most; of them until it is learned how runs differ
FORM_ROUNDS = 2
SCATTER_ROUNDS = 4  # in which it is learned how runs differ, then held
MIN_SCATTER_RUNS = 3  # from fewer nothing is learned of how runs differ
USUAL_SCATTER, USUAL_OWN_SCATTER = 0.02, 0.5  # spreads, from run to run; of what is declared a number of each run
LABEL_SCATTERS = np.geomspace(0.005, 20.0, 60)  # spreads: candidates for a label's scatter
LONGEST_MOVE, SHARES = 2.0, (1.0, 0.4, 0.1)  # spreads a round; of a step, until the exact posterior gains
LEAST_DAMPING, MOST_DAMPING = 0.01, 1e6  # of the curvature, in spreads
CONVERGED_GAIN = 0.5  # of -2 log posterior: no further round
CONVERGED_SCALE = 0.05  # e-folds of what is left, by which it changes no more
LEAST_SCALE = 0.02  # tolerances: less than that no channel is known to be left with


@dataclass
class RunsFit:
    """Where the values of runs are most probable, and what was learned of how they differ."""

    observer: Observer
    nuisance: list[Effect]
    limits: tuple[np.ndarray, np.ndarray]
    usual: np.ndarray  # (k,) spreads, scatter before any run is seen
    V: np.ndarray  # (k, k) prior covariance of the shared values
    errors: ChannelErrors
    values: np.ndarray  # (k,) spreads
    own: np.ndarray  # (runs, k)
    scatter: np.ndarray  # (k,)

    def expansions(self, keep: bool = False) -> list[Expansion]:
        """Every run about its own values."""
        horizon = self.observer.horizon
        return [expand(self.observer, n, self.nuisance, row, self.errors, horizon, keep)
                for n, row in enumerate(self.own)]  # fmt: skip

    def led(self, say: Callable[[str], None], differ: bool = False) -> "RunsFit":
        """The fit led on until it rests; differ: it is learned at once how runs differ, else what they share first."""
        fit, learned, many = replace(self), 0, len(self.own) >= MIN_SCATTER_RUNS
        for round_ in range(ROUNDS):
            found = fit.expansions()
            *_, eta = inflation(found)
            warm = [one.tempered(eta) for one in found]
            if differ and learned < SCATTER_ROUNDS:
                fit.V = with_form_errors([marginalised(one, fit.scatter) for one in warm], fit.V, fit.nuisance)
                scatter = learn_scatter(warm, fit.V, fit.usual)
                fit.scatter = scatter if learned == 0 else np.sqrt(fit.scatter * scatter)
                learned += 1
            search = LineSearch(fit.observer, fit.nuisance, warm, fit.scatter, eta, fit.V, fit.limits, fit.errors,
                                fit.observer.horizon)  # fmt: skip
            step = damped_step(Pooled.of([marginalised(one, fit.scatter) for one in warm], fit.V), fit.values)
            fit.values, fit.own, gain = search.along(fit.values, fit.own, step)
            before, scales = fit.errors.scales, left_by(found, fit.errors).scales
            fit.errors = replace(fit.errors, scales=scales)  # channels' own inflation is for what is asked later
            left = np.sqrt(np.mean(scales**2))
            say(f"round {round_ + 1}: gain {gain:.1f}, {left:.2f} tolerances left, inflation {eta:.0f}")
            if gain < CONVERGED_GAIN and np.abs(np.log(scales / before)).max() < CONVERGED_SCALE:
                if learned == SCATTER_ROUNDS or not many:
                    break
                differ = True
            differ = differ or (round_ == SHARED_ROUNDS and many)
        return fit


def damped_step(pooled: Pooled, values: np.ndarray) -> np.ndarray:
    """Step (k,) to the most probable shared values, damped as Levenberg has it until no value moves LONGEST_MOVE."""
    damping = 0.0
    while True:
        near = replace(pooled, H=pooled.H + damping * np.eye(len(values)), r=pooled.r + damping * values)
        step = near.mean() - values
        if np.abs(step).max(initial=0.0) <= LONGEST_MOVE or damping > MOST_DAMPING:
            return np.clip(step, -LONGEST_MOVE, LONGEST_MOVE)
        damping = max(4.0 * damping, LEAST_DAMPING)


def with_form_errors(found: Sequence[Expansion], V: np.ndarray, nuisance: Sequence[Effect]) -> np.ndarray:
    """The prior covariance with the variances of form errors learned, two for every noise: of what goes with inputs,
    and with operating points.

    The most probable, with the prior of `learn_scatter`, of runs with their own deviations integrated out.
    """
    kept = Pooled.of(found, V)
    for _ in range(FORM_ROUNDS):
        for kind in dict.fromkeys(kind for one in nuisance if (kind := one.form_kind) is not None):
            places = np.array([one.form_kind == kind for one in nuisance])
            usual = USUAL_SCATTER if kind[1] else USUAL_OWN_SCATTER

            def at(size: float, V=V, places=places) -> np.ndarray:
                return np.diag(np.where(places, size**2, np.diag(V)))

            def score(size: float, at=at, usual=usual) -> float:
                return kept.log_evidence(at(size)) + float(log_prior(size**2, usual**2))

            V = at(max(LABEL_SCATTERS, key=score))
    return V


def left_by(found: Sequence[Expansion], errors: ChannelErrors) -> ChannelErrors:
    """What runs leave, channel by channel, where they were expanded; `errors`: in what they were counted."""
    squares = np.sum([one.gap_squares for one in found], axis=0)
    samples = np.sum([one.samples for one in found], axis=0)
    scales = np.where(samples > 0, np.sqrt(squares / np.maximum(samples, 1)), errors.scales)
    return replace(errors, scales=np.maximum(scales, LEAST_SCALE), inflation=inflation(found)[:-1])


@dataclass
class LineSearch:
    """The exact posterior along a step of the shared values."""

    observer: Observer
    nuisance: list[Effect]
    warm: list[Expansion]
    scatter: np.ndarray
    eta: float
    V: np.ndarray
    limits: tuple[np.ndarray, np.ndarray]
    errors: ChannelErrors
    horizon: float
    first: int = 0  # run of the observer that `warm` begins with
    level: RunLevel | None = None  # of the runs' own errors, where they have one

    def prior(self, x: np.ndarray, own: np.ndarray) -> float:
        apart, free = ((own - x) / np.maximum(self.scatter, 1e-6)) ** 2, np.diag(self.V) > 0.0
        return float(apart.sum() + x[free] @ np.linalg.solve(self.V[np.ix_(free, free)], x[free]))

    def misfit(self, n: int, row: np.ndarray) -> float:
        point = moved(self.observer.declared, self.observer.point, self.nuisance, row)
        flown = self.first + n
        error = self.observer.residuals(flown, [point], self.observer.filter(flown, point), self.horizon)[0]
        squares = float(self.errors.misfit(flown, error)) / self.eta
        return squares if self.level is None else self.level.value(squares, self.level.count(self.warm[n]))

    def along(self, values: np.ndarray, own: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Values, runs' own values and the gain of a step, shortened until the exact posterior gains."""

        def at(share: float, of_own: float = 1.0) -> tuple[float, np.ndarray, np.ndarray]:
            x = np.clip(values + share * step, *self.limits)
            target = np.array([run_values(one, x, self.scatter) for one in self.warm])
            theirs = own + of_own * np.clip(target - own, -LONGEST_MOVE, LONGEST_MOVE)
            theirs = np.clip(np.where(self.scatter > 0.0, theirs, x), *self.limits)
            return sum(self.misfit(n, row) for n, row in enumerate(theirs)) + self.prior(x, theirs), x, theirs

        here = sum(one.value for one in self.warm) + self.prior(values, own), values, own
        stay = here
        for of_own in SHARES:
            tried = at(0.0, of_own)
            if tried[0] < stay[0]:
                stay = tried
                break
        if not step.any():
            return stay[1], stay[2], 0.0
        for share in SHARES:
            tried = at(share)
            if tried[0] < stay[0]:
                return tried[1], tried[2], stay[0] - tried[0]
        return stay[1], stay[2], 0.0
