"""Effects: differences between the plant and the nominal vehicle, each a small file in this folder.

A file defines EFFECT: its label and place as in the catalogue of causes, its parameters with unit and range, and
`apply(world, **values)`, which adds it to a world. Effects go together in any number. `docs/EFFECTS.md` says how to add
one.
"""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from hal.strict import ConfigError


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: 0 (or `default`) is no effect.

    `spread` is the prior's 1 sigma: how far cases that are worth a diagnosis are likely to go. `entry` is its place in
    the effect vector F (sim_backend/core/effect_layout), -1 where `apply` of the effect sets the world otherwise.
    """

    name: str
    unit: str
    low: float
    high: float
    spread: float
    default: float = 0.0
    entry: int = -1


@dataclass(frozen=True)
class Effect:
    """An unmodelled effect: what it is called, where it sits, what sizes it, and how it changes a world."""

    label: str
    subsystem: str
    element: str
    summary: str
    parameters: tuple[Parameter, ...]
    apply: Callable[..., None] | None = None  # where the effect vector is not all

    @property
    def place(self) -> tuple[str, str]:
        """Subsystem and element."""
        return self.subsystem, self.element

    def add(self, world: Any, values: dict[str, float]) -> None:
        """Add the effect to a world (or to anything with an effect vector F)."""
        for parameter in self.parameters:
            if parameter.entry >= 0:
                world.F[parameter.entry] += values[parameter.name]
        if self.apply is not None:
            self.apply(world, **values)


class EffectError(ValueError):
    """An effect or one of its parameters is not known or not possible."""


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by label, found in this folder."""
    package = importlib.import_module("sim_backend.effects")
    found = {}
    for info in pkgutil.iter_modules(package.__path__):
        if info.name == "base":
            continue
        effect = importlib.import_module(f"sim_backend.effects.{info.name}").EFFECT
        found[effect.label] = effect
    return dict(sorted(found.items()))


def check_values(label: str, values: dict[str, float]) -> dict[str, float]:
    """The effect's parameters with defaults filled in; EffectError names what is wrong."""
    effects = catalogue()
    if label not in effects:
        raise EffectError(f"no effect '{label}'; known: {', '.join(effects)}")
    known = {parameter.name: parameter for parameter in effects[label].parameters}
    for name, value in values.items():
        if name not in known:
            raise EffectError(f"effect {label} has no parameter '{name}'; it has {', '.join(known)}")
        parameter = known[name]
        if not parameter.low <= value <= parameter.high:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            raise EffectError(
                f"effect {label}: {name} = {value:g} is outside {parameter.low:g} to {parameter.high:g}{unit}"
            )
    return {name: values.get(name, parameter.default) for name, parameter in known.items()}


def check_flown(label: str, values: dict[str, float]) -> dict[str, float]:
    """The same for an effect that is to be flown: EffectError also for one of motion capture, which no flight has."""
    checked = check_values(label, values)
    effect = catalogue()[label]
    if (effect.subsystem, effect.element) == ("timing", "mocap"):
        raise EffectError(f"effect {label} is one of motion capture's clock: no flight aboard has motion capture")
    return checked


def check_board(effects: dict[str, dict[str, float]], source: str) -> None:
    """The [effects] of a board file; ConfigError says which is wrong."""
    for label, values in effects.items():
        try:
            check_flown(label, values)
        except EffectError as error:
            raise ConfigError(source, str(error), key=f"effects.{label}") from None


def apply_effects(world: Any, effects: dict[str, dict[str, float]]) -> None:
    """Add the effects to a world that has not begun to move."""
    for label, values in effects.items():
        catalogue()[label].add(world, check_flown(label, values))
