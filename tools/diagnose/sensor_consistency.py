"""Sensor consistency: sensors and clocks so far out that no motion of the vehicle reconciles them.

With the disturbance inflated a hundredfold the filter lets the vehicle move as it likes: what it then misses by far, no
force explains. One run, the one that misses most, is filtered again with each parameter of each sensor's and of motion
capture's labels far out; the one that leaves least is where the search begins.
"""

import itertools

import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.inference.parameters import CLOCK_PLACE, FreeParameter, model_at
from glider.tools.inference.predict import poses_in_place
from glider.tools.inference.problem import LOST, Gains, Problem

DISTANT = (-10.0, -5.0, -2.0, 2.0, 5.0, 10.0)  # spreads of a parameter, tried as starts
NEARBY = (-1.0, -0.5, 0.5, 1.0, 1.5)  # likewise, nearer
HOLDS_BELOW = 30.0  # squared innovations a sample: beyond that a filter does not hold its model to the course flown
MAX_REMAINING_SHARE = (
    0.5  # of the squared innovations, that are left at most where the right reading is set about right
)


def mean_nis(problem: Problem, gains: Gains) -> float:
    """Squared innovations a sample, of a filter's own model."""
    e = np.clip(np.nan_to_num(gains.E[problem.valid], nan=LOST), -LOST, LOST)
    return float(e @ e) / len(e)


def suspects(candidates: dict[str, list[FreeParameter]]) -> list[FreeParameter]:
    """The parameters of the labels of sensors and of motion capture's clock."""
    effects = catalogue()
    return [
        free
        for label, found in candidates.items()
        if effects[label].subsystem == "sensing" or effects[label].place == CLOCK_PLACE
        for free in found
    ]


def inconsistent_sensors(
    problem: Problem, nuisance: list[FreeParameter], candidates: dict[str, list[FreeParameter]]
) -> list[tuple[FreeParameter, float]]:
    """Of each label that reconciles the readings, its parameter and how many spreads it is out; the best first."""
    own = np.zeros(len(nuisance))
    whole = problem.filter(*model_at(problem, nuisance, own), begin=True)
    bounds = problem.recording.bounds
    missed = [np.nanmean(whole.E[a:b] ** 2) for a, b in itertools.pairwise(bounds)]
    worst = problem.part(int(np.argmax(np.nan_to_num(missed))))
    most = MAX_REMAINING_SHARE * mean_nis(worst, worst.filter(*model_at(problem, nuisance, own), begin=True))
    found: dict[str, tuple[float, FreeParameter, float]] = {}
    for free in suspects(candidates):
        for far in (far for far in (*NEARBY, *DISTANT) if free.low <= far <= free.high):
            model = model_at(problem, [*nuisance, free], np.append(own, far))
            placed, walk, _ = poses_in_place(worst, model[1])
            left = mean_nis(placed, placed.filter(*model, begin=True, more=walk))
            if left < min(most, found.get(free.label, (np.inf,))[0]):
                found[free.label] = left, free, far
    return [(free, far) for _, free, far in sorted(found.values(), key=lambda one: one[0])]
