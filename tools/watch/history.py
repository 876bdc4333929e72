"""What happened over the runs, as far as it is found: events, and what the runs fly by with them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from glider.sim_backend.core.effects.base import Effect
from glider.tools.diagnose.noise_probes import NoiseProbe
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.watch.events import Change, Joint, Span, spans
from glider.tools.watch.excess_noise import WATER, with_inflated_noise
from glider.tools.watch.flights import RunEnsemble, numbers
from glider.tools.watch.lasting import Lasting, lasting

LEAST_COSINE = 0.01  # cosine of two labels' columns, below which one is not fitted as a rival of the other


@dataclass
class ChangeEvent:
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
    strange: Lasting | None = None  # what lasts in its runs beside it, before any other event was searched
    matters: bool = True  # whether it moves a channel by as much as its kind of vehicle asks for, when it was found

    @property
    def has_course(self) -> bool:
        """Whether its runs fly by another model; else by more noise."""
        return self.label not in ("", *WATER)


@dataclass
class History:
    """Where the search stands."""

    flights: RunEnsemble
    judged: np.ndarray  # (runs,) bool
    begins: int  # the first run with which an event may begin
    events: list[ChangeEvent] = field(default_factory=list)
    water: np.ndarray | None = None  # nat that the water's disorder gains, (labels, runs, scales)

    @property
    def taken(self) -> list[tuple[str, np.ndarray]]:
        """The events with a course, as unknowns of all runs together."""
        count = self.flights.count
        return [(event.label, event.span.weights(count)) for event in self.events if event.has_course]

    @property
    def effects(self) -> Mapping[str, Effect]:
        """The catalogue of the vehicles' kind."""
        return self.flights.parts[0].kind.catalogue()

    def joint(self) -> Joint:
        """All runs with the events that have a course."""
        return Joint(self.flights.shared, list(self.flights.runs), self.taken)

    def listed(self) -> list[Span]:
        """Every span that an event may have."""
        return spans([bool(one) for one in self.judged], self.begins)


def noise_location(event: ChangeEvent) -> tuple[str, str] | None:
    """Where a single link shakes; None of the water."""
    return None if event.place is None else (event.place.subsystem, event.place.element)


def already(history: History, change: Change) -> bool:
    """Whether a change is one of those found: the same label, over runs that overlap."""
    return any(
        event.label == change.label and event.span.first < change.span.end and change.span.first < event.span.end
        for event in history.events
    )


def compared(history: History) -> int:
    """How many changes are compared: labels over spans."""
    return max(len(history.listed()) * len(history.flights.shared.labels), 1)


def evidence_by_chance(history: History) -> float:
    """Nat that a change needs at least: of more changes compared, chance makes one more evident."""
    return WATCH.evidence_by_chance + float(np.log(compared(history)))


def earns_place(history: History, event: ChangeEvent | Change) -> bool:
    """Whether an event beside others in the same runs is more than the wrong form of one of them.

    One that does not matter hides none: of a month's slow growth of a label that moves little, the evidence grows with
    the runs, and so does what its form leaves.
    """
    flights = history.flights
    own = event.span.weights(flights.count) > 0.0
    evidence = event.evidence * float(
        flights.run_inflation[own].max()
    )  # as others were weighed, before their runs were hot
    for other in (one for one in history.events if one.matters):
        shared = own & (other.span.weights(flights.count) > 0.0)
        mostly_there = shared.sum() >= WATCH.majority * own.sum()
        if mostly_there and evidence < WATCH.form_evidence_share * other.explained:
            return False
    return True


def confounded(history: History, one: str, other: str, runs: np.ndarray) -> bool:
    """Whether two labels move the same readings at all, in any of the runs (bool).

    If not, one is no form of the other. Disorder is confounded with everything.
    """
    flights, labels = history.flights, history.flights.shared.labels
    if one not in labels or other not in labels:
        return True
    a, b = labels[one], labels[other]
    for n in numbers(runs):
        A = flights.raw[n].curvature
        sizes = np.sqrt(np.outer(np.diag(A)[a], np.diag(A)[b]))
        if (np.abs(A[np.ix_(a, b)]) > LEAST_COSINE * sizes).any():
            return True
    return False


def lasts(history: History, event: ChangeEvent) -> Lasting | None:
    """What lasts in an event's runs beside it; None of a kind without, and where the event moves other readings."""
    flights, weights = history.flights, event.span.weights(history.flights.count)
    runs = numbers((weights > 0.0) & history.judged)
    if flights.parts[0].kind.input_table is None or event.label == "":
        return None
    if not event.has_course:
        return lasting(flights, runs, weights)
    beside = lasting(flights, runs, weights, event.label, event.size)
    return beside if beside.confounded else None


def take(history: History, event: ChangeEvent) -> None:
    """The runs of an event about the model that has it; without a course, with the noise that it is."""
    flights = history.flights
    inside = numbers(event.span.weights(flights.count))
    if not event.has_course:
        for n in inside:
            name, scale = event.probe or (event.label, float(event.size[0]))
            flights.parts[n] = with_inflated_noise(flights.parts[n], name, scale)
            flights.put(n, flights.expanded(n, flights.runs[n].at))
            if event.label == "":
                flights.let_go(n)
    else:
        # about the shared values of the reference (those of all runs make up for the next event too), and the size
        # that was fitted: parabolas about none of it say nothing of an effect that begins behind a threshold
        columns, weights = flights.shared.labels[event.label], event.span.weights(flights.count)
        for n in inside:
            before = flights.runs[n].at
            x = before.copy()
            x[columns] += weights[n] * event.size
            x = within(flights, x)
            flights.put(n, flights.expanded(n, x))
            flights.inflate_run(n)
            flights.loosen(n, x - before)
    if history.water is not None:
        # what the form of a label leaves is no disorder: it is asked about as what is left of the label
        history.water[:, inside] = -WATCH.clean_run


def within(flights: RunEnsemble, x: np.ndarray) -> np.ndarray:
    """Values inside the limits of what runs may share."""
    return np.clip(x, flights.shared.low, flights.shared.high)
