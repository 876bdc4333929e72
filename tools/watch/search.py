"""The search over events: one by one, the most evident first, until none is left."""

from collections.abc import Callable

import numpy as np

from tools.inference.parameters import CLOCK_PLACE
from tools.watch.history import Event, History, already, earns_place, shaken_place, take
from tools.watch.rivals import refined
from tools.watch.water import named, rougher, water_event

EVIDENCE_NEEDED = 16.0  # nat over no change (docs/WATCH.md)
BEYOND_CHANCE = 7.3  # nat over the logarithm of how many changes are looked at
MOST_EVENTS = 5


def find_events(history: History, say: Callable[[str], None] = lambda text: None) -> None:
    """Events added to the history, the most evident first."""
    needed = evidence_needed(history)
    for _ in range(MOST_EVENTS):
        event = next_event(history)
        if event is None or event.evidence < needed or not earns_place(history, event):
            break
        history.events.append(event)
        take(history, event)
        say(f"{event.label or 'unknown'} in runs {event.span.first} to {event.span.end - 1}")


def evidence_needed(history: History) -> float:
    """Nat that an event needs: more where there are more runs, and so more changes that chance may bring."""
    looked_at = len(history.listed()) * len(history.flights.shared.labels)
    return max(EVIDENCE_NEEDED, BEYOND_CHANCE + float(np.log(max(looked_at, 1))))


def next_event(history: History) -> Event | None:
    """The change that is most evident beside those found: a label's course, or disorder where that explains more."""
    joint = history.joint()
    every = joint.changes(history.listed())
    changes = [one for one in every if not already(history, one) and earns_place(history, one)]
    best = max(changes, key=lambda one: one.evidence, default=None)
    event = refined(history, joint, best, changes) if best is not None and best.evidence >= EVIDENCE_NEEDED else None
    rough = water_event(history)
    if rough is None or rough.evidence < EVIDENCE_NEEDED or (event is not None and not rougher(history, rough, event)):
        return event
    if not earns_place(history, rough):
        return event
    found = named(history, rough)
    if event is not None and history.effects[event.label].place == CLOCK_PLACE == shaken_place(found):
        return event  # a clock that wanders is still one that is wrong
    return found
