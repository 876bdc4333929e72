"""What changed over the runs of a user's vehicle: labels over spans of runs, beside what all runs share.

The model is that of hierarchy.py with effects over spans: x_n = s + d_n + sum of c over the spans that n lies in. What
is shared is learned from the runs of the reference (or the first runs) and the vehicle file. Events are added one by
one, the most evident first, each relinearised in the runs of its span, until the next is not probable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.special import logsumexp

from glider.tools.data.intervals import NINETY
from glider.tools.own.decision import (
    ANOTHER,
    FORM_SHARES,
    MATERIAL,
    SIZES,
    Hypothesis,
    log_odds,
    strangeness,
    usual_share,
)
from glider.tools.own.effects import FORM, UNEXPLAINED
from glider.tools.own.evidence import size_posterior
from glider.tools.own.healthy import healthy_of
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun
from glider.tools.own.sessions import Session, SessionRuns, log_evidence, summed
from glider.tools.own.strong import STRONG_LEFT, strong_sizes
from glider.tools.own.watched import CERTAIN, Event, Watched, likeliest
from glider.tools.own.watched_runs import Warm, WatchedRuns

LEARNED = 4  # first runs, from which a watch without a reference learns
CHANGE = 0.3  # prior probability that anything changed over the runs
CHANGE_ODDS = float(np.log(CHANGE / (1.0 - CHANGE)))
NEW_SESSION = 0.5  # prior probability that they are not all of one session
TO_THE_END = 0.5  # of spans: that a change is still there in the last run
WITH_SESSION = 0.5  # of changes: that they begin with a session, where one begins
MOST_EVENTS = 4
REFITTED, SPANS = 5, 4  # labels by the parabola about no label, over the best spans
UNLIKELY = 7.0  # nat behind the best by the parabola there: not refitted
SHOWN = 3  # numbers that a session differs by, labels that it may be instead
MENTIONED = 0.05  # probability that something changed where a session begins, from which its caution says so


@dataclass(frozen=True)
class Place:
    """A span of runs, sessions with it, and log odds (k,) of each label there by a parabola."""

    span: tuple[int, int]
    sessions: Sequence[Session]
    scores: np.ndarray


@dataclass(frozen=True)
class Refit:
    """An event where it is most probable, its log odds against what is known, and sessions with it; usual: nat that a
    deviation of the label as healthy runs have it brings too."""

    score: float
    event: Event
    sessions: Sequence[Session]
    usual: float


class Watch(WatchedRuns):
    """Events and sessions among the runs that are watched."""

    @property
    def named(self) -> int:
        """How many labels there are."""
        return sum(one.family not in (*UNEXPLAINED, FORM) for one in self.healthy.effects)

    @property
    def change_odds(self) -> float:
        """Log prior odds that something changed, or something else beside the events that are known."""
        return float(np.log(ANOTHER)) if self.events else CHANGE_ODDS

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
        """Log prior odds of sessions against those that are known, how far they differ; which run they begin with is
        equally probable."""
        each = np.log(NEW_SESSION / (1.0 - NEW_SESSION) / max(1, self.count - self.learned))
        times = sum(one.log_prior for one in sessions) - sum(one.log_prior for one in self.sessions)
        return float((len(sessions) - len(self.sessions)) * each + times)

    def others(self) -> list[tuple[float, Sequence[Session]]]:
        """Sessions with another one from each run on where none begins, and their log odds by the parabola."""
        tried = [self.with_another(n) for n in range(self.learned, self.count)]
        return [(self.session_gain(self.pooled(one), one), one) for one in tried if len(one) > len(self.sessions)]

    def alone(self, first: int | None) -> tuple[float, Sequence[Session]]:
        """Log odds of another session from run `first` on (None: of those that are known) by itself, led; sessions."""
        if first is not None and first not in self.led_alone:
            begun = self.with_another(first)
            led = [self.led((0, 0), one) for one in (begun, self.expanded(begun))]
            at = max(led, key=lambda one: one.log_density)
            self.led_alone[first] = self.session_gain(at.pooled, at.sessions), at.sessions
        return self.led_alone[first]

    def other_way(self, one: Refit) -> Refit | None:
        """An event refitted beside a session that begins with it, or without the one that does; None: neither."""
        first, end = span = one.event.first, one.event.end
        (k,) = self.healthy.at([one.event.label])
        if self.begun(one.sessions) is not None:
            return self.refit(span, k, one.event.size, self.sessions)
        further = self.with_another(first)
        if len(further) == len(self.sessions):
            return None
        if end < further[[each.first for each in further].index(first, 1)].end:
            return None
        return self.refit(span, k, one.event.size, self.alone(first)[1])

    def unchanged(self, found: Sequence[Refit]) -> dict[int | None, float]:
        """Log odds that nothing changed, by the run with which another session begins (None: with none), beside what
        healthy runs show of one label, as of `with_usual` in decision.py."""
        best: dict[int | None, float] = {first: gain for first, (gain, _) in self.led_alone.items()}
        for one in found:
            first = self.begun(one.sessions)
            best[first] = max(best[first], self.alone(first)[0] + one.usual)
        return best

    def search(self) -> None:
        """Events and sessions, the most evident first."""
        spans = [(a, b) for a in range(self.learned, self.count) for b in range(a + 1, self.count + 1)]

        def prior(some: Sequence[tuple[int, int]], sessions: Sequence[Session]) -> np.ndarray:
            return np.array([self.span_prior(*span, sessions) for span in some])[:, None] - np.log(self.named)

        while spans and len(self.events) < MOST_EVENTS:
            self.converge()
            self.led_alone: dict[int | None, tuple[float, Sequence[Session]]] = {None: (0.0, self.sessions)}
            others = self.others()
            if others:
                self.alone(self.begun(max(others, key=lambda one: one[0])[1]))
            other = max(gain for gain, _ in self.led_alone.values())
            # a label alone over every span, and beside another session that begins with it
            tables: list[tuple[Sequence[Session], list[tuple[int, int]], np.ndarray]]
            tables = [(self.sessions, spans, self.scored(spans, self.sessions) + prior(spans, self.sessions))]
            for gain, further in others:
                first = self.begun(further)
                own = [span for span in spans if span[0] == first]
                tables.append((further, own, self.scored(own, further) + prior(own, further) + gain))
            ranked = sorted(((float(scores[row].max()), t, row) for t, (_, own, scores) in enumerate(tables)
                             for row in range(len(own))), reverse=True)  # fmt: skip
            any_change = logsumexp(np.concatenate([scores.ravel() for *_, scores in tables])) + self.change_odds > 0.0
            places = [Place(tables[t][1][row], self.alone(self.begun(tables[t][0]))[1], tables[t][2][row])
                      for _, t, row in (ranked[:SPANS] if any_change else ())]  # fmt: skip
            found = self.compared(places, other)
            total = float(logsumexp([one.score for one in found])) + self.change_odds if found else -np.inf
            other_way = self.other_way(max(found, key=lambda one: one.score)) if found else None
            unchanged = self.unchanged([*found, other_way] if other_way else found)
            most = float(logsumexp(list(unchanged.values())))
            none = unchanged.pop(None)
            if total > max(unchanged.values(), default=-np.inf):
                taken, chances = self.decided(found)
                best = taken.event
                best.probability = float(1.0 / (1.0 + np.exp(-np.clip(total - most, -50.0, 50.0))))
                best.chances = {label: best.probability * chance for label, chance in chances.items()}
                reach = self.reach[self.healthy.at([best.label])[0]]
                if best.probability >= CERTAIN and abs(best.size) * reach >= MATERIAL:
                    self.say(f"{best.label} from {self.name(best.first)} to {self.name(best.end - 1)}: {total:.1f} nat")
                    self.take(taken.sessions, best)
                    continue
            first = max(unchanged, key=lambda first: unchanged[first], default=None)
            if first is None or unchanged[first] <= none:
                break
            self.say(f"another session from {self.name(first)} on: {unchanged[first] - none:.1f} nat")
            there = [replace(one, score=one.score + self.change_odds - np.logaddexp(most, total))
                     for one in found if one.event.first == first]  # fmt: skip
            self.instead[first] = chances_of(there)
            self.take(self.alone(first)[1])

    def name(self, n: int) -> str:
        return self.observer.runs[n].name

    def compared(self, places: Sequence[Place], other: float) -> list[Refit]:
        """Labels over spans, refitted where each leads.

        First those that are best by the parabola about no label. Then, where an event can be more probable than none
        and than sessions alone (log odds `other`), every label that is likely in the best one's place, over each of
        the spans, until the best one stays.
        """
        found, best = dict[tuple[str, int, int], Refit](), None

        def add(one: Place, starts: dict[int, float]) -> None:
            for k, start in starts.items():
                new = self.refit(one.span, k, start, one.sessions)
                key = (new.event.label, *one.span)
                if key not in found or found[key].score < new.score:
                    found[key] = new

        for one in places:
            starts, runs = {int(k): 0.0 for k in np.argsort(one.scores)[::-1][:REFITTED]}, range(*one.span)
            if np.sqrt(np.mean([self.left(n) for n in runs])) > STRONG_LEFT:
                starts |= dict(strong_sizes(self.observer, self.healthy, self.reach, runs)[:REFITTED])
            add(one, starts)
        while found and (leading := max(found.values(), key=lambda one: one.score)) is not best:
            if leading.score + np.log(self.named) + self.change_odds < max(leading.usual, other):
                break
            best, span = leading, (leading.event.first, leading.event.end)
            predicted, size = self.swapped(best)
            known = np.array([found[key].score if (key := (one.label, *span)) in found else -np.inf
                              for one in self.healthy.effects])  # fmt: skip
            likely = predicted > np.maximum(known, best.score - UNLIKELY)
            add(Place(span, best.sessions, predicted), {int(k): float(size[k]) for k in np.flatnonzero(likely)})
            most = max(one.score for one in found.values())
            of_span = [one for (_, *at), one in found.items() if tuple(at) == span and one.score > most - UNLIKELY]
            for one in places:
                add(one, {int(self.healthy.at([other.event.label])[0]): other.event.size for other in of_span
                          if (other.event.label, *one.span) not in found})  # fmt: skip
        return list(found.values())

    def decided(self, found: Sequence[Refit]) -> tuple[Refit, dict[str, float]]:
        """The event that is most probable of labels over spans, one of which it is, and the chance of each label: a
        label where labels together are more probable than a force that none has; the span that is best for it."""
        effects, total = {one.label: one for one in self.healthy.effects}, logsumexp([one.score for one in found])
        chances = chances_of([replace(one, score=one.score - total) for one in found])
        forces = {label for label in chances if effects[label].family in UNEXPLAINED}
        named = sum(chance for label, chance in chances.items() if label not in forces)
        among = [label for label in chances if (label in forces) == (named < 0.5)]
        label = max(among, key=lambda label: chances[label])
        return max((one for one in found if one.event.label == label), key=lambda one: one.score), chances

    def swapped(self, best: Refit) -> tuple[np.ndarray, np.ndarray]:
        """Scores (k,) of labels in an event's place by the parabola where it leads, and their sizes."""
        span, warm = (best.event.first, best.event.end), Warm()
        (place,) = self.healthy.at([best.event.label])
        runs = self.observer.each(
            lambda n: self.again(n, best.sessions, span, place, best.event.size, warm, every=True), range(*span)
        )
        there = dict(zip(range(*span), self.of_shared(runs), strict=True))
        gain, size = self.label_gains(*summed(one.alone(*span) for one in self.pooled(best.sessions, there)))
        predicted = best.score + gain - gain[place]
        predicted[place] = -np.inf
        return predicted, size

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

        within, without = span[1] <= sessions[0].end, self.sessions
        if within:
            sessions, without = self.with_usual(sessions, k), self.with_usual(without, k)
        at = self.led(span, sessions, k, start, target)
        slope, precision, d = parabola(at.pooled, at.size)
        evidence = log_evidence(at.pooled)
        nat, mean, sd = size_posterior(slope, precision, d, effect.one_sided)
        if abs(mean - at.size) > sd:  # the likelihood does not follow: the label's evidence is that where it is
            evidence += float((slope[0] - precision[0, 0] * at.size) * at.size)
            nat, mean, sd = size_posterior(precision[0, :1] * at.size, precision[:1, :1], d[:, :1], effect.one_sided)
        mean = float(np.clip(mean, self.low[k], self.high[k]))
        prior = self.span_prior(*span, at.sessions) - np.log(self.named) + log_odds(effect)
        gain = evidence + nat - log_evidence(self.pooled(without)) + self.session_prior(at.sessions)
        event = Event({}, *span, effect.label, mean, sd, 0.0)
        moved, alone = self.moved_by_events(span), self.alone(self.begun(at.sessions))[0]
        usual = usual_share(healthy, k, float(self.reach[k]), mean, sd, span[1] - span[0], moved, gain - alone, within)
        return Refit(gain + prior, event, at.sessions, usual)

    def moved_by_events(self, span: tuple[int, int]) -> float:
        """Mean square (tolerances squared) that events move the channels by over a span."""
        found = 0.0
        for one in self.events:
            share = max(0, min(one.end, span[1]) - max(one.first, span[0])) / (span[1] - span[0])
            found += (share * one.size * self.reach[self.healthy.at([one.label])[0]]) ** 2
        return float(found)

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
        """Sessions of the runs that are watched, and by what each differs from the reference more than sessions do."""
        first, found = self.sessions[0], []
        for one in self.pooled(self.sessions[1:]):
            value, sd = one.session.mean + one.mean - first.values, np.sqrt(np.maximum(np.diag(one.M + first.V), 0.0))
            usual = np.hypot(sd, np.sqrt(2.0) * self.healthy.session.sizes)  # of two sessions
            sigmas = np.abs(value) / np.maximum(usual, 1e-9)
            rows = []
            for k in np.argsort(-np.where(self.healthy.session.sizes > 0.0, sigmas, 0.0))[:SHOWN]:
                effect = self.healthy.effects[k]
                low, high = ((value[k] + side * NINETY * sd[k]) * effect.spread for side in (-1.0, 1.0))
                rows.append({"name": effect.label, "difference": float(value[k] * effect.spread),
                             "ci90": [float(low), float(high)], "unit": effect.unit,
                             "sigmas": float(sigmas[k])})  # fmt: skip
            labels = likeliest(self.instead.get(one.session.first, {}))
            found.append({"from_run": self.name(one.session.first), "differences": rows, "labels": labels})
        return found


def chances_of(found: Sequence[Refit]) -> dict[str, float]:
    """Probability of each label, that of refits being the exponential of their scores."""
    chances: dict[str, float] = {}
    for one in found:
        chances[one.event.label] = chances.get(one.event.label, 0.0) + float(np.exp(one.score))
    return chances


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
    cautions += [f"another session begins with {one['from_run']}: {_said(one)}" for one in sessions]
    return Watched(
        names, learned - drop, events, healthy, gaps[drop:], strange[drop:], cautions, learned_from, sessions
    )


def _said(session: dict[str, Any]) -> str:
    """What a session differs by, in words, and the change that it may be instead."""
    differs = ", ".join(
        f"{one['name']} {one['difference']:+.2g} {one['unit']} ({one['sigmas']:.1f} sigma)"
        for one in session["differences"]
    )
    change = sum(session["labels"].values())
    if change < MENTIONED:
        return f"{differs}, of what sessions differ by"
    labels = ", ".join(f"{label} {p:.2f}" for label, p in list(session["labels"].items())[:SHOWN])
    return f"{differs}, of what sessions differ by; or something changed too, with probability {change:.2f}: {labels}"
