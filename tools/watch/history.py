"""What happened over the runs: events found one by one, each refined and compared with its rivals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sim_backend.core.effects.catalogue import catalogue
from tools.diagnose.noise_probes import TURBULENCE, WAVES, NoiseProbe, probes
from tools.diagnose.unknown import ONE_AXIS
from tools.inference.fit import bounded_step
from tools.inference.parameters import CLOCK_PLACE
from tools.watch.disorder import SCALES, WATER, beyond_reference, shaken, water_gains
from tools.watch.events import GROWING, STEP, Change, Joint, Span, spans
from tools.watch.expansion import Expansion, expand
from tools.watch.flights import Flights, numbers, roughness_sigma
from tools.watch.label_fit import Affected, LabelFit, best_fit, cost_of, values_of

EVIDENCE_NEEDED = 16.0  # nat over no change (docs/WATCH.md)
MOST_EVENTS = 5
ASKED_ABOVE = 4.0  # sigma of a run's mean squared innovation over the reference's, for disorder to be looked for
NOT_ROUGH = 5.0  # nat that a run that is not rough takes off disorder that would hold there too
STRETCH = 5.0  # s
BURSTS = 0.65  # turbulence by 0.5 (weak) and less; changes that no label knows come in bursts, by 0.9 and more
PROBED = 2  # runs in which it is asked what shakes
FITTED = 3  # runs in which rivals are fitted
LINEAR_TRIED, ROUGH_TRIED = 4, 5  # labels: by the parabolas of the filter as it is, and by rough ones
FINAL = 3  # rivals that are compared over all spans
BEHIND, BEHIND_SHARE = 40.0, 0.1  # squared sigma, and share of what the best gains, that a rival may be behind
POORLY = 0.1  # of the excess: what the best of the first rivals may leave before more are tried
REACH = 2  # runs about a span's ends between which it is found again
FURTHER = 0.15  # of what an event explains in the same runs, that a further event there has to bring
TIE = 6.0  # nat within which two labels are not told apart, as in tools/diagnose/verdict.py


@dataclass
class Event:
    """A change over a span of runs."""

    label: str  # of the catalogue, with parameters or of water's disorder; "" for disorder of something else
    span: Span
    evidence: float  # nat over no such change
    rivals: dict[str, float]  # log evidence of labels, its own among them
    size: np.ndarray  # spreads; of disorder its scale
    covariance: np.ndarray
    explained: float  # nat by which the runs' misfit falls
    sure_spans: dict[Span, float] = field(default_factory=dict)  # log evidence by span
    probe: tuple[str, float] | None = None  # of disorder that is not the water's: what shakes, and how much
    place: NoiseProbe | None = None  # and the single link that shakes most
    fitted: list[int] = field(default_factory=list)  # runs in which it was compared with rivals

    @property
    def has_course(self) -> bool:
        """Whether its runs fly by another model; else by more noise."""
        return self.label not in ("", *WATER)


@dataclass
class History:
    """Where the search stands."""

    flights: Flights
    judged: np.ndarray  # (runs,) bool
    begins: int  # the first run with which an event may begin
    events: list[Event] = field(default_factory=list)
    water: np.ndarray | None = None  # nat that the water's disorder gains, (WATER, runs, scales)

    @property
    def taken(self) -> list[tuple[str, np.ndarray]]:
        """The events with a course, as unknowns of all runs together."""
        count = self.flights.count
        return [(event.label, event.span.weights(count)) for event in self.events if event.has_course]

    def joint(self, runs: Sequence[Expansion] | None = None, more: Sequence[tuple[str, np.ndarray]] = ()) -> Joint:
        return Joint(self.flights.shared, list(self.flights.runs if runs is None else runs), [*self.taken, *more])

    def listed(self) -> list[Span]:
        return spans([bool(one) for one in self.judged], self.begins)


def find_events(history: History, say: Callable[[str], None] = lambda text: None) -> None:
    """Events added to the history, the most evident first."""
    for _ in range(MOST_EVENTS):
        event = next_event(history)
        if event is None or event.evidence < EVIDENCE_NEEDED or not earns_place(history, event):
            break
        history.events.append(event)
        take(history, event)
        say(f"{event.label or 'unknown'} in runs {event.span.first} to {event.span.end - 1}")


def next_event(history: History) -> Event | None:
    """The change that is most evident beside those found: a label's course, or disorder where that explains more."""
    joint = history.joint()
    changes = [one for one in joint.changes(history.listed()) if not already(history, one)]
    best = max(changes, key=lambda one: one.evidence, default=None)
    event = refined(history, joint, best, changes) if best is not None and best.evidence >= EVIDENCE_NEEDED else None
    rough = water_event(history)
    if rough is None or rough.evidence < EVIDENCE_NEEDED or (event is not None and not rougher(history, rough, event)):
        return event
    if not earns_place(history, rough):
        return event
    found = named(history, rough)
    if event is not None and place_of(event) == CLOCK_PLACE == shaken_place(found):
        return event  # a clock that wanders is still one that is wrong
    return found


