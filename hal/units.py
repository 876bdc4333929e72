"""One table of units to SI, for whatever is read in other units: register maps, foreign logs, the bench."""

import math
from typing import NamedTuple

BITS = 10  # on a serial line for a byte, 8N1


class Unit(NamedTuple):
    """What a unit measures, and how many SI units it is (deg C for temperatures)."""

    kind: str
    factor: float


UNITS = {
    "m": Unit("length", 1.0), "cm": Unit("length", 0.01), "mm": Unit("length", 0.001), "ft": Unit("length", 0.3048),
    "in": Unit("length", 0.0254), "rad": Unit("angle", 1.0), "deg": Unit("angle", math.pi / 180.0),
    "rad/s": Unit("rate", 1.0), "deg/s": Unit("rate", math.pi / 180.0), "m/s": Unit("speed", 1.0),
    "cm/s": Unit("speed", 0.01), "mm/s": Unit("speed", 0.001), "kn": Unit("speed", 1852.0 / 3600.0),
    "m/s2": Unit("acceleration", 1.0), "1/s": Unit("frequency", 1.0), "Hz": Unit("frequency", 1.0),
    "rpm": Unit("frequency", 1.0 / 60.0), "N": Unit("force", 1.0), "1": Unit("share", 1.0), "%": Unit("share", 0.01),
    "kg": Unit("mass", 1.0),
    "g": Unit("mass", 0.001), "lb": Unit("mass", 0.45359237), "ml": Unit("volume", 1e-6), "l": Unit("volume", 1e-3),
    "Pa": Unit("pressure", 1.0), "hPa": Unit("pressure", 100.0), "kPa": Unit("pressure", 1e3),
    "MPa": Unit("pressure", 1e6), "mbar": Unit("pressure", 100.0), "dbar": Unit("pressure", 1e4),
    "bar": Unit("pressure", 1e5), "psi": Unit("pressure", 6894.757293168), "deg C": Unit("temperature", 1.0),
    "V": Unit("voltage", 1.0), "s": Unit("time", 1.0), "ms": Unit("time", 1e-3), "us": Unit("time", 1e-6),
    "ns": Unit("time", 1e-9), "min": Unit("time", 60.0), "h": Unit("time", 3600.0), "counts": Unit("counts", 1.0),
}  # fmt: skip


def units_of(*kinds: str) -> list[str]:
    """Names of the units of these kinds."""
    return [name for name, unit in UNITS.items() if unit.kind in kinds]
