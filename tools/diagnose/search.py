"""The search for the cause: every label tried, the likely ones fitted, more than one where one does not do.

The data's weight is let in by degrees. At first the filter is told of a disturbance many times the vehicle's, so that
it holds any model to the course flown and the misfit is nearly a parabola however large the effect; then of less, and
at last of what the vehicle file says. Candidates that fall behind by far are dropped on the way.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.diagnose.contradiction import LEAPS, NEAR, NEARER, contradicting
from tools.diagnose.retime import retimed
from tools.inference.candidates import CLOCK_PLACE, Free, allowed, candidates, place
from tools.inference.fit import POOR, WIDE, Course, Fitter
from tools.inference.problem import Gains, Problem

ROUGHNESS = (100.0, 10.0)  # times the disturbance, before the vehicle's own
TRIED, KEPT, LEFT = 20, 12, 8  # candidates: after the screen, after the first rung, after the second
FAR = 60.0  # half misfits behind the best, and then no longer worth a flight, beside a share of all that was gained
SHARE = 0.5
STARTED = 4  # candidates at most that are given other starts at a time
SETTLING = 1  # steps of all candidates before any is dropped
ENOUGH = 0.05  # half misfits; a candidate that gains less has arrived
MOST_EFFECTS = 3
SECONDS = 5  # further effects tried beside each of the leading candidates
LEADING = 3
SHOWN = 1.0  # squared sigma: a spread of an effect that moves nothing by as much cannot be seen in these runs
EARNED = 5.0  # nat that a further effect must promise
POLISHED = (3, 2, 1)  # times at most, by the number of effects
ROUNDS = 3  # of gains at the best label and all labels tried again there, at most
RETIMED = 3  # times that poses are moved to where the clock found so far says
COOL = 1.05  # times the weight of white innovations: the best candidate is near the truth


@dataclass
class Search:
    """Where a search stands."""

    problem: Problem
    allowed: list[Free]
    candidates: dict[str, list[Free]]
    fitter: Fitter
    null: Course
    courses: list[Course]
    gains: Gains

    def free(self, labels: tuple[str, ...]) -> list[Free]:
        return [f for label in labels for f in self.candidates[label]]

    def model(self, course: Course) -> tuple[np.ndarray, np.ndarray]:
        return place(self.problem, [*self.allowed, *course.free], np.concatenate([course.allowed, course.values]))

    def ranked(self) -> list[Course]:
        return sorted(self.courses, key=lambda c: -c.log_evidence(self.fitter))

    @property
    def best(self) -> Course:
        return self.ranked()[0]


def settle(fitter: Fitter, course: Course, steps: int = 6) -> None:
    """A candidate to its least misfit."""
    for _ in range(steps):
        fitter.advance([course])
        if course.gained < 2.0 * ENOUGH:
            break


def prune(courses: list[Course], worst: float, most: int, least_kept: int = 4) -> list[Course]:
    """The candidates that may still win: `worst` is the misfit of no effect.

    Each is taken to gain once more what its last step brought: many steps need not mean a poor end.
    """
    hoped = {id(c): c.misfit - (c.gained if np.isfinite(c.gained) else 0.0) for c in courses}
    courses = sorted(courses, key=lambda c: hoped[id(c)])
    least = min(c.misfit for c in courses)
    margin = max(2.0 * FAR, SHARE * (worst - least))
    return [c for n, c in enumerate(courses) if n < least_kept or hoped[id(c)] - least <= margin][:most]


def improve(fitter: Fitter, courses: list[Course], worst: float, most: int, steps: int) -> list[Course]:
    """Candidates led on and thinned out."""
    for _ in range(steps):
        moving = [c for c in courses if c.gained >= 2.0 * ENOUGH]
        if not moving:
            break
        fitter.advance(moving)
        courses = prune(courses, worst, most)
    return courses


def carried(fitter: Fitter, courses: list[Course]) -> list[Course]:
    """Candidates taken over to another fitter, with where they stand."""
    return [fitter.course(c.labels, c.free, c.values, c.allowed) for c in courses]


def screen(search: Search, beside: Course, most: int) -> list[Course]:
    """The labels that should gain most beside a candidate, were everything linear: as candidates before a step.

    What begins only beyond some size (a limit that the commands never reached) is nudged further.
    """
    fitter, tried = search.fitter, []
    for label, free in search.candidates.items():
        if label in beside.labels or {f.entry for f in free} & {f.entry for f in beside.free}:
            continue
        values = np.concatenate([beside.values, np.zeros(len(free))])
        course = fitter.course((*beside.labels, label), [*beside.free, *free], values, beside.allowed)
        course.settle(beside.e, fitter.tight)
        course.known = beside.columns if len(beside.free) else course.known
        tried.append(course)
    fitter.linearise(tried, coarse=True)
    new = len(beside.free)

    def shows(course: Course) -> bool:
        return (course.columns[new:] ** 2).sum() > SHOWN

    hidden = [c for c in tried if not shows(c) and all(f.kinked for f in c.free[new:])]
    for course in hidden:
        course.whole = WIDE
        course.known = course.columns[:new]
    if hidden:
        fitter.linearise(hidden, coarse=True)
    shown = [c for c in tried if shows(c)]
    return sorted(shown, key=lambda course: -course.promise())[:most]


def leap(fitter: Fitter, courses: list[Course], leaps=LEAPS, afresh=False) -> None:
    """Further starts: each parameter of a candidate's last effect alone far out, where that does better.

    A delay is not linear. afresh: also with what is allowed back at the vehicle file's: it may have been led to make up
    for the effect.
    """
    points = []
    for course in courses:
        bases = [course.allowed] + ([np.zeros(len(course.allowed))] if afresh else [])
        for k in (k for k, free in enumerate(course.free) if free.label == course.labels[-1]):
            for far in leaps:
                values = course.values.copy()
                values[k] = far
                if course.low[k] <= far <= course.high[k]:
                    points += [(course, values, base) for base in bases]
    flown = fitter.flown([(course.free, values, base) for course, values, base in points])
    for (course, values, base), e in zip(points, flown, strict=True):
        course.consider(e, values, base, fitter.tight)
    for course in courses:
        course.accept()
        course.gained = np.inf  # no step was taken from there yet


def contradiction_first(search: Search) -> bool:
    """Readings that contradict each other, settled before all else; False where they do not.

    A filter told to doubt its model leans on the readings, and with gyros that turn twice as far as the attitude, or
    with poses that are a second late, it holds no model to the course flown.
    """
    if search.fitter.tight <= NEAR:
        return False
    found = contradicting(search.problem, search.allowed, search.candidates)
    if found is None:
        return False
    free, value = found
    labelled = search.candidates[free.label]
    search.courses = [search.fitter.course((free.label,), labelled, np.array([value * (f is free) for f in labelled]))]
    for _ in range(RETIMED if catalogue()[free.label].place == CLOCK_PLACE else 1):
        if catalogue()[free.label].place == CLOCK_PLACE:
            search.problem = retimed(search.problem, search.model(search.courses[0])[1])
        refilter(search, search.courses[0], 1.0)
        settle(search.fitter, search.courses[0])
    return True


def begin(fitter: Fitter, courses: list[Course]) -> None:
    """The first step of candidates; other starts for those to which it should bring much, and brings much less."""
    fitter.move(courses)
    much = [c for c in courses if c.foreseen_gain() > 2.0 * FAR and c.gained < POOR * c.foreseen_fall()]
    much = sorted(much, key=lambda c: -c.foreseen_gain())[:STARTED]
    leap(fitter, much, (*NEARER, *LEAPS), afresh=True)


def gains_at(problem: Problem, model: tuple[np.ndarray, np.ndarray], roughness: float) -> Gains:
    """Gains of a filter with a model."""
    gains = problem.filter(*model, roughness=roughness, begin=True)
    return gains if problem.rules.splice else problem.unheld(gains)


def refilter(search: Search, at: Course, roughness: float) -> None:
    """New gains and a new fitter at a candidate; all candidates are taken over."""
    problem = search.problem
    search.gains = gains_at(problem, search.model(at), roughness)
    search.fitter = Fitter(problem, search.gains, search.allowed, at, temper=True)
    search.courses = carried(search.fitter, search.courses)
    search.null = carried(search.fitter, [search.null])[0]
    search.fitter.measure(search.courses)
    settle(search.fitter, search.null)


def first_round(search: Search) -> None:
    """Every label tried in the roughest filter, and the likely ones led on to the vehicle's own disturbance."""
    fitter, null = search.fitter, search.null
    fitter.linearise([null])
    tried = screen(search, null, TRIED)
    settle(fitter, null)
    fitter.move(tried)
    leap(fitter, tried)
    for _ in range(SETTLING):
        fitter.advance(tried)
    search.courses = improve(fitter, prune(tried, null.misfit, KEPT, KEPT), null.misfit, KEPT, 3 - SETTLING)
    refilter(search, min([*search.courses, search.null], key=lambda c: c.misfit), ROUGHNESS[1])
    search.courses = improve(search.fitter, search.courses, search.null.misfit, LEFT, 3)


