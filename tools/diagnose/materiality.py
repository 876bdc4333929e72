"""Whether an effect matters: how far it moves what is measured, and not only how surely it is there.

Evidence grows with the length of the runs, whatever an effect does: a clock that is a millisecond late brings a
hundred nat in ten minutes of 10 Hz. What nobody could see in a window is no gap (docs/reference/gap.md, Measures).
"""

import numpy as np

from glider.tools.diagnose.gates import materiality
from glider.tools.diagnose.search import Search
from glider.tools.diagnose.shrink import AFTER, FLOOR, Shrinkage, case_noise_floor
from glider.tools.gap.measure import mean_square
from glider.tools.inference.channels import errors
from glider.tools.inference.fit import Hypothesis
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.predict import at_its_word, fly_windows_from
from glider.tools.inference.problem import Problem, cut


def movements(search: Search, hypothesis: Hypothesis) -> dict[str, float]:
    """By effect of a hypothesis: the largest rms, in tolerances, by which it moves a channel of a window.

    Windows are flown with it and without it from the same starts, where the filter of the whole model stands.
    """
    effects = search.entries(hypothesis)
    if not effects:
        return {}
    problem = search.problem.as_recorded
    P, F = search.model(hypothesis)
    gains, found = at_its_word(problem, P, F), {}
    whole = fly_windows_from(problem, P, F, gains)
    for label, entries in effects.items():
        without = search.without_effect(F, entries)
        found[label] = largest(problem, whole, fly_windows_from(problem, P, without, gains))
    return found


def largest(problem: Problem, Y: np.ndarray, other: np.ndarray) -> float:
    """The largest rms of a channel in a scored window by which two predictions (rows, N_Y) differ, in tolerances."""
    most = 0.0
    for n, listed in enumerate(cut(problem).listed):
        first = problem.recording.bounds[n]
        for window in (window for window in listed if window.scored and window.start < window.end):
            rows = slice(first + window.start, first + window.end)
            for channel in problem.kind.measures.channels_of(problem.runs[n]):
                square = mean_square(channel, errors(channel, Y[rows], other[rows]))
                most = max(most, float(np.sqrt(np.nan_to_num(square))))
    return most


def excess(after: dict[str, float], floor: dict[str, float]) -> float:
    """The most by which a channel's gap exceeds its floor: the root of the difference of squares, in tolerances."""
    beyond = [after[name] ** 2 - floor[name] ** 2 for name in after if name != "total" and name in floor]
    return float(np.sqrt(max([0.0, *beyond])))


def excess_noise_is_material(search: Search, hypothesis: Hypothesis, shrinkage: Shrinkage) -> bool:
    """Whether disorder that the search knows of shows in the gap, beyond what the case's own noise leaves."""
    return excess(shrinkage.channels(AFTER), case_noise_floor(search, hypothesis)) >= DIAGNOSIS.material


def gap_is_material(shrinkage: Shrinkage) -> float:
    """How far what is left exceeds the floor in any channel, by degrees from 0 to 1 (`gates.materiality`)."""
    return materiality(excess(shrinkage.channels(AFTER), shrinkage.channels(FLOOR)))
