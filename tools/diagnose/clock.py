"""A wandering clock of motion capture, which stands in the model of a search that knows of its noise."""

from dataclasses import dataclass, replace

import numpy as np

from glider.tools.inference.model import effect_vector
from glider.tools.inference.parameters import FreeParameter
from glider.tools.inference.problem import Problem
from glider.tools.inference.time_alignment import aligned


@dataclass(frozen=True)
class ClockModel:
    """The effect of a wandering clock of motion capture: it stands in the model beside which all else is looked for."""

    label: str
    free: list[FreeParameter]
    values: np.ndarray  # in spreads
    sd: np.ndarray

    def within(self, problem: Problem) -> Problem:
        """The problem, and the one it was made from, of the model with it."""
        F, recorded = effect_vector(problem.model), problem.recorded
        for free, value in zip(self.free, self.values, strict=True):
            F[free.entry] += free.spread * value
        model = replace(problem.model, F=F)
        return replace(problem, model=model, recorded=None if recorded is None else replace(recorded, model=model))

    def aligned(self, problem: Problem) -> Problem:
        """The problem with its poses where this clock says; the model is as it was."""
        return aligned(problem, effect_vector(self.within(problem).model))
