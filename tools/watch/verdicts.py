"""From events to an answer: does a change matter, is its label the cause, how large is it, and in which runs."""

import warnings
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.data.intervals import NINETY
from glider.tools.diagnose.materiality import largest
from glider.tools.diagnose.probabilities import softmax
from glider.tools.inference.hyperparameters import DIAGNOSIS, WATCH
from glider.tools.inference.predict import fly_windows_from
from glider.tools.watch.answer import CAUSE, NONE, UNKNOWN, EventAnswer, RunCause, RunVerdict, Sized
from glider.tools.watch.events import GROWING, STEP, Span
from glider.tools.watch.excess_noise import WATER
from glider.tools.watch.flights import excess_nis_sigma
from glider.tools.watch.history import ChangeEvent, History, evidence_by_chance, within
from glider.tools.watch.unknown import NO_RESIDUAL, Residual, what_is_left
from glider.tools.watch.water import asked_above

VECTORS = ("gyro_bias", "current", "current_shear", "compass")  # labels whose parameters are parts of one length


@dataclass
class ResolvedEvent:
    """An event that stands, and what is thought of it."""

    event: ChangeEvent
    left: Residual
    probability: float  # that there is such a change
    outside: float  # probability that it is none of the catalogue
    number: int  # of the event among those with a course; -1: it has none

    @property
    def unknown(self) -> bool:
        return self.outside > WATCH.majority

    @property
    def label(self) -> str | None:
        return None if self.unknown else self.event.label


def resolve_events(history: History) -> list[ResolvedEvent]:
    """The events that matter; those that no label explains, as unknown."""
    found: list[ResolvedEvent] = []
    number, kind, needed = 0, history.flights.parts[0].kind, evidence_by_chance(history)
    for event in history.events:
        own, number = (number, number + 1) if event.has_course else (-1, number)
        if any(one.unknown and beside(one.event.span, event.span) for one in found):
            continue  # what mimics an unknown change is none of its own
        if event.has_course and not material(history, event, own):
            continue
        left = what_is_left(history, event) if event.has_course else NO_RESIDUAL
        sure = 1.0 / (1.0 + np.exp(-np.clip(event.evidence - needed, -50.0, 50.0)))
        outside = 1.0 - DIAGNOSIS.error_rate if event.label == "" else left.probability
        strange = event.strange
        if strange is not None and event.label and strange.moves(kind.measures) >= needed_of(history, event):
            chance = min(
                strange.chance(-WATCH.lasting_odds if event.has_course else WATCH.lasting_odds),
                1.0 - DIAGNOSIS.error_rate,
            )
            if chance > outside:
                left, outside = Residual(0.0, [(strange.place, chance, 1.0)]), chance
        found.append(ResolvedEvent(event, left, min(float(sure), most_sure(history)), outside, own))
    found = one_form(found)
    return one_unknown([*found, *unattributed_changes(history, found)])


def one_form(found: list[ResolvedEvent]) -> list[ResolvedEvent]:
    """Three changes or more that touch, one of them of one run alone, are one of a form that no label has.

    An unknown form looks like another label, or another size of it, in each run that is flown otherwise.
    """
    known = [one for one in found if one.label and one.event.has_course]
    strange = [
        group for group in touching(known)
        if len(group) >= WATCH.fragments and any(of_one_run(one.event.span) for one in group)
    ]  # fmt: skip
    inside = [id(one) for group in strange for one in group]
    return [replace(one, outside=1.0 - DIAGNOSIS.error_rate) if id(one) in inside else one for one in found]


def touching(found: list[ResolvedEvent]) -> list[list[ResolvedEvent]]:
    """Changes in groups: each touches another of its own group, and none of the others."""
    groups: list[list[ResolvedEvent]] = []
    for one in found:
        near = [group for group in groups if any(touch(one.event.span, other.event.span) for other in group)]
        groups = [group for group in groups if group not in near] + [[one, *(other for g in near for other in g)]]
    return groups


def of_one_run(span: Span) -> bool:
    """Whether a span is one run."""
    return span.end - span.first == 1


def one_unknown(found: list[ResolvedEvent]) -> list[ResolvedEvent]:
    """Unknown changes of runs that overlap or follow on each other are one, at the place of the first."""
    kept: list[ResolvedEvent] = []
    for one in found:
        other = next((k for k in kept if k.unknown and one.unknown and touch(k.event.span, one.event.span)), None)
        if other is None:
            kept.append(one)
            continue
        a, b = other.event.span, one.event.span
        span = Span(min(a.first, b.first), max(a.end, b.end), STEP)
        evidence = other.event.evidence + one.event.evidence
        other.event = replace(other.event, span=span, evidence=evidence, sure_spans={})
        other.probability = max(other.probability, one.probability)
    return kept if len(kept) == len(found) else one_unknown(kept)


def touch(one: Span, other: Span) -> bool:
    """Whether two spans overlap or have one run at most between them."""
    return one.first <= other.end + 1 and other.first <= one.end + 1