def place_of(event: Event) -> tuple[str, str]:
    """Where its label sits."""
    return catalogue()[event.label].place


def shaken_place(event: Event) -> tuple[str, str] | None:
    """Where a single link shakes; None of the water."""
    return None if event.place is None else (event.place.subsystem, event.place.element)


def rougher(history: History, rough: Event, event: Event) -> bool:
    """Whether disorder says more of the runs than a label does; of other runs, whether it is the more evident."""
    flights, chosen = history.flights, event.fitted
    inside = rough.span.weights(flights.count) > 0.0
    if not inside[chosen].any():
        return rough.evidence > event.evidence
    weights, cost = event.span.weights(flights.count), 0.0
    for n in chosen:
        x = flights.raw[n].at
        part = shaken(flights.parts[n], rough.label, float(rough.size[0]))
        cost += flights.own_cost(part, x)
        changed = values_of(flights.shared, event.label, x, weights[n], event.size)
        cost -= flights.own_cost(flights.parts[n], within(flights, changed))
    return cost < 0.0


def already(history: History, change: Change) -> bool:
    """Whether a change is one of those found: the same label, over runs that overlap."""
    return any(
        event.label == change.label and event.span.first < change.span.end and change.span.first < event.span.end
        for event in history.events
    )


def earns_place(history: History, event: Event) -> bool:
    """Whether an event beside others in the same runs is more than the wrong form of one of them."""
    count = history.flights.count
    own = event.span.weights(count) > 0.0
    for other in history.events:
        theirs = other.span.weights(count) > 0.0
        mostly_there = (own & theirs).sum() >= 0.5 * own.sum()
        if mostly_there and event.evidence < FURTHER * other.explained:
            return False
    return True


def take(history: History, event: Event) -> None:
    """The runs of an event about the model that has it; without a course, with the noise that it is."""
    flights = history.flights
    inside = numbers(event.span.weights(flights.count))
    if not event.has_course:
        for n in inside:
            name, scale = event.probe or (event.label, float(event.size[0]))
            flights.parts[n] = shaken(flights.parts[n], name, scale)
            flights.put(n, flights.expanded(n, flights.runs[n].at))
    else:
        joint = history.joint()
        for n in inside:
            flights.put(n, flights.expanded(n, within(flights, joint.run_values(n))))
    if history.water is not None:
        # what the form of a label leaves is no disorder: it is asked about as what is left of the label
        history.water[:, inside] = -NOT_ROUGH


def within(flights: Flights, x: np.ndarray) -> np.ndarray:
    """Values inside the limits of what runs may share."""
    return np.clip(x, flights.shared.low, flights.shared.high)


