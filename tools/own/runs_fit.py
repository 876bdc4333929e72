"""Healthy runs fitted: what they share, what each has of its own, how they differ, to windows flown open loop."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.pooled import (
    Parabola,
    Pooled,
    Scatter,
    learn_scatter_together,
    log_prior,
    marginalised,
    run_values,
)
from glider.tools.own.effects import Effect, moved
from glider.tools.own.hierarchy import ChannelErrors, Expansion, RunLevel, expand, inflation, room, shortened
from glider.tools.own.observer import Observer

SHARED_ROUNDS, ROUNDS = 10, 40  # at most, until it is learned how runs differ, and from then on
FORM_ROUNDS = 2
SCATTER_ROUNDS = 4  # in which it is learned how runs differ, then held
MIN_SCATTER_RUNS = 3  # from fewer nothing is learned of how runs differ
USUAL_SCATTER, USUAL_OWN_SCATTER = 0.02, 0.5  # spreads, from run to run; of what is declared a number of each run
SCATTERS = np.geomspace(0.005, 20.0, 60)  # candidates: spreads of form errors, tolerances of labels
SHARES = 1.0, 0.4, 0.1  # of a step of a run's own values, until the exact posterior gains
LEAST_DAMPING, MORE_DAMPING, MOST_DAMPING = 0.01, 4.0, 1e6  # of the curvature, number by number; times, a step
MOST_MOVED = 2.0  # spreads of a number a round
DAMPINGS = 8  # tried at most, from the least on that keeps steps short
UNSEEN = 1e-3  # curvature that is damped where runs say nothing
CONVERGED_GAIN = 0.5  # of -2 log posterior: no further round
CONVERGED_SCALE = 0.05  # e-folds of what is left, by which it changes no more
TINY = 1e-300  # of a square: none
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
    scatter: Scatter

    def expansions(self, keep: bool = False, keep_filter: bool = False) -> list[Expansion]:
        """Every run about its own values; keep, keep_filter: as in `expand`."""
        observer, horizon = self.observer, self.observer.horizon
        return observer.each_run(
            lambda n: expand(observer, n, self.nuisance, self.own[n], self.errors, horizon, keep, keep_filter)
        )

    def led_at_levels(self, say: Callable[[str], None]) -> "RunsFit":
        """The fit led on until it rests in what runs share, each run at its own level of errors.

        A model that is far off may tumble where the vehicle did not. Of a run whose errors all are larger by a factor
        of its own the logarithm counts, so that the other runs lead on.
        """
        fit = replace(self)
        for _ in range(SHARED_ROUNDS):
            weighted, warm, level = fit.at_levels()
            if fit.stepped(warm, weighted, level, say):
                break
        return fit

    def led_with_differences(self, say: Callable[[str], None]) -> "RunsFit":
        """The fit led on until it rests, how runs differ learned, and what the form of the model cannot do.

        Errors of each run are as large as its own weather has them (`own_levels`): a rough day outweighs no calm one.
        """
        fit, learned = replace(self), 0 if len(self.own) >= MIN_SCATTER_RUNS else SCATTER_ROUNDS
        fit.errors = replace(fit.errors, levels=own_levels(fit.expansions(), fit.errors))
        for _ in range(ROUNDS):
            found = fit.expansions(keep_filter=True)
            level = RunLevel(fit.errors, float(inflation(found)[-1]), 0.0)
            warm = [one.tempered(level.eta) for one in found]
            if learned < SCATTER_ROUNDS:
                fit.V = with_form_errors([marginalised(one, fit.scatter) for one in warm], fit.V, fit.nuisance)
                scatter, _ = learn_scatter_together(warm, fit.V, fit.usual, by_channel(found))
                fit.scatter = scatter if learned == 0 else fit.scatter.half_way(scatter)
                learned += 1
            rests = fit.stepped(warm, found, level, say)
            before, fit.errors = fit.errors, replace(fit.errors, levels=own_levels(found, fit.errors))
            still = np.abs(np.log(fit.errors.levels / before.levels)).max() < CONVERGED_SCALE
            if rests and still and learned == SCATTER_ROUNDS:
                break
        return fit

    def at_levels(self) -> tuple[list[Expansion], list[Expansion], RunLevel]:
        """Every run at its own level of errors, as it is and tempered."""
        found = self.expansions(keep_filter=True)
        scatter = level_scatter(level_logs(found, self.errors))
        plain = RunLevel(self.errors, 1.0, scatter)
        weighted = [one.weighted(plain.share(one)) for one in found]
        level = RunLevel(self.errors, float(inflation(weighted)[-1]), scatter)
        return weighted, [level.of(one.tempered(level.eta)) for one in found], level

    def held_out(self, every: Pooled, others: Sequence[Pooled]) -> np.ndarray:
        """Gaps (runs, outputs), in tolerances, of every run by a model of the others (`left_out`), to first order."""
        observer, found = self.observer, list[np.ndarray]()
        for n, one in enumerate(others):
            values = np.clip(self.values + one.mean() - every.mean(), *self.limits)
            point = moved(observer.declared, observer.point, self.nuisance, values)
            found.append(observer.gaps(n, point, observer.horizon))
        return np.array(found)

    def left_out_gaps(self) -> np.ndarray:
        """Gaps (runs, outputs), in tolerances, of every run by a model of the others, as this fit has them."""
        found = self.expansions()
        eta = float(inflation(found)[-1])
        warm = [marginalised(one.tempered(eta), self.scatter) for one in found]
        return self.held_out(Pooled.of(warm, self.V), left_out(warm, self.V))

    def stepped(
        self, warm: Sequence[Expansion], found: Sequence[Expansion], level: RunLevel, say: Callable[[str], None]
    ) -> bool:
        """One step, in place, by runs tempered (`warm`); what they leave counts as in `found`. Whether it rests."""
        search = LineSearch(self.observer, self.nuisance, warm, self.scatter, level.eta, self.V, self.limits,
                            self.errors, self.observer.horizon, level=level)  # fmt: skip
        pooled = Pooled.of([marginalised(one, self.scatter) for one in warm], self.V)
        self.values, self.own, gain = search.along(self.values, self.own, pooled)
        before, scales = self.errors.scales, left_by(found, self.errors).scales
        self.errors = replace(self.errors, scales=scales)  # channels' own inflation is for what is asked later
        left = np.sqrt(np.mean(scales**2))
        say(f"gain {gain:.1f}, {left:.2f} tolerances left, inflation {level.eta:.0f}")
        return bool(gain < CONVERGED_GAIN and np.abs(np.log(scales / before)).max() < CONVERGED_SCALE)


def level_logs(found: Sequence[Expansion], errors: ChannelErrors) -> np.ndarray:
    """Logarithms (runs,) of the mean squares that runs leave, at no level of their own."""
    mean = [one.squares.sum() / max(1, one.samples.sum()) for one in found]
    return np.log(np.maximum(mean, TINY)) + 2.0 * np.log([errors.level(n) for n in range(len(found))])


def level_scatter(logs: np.ndarray) -> float:
    """1 sigma from run to run of `level_logs`."""
    return float(logs.std(ddof=1)) if len(logs) > 1 else HEALTHY.run_scale


def weather_scatter(logs: np.ndarray, counts: np.ndarray) -> float:
    """What of that is runs' own weather: beyond what so many independent errors, counts (runs,), make the logarithm of
    a mean square differ by (chi-squared: 2 / count), and what runs usually differ by, flown one way or another."""
    usual = float(np.mean(2.0 / counts)) + HEALTHY.run_scale**2
    return float(np.sqrt(max(level_scatter(logs) ** 2 - usual, 0.0)))


def damped_steps(pooled: Pooled, values: np.ndarray) -> Iterator[np.ndarray]:
    """Steps (k,) to the most probable shared values, damped as Marquardt has it more and more, from that on in which no
    value moves further than MOST_MOVED."""
    damping, of = 0.0, np.diag(pooled.H) + UNSEEN
    for _ in range(DAMPINGS):
        while True:
            near = replace(pooled, H=pooled.H + damping * np.diag(of), r=pooled.r + damping * of * values)
            step, damping = near.mean() - values, max(MORE_DAMPING * damping, LEAST_DAMPING)
            if np.abs(step).max(initial=0.0) <= MOST_MOVED or damping > MOST_DAMPING:
                break
        yield np.clip(step, -MOST_MOVED, MOST_MOVED)


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

            V = at(max(SCATTERS, key=score))
    return V


def by_channel(found: Sequence[Expansion]) -> np.ndarray:
    """Curvature (y, k, k) of a run by channel, the mean."""
    return np.asarray(np.mean([one.by_channel for one in found], axis=0))


def left_out(found: Sequence[Parabola], V: np.ndarray) -> list[Pooled]:
    """What the other runs say, of each run; a single one's others are itself."""
    return [Pooled.of([*found[:n], *found[n + 1 :]] or found, V) for n in range(len(found))]


