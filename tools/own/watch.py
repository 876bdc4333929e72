"""What changed over the runs of a user's vehicle: labels over spans of runs, beside what all runs share.

The model is that of hierarchy.py with effects over spans: x_n = s + d_n + sum of c over the spans that n lies in. What
is shared is learned from the runs of the reference (or the first runs) and the vehicle file. Events are added one by
one, the most evident first, each relinearised in the runs of its span, until the next is not probable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.data.intervals import NINETY
from glider.tools.inference.pooled import Pooled, learn_scatter
from glider.tools.own.decision import (
    FORM_SHARES,
    LEAST_REACH,
    MATERIAL,
    SIZES,
    UNKNOWN,
    Healthy,
    Hypothesis,
    log_odds,
    strangeness,
    usual_share,
)
from glider.tools.own.effects import FORM, PUSH
from glider.tools.own.hierarchy import Expansion
from glider.tools.own.identify import CONVERGED_GAIN, SCATTER_ROUNDS, LineSearch, damped_step
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observer import Observer, observer_of
from glider.tools.own.posterior import LONGEST_MOVE, LONGEST_REACH, STRONG_LEFT, Engine, healthy_of
from glider.tools.own.runs import OwnRun

LEARNED = 4  # first runs, from which a watch without a reference learns
CHANGE = 0.3  # prior probability that anything changed over the runs
TO_THE_END = 0.5  # of spans: that a change is still there in the last run
MOST_EVENTS = 4
REFITTED, SPANS = 5, 2  # labels, of the best spans, whose parabolas are taken where they lead to
CERTAIN = 0.5  # probability from which an event is one
GROUP = 0.1  # of a label's probability: others of at least so much share its group
OWN_ROUNDS, CONVERGED_OWN = 5, 0.1  # of a run's own values, spreads
ROUNDS, PREPARED = 3, 20


@dataclass
class Event:
    """A change: its labels by probability, the runs it is in, its size."""

    chances: dict[str, float]
    first: int
    end: int
    label: str
    size: float  # spreads
    sd: float
    probability: float

    @property
    def span(self) -> slice:
        return slice(self.first, self.end)


@dataclass
class Watched:
    """The answer of a watch."""

    names: list[str]
    learned: int
    events: list[Event]
    healthy: Healthy
    gaps: np.ndarray  # (runs,) tolerances
    strange: np.ndarray  # (runs,) probability that a run has more left than healthy ones and its events say
    cautions: list[str] = field(default_factory=list)
    reference: list[str] = field(default_factory=list)  # runs from which it was learned

    def plain(self) -> dict[str, Any]:
        """The JSON of docs/reference/gap.md, What changed."""
        effects = {one.label: one for one in self.healthy.effects}
        runs, events = [], []
        for one in self.events:
            events.append(self._event(one, effects))
        for n, name in enumerate(self.names):
            own = [event for one, event in zip(self.events, events, strict=True) if one.first <= n < one.end]
            causes = [{key: event[key] for key in ("label", "probability", "group", "size", "ci90", "unit")}
                      for event in own if event["label"]]  # fmt: skip
            unknown = self.strange[n] > CERTAIN or any(event["label"] is None for event in own)
            verdict = "cause" if causes else (UNKNOWN if unknown else "none")
            runs.append(
                {"run": name, "verdict": verdict, "causes": causes, "gap": float(self.gaps[n]), "skipped": None}
            )
        return {
            "format": 1, "runs": runs, "events": events, "reference": self.reference, "cautions": self.cautions,
        }  # fmt: skip

    def _event(self, one: Event, effects) -> dict[str, Any]:
        effect = effects[one.label]
        known = effect.family != PUSH
        low, high = ((one.size + side * NINETY * one.sd) * effect.spread for side in (-1.0, 1.0))
        # of an unknown change the labels that come nearest
        top = max((p for label, p in one.chances.items() if known or effects[label].family != PUSH), default=0.0)
        group = [label for label, p in sorted(one.chances.items(), key=lambda item: -item[1])
                 if p > GROUP * top and effects[label].family != PUSH]  # fmt: skip
        places: dict[tuple[str, str], float] = {}
        for label, p in one.chances.items():
            where = effects[label].where
            places[where] = places.get(where, 0.0) + p
        return {
            "label": one.label if known else None, "group": group, "probability": one.probability,
            "labels": {label: p for label, p in sorted(one.chances.items(), key=lambda item: -item[1]) if p > 0.005},
            "where": [{"subsystem": s, "element": e, "probability": p}
                      for (s, e), p in sorted(places.items(), key=lambda item: -item[1]) if p > 0.005],
            "from_run": self.names[one.first],
            "to_run": None if one.end == len(self.names) else self.names[one.end - 1],
            "course": "step" if one.end == len(self.names) else "episode",
            "size": one.size * effect.spread, "ci90": [low, high], "unit": effect.unit, "sizes": [],
        }  # fmt: skip


class Watch(Engine):
    """Events over the runs of one observer: the first `learned` are the reference's."""

    def __init__(
        self, observer: Observer, healthy: Healthy, learned: int, say: Callable[[str], None] = lambda text: None
    ):
        super().__init__(observer, healthy, say)
        self.learned = learned

    def prepare(self) -> None:
        """Every run about where it lies, with what the reference says of all; how runs differ, learned from it too."""
        every, columns, healthy = np.arange(self.k), np.flatnonzero(self.active), self.healthy
        shared, own = np.zeros(self.k), np.zeros((self.learned, self.k))
        for round_ in range(PREPARED):
            found = [self.expansion_of(n, own[n], columns) for n in range(self.learned)]
            if self.learned > 2 and round_ < SCATTER_ROUNDS:
                learned = learn_scatter(found, self.together.V, healthy.scatter)
                self.together = replace(self.together, scatter=learned)
            pooled = Pooled.of(self.together.marginal(found), self.together.V)
            search = LineSearch(self.observer, healthy.effects, found, self.together.scatter, healthy.eta,
                                self.together.V, (self.low, self.high), healthy.errors, self.horizon)  # fmt: skip
            shared, own, gain = search.along(shared, own, damped_step(pooled, shared))
            if gain < CONVERGED_GAIN and round_ >= SCATTER_ROUNDS:
                break
        self.shared, self.events = shared, list[Event]()
        later = [self.own_values(n, shared) for n in range(self.learned, self.count)]
        self.found = self.expansions(np.array([*own, *later]), every)
        self.reach = np.sqrt(np.mean([one.reach for one in self.found], axis=0))
        self.runs = self.together.marginal(self.found)
        self.M = Pooled.of(self.runs[: self.learned], self.together.V).covariance()

    def own_values(self, n: int, around: np.ndarray) -> np.ndarray:
        """Most probable values (k,) of run n by the exact likelihood, about those that it is thought to have."""
        columns, healthy, scatter = np.flatnonzero(self.active), self.healthy, self.together.scatter
        own = around.copy()
        for _ in range(OWN_ROUNDS):
            found = self.expansion_of(n, own, columns)
            search = LineSearch(self.observer, healthy.effects, [found], scatter, healthy.eta, self.together.V,
                                (self.low, self.high), healthy.errors, self.horizon, n)  # fmt: skip
            _, (moved_own,), _ = search.along(around, own[None], np.zeros(self.k))
            if np.abs(moved_own - own).max() < CONVERGED_OWN:
                break
            own = moved_own
        return own

    def at_run(self, n: int) -> np.ndarray:
        """Values (k,) that run n is thought to have: shared and its events'."""
        x = self.shared.copy()
        for one in self.events:
            if one.first <= n < one.end:
                x[self.healthy.at([one.label])[0]] += one.size
        return x

    def scored(self, spans: Sequence[tuple[int, int]]) -> np.ndarray:
        """Log evidence (spans, labels) of every label over every span; -inf where nothing moves."""
        slopes = np.array([-(one.slope + one.curvature @ (self.at_run(n) - one.at)) for n, one in enumerate(self.runs)])
        curvatures = np.array([one.curvature for one in self.runs])
        r_up, H_up = (
            np.concatenate([0.0 * slopes[:1], slopes.cumsum(axis=0)]),
            np.concatenate([0.0 * curvatures[:1], curvatures.cumsum(axis=0)]),
        )
        found = np.full((len(spans), self.k), -np.inf)
        for row, (first, end) in enumerate(spans):
            # shared values are known to M from the reference; the span's runs see them with the change
            found[row], _ = self.label_gains(Pooled(H_up[end] - H_up[first], r_up[end] - r_up[first], 0.0, self.M))
        return found

    def span_prior(self, spans: Sequence[tuple[int, int]]) -> np.ndarray:
        """Log prior probability of each span: half of them reach the last run."""
        ends = np.array([end == self.count for _, end in spans])
        last, others = max(1, int(ends.sum())), max(1, int((~ends).sum()))
        return np.log(np.where(ends, TO_THE_END / last, (1.0 - TO_THE_END) / others))

    def search(self) -> None:
        """Events, the most evident first."""
        spans = [(a, b) for a in range(self.learned, self.count) for b in range(a + 1, self.count + 1)]
        if not spans:
            return
        named = sum(one.family not in (PUSH, FORM) for one in self.healthy.effects)
        for _ in range(MOST_EVENTS):
            scores = self.scored(spans) + self.span_prior(spans)[:, None] - np.log(named)
            ranked = np.argsort(scores.max(axis=1))[::-1][:SPANS]
            if scores.max() + np.log(CHANGE / (1.0 - CHANGE)) < 0.0:
                break
            refitted: list[tuple[float, Event]] = []
            for row in ranked:
                prior = float(self.span_prior(spans)[row]) - np.log(named)
                starts = {int(k): 0.0 for k in np.argsort(scores[row])[::-1][:REFITTED]}
                runs = range(*spans[row])
                if np.sqrt(np.mean([self.left(n) for n in runs])) > STRONG_LEFT:
                    starts |= dict(self.strong_sizes(runs)[:REFITTED])
                refitted += [self.refit(spans[row], k, start, prior) for k, start in starts.items()]
            refitted += self.swapped(max(refitted, key=lambda one: one[0])[1], refitted, spans, named)
            best = max(refitted, key=lambda one: one[0])[1]
            same = [(score, one) for score, one in refitted if (one.first, one.end) == (best.first, best.end)]
            best = self.decided(same)
            k = self.healthy.at([best.label])[0]
            total = float(logsumexp([score for score, _ in same]))
            odds = total + np.log(CHANGE / (1.0 - CHANGE))
            best.probability = float(1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0))))
            best.chances = {one.label: best.probability * float(np.exp(score - total)) for score, one in same}
            if best.probability < CERTAIN or abs(best.size) * self.reach[k] < MATERIAL:
                break
            self.say(
                f"{best.label} from {self.observer.runs[best.first].name} to {self.observer.runs[best.end - 1].name}: "
                f"{odds:.1f} nat"
            )
            self.take(best)

    def decided(self, same: Sequence[tuple[float, Event]]) -> Event:
        """The event of a span: a label where labels together are more probable than a force that none has."""
        effects = {one.label: one for one in self.healthy.effects}
        forces = [one for one in same if effects[one[1].label].family == PUSH]
        labels = [one for one in same if effects[one[1].label].family != PUSH]
        sums = [float(logsumexp([score for score, _ in some])) if some else -np.inf for some in (labels, forces)]
        return max(labels if sums[0] >= sums[1] else forces, key=lambda one: one[0])[1]

    def swapped(self, event: Event, refitted: Sequence[tuple[float, Event]], spans, named: int):
        """Labels in an event's place that come nearest to it where it leads, refitted (log odds, event)."""
        span, every = (event.first, event.end), np.arange(self.k)
        (place,), runs = self.healthy.at([event.label]), list[Expansion]()
        for n in range(*span):
            x = self.at_run(n)
            x[place] += event.size
            x = self.own_values(n, np.clip(x, self.low, self.high))
            runs += self.together.marginal([self.expansion_of(n, x, every)])
        gain, size = self.label_gains(self.evidence(runs, span, self.M))
        gain[self.healthy.at([one.label for _, one in refitted if (one.first, one.end) == span])] = -np.inf
        prior = float(self.span_prior(spans)[spans.index(span)]) - np.log(named)
        return [self.refit(span, int(k), float(size[k]), prior)
                for k in np.argsort(-gain)[:REFITTED] if np.isfinite(gain[k])]  # fmt: skip

    def left(self, n: int) -> float:
        """Mean square that a run leaves about where it was expanded, in units of what healthy runs leave."""
        return float(self.found[n].squares.sum() / max(1, self.found[n].samples.sum()))

    def take(self, event: Event) -> None:
        """An event into what is known: the runs of its span are expanded again where they are now."""
        self.events.append(event)
        for n in range(event.first, event.end):
            self.found[n] = self.expansion_of(n, self.own_values(n, self.at_run(n)), np.arange(self.k))
            (self.runs[n],) = self.together.marginal([self.found[n]])

    def evidence(self, runs: Sequence[Expansion], span: tuple[int, int], V: np.ndarray) -> Pooled:
        """A span's runs, values counted from what they are thought to have."""
        moved_runs = [replace(one, at=one.at - self.at_run(n)) for n, one in zip(range(*span), runs, strict=True)]
        return Pooled.of(moved_runs, V)

    def refit(self, span: tuple[int, int], k: int, start: float, prior: float) -> tuple[float, Event]:
        """A label over a span, expanded where it leads to: log odds against no change, and the event."""
        nothing = self.evidence(self.runs[slice(*span)], span, self.M).log_evidence()
        columns = np.unique(np.append(np.flatnonzero(self.active), k))
        size, best = start, (-np.inf, start, 0.0)
        odds = log_odds(self.healthy.effects[k])
        runs = self.runs[slice(*span)] if start == 0.0 else None
        linear = runs is not None
        for _ in range(ROUNDS + 1):
            if runs is not None:
                pooled = self.evidence(runs, span, self.M)
                table = []
                where = size * (np.arange(self.k) == k)
                for tolerances, form in product(SIZES.tolist(), FORM_SHARES):
                    V = self.variance(self.M, [k], [tolerances], where, form)
                    M = pooled.covariance(V)
                    mean, sd = float((M @ pooled.r)[k]), float(np.sqrt(max(M[k, k], 1e-30)))
                    halved = np.log(2.0) + norm.logcdf(mean / sd) if self.healthy.effects[k].one_sided else 0.0
                    table.append((pooled.log_evidence(V) + halved, mean, sd))
                score = float(logsumexp([one[0] for one in table]) - np.log(len(table)))
                _, mean, sd = max(table)
                mean = float(np.clip(mean, self.low[k], self.high[k]))
                if not linear and score > best[0]:
                    best = score, mean, sd
                linear = False
                converged = abs(mean - size) < 0.1 * sd
                room = max(LONGEST_MOVE, LONGEST_REACH / max(self.reach[k], LEAST_REACH))
                size += float(np.clip(mean - size, -room, room))
                if converged and np.isfinite(best[0]):
                    break
            runs = []
            for n in range(*span):
                x = self.at_run(n)
                x[k] = np.clip(x[k] + size, self.low[k], self.high[k])
                runs += self.together.marginal([self.expansion_of(n, self.own_values(n, x), columns)])
        score, mean, sd = best
        usual = usual_share(self.healthy, k, float(self.reach[k]), mean, sd, span[1] - span[0]) if sd > 0.0 else 0.0
        event = Event({}, *span, self.healthy.effects[k].label, mean, sd, 0.0)
        return score - nothing - usual + prior + odds, event

    def judge(self) -> np.ndarray:
        """Probability of each run to have more left than healthy ones and its events say."""
        found = np.zeros(self.count)
        nothing = Hypothesis((), 0.0, np.zeros(0), np.zeros(0), self.shared, np.zeros((1, self.k)), np.ones(1))
        for n in range(self.learned, self.count):
            one = self.expansion_of(n, self.own_values(n, self.at_run(n)), np.flatnonzero(self.active))
            left = np.array([one.squares.sum() / max(1, one.samples.sum())])
            named = tuple(event.label for event in self.events if event.first <= n < event.end)
            found[n] = strangeness(
                self.healthy, replace(nothing, labels=named, left=left), replace(nothing, left=np.array([self.left(n)]))
            )
        return found


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
    return Watched(names, learned - drop, events, healthy, gaps[drop:], strange[drop:], cautions, learned_from)