# --- a label over a span ----------------------------------------------------------------------------------------------
def refined(history: History, joint: Joint, best: Change, changes: Sequence[Change]) -> Event | None:
    """The change fitted without parabolas, with the labels that may be meant as well, and its span found again."""
    flights, shared = history.flights, history.flights.shared
    weights = best.span.weights(flights.count)
    inside = numbers(weights * history.judged)
    chosen = sorted(inside, key=lambda n: (-weights[n], -flights.excess(n)))[:FITTED]
    base = [within(flights, flights.runs[n].at) for n in chosen]
    affected = Affected([flights.parts[n] for n in chosen], [weights[n] for n in chosen], base, flights.heat)
    same = sorted((one for one in changes if one.span == best.span), key=lambda one: -one.evidence)
    nothing = cost_of(affected, shared, best.label, np.zeros(len(best.size)))
    fits = {one.label: best_fit(affected, shared, one.label, one.size, False) for one in same[:LINEAR_TRIED]}
    samples = sum(flights.raw[n].samples for n in chosen)
    least = min(fits.values(), key=lambda fit: fit.cost)
    promised = sum(max(flights.excess(n), 0.0) for n in chosen)
    if nothing - least.cost < (1.0 - POORLY) * promised and promised > 0.1 * samples:
        for label, size in rough_ranking(affected, flights)[:ROUGH_TRIED]:
            again = best_fit(affected, shared, label, size, True)
            if label not in fits or again.cost < fits[label].cost:
                fits[label] = again
    ranked = sorted(fits.values(), key=lambda fit: fit.cost)
    gained = nothing - ranked[0].cost
    kept = [fit for fit in ranked if fit.cost - ranked[0].cost <= max(BEHIND, BEHIND_SHARE * gained)][:FINAL]
    found = [one for one in (over_spans(history, joint, best.span, fit) for fit in kept) if one is not None]
    if not found:
        return None
    winner = max(found, key=lambda event: event.evidence)
    other = by_other_course(history, joint, winner)
    if other is not None and other.evidence > winner.evidence:
        found[found.index(winner)] = winner = other
    winner.rivals = {event.label: event.evidence for event in found}
    # labels that were behind already count as far behind as they were in the runs of the fit
    for fit in ranked:
        winner.rivals.setdefault(fit.label, winner.evidence - 0.5 * (fit.cost - ranked[0].cost))
    winner.fitted = chosen
    winner.explained = 0.5 * gained * len(inside) / max(1, len(chosen))
    return winner


