"""The search over events: one by one, the most evident first, until none is left."""

from collections.abc import Callable

from scipy.stats import t as student

from glider.tools.inference.hyperparameters import HEALTHY, WATCH
from glider.tools.inference.parameters import CLOCK_PLACE
from glider.tools.watch.events import Change
from glider.tools.watch.history import (
    ChangeEvent,
    History,
    already,
    compared,
    earns_place,
    evidence_by_chance,
    lasts,
    noise_location,
    take,
)
from glider.tools.watch.rivals import refit_event
from glider.tools.watch.water import named, noise_beats_label, water_event

MOST_EVENTS = 5


def find_events(
    history: History, matters: Callable[[History, ChangeEvent, int], bool],
    say: Callable[[str], None] = lambda text: None,
) -> None:  # fmt: skip
    """Events added to the history, the most evident first.

    matters: of a history, an event with a course and its number among those, whether it moves anything by enough.
    """
    for _ in range(MOST_EVENTS):
        event = next_event(history)
        if event is None or event.evidence < evidence_needed(history, event) or not earns_place(history, event):
            break
        history.events.append(event)
        take(history, event)
        if event.has_course:
            event.matters = matters(history, event, len(history.taken) - 1)
        event.strange = lasts(history, event)
        say(f"{event.label or 'unknown'} in runs {event.span.first} to {event.span.end - 1}")


def acts_at(place: tuple[str, str], there: tuple[str, str]) -> bool:
    """Whether what is wrong at a place shows at another: commands that come late shake the actuators."""
    return place == there or (place == ("timing", "command") and there[0] == "actuation")


def evidence_needed(history: History, event: ChangeEvent) -> float:
    """Nat that an event needs: more where there are more runs, and so more changes that chance may bring.

    And more where how much runs differ was learned from a few: a change against that is Student's t, squared, by those
    runs, what is usual, and the event's own runs against each other. (With fewer than `scatter_runs` nothing was
    learned, and no event is sure.)
    """
    flights, needed = history.flights, evidence_by_chance(history)
    learned = int(flights.reference.sum())
    if not event.has_course or learned < WATCH.scatter_runs:
        return needed
    inside = (event.span.weights(flights.count) > 0.0) & history.judged
    freedom = learned - 1 + HEALTHY.prior_runs + int(inside.sum()) - 1
    return max(needed, 0.5 * float(student.isf(0.5 * WATCH.false_alarms / compared(history), freedom)) ** 2)


def next_event(history: History) -> ChangeEvent | None:
    """The change that is most evident beside those found: a label's course, or disorder where that explains more."""
    joint = history.joint()
    every = joint.changes(history.listed())

    def possible(one: Change) -> bool:
        return not already(history, one) and earns_place(history, one)

    least = evidence_by_chance(history)
    evident = sorted((one for one in every if one.evidence >= least), key=lambda one: -one.evidence)
    best = next((one for one in evident if possible(one)), None)
    changes = [] if best is None else [one for one in every if one.span == best.span and possible(one)]
    event = None if best is None else refit_event(history, joint, best, changes)
    noisy = water_event(history)
    if noisy is None or noisy.evidence < least:
        return event
    if event is not None and not noise_beats_label(history, noisy, event):
        return event
    found = named(history, noisy)
    there = noise_location(found)
    if best is not None and event is not None and there is not None:
        # parabolas promise nothing of what begins behind a threshold: labels of that place are fitted
        labels = [label for label in history.flights.shared.labels if acts_at(history.effects[label].place, there)]
        event = refit_event(history, joint, best, changes, labels) or event
        if not noise_beats_label(history, noisy, event):
            return event
    if not earns_place(history, noisy):
        return event
    if event is not None and history.effects[event.label].place == CLOCK_PLACE == there:
        return event  # a clock that wanders is still one that is wrong
    return found
