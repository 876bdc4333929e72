"""Readings that contradict each other: sensors and clocks so far out that no motion of the vehicle reconciles them.

With the disturbance raised a hundredfold the filter lets the vehicle move as it likes: what it then misses by far, no
force explains. One run, the one that misses most, is filtered again with each parameter of each sensor's and of motion
capture's labels far out; the one that leaves least is where the search begins.
"""

import itertools

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.inference.candidates import CLOCK_PLACE, Free, place
from tools.inference.problem import LOST, Gains, Problem

LEAPS = (-10.0, -5.0, -2.0, 2.0, 5.0, 10.0)  # spreads of a parameter, tried as starts
NEARER = (-1.0, -0.5, 0.5, 1.0, 1.5)  # likewise, nearer
NEAR = 30.0  # squared innovations a sample: beyond that a filter does not hold its model to the course flown
OUT = 0.5  # of the squared innovations, that are left at most where the right reading is set about right


def heat(problem: Problem, gains: Gains) -> float:
    """Squared innovations a sample, of a filter's own model."""
    e = np.clip(np.nan_to_num(gains.E[problem.valid], nan=LOST), -LOST, LOST)
    return float(e @ e) / len(e)


def suspects(candidates: dict[str, list[Free]]) -> list[Free]:
    """The parameters of the labels by which readings contradict each other."""
    effects = catalogue()
    return [
        free
        for label, found in candidates.items()
        if effects[label].subsystem == "sensing" or effects[label].place == CLOCK_PLACE
        for free in found
    ]


def contradicting(
    problem: Problem, allowed: list[Free], candidates: dict[str, list[Free]]
) -> tuple[Free, float] | None:
    """The parameter, and how many spreads it is out, that reconciles the readings best; None where none does."""
    own = np.zeros(len(allowed))
    whole = problem.filter(*place(problem, allowed, own), begin=True)
    bounds = problem.recording.bounds
    missed = [np.nanmean(whole.E[a:b] ** 2) for a, b in itertools.pairwise(bounds)]
    worst = problem.part(int(np.argmax(np.nan_to_num(missed))))
    first = heat(worst, worst.filter(*place(problem, allowed, own), begin=True))
    best, least = None, OUT * first
    for free in suspects(candidates):
        for far in (far for far in (*NEARER, *LEAPS) if free.low <= far <= free.high):
            model = place(problem, [*allowed, free], np.append(own, far))
            if (left := heat(worst, worst.filter(*model, begin=True))) < least:
                best, least = (free, far), left
    return best