def left_by(found: Sequence[Expansion], errors: ChannelErrors) -> ChannelErrors:
    """What runs leave, channel by channel, where they were expanded; `errors`: in what they were counted."""
    squares = np.sum([one.gap_squares / errors.level(n) ** 2 for n, one in enumerate(found)], axis=0)
    samples = np.sum([one.samples for one in found], axis=0)
    scales = np.where(samples > 0, np.sqrt(squares / np.maximum(samples, 1)), errors.scales)
    return replace(errors, scales=np.maximum(scales, LEAST_SCALE), inflation=inflation(found)[:-1])


def own_levels(found: Sequence[Expansion], errors: ChannelErrors) -> np.ndarray:
    """By how much the errors of runs (runs,) are larger than a usual run's, the most probable."""
    logs, plain = level_logs(found, errors), RunLevel(errors, float(inflation(found)[-1]), 0.0)
    counts = np.maximum([plain.count(one) for one in found], 1.0)
    by, about = RunLevel(errors, 1.0, weather_scatter(logs, counts), -np.inf), np.exp(logs - logs.mean())
    return np.exp(0.5 * np.array([by.log_level(*one) for one in zip(counts * about, counts, strict=True)]))


@dataclass
class LineSearch:
    """The exact posterior along a step of the shared values; windows begun by the filter's gains where runs are
    expanded, if these are kept, else by those of each place. A place that is worse by its own is searched by these."""

    observer: Observer
    nuisance: list[Effect]
    warm: Sequence[Expansion]
    scatter: Scatter
    eta: float
    V: np.ndarray
    limits: tuple[np.ndarray, np.ndarray]
    errors: ChannelErrors
    horizon: float
    first: int = 0  # run of the observer that `warm` begins with
    level: RunLevel | None = None  # of the runs' own errors, where they have one

    def prior(self, x: np.ndarray, own: np.ndarray) -> float:
        free = np.diag(self.V) > 0.0
        return float(self.apart(x, own).sum() + x[free] @ np.linalg.solve(self.V[np.ix_(free, free)], x[free]))

    def apart(self, x: np.ndarray, own: np.ndarray) -> np.ndarray:
        """-2 log prior density (runs,) of runs' own values (runs, k) about shared ones."""
        return self.scatter.distance(own - x)

    def misfit(self, n: int, row: np.ndarray) -> float:
        point = moved(self.observer.declared, self.observer.point, self.nuisance, row)
        flown = self.first + n
        by = self.warm[n].filtered or self.observer.filter(flown, point)
        error = self.observer.residuals(flown, [point], by, self.horizon)[0]
        squares = float(self.errors.misfit(flown, error)) / self.eta
        return squares if self.level is None else self.level.value(squares, self.level.count(self.warm[n]))

    def along(self, values: np.ndarray, own: np.ndarray, pooled: Pooled | None) -> tuple[np.ndarray, np.ndarray, float]:
        """Values, runs' own values and the gain of a step, damped until the exact posterior gains; without the runs
        pooled, of their own values alone."""
        x, theirs, gain = self._along(values, own, pooled)
        if all(one.filtered is None for one in self.warm):
            return x, theirs, gain
        anew = replace(self, warm=[replace(one, filtered=None) for one in self.warm])
        before = sum(one.value for one in self.warm) + self.prior(values, own)
        if anew.cost(x, theirs) <= before + CONVERGED_GAIN:
            return x, theirs, gain
        return anew.along(values, own, pooled)

    def cost(self, x: np.ndarray, theirs: np.ndarray) -> float:
        """-2 log posterior of shared values x (k,) and runs' own (runs, k)."""
        return sum(self.observer.each(lambda n: self.misfit(n, theirs[n]), range(len(theirs)))) + self.prior(x, theirs)

    def _along(
        self, values: np.ndarray, own: np.ndarray, pooled: Pooled | None
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """`along`, by the filters that it has."""
        rooms, shares = [room(np.sqrt(one.reach)) for one in self.warm], np.full((len(own), 1), SHARES[0])

        def led(x: np.ndarray) -> np.ndarray:
            steps = np.array([run_values(one, x, self.scatter) for one in self.warm]) - own
            theirs = own + shares * np.array([shortened(*one) for one in zip(steps, rooms, strict=True)])
            return np.clip(np.where(self.scatter.sizes > 0.0, theirs, x), *self.limits)

        costs, stay = np.array([one.value for one in self.warm]) + self.apart(values, own), own.copy()
        before = float(costs.sum()) + self.prior(values, own[:0])
        worse = np.arange(len(own))
        for share in SHARES:
            shares[worse] = share
            tried = led(values)
            misfits = self.observer.each(lambda one: self.misfit(*one), [(n, tried[n]) for n in worse])
            found = np.array(misfits) + self.apart(values, tried[worse])
            better = worse[found < costs[worse]]
            costs[worse], stay[better] = np.minimum(found, costs[worse]), tried[better]
            worse = np.setdiff1d(worse, better)
        here = float(costs.sum()) + self.prior(values, own[:0]), values, stay
        best = here
        for step in damped_steps(pooled, values) if pooled is not None else ():
            x = np.clip(values + step, *self.limits)
            theirs = led(x)
            cost = self.cost(x, theirs)
            if cost < best[0]:
                best = cost, x, theirs
            elif best is not here:
                break
        return best[1], best[2], before - best[0]