def run(problem: Problem, say: Callable[[str], None] = lambda text: None, first: Course | None = None) -> Search:
    """The search over a problem's runs; from the effects of `first`, where those are certain."""
    free, known = allowed(problem), candidates(problem)
    P, F = place(problem, free, np.zeros(len(free)))
    gains = gains_at(problem, (P, F), ROUGHNESS[0])
    fitter = Fitter(problem, gains, free, temper=True)
    null = fitter.course((), [])
    fitter.measure([null])
    search = Search(problem, free, known, fitter, null, [], gains)
    if first is not None:
        search.courses = [fitter.course(first.labels, first.free, first.values, first.allowed)]
        refilter(search, search.courses[0], 1.0)
        settle(search.fitter, search.courses[0])
    elif contradiction_first(search):
        say(f"readings contradict each other: {search.courses[0].labels[0]}")
    else:
        first_round(search)
        say(f"screened {len(known)} labels")
    for _ in range(ROUNDS):
        polish(search, POLISHED[0])
        first = search.best.labels
        rescreen(search)
        if search.best.labels == first:
            break
    say(f"one effect: {' '.join(search.best.labels) or 'none'}")
    for count in range(2, MOST_EFFECTS + 1):
        if len(search.best.labels) < count - 1 or not widen(search, count):
            break
        polish(search, POLISHED[count - 1])
        say(f"{count} effects: {' '.join(search.best.labels)}")
    return search


