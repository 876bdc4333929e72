"""What a person at the bench reads and types: degrees and millimetres, where the ports have rad, m and kg.

The ballast pump is moved by its plunger's travel, which a ruler can check; net mass follows from the water's density.
"""

import math
from typing import Any

from glider.hal.ports import SLOTS
from glider.hal.units import UNITS as SI

UNITS = {"servo": "deg", "slider": "mm", "ballast": "mm"}
WIRES = {"slider": "slider_wire", "ballast": "plunger_wire"}
SHOWN = {"rad": "deg", "rad/s": "deg/s", "m": "mm", "Pa": "kPa", "1": ""}  # a port's unit as a person reads it


def from_port(name: str, value: float, kg_per_m: float) -> float:
    """An actuator's position in its port's unit as a person reads it."""
    return (value / kg_per_m if name == "ballast" else value) / SI[UNITS[name]].factor


def to_port(name: str, value: float, kg_per_m: float) -> float:
    """What a person typed in the port's unit."""
    return (value * kg_per_m if name == "ballast" else value) * SI[UNITS[name]].factor


def shown_values(name: str, values: list[float | None]) -> str:
    """A sensor's values as text."""
    parts = []
    slot = SLOTS[name]
    for label, port_unit, value in zip(slot.names, slot.units, values, strict=True):
        unit = SHOWN.get(port_unit, port_unit)
        factor = SI[unit].factor if unit else 1.0
        text = "-" if value is None else f"{value / factor:.2f}"
        parts.append(f"{label.removesuffix('_c')} {text} {unit}".rstrip())
    return ", ".join(parts)


def finite(value: Any) -> Any:
    """A number for JSON: what is not finite becomes None."""
    return value if not isinstance(value, float) or math.isfinite(value) else None
