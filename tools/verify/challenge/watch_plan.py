"""Which vehicles a blind test of `glider gap watch` holds: what changes, in which runs, by which course."""

from dataclasses import dataclass

import numpy as np

from glider.tools.verify.challenge.forms import KNOWN, SECRET, Form
from glider.tools.verify.challenge.plan import Planned

UNCHANGED, CHANGED, OUTSIDE = "unchanged", "changed", "outside"
STEP, EPISODE, GROWING = "step", "episode", "growing"
COURSES = (STEP, EPISODE, GROWING)
EVERY_OUTSIDE = 5  # one changed vehicle in so many is changed by something outside the catalogue
LEAST_AFTER = 2  # runs that a change lasts at least
LEAST_WATCHED = 3  # runs behind the reference


@dataclass(frozen=True)
class WatchCounts:
    """Vehicles of a watch's blind test, and their runs."""

    vehicles: int = 40
    unchanged: int = 10
    runs: int = 14
    reference: int = 5  # of the runs: before anything changes

    @property
    def judged(self) -> int:
        """Runs that are watched."""
        return self.runs - self.reference


@dataclass(frozen=True)
class VehiclePlan(Planned):
    """One vehicle; runs are counted from the first that is watched."""

    label: str | None
    course: str | None
    first: int | None
    last: int | None  # None: still there at the end
    mocap: bool

    def strengths(self, judged: int) -> np.ndarray:
        """Strength of the change in each watched run, (judged,), 1 at its full size."""
        found = np.zeros(judged)
        if self.first is None:
            return found
        end = judged if self.last is None else self.last + 1
        grown = np.arange(1, end - self.first + 1) / (end - self.first)
        found[self.first : end] = grown if self.course == GROWING else 1.0
        return found


def draw_span(rng: np.random.Generator, course: str, judged: int) -> tuple[int, int | None]:
    """First and last run of a change; a growing one has runs enough to grow in."""
    if course == EPISODE:
        length = int(rng.integers(LEAST_AFTER, max(LEAST_AFTER, judged // 2) + 1))
        first = int(rng.integers(0, judged - length))
        return first, first + length - 1
    least = LEAST_AFTER if course == STEP else max(LEAST_AFTER, judged // 2)
    return int(rng.integers(0, judged - least + 1)), None


def _draw(rng: np.random.Generator, forms: tuple[Form, ...], count: int) -> list[Form]:
    """`count` forms, all as often as can be."""
    turns = -(-count // len(forms)) if count else 0
    return [forms[n] for _ in range(turns) for n in rng.permutation(len(forms))][:count]


def watch_plan(seed: int, counts: WatchCounts) -> list[VehiclePlan]:
    """The vehicles in their order; half of them at a pool with motion capture, those that need it among them."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    changed = counts.vehicles - counts.unchanged
    outside = changed // EVERY_OUTSIDE
    drawn: list[tuple[str, Form | None]] = [(UNCHANGED, None)] * counts.unchanged
    drawn += [(CHANGED, form) for form in _draw(rng, KNOWN, changed - outside)]
    drawn += [(OUTSIDE, form) for form in _draw(rng, SECRET, outside)]
    must = np.array([form is not None and form.by_mocap for _, form in drawn])
    free = rng.permutation(np.flatnonzero(~must))
    mocap = must.copy()
    mocap[free[: max(0, len(drawn) // 2 - int(must.sum()))]] = True
    courses = [COURSES[n % len(COURSES)] for n in rng.permutation(len(drawn))]
    plans = []
    for number, n in enumerate(rng.permutation(len(drawn))):
        kind, form = drawn[n]
        if form is None:
            plans.append(VehiclePlan(number, kind, None, None, None, None, bool(mocap[n])))
            continue
        first, last = draw_span(rng, courses[n], counts.judged)
        plans.append(VehiclePlan(number, kind, form.label, courses[n], first, last, bool(mocap[n])))
    return plans
