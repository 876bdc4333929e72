"""`glider gap watch`: what is different, since when. The flow from runs to the answer (docs/explanation/watch.md)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import Case
from glider.tools.data.vehicle_kinds import kind_of
from glider.tools.gap.measure import run_gap
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.predict import fly
from glider.tools.inference.problem import Problem, cut, problem_of
from glider.tools.inference.shared_parameters import shared_parameters
from glider.tools.watch.answer import NONE, RunVerdict, WatchAnswer
from glider.tools.watch.events import GROWING
from glider.tools.watch.flights import RunEnsemble
from glider.tools.watch.history import History
from glider.tools.watch.search import find_events
from glider.tools.watch.verdicts import event_answer, material, resolve_events, run_verdict


def watch(case: Case, reference: Case | None = None, say: Callable[[str], None] = lambda text: None) -> WatchAnswer:
    """What changed over the runs of a case; InputError where there is nothing to compare them with."""
    before = [] if reference is None else reference.runs
    kind = kind_of(case.vehicle)
    runs, skipped = kind.usable_runs([*before, *case.runs])
    count = len(before)
    here = sorted(runs)
    reference_names = [f"{reference.folder.name}/{run.name}" for run in before] if reference is not None else []
    names = [*reference_names, *(run.name for run in case.runs)]
    judged = np.array([reference is None or n >= count for n in here], dtype=bool)
    if not judged.any() or (reference is not None and judged.all()) or len(here) < 2:
        raise InputError(nothing_to_compare(skipped, names, count), source=case.folder)
    problem = problem_of(case, runs=[runs[n] for n in here])
    parts = [problem.part(k) for k in range(len(here))]
    learned_from = ~judged if reference is not None else first_runs(len(here), problem.kind.learned_runs)
    begins = int((~judged).sum()) if reference is not None else 1
    history = looked_at(parts, problem, learned_from, judged, begins, say)
    if reference is None:
        again = unchanged(history, learned_from)
        if (again != learned_from).any() and again.sum() >= min(WATCH.scatter_runs, learned_from.sum()):
            say("something changed among the first runs: learning again from those without it")
            learned_from = again
            history = looked_at(parts, problem, learned_from, judged, begins, say)
    resolved = resolve_events(history)
    run_names = [names[n] for n in here]
    speeds = kind.speeds(problem, learned_from)
    verdicts = []
    for n, run in enumerate(case.runs, start=count):
        if n not in runs:
            verdicts.append(RunVerdict(run.name, NONE, [], None, skipped[n]))
            continue
        k = here.index(n)
        gap = shared_gap(parts[k], history.flights)
        verdict = run_verdict(history, resolved, k, run.name, gap)
        verdicts.append(verdict if speeds is None else replace(verdict, velocity=speeds(history, resolved, k)))
    events = [event_answer(history, one, run_names) for one in resolved]
    learned = [run_names[k] for k in np.flatnonzero(learned_from)]
    return WatchAnswer(verdicts, events, learned, cautions(case, reference, learned, skipped, names), kind.name)


def first_runs(count: int, most: int) -> np.ndarray:
    """Where learning begins without a reference: the first runs, `most` at most, (runs,) bool."""
    return np.arange(count) < max(1, min(most, count // WATCH.reference_part))


def looked_at(
    parts: list[Problem],
    problem: Problem,
    learned_from: np.ndarray,
    judged: np.ndarray,
    begins: int,
    say: Callable[[str], None],
) -> History:
    """The shared model learned, and the events found."""
    flights = RunEnsemble(list(parts), shared_parameters(problem), learned_from)
    flights.learn()
    say(f"learned from {int(learned_from.sum())} runs what all share")
    history = History(flights, judged, begins)
    find_events(history, material, say)
    return history


def unchanged(history: History, learned_from: np.ndarray) -> np.ndarray:
    """The runs before the first event and behind those that ended, (runs,) bool; else `learned_from`.

    What does not matter is no event, and what grows slowly from the first runs on is not theirs alone.
    """
    count, number = history.flights.count, 0
    inside, early = np.zeros(count, dtype=bool), False
    for event in history.events:
        own, number = number, number + int(event.has_course)
        if event.span.course == GROWING or (event.has_course and not material(history, event, own)):
            continue
        early |= event.span.first < learned_from.sum()
        inside |= event.span.weights(count) > 0.0
    return ~inside if early else learned_from


def shared_gap(part: Problem, flights: RunEnsemble) -> float | None:
    """Total gap of a run to the model that all runs share."""
    Y = fly(part, *flights.shared.model(part, flights.values))
    total = run_gap(part.kind.measures, part.runs[0], Y, cut(part).listed[0]).total
    return float(total) if np.isfinite(total) else None


def nothing_to_compare(skipped: dict[int, str], names: list[str], count: int) -> str:
    """Why no run can be compared with any other."""
    if skipped:
        n = min(skipped, key=lambda k: (k < count, k))
        return f"nothing to compare: {names[n]}: {skipped[n]}"
    return "nothing to compare: one run, and no --reference"


def cautions(
    case: Case, reference: Case | None, learned: list[str], skipped: dict[int, str], names: list[str]
) -> list[str]:
    """What has to be said with the answer."""
    found = []
    if len(learned) < WATCH.scatter_runs:
        found.append(
            f"only {len(learned)} run{'' if len(learned) == 1 else 's'} to learn from: how much runs differ though "
            "nothing changed is assumed, not learned, and a model that is wrong may pass for a change"
        )
    if reference is None:
        found.append(f"no reference: {', '.join(learned)} are taken as unchanged")
    if reference is not None and reference.motion_capture != case.motion_capture:
        found.append("motion capture in the reference or in the case only: what it alone sees cannot be compared")
    found += [f"reference run {names[n]} left out: {why}" for n, why in skipped.items() if names[n].find("/") > 0]
    return found
