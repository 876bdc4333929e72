"""What may differ: the parameters that a diagnosis fits, each in units of how far it is likely to go."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import PLACES
from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.base import Effect
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.intervals import NINETY
from glider.tools.inference.model import effect_vector
from glider.tools.inference.problem import Problem

LEAST_RATIO = 1e-3  # of a number that keeps its sign
NUISANCE = ""  # the label of what is no effect
ASSUMED_UNITS = {"m": "kg", "J": "kg m2", "x": "m", "R": "m", "net": "kg", "cg": "m"}  # by a name's first part
CLOCK_PLACE = ("timing", "mocap")  # of the labels by which motion capture's clock is wrong


@dataclass(frozen=True)
class FreeParameter:
    """A parameter that is free in a fit: `entry` of P or F moves by `spread` for each unit; limits in those units.

    Where `factor` is above 1, the entry (and `base`) is multiplied by it for each unit instead: it keeps its sign.
    """

    label: str  # of its effect; NUISANCE for what [uncertainty] and [sensors] allow
    name: str
    vector: str  # "P" or "F"
    entry: int
    spread: float
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""
    along: tuple[tuple[int, float], ...] = ()  # entries of P that move together, in place of `entry`
    along_effects: tuple[tuple[int, float], ...] = ()  # entries of F that move with them
    factor: float = 1.0
    base: float = 0.0  # 1 of a scale, which stands for 1 + scale

    def moved(self, entry: np.ndarray | float, value: np.ndarray | float) -> Any:
        """The entry of P or F, moved by a value in units of the spread."""
        if self.factor > 1.0:
            return (entry + self.base) * self.factor**value - self.base
        return entry + self.spread * value

    def value(self, entry: float, wanted: float) -> float:
        """The way back from `moved`: the value that brings the entry to the wanted number."""
        if self.factor > 1.0:
            ratio = (wanted + self.base) / (entry + self.base)
            return float(np.log(max(ratio, LEAST_RATIO)) / np.log(self.factor))
        return (wanted - entry) / self.spread

    @property
    def one_sided(self) -> bool:
        """Whether it begins at 0 and does nothing, or something else, on the other side."""
        return self.low == 0.0 or self.high == 0.0

    @property
    def delays(self) -> bool:
        """Whether it shifts a column in time: the misfit then has steps."""
        return self.label in catalogue() and catalogue()[self.label].subsystem == "timing"


def nuisance_parameters(problem: Problem) -> list[FreeParameter]:
    """What the nominal model allows for: parameters within [uncertainty], and a constant bias of each sensor."""
    if not problem.rules.nuisance:
        return []
    sigma, spread = problem.model.sigma.copy(), problem.model.spread
    free = []
    if spread is not None:  # as identification left them, together
        sigma[np.abs(spread).max(axis=0) > 0.0] = 0.0
        for n, row in enumerate(spread):
            along = tuple((int(i), float(row[i])) for i in np.flatnonzero(row))
            free.append(FreeParameter(NUISANCE, f"identified[{n}]", "P", -1, 1.0, along=along))
    said = assumed(problem)
    sigma[[f.entry for f in said if f.vector == "P"]] = 0.0
    free += said
    free += [FreeParameter(NUISANCE, f"P[{i}]", "P", int(i), float(sigma[i])) for i in np.flatnonzero(sigma > 0.0)]
    for j, (reading, seen) in enumerate(zip(problem.kind.readings, problem.seen, strict=True)):
        size = getattr(problem.case.sensors, reading.source).bias
        if reading.bias >= 0 and seen and size > 0.0:
            free.append(FreeParameter(NUISANCE, f"bias[{j}]", "F", reading.bias, size))
    return free


def assumable() -> dict[str, tuple[str, int]]:
    """What a file may call assumed: its name, the vector it stands in and its entry there."""
    effects = {
        label if len(effect.parameters) == 1 else f"{label}_{p.name}": ("F", p.entry)
        for label, effect in catalogue().items() for p in effect.parameters if p.entry >= 0
    }  # fmt: skip
    return {name: ("P", entry) for name, entry in PLACES.items()} | effects


def assumed(problem: Problem) -> list[FreeParameter]:
    """What the vehicle or case file calls assumed, as free as it says; ConfigError names what is no number of either.

    A factor is 1 sigma of the value's logarithm, of a scale's 1 + value; a range holds 90 %.
    """
    found, known = [], assumable()
    P, F = problem.model.P, effect_vector(problem.model)
    for name, one in problem.case.assumed.items():
        if name not in known:
            raise ConfigError(problem.case.vehicle_name, "no such number to be assumed", key=f"assumed.{name}")
        vector, entry = known[name]
        value = float((P if vector == "P" else F)[entry])
        unit = ASSUMED_UNITS.get(name.split("_")[0], "")
        if one.factor is not None:
            base = 1.0 if name.endswith("_scale") else 0.0
            if base + value == 0.0:
                raise ConfigError(
                    problem.case.vehicle_name, "is 0: a factor says nothing, give a range", key=f"assumed.{name}"
                )
            spread = float(np.log(one.factor)) * abs(base + value)
            found.append(FreeParameter("", name, vector, entry, spread, unit=unit, factor=one.factor, base=base))
        else:
            assert one.range is not None
            low, high = one.range
            spread = (high - low) / (2.0 * NINETY)
            limits = ((low - value) / spread, (high - value) / spread)
            if not limits[0] <= 0.0 <= limits[1]:
                raise ConfigError(
                    problem.case.vehicle_name, f"the file's own value {value:g} is not in it", key=f"assumed.{name}"
                )
            found.append(FreeParameter("", name, vector, entry, spread, *limits, unit))
    return found


def of_effect(effect: Effect) -> list[FreeParameter]:
    """The parameters of an effect that stand in F."""
    return [
        FreeParameter(effect.label, p.name, "F", p.entry, p.spread, p.low / p.spread, p.high / p.spread, p.unit)
        for p in effect.parameters
        if p.entry >= 0
    ]


def effect_parameters(problem: Problem) -> dict[str, list[FreeParameter]]:
    """Every label whose effect these runs could show, with its parameters."""
    if problem.kind.input_table is not None:  # attitude and engine are measured: every label of such a kind is seen
        found = {label: of_effect(effect) for label, effect in problem.kind.catalogue().items()}
        return {label: free for label, free in found.items() if free}
    seen = problem.seen
    mocap = bool(seen[ef.Y_ONBOARD :].any())
    commands = all(run.has_commands for run in problem.runs)
    found = {}
    for label, effect in problem.kind.catalogue().items():
        free = of_effect(effect)
        if not free:
            continue
        if effect.subsystem == "timing" and effect.element == "mocap" and not mocap:
            continue
        if effect.subsystem in ("actuation", "timing") and effect.element != "mocap" and not commands and (
            label != "ballast_leak"
        ):  # fmt: skip
            continue
        found[label] = free
    return found


def model_at(problem: Problem, free: list[FreeParameter], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The model (P, F) with these parameters at `values` (in their spreads)."""
    P = problem.model.P.copy()
    F = effect_vector(problem.model)
    for parameter, value in zip(free, values, strict=True):
        if not parameter.along and not parameter.along_effects:
            vector = P if parameter.vector == "P" else F
            vector[parameter.entry] = parameter.moved(vector[parameter.entry], value)
        for entry, size in parameter.along:
            P[entry] += size * value
        for entry, size in parameter.along_effects:
            F[entry] += size * value
    return P, F