def most_sure(history: History) -> float:
    """How probable an event can be at most: of what one or two runs share nobody knows that the next ones share it."""
    learned = int(history.flights.reference.sum())
    return 1.0 - DIAGNOSIS.least_unknown if learned >= WATCH.scatter_runs else learned / (learned + 1.0)


def beside(one: Span, other: Span) -> bool:
    """Whether two spans are the same to one run."""
    return abs(one.first - other.first) <= 1 and abs(one.end - other.end) <= 1


def unattributed_changes(history: History, found: list[ResolvedEvent]) -> list[ResolvedEvent]:
    """Runs in no event that are noisier than the reference by far: a change that no label takes."""
    flights = history.flights
    least = asked_above(int(flights.reference.sum()))
    covered = np.zeros(flights.count, dtype=bool)
    for one in found:
        covered |= one.event.span.weights(flights.count) > 0.0
    noisy = np.array([
        bool(history.judged[n]) and not covered[n] and n >= history.begins and excess_nis_sigma(flights, n) > least
        for n in range(flights.count)
    ])  # fmt: skip
    edges = np.flatnonzero(np.diff(np.concatenate([[0], noisy.astype(int), [0]])))
    more = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        span = Span(int(first), int(end), STEP)
        evidence = float(sum(max(flights.excess(n), 0.0) for n in range(first, end))) / 2.0
        event = ChangeEvent("", span, evidence, {}, np.zeros(0), np.zeros((0, 0)), 0.0)
        more.append(
            ResolvedEvent(event, what_is_left(history, event), most_sure(history), 1.0 - DIAGNOSIS.error_rate, -1)
        )
    return more


def material(history: History, event: ChangeEvent, number: int) -> bool:
    """Whether the change moves a channel of some window by as much as its kind of vehicle asks for.

    See docs/reference/gap.md.
    """
    weights = event.span.weights(history.flights.count)
    inside = sorted(np.flatnonzero(weights * history.judged), key=lambda n: -weights[n])
    needed = needed_of(history, event)
    return any(moved_by(history, event, number, int(n)) >= needed for n in inside)


def needed_of(history: History, event: ChangeEvent) -> float:
    """Tolerances by which a change has to move a channel: twice as many where its runs were flown otherwise.

    A law of drag or lift that is not nature's shows when pitch, buoyancy or depth change, in all runs alike.
    """
    kind = history.flights.parts[0].kind
    needed = kind.material_growth if event.span.course == GROWING else kind.material
    return needed * (WATCH.other_regime_ratio if flown_otherwise(history, event.span) else 1.0)


def flown_otherwise(history: History, span: Span) -> bool:
    """Whether the runs of a span were flown by another pitch, buoyancy or to another depth than those learned from."""
    flights = history.flights
    regime = flights.parts[0].kind.regime
    if regime is None:
        return False
    flown = np.array([regime(part.runs[0]) for part in flights.parts])
    inside = (span.weights(flights.count) > 0.0) & history.judged
    usual = flights.reference & ~inside
    if not usual.any():
        return False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a way that no run flew
        apart = np.abs(np.nanmedian(flown[inside], axis=0) - np.nanmedian(flown[usual], axis=0))
    return bool(np.nanmax(apart, initial=0.0) > 1.0)


def moved_by(history: History, event: ChangeEvent, number: int, n: int) -> float:
    """The largest rms, in tolerances, by which a change moves a channel of a window of run n."""
    flights, shared = history.flights, history.flights.shared
    weights = event.span.weights(flights.count)
    size = history.joint().size_of(number)[0]
    part, x = flights.parts[n], flights.raw[n].at
    without = x.copy()
    without[shared.labels[event.label]] -= weights[n] * size
    P, F = shared.model(part, x)
    gains = part.filter(P, F, begin=True)
    Y = fly_windows_from(part, P, F, gains)
    return largest(part, Y, fly_windows_from(part, *shared.model(part, within(flights, without)), gains))


def membership(event: ChangeEvent, count: int) -> np.ndarray:
    """Probability of each run to be in the event, by the evidence of its spans, (runs,)."""
    if not event.sure_spans:
        return (event.span.weights(count) > 0.0).astype(float)
    chances = softmax({str(n): value for n, value in enumerate(event.sure_spans.values())})
    inside = [span.weights(count) > 0.0 for span in event.sure_spans]
    return np.asarray(sum(chances[str(n)] * own for n, own in enumerate(inside)))


def probabilities(one: ResolvedEvent) -> dict[str, float]:
    """Of the labels that the change may be, most probable first."""
    if one.unknown or not one.event.rivals:
        return {}
    known = 1.0 - one.outside if one.left.probes else 1.0
    chances = softmax(one.event.rivals)
    scaled = {
        label: chance * (1.0 - DIAGNOSIS.error_rate) * known * one.probability for label, chance in chances.items()
    }
    return dict(sorted(scaled.items(), key=lambda item: -item[1]))


def group_of(history: History, one: ResolvedEvent) -> list[str]:
    """The labels that these runs cannot tell apart from the change's own, itself first."""
    if one.label is None:
        return []
    rivals = one.event.rivals
    confounded = history.flights.parts[0].one_group
    if one.label in confounded:
        return [one.label, *(label for label in confounded if label != one.label)]
    near = [
        label
        for label in rivals
        if rivals[one.label] - rivals[label] <= DIAGNOSIS.confounded_evidence and label != one.label
    ]
    return [one.label, *sorted(near, key=lambda label: -rivals[label])]


