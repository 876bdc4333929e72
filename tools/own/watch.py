"""What changed over the runs of a user's vehicle: labels over spans of runs, beside what all runs share.

The model is that of hierarchy.py with effects over spans: x_n = s + d_n + sum of c over the spans that n lies in. What
is shared is learned from the runs of the reference (or the first runs) and the vehicle file. Events are added one by
one, the most evident first, each relinearised in the runs of its span, until the next is not probable.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.data.intervals import NINETY
from glider.tools.inference.pooled import Pooled, learn_scatter, run_values
from glider.tools.own.decision import (
    FORM_SHARES,
    LEAST_REACH,
    MATERIAL,
    SIZES,
    Healthy,
    Hypothesis,
    log_odds,
    strangeness,
    usual_share,
)
from glider.tools.own.effects import FORM, PUSH
from glider.tools.own.healthy import healthy_of
from glider.tools.own.hierarchy import Expansion
from glider.tools.own.identify import CONVERGED_GAIN, MIN_SCATTER_RUNS, SCATTER_ROUNDS, LineSearch, damped_step
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observer import Observer, observer_of
from glider.tools.own.posterior import AT_REST, LONGEST_MOVE, LONGEST_REACH, STRONG_LEFT, Engine, under_priors
from glider.tools.own.runs import OwnRun
from glider.tools.own.sessions import Session, SessionRuns, of_another, split
from glider.tools.own.watched import CERTAIN, Event, Watched

LEARNED = 4  # first runs, from which a watch without a reference learns
CHANGE = 0.3  # prior probability that anything changed over the runs
CHANGE_ODDS = float(np.log(CHANGE / (1.0 - CHANGE)))
NEW_SESSION = 0.5  # prior probability that they are not all of one session
TO_THE_END = 0.5  # of spans: that a change is still there in the last run
WITH_SESSION = 0.5  # of changes: that they begin with a session, where one begins
MOST_EVENTS = 4
REFITTED, SPANS = 5, 4  # labels, of the best spans, whose parabolas are taken where they lead to
UNLIKELY = 7.0  # nat behind the best by the parabola there: not taken
OWN_ROUNDS, CONVERGED_OWN = 5, 0.1  # of a run's own values, spreads
LED_ROUNDS, PREPARED = 8, 20
SHOWN = 3  # numbers that a session differs by


Warm = dict[int, tuple[np.ndarray, np.ndarray]]  # run: most probable values (k,) last, and those about which


@dataclass(frozen=True)
class Led:
    """Where a label over a span, and another session, are most probable."""

    sessions: Sequence[Session]
    pooled: Sequence[SessionRuns]  # their runs expanded there
    size: float  # spreads
    log_density: float  # of the posterior there


@dataclass(frozen=True)
class Refit:
    """An event where it is most probable, its log odds against what is known, and sessions with it."""

    score: float
    event: Event
    sessions: Sequence[Session]


class Watch(Engine):
    """Events over the runs of one observer: the first `learned` are the reference's."""

    def __init__(
        self, observer: Observer, healthy: Healthy, learned: int, say: Callable[[str], None] = lambda text: None
    ):
        super().__init__(observer, healthy, say)
        self.learned = learned
        self.named = sum(one.family not in (PUSH, FORM) for one in healthy.effects)

    def prepare(self) -> None:
        """Every run about where it lies, with what the reference says of all; how runs differ, learned from it too.

        Of what runs share they say less than their likelihood has it, by `run_inflation`: for where the shared values
        are most probable that is as good as a prior so much narrower.
        """
        every, columns, healthy = np.arange(self.k), self.columns(), self.healthy
        known_from = healthy.runs if healthy.runs >= MIN_SCATTER_RUNS else 0
        V = self.together.V / healthy.run_inflation
        shared, own = np.zeros(self.k), np.zeros((self.learned, self.k))
        for round_ in range(PREPARED):
            found = [self.expansion_of(n, own[n], columns) for n in range(self.learned)]
            if self.learned > 2 and round_ < SCATTER_ROUNDS:
                scatter = learn_scatter(found, self.together.V, healthy.scatter, learned_from=known_from)
                self.together = replace(self.together, scatter=scatter)
            pooled = Pooled.of(self.together.marginal(found), V)
            search = LineSearch(self.observer, healthy.effects, found, self.together.scatter, healthy.eta, V,
                                (self.low, self.high), healthy.errors, self.horizon, 0, self.level)  # fmt: skip
            shared, own, gain = search.along(shared, own, damped_step(pooled, shared))
            if gain < CONVERGED_GAIN and round_ >= SCATTER_ROUNDS:
                break
        later = [self.about(n, shared, shared, columns).at for n in range(self.learned, self.count)]
        self.found = self.expansions(np.array([*own, *later]), every)
        self.reach = np.sqrt(np.mean([one.reach for one in self.found], axis=0))
        self.runs = self.together.marginal(self.found)
        known = [one.tempered(healthy.run_inflation) for one in self.runs[: self.learned]]
        M = Pooled.of(known, self.together.V).covariance()
        self.events, self.sessions = list[Event](), [Session(self.learned, self.count, shared, M, shared)]
        self.another = of_another(known, healthy.V, healthy.session)

    def about(
        self, n: int, around: np.ndarray, begin: np.ndarray, columns: np.ndarray, keep: bool = False
    ) -> Expansion:
        """Run n expanded in some columns about its most probable values by the exact likelihood, led from `begin` (k,);
        around: those that it is thought to have; keep: with its derivatives."""
        healthy, scatter, own = self.healthy, self.together.scatter, np.clip(begin, self.low, self.high)
        free = np.flatnonzero(scatter)
        for _ in range(OWN_ROUNDS):
            found = self.expansion_of(n, own, free)
            search = LineSearch(self.observer, healthy.effects, [found], scatter, healthy.eta, self.together.V,
                                (self.low, self.high), healthy.errors, self.horizon, n, self.level)  # fmt: skip
            _, (moved_own,), _ = search.along(around, own[None], np.zeros(self.k))
            if np.abs(moved_own - own).max() < CONVERGED_OWN:
                break
            own = moved_own
        return self.expansion_of(n, own, columns, keep)

    def near(self, n: int, around: np.ndarray, begin: np.ndarray, columns: np.ndarray, one: Expansion) -> Expansion:
        """The same by the derivatives of an expansion that has kept them, errors flown at every place."""
        own, best, share = np.clip(begin, self.low, self.high), None, 1.0
        for _ in range(OWN_ROUNDS):
            found = self.followed(n, own, columns, one)
            cost = found.value + float((((own - around) / np.maximum(self.together.scatter, 1e-6)) ** 2).sum())
            if best is not None and cost > best[0]:
                share *= 0.5
            else:
                best = cost, found
                move = run_values(found, around, self.together.scatter) - own
                step = np.clip(move, -LONGEST_MOVE, LONGEST_MOVE)
                if np.abs(step).max() < CONVERGED_OWN:
                    break
            own = np.clip(best[1].at + share * step, self.low, self.high)
        assert best is not None
        return best[1]

    def session_of(self, n: int, sessions: Sequence[Session]) -> Session:
        return next(one for one in sessions if one.first <= n < one.end)

    def of_events(self, n: int) -> np.ndarray:
        """What events add to the values (k,) of run n."""
        x = np.zeros(self.k)
        for one in self.events:
            if one.first <= n < one.end:
                x[self.healthy.at([one.label])[0]] += one.size
        return x

    def at_run(self, n: int, sessions: Sequence[Session]) -> np.ndarray:
        """Values (k,) that run n is thought to have: its session's and its events'."""
        return self.session_of(n, sessions).values + self.of_events(n)

    def again(
        self, n: int, sessions: Sequence[Session], columns: np.ndarray, label: int, size: float, warm: Warm,
        kept: dict[int, Expansion],
    ) -> Expansion:  # fmt: skip
        """Run n expanded again where it is, or was last, with a label of a size (spreads) beside its events.

        kept: runs' last expansions with derivatives, which serve for another place.
        """
        around = self.at_run(n, sessions)
        around[label] = np.clip(around[label] + size, self.low[label], self.high[label])
        at, before = warm.get(n) or (self.found[n].at, self.at_run(n, self.sessions))
        begin = at + around - before
        if n in kept:
            found = self.near(n, around, begin, columns, kept[n])
        else:
            found = kept[n] = self.about(n, around, begin, columns, keep=True)
        warm[n] = found.at, around
        return found

    def pooled(self, sessions: Sequence[Session], runs: dict[int, Expansion] | None = None) -> list[SessionRuns]:
        """Runs by session, what events add taken off; runs: others than those that are known, deviations in them."""
        runs, found = runs or {}, []
        for session in sessions:
            own = [runs.get(n, self.runs[n]) for n in range(session.first, session.end)]
            own = [replace(one, at=one.at - self.of_events(session.first + n)) for n, one in enumerate(own)]
            found.append(SessionRuns.of(session, own))
        return found

    def scored(self, spans: Sequence[tuple[int, int]], sessions: Sequence[Session]) -> np.ndarray:
        """Log evidence (spans, labels) of every label over every span; -inf where nothing moves."""
        pooled, found = self.pooled(sessions), np.full((len(spans), self.k), -np.inf)
        for row, (first, end) in enumerate(spans):
            found[row], _ = self.label_gains(*summed(one.alone(first, end) for one in pooled))
        return found

    def span_prior(self, first: int, end: int, sessions: Sequence[Session]) -> float:
        """Log prior probability that a change is over these runs: half of all last to the last run, and half of those
        for which a session begins among the runs begin with one."""
        count, starts = self.count - self.learned, {one.first for one in sessions[1:]}
        begin = 1.0 / count
        if starts:
            begin = (
                WITH_SESSION / len(starts) if first in starts else (1.0 - WITH_SESSION) / max(1, count - len(starts))
            )
        if end == self.count:
            return float(np.log(begin * TO_THE_END))
        return float(np.log(begin * (1.0 - TO_THE_END) / max(1, self.count - first - 1)))

    def session_gain(self, pooled: Sequence[SessionRuns], sessions: Sequence[Session]) -> float:
        """Log posterior odds of sessions, their runs pooled, against those that are known."""
        gain = log_evidence(pooled) - log_evidence(self.pooled(self.sessions))
        return gain + self.session_prior(sessions)

    def session_prior(self, sessions: Sequence[Session]) -> float:
        """Log prior odds of sessions against those that are known, which run they begin with equally probable."""
        each = np.log(NEW_SESSION / (1.0 - NEW_SESSION) / max(1, self.count - self.learned))
        return float((len(sessions) - len(self.sessions)) * each)

    def begun(self, sessions: Sequence[Session]) -> int | None:
        """The run from which on there is another session than those that are known."""
        known = [one.first for one in self.sessions[1:]]
        return next((one.first for one in sessions[1:] if one.first not in known), None)

    def expanded(self, sessions: Sequence[Session]) -> Sequence[Session]:
        """Sessions, the new one of them about what its runs say of it by the parabola."""
        new = self.begun(sessions)
        return [replace(one, values=self.pooled([one])[0].given(0, 0, 0, 0.0))
                if new is not None and one.first == new and one.end > new else one for one in sessions]  # fmt: skip

    def others(self) -> list[tuple[float, Sequence[Session]]]:
        """Sessions with another one from each run on where none begins, and their log odds by the parabola."""
        tried = [split(self.sessions, n, *self.another) for n in range(self.learned, self.count)]
        return [(self.session_gain(self.pooled(one), one), one) for one in tried if len(one) > len(self.sessions)]

    def new_session(self, others: Sequence[tuple[float, Sequence[Session]]]) -> tuple[float, Sequence[Session]]:
        """The likeliest of further sessions, where it is most probable: its log odds."""
        if not others:
            return -np.inf, self.sessions
        _, likeliest = max(others, key=lambda one: one[0])
        at = self.led((0, 0), self.expanded(likeliest))
        return self.session_gain(at.pooled, at.sessions), at.sessions

    def search(self) -> None:
        """Events and sessions, the most evident first."""
        spans = [(a, b) for a in range(self.learned, self.count) for b in range(a + 1, self.count + 1)]

        def prior(some: Sequence[tuple[int, int]], sessions: Sequence[Session]) -> np.ndarray:
            return np.array([self.span_prior(*span, sessions) for span in some])[:, None] - np.log(self.named)

        while spans and len(self.events) < MOST_EVENTS:
            others = self.others()
            other, with_other = self.new_session(others)
            # a label alone over every span, and beside another session that begins with it
            tables: list[tuple[Sequence[Session], list[tuple[int, int]], np.ndarray]]
            tables = [(self.sessions, spans, self.scored(spans, self.sessions) + prior(spans, self.sessions))]
            for gain, further in others:
                first = self.begun(further)
                own = [span for span in spans if span[0] == first]
                tables.append((further, own, self.scored(own, further) + prior(own, further) + gain))
            ranked = sorted(((float(scores[row].max()), t, row) for t, (_, own, scores) in enumerate(tables)
                             for row in range(len(own))), reverse=True)  # fmt: skip
            found, any_change = list[Refit](), logsumexp(np.concatenate([scores.ravel() for *_, scores in tables]))
            for _, t, row in ranked[:SPANS] if any_change + CHANGE_ODDS > 0.0 else ():
                theirs, own, scores = tables[t]
                found += self.compared(own[row], self.expanded(theirs), scores[row])
            total = float(logsumexp([one.score for one in found])) + CHANGE_ODDS if found else -np.inf
            if total > other:
                taken, chances = self.decided(found)
                best = taken.event
                best.probability = float(1.0 / (1.0 + np.exp(-np.clip(total - np.logaddexp(0.0, other), -50.0, 50.0))))
                best.chances = {label: best.probability * chance for label, chance in chances.items()}
                reach = self.reach[self.healthy.at([best.label])[0]]
                if best.probability >= CERTAIN and abs(best.size) * reach >= MATERIAL:
                    self.say(f"{best.label} from {self.name(best.first)} to {self.name(best.end - 1)}: {total:.1f} nat")
                    self.take(taken.sessions, best)
                    continue
            if other <= 0.0:
                break
            self.say(f"another session from {self.name(self.begun(with_other) or 0)} on: {other:.1f} nat")
            self.take(with_other)

    def name(self, n: int) -> str:
        return self.observer.runs[n].name

    def compared(self, span: tuple[int, int], sessions: Sequence[Session], scores: np.ndarray) -> list[Refit]:
        """Labels over a span, each refitted where it leads."""
        starts, runs = {int(k): 0.0 for k in np.argsort(scores)[::-1][:REFITTED]}, range(*span)
        if np.sqrt(np.mean([self.left(n) for n in runs])) > STRONG_LEFT:
            starts |= dict(self.strong_sizes(runs)[:REFITTED])
        found = [self.refit(span, k, start, sessions) for k, start in starts.items()]
        return found + self.swapped(max(found, key=lambda one: one.score), found)

    def decided(self, found: Sequence[Refit]) -> tuple[Refit, dict[str, float]]:
        """The event that is most probable of labels over spans, one of which it is, and the chance of each label: a
        label where labels together are more probable than a force that none has; the span that is best for it."""
        effects, total = {one.label: one for one in self.healthy.effects}, logsumexp([one.score for one in found])
        chances: dict[str, float] = {}
        for one in found:
            chances[one.event.label] = chances.get(one.event.label, 0.0) + float(np.exp(one.score - total))
        forces = {label for label in chances if effects[label].family == PUSH}
        named = sum(chance for label, chance in chances.items() if label not in forces)
        among = [label for label in chances if (label in forces) == (named < 0.5)]
        label = max(among, key=lambda label: chances[label])
        return max((one for one in found if one.event.label == label), key=lambda one: one.score), chances

    def swapped(self, best: Refit, refitted: Sequence[Refit]) -> list[Refit]:
        """Labels in an event's place that come nearest to it where it leads, refitted."""
        span, every, warm = (best.event.first, best.event.end), np.arange(self.k), Warm()
        (place,) = self.healthy.at([best.event.label])
        runs = [self.again(n, best.sessions, every, place, best.event.size, warm, {}) for n in range(*span)]
        there = dict(zip(range(*span), self.together.marginal(runs), strict=True))
        gain, size = self.label_gains(*summed(one.alone(*span) for one in self.pooled(best.sessions, there)))
        likely = gain > gain[place] - UNLIKELY
        likely[self.healthy.at([one.event.label for one in refitted])] = False
        return [self.refit(span, int(k), float(size[k]), best.sessions)
                for k in np.argsort(-np.where(likely, gain, -np.inf))[:REFITTED] if likely[k]]  # fmt: skip

    def led(
        self, span: tuple[int, int], sessions: Sequence[Session], label: int = 0, size: float = 0.0,
        target: Callable[[Sequence[SessionRuns], float], tuple[float, float]] = lambda pooled, size: (0.0, 1.0),
    ) -> Led:  # fmt: skip
        """A label over a span and the new one of sessions led to where both are most probable.

        size: where the label begins; target: mean and 1 sigma of it by the parabola about a place. A step is halved
        until the posterior does not fall: the parabola says where to go, the likelihood whether it is better there.
        """
        new, columns = self.begun(sessions), self.columns([label])
        moved = sorted({*range(*span), *(n for n in range(self.learned, self.count)
                                         if self.session_of(n, sessions).first == new)})  # fmt: skip
        best, warm, kept, at_rest = None, Warm(), dict[int, Expansion](), False
        for round_ in range(LED_ROUNDS):
            if at_rest or round_ == LED_ROUNDS - 1:  # derivatives serve on the way, evidence is taken where they are
                best, kept = None, {}
            anew = not kept
            if size == 0.0 and new is None:
                runs = {}
            else:
                again = [self.again(n, sessions, columns, label, size, warm, kept) for n in moved]
                runs = dict(zip(moved, self.together.marginal(again), strict=True))
            pooled = self.pooled(sessions, runs)
            density = sum(one.log_density(*span, label, size) for one in pooled)
            gain = np.inf if best is None else density - best.log_density
            if best is not None and gain < -AT_REST:
                size = 0.5 * (size + best.size)
                sessions = [replace(one, values=0.5 * (one.values + other.values)) if one.first == new else one
                            for one, other in zip(sessions, best.sessions, strict=True)]  # fmt: skip
                continue
            best = Led(sessions, pooled, size, density)
            mean, sd = target(pooled, size)
            room = max(LONGEST_MOVE, LONGEST_REACH / max(self.reach[label], LEAST_REACH))
            step = float(np.clip(np.clip(mean, self.low[label], self.high[label]) - size, -room, room))
            at_rest = abs(step) < sd if at_rest or gain < AT_REST else new is None and abs(step) < 0.1 * sd
            if at_rest and anew:
                break
            if not at_rest and round_ < LED_ROUNDS - 1:
                size += step
                sessions = [replace(one, values=each.given(*span, label, size)) if one.first == new else one
                            for one, each in zip(sessions, pooled, strict=True)]  # fmt: skip
        assert best is not None
        return best

    def left(self, n: int) -> float:
        """Mean square that a run leaves about where it was expanded, in units of what healthy runs leave."""
        return float(self.found[n].squares.sum() / max(1, self.found[n].samples.sum()))

    def take(self, sessions: Sequence[Session], event: Event | None = None) -> None:
        """Sessions and an event into what is known: runs that they move are expanded again where they are now."""
        moved = [n for n in range(self.learned, self.count)
                 if self.session_of(n, sessions).values is not self.session_of(n, self.sessions).values
                 or (event is not None and event.first <= n < event.end)]  # fmt: skip
        before = {n: self.at_run(n, self.sessions) for n in moved}
        self.sessions = list(sessions)
        if event is not None:
            self.events.append(event)
        for n in moved:
            around = self.at_run(n, self.sessions)
            self.found[n] = self.about(n, around, self.found[n].at + around - before[n], np.arange(self.k))
            (self.runs[n],) = self.together.marginal([self.found[n]])

    def refit(self, span: tuple[int, int], k: int, start: float, sessions: Sequence[Session]) -> Refit:
        """A label over a span where it is most probable: log odds against what is known, and the event."""
        effect, healthy, where = self.healthy.effects[k], self.healthy, np.arange(self.k) == k
        none = np.zeros((self.k, self.k))
        varied = np.array([k, *(force for force in self.forces if force != k)])

        def parabola(pooled: Sequence[SessionRuns], size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            d = np.array([self.variance(none, [k], [tolerances], size * where, form)[varied, varied]
                          for tolerances, form in product(SIZES.tolist(), FORM_SHARES)])  # fmt: skip
            return *summed(one.beside(*span, varied) for one in pooled), d

        def target(pooled: Sequence[SessionRuns], size: float) -> tuple[float, float]:
            return size_posterior(*parabola(pooled, size), effect.one_sided)[1:]

        at = self.led(span, sessions, k, start, target)
        slope, precision, d = parabola(at.pooled, at.size)
        evidence = log_evidence(at.pooled)
        nat, mean, sd = size_posterior(slope, precision, d, effect.one_sided)
        if abs(mean - at.size) > sd:  # the likelihood does not follow: the label's evidence is that where it is
            evidence += float((slope[0] - precision[0, 0] * at.size) * at.size)
            nat, mean, sd = size_posterior(precision[0, :1] * at.size, precision[:1, :1], d[:, :1], effect.one_sided)
        mean = float(np.clip(mean, self.low[k], self.high[k]))
        usual = usual_share(healthy, k, float(self.reach[k]), mean, sd, span[1] - span[0])
        prior = self.span_prior(*span, at.sessions) - np.log(self.named) + log_odds(effect)
        score = evidence + nat - log_evidence(self.pooled(self.sessions)) - usual + prior
        event = Event({}, *span, effect.label, mean, sd, 0.0)
        return Refit(score + self.session_prior(at.sessions), event, at.sessions)

    def judge(self) -> np.ndarray:
        """Probability of each run to have more left than healthy ones and its events say."""
        found = np.zeros(self.count)
        for n in range(self.learned, self.count):
            labels = tuple(event.label for event in self.events if event.first <= n < event.end)
            one = Hypothesis(labels, 0.0, np.zeros(0), np.zeros(0), np.zeros(self.k), np.zeros((1, self.k)),
                             np.array([self.left(n)]))  # fmt: skip
            found[n] = strangeness(self.healthy, one, one)
        return found

    def differences(self) -> list[dict[str, Any]]:
        """Sessions of the runs that are watched, and what each differs by from the reference most clearly."""
        first, found = self.sessions[0], []
        for one in self.pooled(self.sessions[1:]):
            value, sd = one.session.mean + one.mean - first.values, np.sqrt(np.maximum(np.diag(one.M + first.V), 0.0))
            clear = np.abs(value) / np.hypot(sd, np.maximum(self.together.scatter, 1e-9))
            rows = []
            for k in np.argsort(-np.where(self.healthy.session > 0.0, clear, 0.0))[:SHOWN]:
                effect = self.healthy.effects[k]
                low, high = ((value[k] + side * NINETY * sd[k]) * effect.spread for side in (-1.0, 1.0))
                rows.append({"name": effect.label, "difference": float(value[k] * effect.spread),
                             "ci90": [float(low), float(high)], "unit": effect.unit})  # fmt: skip
            found.append({"from_run": self.name(one.session.first), "differences": rows})
        return found


def log_evidence(pooled: Sequence[SessionRuns]) -> float:
    """Of all sessions' runs, without a label."""
    return sum(one.pooled.log_evidence() for one in pooled)


def summed(parts: Iterable[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Slopes and precisions of a label in some sessions, together; precisions of single labels not below 0."""
    slopes, precisions = zip(*parts, strict=True)
    precision = np.sum(precisions, axis=0)
    return np.sum(slopes, axis=0), np.maximum(precision, 0.0) if precision.ndim == 1 else precision


def size_posterior(
    slope: np.ndarray, precision: np.ndarray, variances: np.ndarray, one_sided: bool
) -> tuple[float, float, float]:
    """Log evidence of a label's size over none, its mean and 1 sigma, of the most probable of its priors.

    slope (v,), precision (v, v) of the label and what may stand beside it; variances (priors, v), equally probable.
    """
    nat, S = under_priors(slope, precision, variances)
    mean, sd = S[:, 0] @ slope, np.sqrt(np.maximum(S[:, 0, 0], 1e-30))
    if one_sided:
        nat = nat + np.log(2.0) + norm.logcdf(mean / sd)
    best = int(np.argmax(nat))
    return float(logsumexp(nat) - np.log(len(nat))), float(mean[best]), float(sd[best])


def watch(
    vehicle: LoadedVehicle, runs: Sequence[OwnRun], reference: Sequence[OwnRun] = (),
    say: Callable[[str], None] = lambda text: None,
) -> Watched:  # fmt: skip
    """What changed over runs in their order; reference: healthy runs before them, else the first are."""
    cautions = []
    learned = len(reference) if reference else min(LEARNED, max(1, len(runs) - 1))
    if not reference:
        cautions.append(f"the first {learned} runs are taken for healthy: --reference names others")
    observer = observer_of(vehicle, [*reference, *runs])
    healthy = healthy_of(observer)
    if vehicle.file.identified is None:
        cautions.append("the vehicle file is not identified: how runs differ though nothing changed is assumed")
    engine = Watch(observer, healthy, learned, say)
    engine.prepare()
    engine.search()
    strange = engine.judge()
    gaps = np.array(
        [
            np.sqrt(np.nanmean(observer.gaps(n, observer.point, observer.horizon) ** 2))
            for n in range(len(observer.runs))
        ]
    )
    drop = len(reference)
    events = [replace(one, first=one.first - drop, end=one.end - drop) for one in engine.events]
    names = [run.name for run in observer.runs[drop:]]
    learned_from = [run.name for run in observer.runs[:learned]]
    sessions = engine.differences()
    cautions += [f"another session begins with {one['from_run']}: {_said(one)}, as sessions differ" for one in sessions]
    return Watched(
        names, learned - drop, events, healthy, gaps[drop:], strange[drop:], cautions, learned_from, sessions
    )


def _said(session: dict[str, Any]) -> str:
    """What a session differs by, in words."""
    return ", ".join(f"{one['name']} {one['difference']:+.2g} {one['unit']}" for one in session["differences"])
