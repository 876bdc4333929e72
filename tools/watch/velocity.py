"""Mean speed through the water of an ocean glider's watched runs, by its vehicle with what changed.

See docs/explanation/ocean.md.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glider.tools.gap.velocity import directions, mean_level, mean_speed, of_run
from glider.tools.identify.ocean.identify import covariance, fitted, inflation_for
from glider.tools.inference.parameters import nuisance_parameters
from glider.tools.inference.problem import Problem
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.inference.steady import first_values
from glider.tools.watch.flights import RunEnsemble, numbers
from glider.tools.watch.history import ChangeEvent, History
from glider.tools.watch.label_fit import affected_runs, fit_label, values_of
from glider.tools.watch.verdicts import ResolvedEvent, group_of

FITTED = 3  # runs of an event, from which its size beside the vehicle is found


@dataclass
class OwnModel:
    """The vehicle by itself: what all runs share beside it makes up for the form of the model, and is no speed."""

    values: np.ndarray  # (count of what the file allows,) spreads
    directions: list[np.ndarray]  # of P (N_P,), 1 sigma each
    sizes: dict[tuple[int, str], np.ndarray] = field(default_factory=dict)  # by event and label, spreads, once found

    def at(self, flights: RunEnsemble) -> np.ndarray:
        """The values of all that runs may share, (count,): no effect."""
        x = np.zeros(flights.shared.count)
        x[: len(self.values)] = self.values
        return x


def own_model(problem: Problem, learned_from: np.ndarray) -> OwnModel:
    """An identified vehicle as its file has it; another as the runs that are learned from (runs,) identify it."""
    free = nuisance_parameters(problem)
    if problem.model.spread is not None:
        return OwnModel(np.zeros(len(free)), directions(problem.model))
    shared = SharedParameters(free, {}, {}, 1.0)
    parts = [problem.part(n) for n in numbers(learned_from)]
    x, found = fitted(parts, shared, first_values(problem, free))
    values, vectors = np.linalg.eigh(covariance(found, shared, inflation_for(len(parts))))
    spreads = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return OwnModel(x, [shared.model(problem, one)[0] - problem.model.P for one in spreads])


def velocity(own: OwnModel, history: History, resolved: list[ResolvedEvent], n: int) -> dict[str, Any]:
    """mean_speed of a run by its vehicle with the events that it is in.

    Labels that cannot be distinguished are other speeds: mean and interval are those over the group.
    """
    flights = history.flights
    there = [event for event in history.events if event.has_course and weight_of(history, event, n) > 0.0]
    x = own.at(flights)
    for event in there:
        x = with_event(own, history, event, event.label, n, x)
    part, shared, moves = flights.parts[n], flights.shared, np.zeros(1)
    P, F = shared.model(part, x)
    moved = [(P + one, F) for one in own.directions]
    for event in there:
        moved += [shared.model(part, x + one) for one in size_directions(history, event, n)]
        moves = np.add.outer(moves, group_moves(own, history, event, resolved, n, x)).ravel()
    return mean_speed(of_run(part, (P, F), moved), moves.tolist())


def weight_of(history: History, event: ChangeEvent, n: int) -> float:
    """A run's share of an event."""
    return float(event.span.weights(history.flights.count)[n])


def group_moves(
    own: OwnModel, history: History, event: ChangeEvent, resolved: list[ResolvedEvent], n: int, x: np.ndarray
) -> np.ndarray:
    """By how much the labels of an event's group move a run's mean speed from that by its own label, m/s, itself first.

    They count alike: a group is what cannot be distinguished.
    """
    flights = history.flights
    part, shared = flights.parts[n], flights.shared
    groups = [group_of(history, one) for one in resolved if one.event is event]
    others = [label for label in (groups[0] if groups else []) if label != event.label and label in shared.labels]
    bare = x.copy()
    bare[shared.labels[event.label]] -= weight_of(history, event, n) * size_of(own, history, event, event.label)
    speeds = [mean_level(part, shared.model(part, x))]
    for label in others:
        speeds.append(mean_level(part, shared.model(part, with_event(own, history, event, label, n, bare))))
    return np.array(speeds) - speeds[0]


def with_event(own: OwnModel, history: History, event: ChangeEvent, label: str, n: int, x: np.ndarray) -> np.ndarray:
    """Values (count,) with an event taken for a label."""
    shared, weight = history.flights.shared, weight_of(history, event, n)
    moved = values_of(shared, label, x, weight, size_of(own, history, event, label))
    return np.clip(moved, shared.low, shared.high)


def size_of(own: OwnModel, history: History, event: ChangeEvent, label: str) -> np.ndarray:
    """The size, spreads, by which a label beside the vehicle alone takes an event's runs."""
    flights, key = history.flights, (id(event), label)
    if key not in own.sizes:
        weights = event.span.weights(flights.count)
        chosen = sorted(numbers(weights * history.judged), key=lambda n: -weights[n])[:FITTED]
        runs = affected_runs(flights, chosen, weights, [own.at(flights)] * len(chosen))
        start = event.size if label == event.label else np.zeros(len(flights.shared.labels[label]))
        own.sizes[key] = fit_label(runs, flights.shared, label, start).size
    return own.sizes[key]


def size_directions(history: History, event: ChangeEvent, n: int) -> np.ndarray:
    """Directions (directions, count) of 1 sigma of an event's size in a run."""
    shared = history.flights.shared
    values, vectors = np.linalg.eigh(event.covariance)
    found = np.zeros((len(values), shared.count))
    spread = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    found[:, shared.labels[event.label]] = weight_of(history, event, n) * spread
    return found