def by_other_course(history: History, joint: Joint, event: Event) -> Event | None:
    """A change that is still there fitted as growing where it is a step, and the other way; None where it ended.

    Parabolas about a step say little of the small sizes that a growth begins with.
    """
    flights, span = history.flights, event.span
    other = replace(span, course=STEP if span.course == GROWING else GROWING)
    if other not in history.listed():
        return None
    weights = other.weights(flights.count)
    inside = numbers(weights * history.judged)
    chosen = [inside[0], inside[len(inside) // 2], inside[-1]]
    base = [within(flights, flights.raw[n].at) for n in chosen]
    affected = Affected([flights.parts[n] for n in chosen], [weights[n] for n in chosen], base, flights.heat)
    fit = best_fit(affected, flights.shared, event.label, event.size, False)
    return over_spans(history, joint, other, fit)


def rough_ranking(affected: Affected, flights: Flights) -> list[tuple[str, np.ndarray]]:
    """Labels by what a filter that lets the vehicle move sees of them, with the sizes it promises."""
    shared = flights.shared
    normal, slope = np.zeros((shared.count, shared.count)), np.zeros(shared.count)
    for part, weight, at in zip(affected.parts, affected.weights, affected.at, strict=True):
        one = expand(part, shared, at, 100.0).cooled(flights.heat)
        normal += weight**2 * one.curvature
        slope += weight * one.slope
    found = []
    for label, columns in shared.labels.items():
        own = normal[np.ix_(columns, columns)] + np.eye(len(columns))
        low, high = shared.limits(label, affected.at[0])
        size = bounded_step(own, slope[columns], low, high)
        found.append((float(2.0 * slope[columns] @ size + size @ own @ size), label, size))
    return [(label, size) for _, label, size in sorted(found, key=lambda one: one[0])]


def over_spans(history: History, joint: Joint, span: Span, fit: LabelFit) -> Event | None:
    """A label's evidence over every span near the one it was fitted in, by parabolas about what it fitted."""
    flights, shared = history.flights, history.flights.shared
    weights = span.weights(flights.count)
    first = max(history.begins, span.first - REACH)
    end = min(flights.count, span.end + REACH)
    about: dict[int, Expansion] = {}
    for n in range(first, end):
        if history.judged[n]:
            weight = weights[n] or (1.0 if span.course != GROWING or n >= span.end else weights[span.first])
            x = values_of(shared, fit.label, flights.runs[n].at, weight, fit.size)
            about[n] = flights.made(flights.expanded(n, within(flights, x)))
    found: dict[Span, tuple[float, np.ndarray, np.ndarray]] = {}
    for one in history.listed():
        near = abs(one.first - span.first) <= REACH and abs(one.end - span.end) <= REACH
        if not near:
            continue
        own = one.weights(flights.count)
        runs = [about[n] if own[n] and n in about else flights.runs[n] for n in range(flights.count)]
        tried = Joint(shared, runs, [*history.taken, (fit.label, own)])
        size, covariance = tried.size_of(len(history.taken))
        low, high = shared.limits(fit.label, tried.values)
        halved = float(np.log(2.0) * ((low == 0.0) | (high == 0.0)).sum())
        outside = np.maximum(low - size, 0.0) + np.maximum(size - high, 0.0)
        lost = 0.5 * float(outside @ np.linalg.solve(covariance, outside)) if outside.any() else 0.0
        found[one] = tried.log_evidence - joint.log_evidence + halved - lost, np.clip(size, low, high), covariance
    if not found:
        return None
    best = max(found, key=lambda one: found[one][0])
    evidence, size, covariance = found[best]
    return Event(fit.label, best, evidence, {}, size, covariance, 0.0, {one: value[0] for one, value in found.items()})


def water_event(history: History) -> Event | None:
    """The water's disorder over the span where it gains most; None where it gains nothing."""
    flights, best = history.flights, None
    if history.water is None:
        history.water = rough_water(flights, range(flights.count))
    shaken_before = [event.span.weights(flights.count) > 0.0 for event in history.events if not event.has_course]
    for span in history.listed():
        inside = span.weights(flights.count) > 0.0
        if span.course == GROWING or any((inside & before).any() for before in shaken_before):
            continue
        for label, gains in zip(WATER, history.water, strict=True):
            together = gains[inside].sum(axis=0)
            k = int(together.argmax())
            if best is None or together[k] > best.evidence:
                size, gain = np.array([SCALES[k]]), float(together[k])
                best = Event(label, span, gain, {label: gain}, size, np.diag(size**2 / 16.0), gain)
    return best


def rough_water(flights: Flights, runs: Sequence[int]) -> np.ndarray:
    """Nat that the water's disorder gains in runs, (WATER, runs, scales); asked of rough ones only."""
    found = np.full((len(WATER), len(runs), len(SCALES)), -NOT_ROUGH)
    rough = [k for k, n in enumerate(runs) if roughness_sigma(flights, n) > ASKED_ABOVE]
    if rough:
        found[:, rough] = water_gains(flights, [runs[k] for k in rough])
    return found


def named(history: History, event: Event) -> Event:
    """Disorder by what shakes most: the water, or something else, which no label means.

    Turbulence shakes every axis, and it does so all the time.
    """
    flights = history.flights
    inside = numbers((event.span.weights(flights.count) > 0.0) & history.judged)
    loudest = sorted(inside, key=lambda n: -roughness_sigma(flights, n))[:PROBED]
    wanted = probes(flights.parts[loudest[0]])
    gains = beyond_reference(flights, wanted, loudest, PROBED).sum(axis=1).max(axis=1)
    first = int(gains.argmax())
    own = gains[[one.name for one in wanted].index(TURBULENCE)]
    axes = [gain for gain, one in zip(gains, wanted, strict=True) if one.stage == "force" and one.name != TURBULENCE]
    even = max(axes) < ONE_AXIS * own and max(burstiness(flights, n) for n in loudest) < BURSTS
    if wanted[first].name == WAVES or (wanted[first].name == TURBULENCE and even):
        return replace(event, label=wanted[first].name)
    linked = max((n for n, one in enumerate(wanted) if one.name not in WATER), key=lambda n: gains[n])
    return replace(event, label="", rivals={}, probe=(wanted[first].name, float(event.size[0])), place=wanted[linked])


def burstiness(flights: Flights, n: int) -> float:
    """By how much a run's squared innovations change from one stretch to the next, over how far they exceed 1."""
    part = flights.parts[n]
    E = part.filter(*flights.shared.model(part, flights.own_values(n))).E
    rows = max(2, int(STRETCH / np.median(np.diff(part.recording.t))))
    each = [np.nanmean(E[k : k + rows] ** 2) for k in range(0, len(E) - rows + 1, rows)]
    return float(np.std(each) / max(np.mean(each) - 1.0, 0.05))
