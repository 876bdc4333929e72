"""What a person at the bench reads and types: degrees and millimetres, where the ports have rad, m and kg.

The ballast pump is moved by its plunger's travel, which a ruler can check; net mass follows from the water's density.
"""

import math
from typing import Any

ACTUATORS = ("servo", "slider", "ballast")
UNITS = {"servo": "deg", "slider": "mm", "ballast": "mm"}
WIRES = {"slider": "slider_wire", "ballast": "plunger_wire"}
SHOWN = {  # sensor -> (name, unit, factor) of each value
    "imu": [(name, "deg", 180.0 / math.pi) for name in ("roll", "pitch", "yaw")]
    + [(name, "deg/s", 180.0 / math.pi) for name in ("p", "q", "r")],
    "beacon": [("pressure", "kPa", 1e-3), ("temperature", "deg C", 1.0)],
    "slider_wire": [("slider", "mm", 1e3)],
    "plunger_wire": [("plunger", "mm", 1e3)],
    "leak": [("wet", "", 1.0)],
    "battery": [("voltage", "V", 1.0)],
}


def from_port(name: str, value: float, kg_per_m: float) -> float:
    """An actuator's position in its port's unit as a person reads it."""
    if name == "servo":
        return math.degrees(value)
    return 1e3 * (value / kg_per_m if name == "ballast" else value)


def to_port(name: str, value: float, kg_per_m: float) -> float:
    """What a person typed in the port's unit."""
    if name == "servo":
        return math.radians(value)
    return 1e-3 * (value * kg_per_m if name == "ballast" else value)


def shown_values(name: str, values: list[float | None]) -> str:
    """A sensor's values as text."""
    parts = []
    for (label, unit, factor), value in zip(SHOWN[name], values, strict=True):
        text = "-" if value is None else f"{value * factor:.2f}"
        parts.append(f"{label} {text} {unit}".rstrip())
    return ", ".join(parts)


def finite(value: Any) -> Any:
    """A number for JSON: what is not finite becomes None."""
    return value if not isinstance(value, float) or math.isfinite(value) else None
