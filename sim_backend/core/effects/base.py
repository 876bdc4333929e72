"""What an effect is: a difference between the plant and the nominal vehicle, with parameters of known size."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: 0 (or `default`) is no effect.

    `spread` is the prior's 1 sigma: how far cases that are worth a diagnosis are likely to go. `place` names its entry
    of the effect vector F, "" where the effect's `apply` sets the world; `entry` is the number that the catalogue gives
    it, -1 for none.
    """

    name: str
    unit: str
    low: float
    high: float
    spread: float
    place: str = ""
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

    @property
    def usual(self) -> dict[str, float]:
        """Every parameter 1 sigma of its prior from its default, on the side that it can take."""
        return {
            p.name: min(p.default + p.spread, p.high) if p.high > p.default else max(p.default - p.spread, p.low)
            for p in self.parameters
        }

    def add(self, world: Any, values: dict[str, float]) -> None:
        """Add the effect to a world (or to anything with an effect vector F)."""
        for parameter in self.parameters:
            if parameter.entry >= 0:
                world.F[parameter.entry] += values[parameter.name]
        if self.apply is not None:
            self.apply(world, **values)


class EffectError(ValueError):
    """An effect or one of its parameters is not known or not possible."""