def rescreen(search: Search) -> None:
    """Labels tried again at full weight beside no effect: weak effects do not show in a filter told to doubt."""
    if search.fitter.tight > NEAR or search.null.misfit / len(search.null.e) > NEAR:
        return
    search.fitter.linearise([search.null])
    there = {c.labels for c in search.courses}
    new = [c for c in screen(search, search.null, LEFT) if c.labels not in there]
    if not new:
        return
    begin(search.fitter, new)
    search.courses = improve(search.fitter, [*search.courses, *new], search.null.misfit, 2 * LEFT, 3)


def polish(search: Search, times: int) -> None:
    """Gains and columns at the best candidate, and all candidates led on; again while that candidate is far away."""
    for _ in range(times):
        refilter(search, min([*search.courses, search.null], key=lambda c: c.misfit), 1.0)
        search.courses = improve(search.fitter, search.courses, search.null.misfit, 2 * LEFT, 3)
        if search.fitter.tight < COOL:
            break


def widen(search: Search, count: int) -> bool:
    """Further effects beside the leading candidates of one effect less; False where none promises to earn its place."""
    leading = [c for c in search.ranked() if len(c.labels) == count - 1][:LEADING]
    search.fitter.linearise(leading)
    more: dict[tuple[str, ...], Course] = {}
    for n, course in enumerate(leading):
        tried = screen(search, course, SECONDS)
        if n == 0 and (not tried or tried[0].promise() - course.promise() < EARNED):
            return False
        more |= {tuple(sorted(c.labels)): c for c in tried}
    found = list(more.values())
    begin(search.fitter, found)
    search.courses += improve(search.fitter, found, min(c.misfit for c in leading), LEFT, 3)
    return True
