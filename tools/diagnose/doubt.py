"""Whether what the selected effects leave is an effect that nobody knows, or disorder: of the water, or of a clock."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from sim_backend.core import effect_layout as ef
from sim_backend.effects.catalogue import catalogue
from tools.diagnose.probes import CLOCK, TURBULENCE, WAVES, Probed, probe_model, probes
from tools.diagnose.search import Search
from tools.diagnose.shrink import Shrinkage
from tools.inference.candidates import CLOCK_PLACE
from tools.inference.fit import Course

UNCLEAN = 6.0  # sigma, corrected for the number of tests
LEFT_OVER, LEFT_WIDTH = 0.145, 1.1  # share of the explainable misfit at which unknown is as likely as not; e-folds
NOISY, NOISY_WIDTH = 0.2, 0.8  # share of the explainable misfit that is left: disorder is looked for; width in e-folds
UNFIT = 5.0  # tolerances that the best explanation still misses by: no effect of the catalogue does that
LOOSE = 3.0  # times the floor, and one tolerance, that no vehicle without a gap is off
ONE_AXIS = 0.65  # of what all axes bring together: where one alone brings as much, it is no turbulence
MOSTLY = 0.9  # of all that can be explained, for turbulence or waves to be the cause
LEAST_DOUBT, MORE_DOUBT = 0.002, 0.005  # probability of an unknown effect where nothing is left, and where something is
CLOCKED = 0.5  # of what freeing the poses altogether gains, that freeing their clock must
RIVALS = 4  # links asked beside water and axes


def chance(share: float, middle: float, width: float) -> float:
    """Probability that what is left is a gap of its own (docs/DIAGNOSIS.md, Thresholds)."""
    z = (np.log(max(share, 1e-6)) - np.log(middle)) / width
    return float(np.clip(norm.cdf(z), MORE_DOUBT, 1.0 - MORE_DOUBT))


def left_share(shrinkage: Shrinkage) -> float:
    """Of the recalibrated model's squared gap beyond the floor, the share that the selected effects leave."""
    beyond = shrinkage.recalibrated**2 - shrinkage.floor**2
    left = shrinkage.after**2 - shrinkage.floor**2
    return float(np.clip(left / beyond, 0.0, 1.0)) if beyond > 0.0 else 0.0


@dataclass
class Left:
    """What the selected effects leave: nat, by links freed one at a time."""

    brought: float  # by the selected effects over none
    left: float  # by the link that gains most when freed
    freed: list[Probed]

    @property
    def share(self) -> float:
        return float(np.clip(self.left / max(self.left + self.brought, 1e-9), 0.0, 1.0))


def what_is_left(search: Search, course: Course, noise: Probed | None) -> Left:
    """Links freed at a candidate, beside what its effects bring; `noise` is brought too."""
    problem = search.problem
    null = float(problem.filter(*search.model(search.null), begin=True).misfit.sum())
    own = float(search.gains.misfit.sum())
    freed = probe_model(problem, *search.model(course), probes(problem))
    brought = max(0.5 * (null - own), 0.0) + (noise.gain if noise is not None else 0.0)
    return Left(brought, freed[0].gain, freed)


def scatter(search: Search, freed: list[Probed]) -> Probed | None:
    """Turbulence or waves, where water in disorder explains the recalibrated model's misfit better than any one link.

    Turbulence shakes every axis: where one alone brings most of it, something else shakes that axis. `freed`: the links
    at the selected model; those that gain most there are asked beside water and axes.
    """
    rivals = [found.probe for found in freed[:RIVALS]]
    asked = [p for p in probes(search.problem) if p in rivals or p.stage in ("force", "water")]
    found = probe_model(search.problem, *search.model(search.null), asked)
    first = found[0]
    if first.probe.name == WAVES:
        return first
    axes = sorted((p.gain for p in found if p.probe.stage == "force" and p.probe.name != TURBULENCE), reverse=True)
    return first if first.probe.name == TURBULENCE and axes[0] < ONE_AXIS * first.gain else None


def disorder(search: Search, left: Left) -> Probed | None:
    """What the search has to be told of, to see what is beside it; None where there is nothing of the kind.

    Motion capture's clock where freeing it gains more than any other link, its poses' noise apart; turbulence or waves
    where they are the cause: of all that can be explained, they explain MOSTLY.
    """
    clock = [found for found in left.freed if found.probe.name == CLOCK and found.gain > CLOCKED * left.left]
    if clock and left.freed[0].probe.element == CLOCK_PLACE[1]:
        return clock[0]
    if left.share <= NOISY:
        return None
    found = scatter(search, left.freed)
    return found if found is not None and found.gain > MOSTLY * (left.brought + left.left) else None


def clock_label(search: Search, course: Course) -> str:
    """The label of a clock that wanders: one that was selected; else whether it is late, or ever later.

    The clock's error where the filter stands is drawn by a constant and by a line from 0, over all runs at once.
    """
    for label in course.labels:
        if catalogue()[label].place == CLOCK_PLACE:
            return label
    since, late = search.problem.since, search.gains.X[:, ef.X_LATE]
    slope = float(since @ late) / max(float(since @ since), 1e-9)
    left = {"mocap_delay": late - late.mean(), "clock_skew": late - slope * since}
    return min(left, key=lambda label: float(left[label] @ left[label]))


def doubt(search: Search, main: str, shrinkage: Shrinkage, left: Left | None, noise: bool) -> float:
    """Probability that the gap is none of the catalogue's, or that there is one where none shows otherwise.

    main: the main effect, or "" without; noise: the search was told of disorder, which no window's gap tells of.
    """
    if left is None:  # what is left was not asked about, or nothing is
        loose = not main and not noise and shrinkage.after > max(LOOSE * shrinkage.floor, 1.0)
        unfit = search.problem.rules.whiteness and (loose or shrinkage.after > UNFIT)
        return 1.0 - MORE_DOUBT if unfit else LEAST_DOUBT
    if shrinkage.after > UNFIT or not (main or noise):
        return 1.0 - MORE_DOUBT
    if noise:
        return chance(left.share, NOISY, NOISY_WIDTH)
    return chance(left.share, LEFT_OVER, LEFT_WIDTH)
