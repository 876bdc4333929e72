"""What all runs may share: one value of every parameter, bias and effect, each about what the vehicle file says.

The shared values are no cause: they make up for whatever the runs have in common, by whichever of them do it. So
effects that cannot be distinguished from each other all stand among them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from glider.tools.inference.parameters import NUISANCE, FreeParameter, effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.problem import Problem

ALLOWED_PRIOR = 3.0  # times [uncertainty] and [sensors]: a file that is not quite right
EFFECT_PRIOR = 0.5  # spreads of a label
BOUND_TOLERANCE = 0.05  # spreads past a kink


@dataclass(frozen=True)
class SharedParameters:
    """The parameters in their order: what the file allows for, then every entry of F that a label has."""

    free: list[FreeParameter]
    labels: dict[str, list[int]]  # places of each label's parameters in `free`
    limited: dict[str, list[tuple[float, float]]]  # limits of each label's own parameters, spreads
    allowed: float = ALLOWED_PRIOR  # 1 sigma of what the file allows for, of its own
    odds: Mapping[str, float] = field(default_factory=dict)  # log odds of labels before any run, nat
    effects: float = EFFECT_PRIOR  # 1 sigma of every label's entry

    @property
    def count(self) -> int:
        return len(self.free)

    @cached_property
    def prior(self) -> np.ndarray:
        """1 sigma of each shared value, in its spreads, (count,)."""
        return np.array([self.allowed if one.label == NUISANCE else self.effects for one in self.free])

    @cached_property
    def low(self) -> np.ndarray:
        return np.array([one.low for one in self.free])

    @cached_property
    def high(self) -> np.ndarray:
        return np.array([one.high for one in self.free])

    @cached_property
    def one_sided(self) -> np.ndarray:
        return np.array([one.one_sided for one in self.free])

    @cached_property
    def groups(self) -> np.ndarray:
        """0 parameters of the vehicle, 1 biases of its sensors, 2 effects, (count,)."""
        return np.array([2 if f.label != NUISANCE else int(f.vector == "F") for f in self.free])

    def model(self, problem: Problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P, F at values x (count,) in spreads."""
        return model_at(problem, self.free, x)

    def limits(self, label: str, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far down and up a label's parameters can go from the shared values `at` (count,), spreads.

        An entry that two labels share, each one way, goes each way from wherever it is.
        """
        own = self.limited[label]
        shared = np.array([self.free[k].label != label or (self.low[k], self.high[k]) != limit
                           for k, limit in zip(self.labels[label], own, strict=True)])  # fmt: skip
        low, high = np.array(own).T
        values = at[self.labels[label]]
        noise = ((low == 0.0) | (high == 0.0)) & (
            np.abs(values) < BOUND_TOLERANCE
        )  # there is no less of what is not there
        values = np.where(shared | noise, 0.0, values)
        return np.minimum(low - values, 0.0), np.maximum(high - values, 0.0)


def shared_parameters(problem: Problem) -> SharedParameters:
    """Of all runs of a problem. An entry that two labels have (heavier or lighter with depth) goes both ways."""
    free = nuisance_parameters(problem)
    places: dict[int, int] = {}
    labels: dict[str, list[int]] = {}
    limited: dict[str, list[tuple[float, float]]] = {}
    for label, own in effect_parameters(problem).items():
        labels[label] = []
        limited[label] = [(one.low, one.high) for one in own]
        for one in own:
            if one.entry in places:
                at = places[one.entry]
                there = free[at]
                free[at] = replace(there, low=min(there.low, one.low), high=max(there.high, one.high))
            else:
                places[one.entry] = len(free)
                free.append(one)
            labels[label].append(places[one.entry])
    return SharedParameters(free, labels, limited, odds=problem.kind.odds)