def sized(history: History, one: ResolvedEvent, weight: float = 1.0) -> Sized:
    """The change's size at a share of it, in the unit of its main parameter."""
    event = one.event
    if one.label is None:
        return Sized(None, None, None)
    if event.label in WATER:
        return water_size(event)
    size, covariance = history.joint().size_of(one.number)
    free = [history.flights.shared.free[k] for k in history.flights.shared.labels[event.label]]
    units = np.array([own.spread for own in free])
    low, high = history.flights.shared.limits(event.label, history.flights.values)
    values = weight * np.clip(size, low, high) * units
    C, form = weight**2 * covariance * np.outer(units, units), history.flights.parts[0].kind.form
    sigma = np.sqrt(np.diag(C) + (form * values) ** 2)
    parameters = {
        own.name: {"estimate": float(v), "ci90": (float(v - NINETY * s), float(v + NINETY * s)), "unit": own.unit}
        for own, v, s in zip(free, values, sigma, strict=True)
    }
    if event.label in VECTORS:
        length = float(np.linalg.norm(values))
        along = values / max(length, 1e-12)
        spread = float(np.sqrt(along @ C @ along + (form * length) ** 2))
        return Sized(length, (max(0.0, length - NINETY * spread), length + NINETY * spread), free[0].unit, parameters)
    main = int(np.argmax(np.abs(values) / np.maximum(sigma, 1e-12)))
    value, spread = float(values[main]), float(sigma[main])
    return Sized(value, (value - NINETY * spread, value + NINETY * spread), free[main].unit, parameters)


def water_size(event: ChangeEvent) -> Sized:
    """Of turbulence: by how much more turbulent the water is, less one, as the catalogue says it; of waves nothing."""
    scale, spread = float(event.size[0]), float(np.sqrt(event.covariance[0, 0]))
    if event.label != "turbulence":
        return Sized(None, None, None)
    return Sized(scale - 1.0, (scale - 1.0 - NINETY * spread, scale - 1.0 + NINETY * spread), "1")


def where_of(history: History, one: ResolvedEvent) -> list[dict[str, object]]:
    """Places of the change, most probable first."""
    chances: dict[tuple[str, str], float] = {}
    if one.label is not None:
        for label, chance in probabilities(one).items():
            place = history.effects[label].place
            chances[place] = chances.get(place, 0.0) + chance
    elif one.left.probes:
        gains = [max(gain, 0.0) for _, gain, _ in one.left.probes]
        for (probe, _, _), gain in zip(one.left.probes, gains, strict=True):
            place = (probe.subsystem, probe.element)
            chances[place] = chances.get(place, 0.0) + gain / max(sum(gains), 1e-9)
    elif one.event.place is not None:
        chances[one.event.place.subsystem, one.event.place.element] = 1.0
    elif one.event.label:
        chances[history.effects[one.event.label].place] = 1.0
    ranked = sorted(chances.items(), key=lambda item: -item[1])
    return [{"subsystem": s, "element": e, "probability": p} for (s, e), p in ranked if p > 0.005]


def event_answer(history: History, one: ResolvedEvent, names: list[str]) -> EventAnswer:
    """An event as it is reported; names: of all runs."""
    span, count = one.event.span, history.flights.count
    inside = np.flatnonzero((span.weights(count) > 0.0) & history.judged)
    still = int(inside[-1]) == int(np.flatnonzero(history.judged)[-1])
    weights = span.weights(count)
    course = GROWING if span.course == GROWING else (STEP if still else "episode")
    sizes = []
    for n in inside:
        own = sized(history, one, float(weights[n]))
        sizes.append({"run": names[n], "size": own.size, "ci90": own.ci90})
    known = max([*probabilities(one).values(), 0.0])
    chance = known if one.label else one.probability * one.outside
    last = None if still else names[inside[-1]]
    return EventAnswer(
        one.label, where_of(history, one), group_of(history, one), names[inside[0]], last, course, float(chance),
        sized(history, one), sizes,
    )  # fmt: skip


def run_verdict(history: History, resolved: list[ResolvedEvent], n: int, name: str, gap: float | None) -> RunVerdict:
    """One run by the events that it is in."""
    count = history.flights.count
    causes, unknown = [], False
    for one in resolved:
        weight = float(one.event.span.weights(count)[n])
        if weight == 0.0:
            continue
        unknown |= one.unknown
        inside = float(membership(one.event, count)[n])
        for label, chance in probabilities(one).items():
            if chance * inside > 0.01 or label == one.label:
                own = sized(history, one, weight) if label == one.label else Sized(None, None, None)
                group = group_of(history, one) if label == one.label else [label]
                causes.append(RunCause(label, chance * inside, group, own))
    causes.sort(key=lambda cause: -cause.probability)
    verdict = CAUSE if causes else (UNKNOWN if unknown else NONE)
    return RunVerdict(name, verdict, causes, gap, None)
