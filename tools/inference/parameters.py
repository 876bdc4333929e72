"""What may differ: the parameters that a diagnosis fits, each in units of how far it is likely to go."""

from dataclasses import dataclass

import numpy as np

from glider.firmware.model.vehicle import PLACES
from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.base import Effect
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.inference.model import effect_vector
from glider.tools.inference.problem import Problem

NINETY = 1.645  # sigma on either side that hold 90 %
NUISANCE = ""  # the label of what is no effect
CLOCK_PLACE = ("timing", "mocap")  # of the labels by which motion capture's clock is wrong


@dataclass(frozen=True)
class FreeParameter:
    """A parameter that is free in a fit: `entry` of P or F moves by `spread` for each unit; limits in those units."""

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

    A factor f is 1 sigma of (f - 1) times the value, of a scale's 1 + value; a range holds 90 %.
    """
    found, known = [], assumable()
    P, F = problem.model.P, effect_vector(problem.model)
    for name, one in problem.case.assumed.items():
        if name not in known:
            raise ConfigError(problem.case.vehicle_name, "no such number to be assumed", key=f"assumed.{name}")
        vector, entry = known[name]
        value = float((P if vector == "P" else F)[entry])
        limits = (-np.inf, np.inf)
        if one.factor is not None:
            whole = 1.0 + value if name.endswith("_scale") else value
            if whole == 0.0:
                raise ConfigError(
                    problem.case.vehicle_name, "is 0: a factor says nothing, give a range", key=f"assumed.{name}"
                )
            spread = (one.factor - 1.0) * abs(whole)
        else:
            assert one.range is not None
            low, high = one.range
            spread = (high - low) / (2.0 * NINETY)
            limits = ((low - value) / spread, (high - value) / spread)
            if not limits[0] <= 0.0 <= limits[1]:
                raise ConfigError(
                    problem.case.vehicle_name, f"the file's own value {value:g} is not in it", key=f"assumed.{name}"
                )
        found.append(FreeParameter("", name, vector, entry, spread, *limits))
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
            (P if parameter.vector == "P" else F)[parameter.entry] += parameter.spread * value
        for entry, size in parameter.along:
            P[entry] += size * value
        for entry, size in parameter.along_effects:
            F[entry] += size * value
    return P, F
