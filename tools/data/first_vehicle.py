"""A first vehicle file from what can be weighed and measured; `glider identify` takes it from there.

The hull stands for a prolate spheroid of the vehicle's length and displaced volume: its added masses are Lamb's
(Hydrodynamics, 6th ed., art. 114, 373), its inertia that of a body of even density. The coefficients of the water's
forces are those of the shipped vehicle, scaled by length and diameter. [uncertainty] says how little that is worth.
"""

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from glider.firmware.model.vehicle import decode_vehicle
from glider.tools.data.sources import load_vehicle
from glider.tools.data.tomltext import toml_text

PATTERN, PATTERN_LENGTH = "roughie", 1.2  # the shipped vehicle, m
WATER = 1000.0  # kg/m3
# 1 sigma of such a first file, as [uncertainty] has it
UNCERTAINTY = {"K": 0.5, "mass": 0.002, "added": 0.3, "net_mass": 0.05, "cg": 0.002}
FORCES, MOMENTS = ("K_D0", "K_D", "K_L0", "K_L", "K_beta"), ("K_MR", "K_M0", "K_M", "K_MY")
DAMPINGS = ("K_p", "K_q", "K_r")


@dataclass(frozen=True)
class Question:
    """One thing to weigh or to measure: key, words, unit, the shipped vehicle's answer, limits."""

    key: str
    words: str
    unit: str
    usual: float
    low: float
    high: float


QUESTIONS = (
    Question("m_t", "mass of the whole vehicle, dry, trimmed neutral", "kg", 13.0, 0.5, 2000.0),
    Question("length", "length of the hull", "m", PATTERN_LENGTH, 0.2, 10.0),
    Question("m_r", "mass of the rail and all that turns with the servo and does not slide", "kg", 2.0, 0.01, 500.0),
    Question("R_r", "how far that mass hangs below the roll axis", "m", 0.015, 0.0, 0.5),
    Question("m_s", "mass of what slides", "kg", 2.0, 0.01, 500.0),
    Question("R_s", "how far that hangs below the roll axis", "m", 0.020, 0.0, 0.5),
    Question("r_sx0", "where along the hull it slides about, ahead of the middle", "m", 0.0, -3.0, 3.0),
    Question("x_b", "where the ballast tank is, ahead of the middle", "m", 0.35, -4.0, 4.0),
    Question("ballast", "largest ballast to either side of neutral", "kg", 0.20, 0.01, 50.0),
    Question("pump", "how fast the pump takes it in", "kg/s", 0.03, 1e-4, 10.0),
    Question("plunger_area", "area of the plunger", "m2", 0.0062, 1e-5, 1.0),
    Question("travel", "how far the slider goes to either side", "m", 0.06, 0.001, 2.0),
    Question("slider_rate", "how fast it slides", "m/s", 0.02, 1e-4, 1.0),
    Question("servo", "how far the servo turns to either side", "deg", 60.0, 1.0, 90.0),
    Question("servo_rate", "how fast it turns", "deg/s", 57.0, 1.0, 1000.0),
)


def spheroid(length: float, diameter: float) -> tuple[float, float, float]:
    """Lamb's k1, k2 (added mass along and across, shares of the displaced) and k' (added inertia across)."""
    if length <= 1.01 * diameter:
        return 0.5, 0.5, 0.0
    e = math.sqrt(1.0 - (diameter / length) ** 2)
    log = math.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * log - e)
    beta = 1.0 / e**2 - (1.0 - e**2) / (2.0 * e**3) * log
    k = e**4 * (beta - alpha) / ((2.0 - e**2) * (2.0 * e**2 - (2.0 - e**2) * (beta - alpha)))
    return alpha / (2.0 - alpha), beta / (2.0 - beta), k


def diameter_of(mass: float, length: float) -> float:
    """Diameter of the spheroid that displaces this mass of water, m."""
    return math.sqrt(6.0 * mass / (WATER * math.pi * length))


def first_vehicle(name: str, answers: dict[str, float]) -> str:
    """The file's text; ConfigError where the answers do not make a vehicle."""
    table: dict[str, Any] = msgspec.to_builtins(load_vehicle(PATTERN))
    m, length = answers["m_t"], answers["length"]
    d, d0 = diameter_of(m, length), diameter_of(table["mass"]["m_t"], PATTERN_LENGTH)
    fixed = max(m - answers["m_r"] - answers["m_s"], 0.1 * m)
    k1, k2, k_turn = spheroid(length, d)
    across, along = m * (length**2 + d**2) / 20.0, m * d**2 / 10.0
    table["name"] = name
    table["mass"] |= {key: answers[key] for key in ("m_t", "m_r", "m_s", "R_r", "R_s", "r_sx0", "x_b")}
    table["mass"]["J"] = [fixed / m * along, fixed / m * across, fixed / m * across]
    table["mass"]["added_mass"] = [k1 * m, k2 * m, k2 * m]
    table["mass"]["added_inertia"] = [0.1 * along, k_turn * across, k_turn * across]
    l, w = length / PATTERN_LENGTH, d / d0
    for names, scale in ((FORCES, l * w), (MOMENTS, l**2 * w), (DAMPINGS, l**3 * w)):
        table["hydrodynamics"] |= {name: table["hydrodynamics"][name] * scale for name in names}
    a = table["actuators"]
    turn = math.radians(answers["servo"])
    a["servo"] |= {"range": [-turn, turn], "rate": math.radians(answers["servo_rate"])}
    a["slider"] |= {"range": [-answers["travel"], answers["travel"]], "rate": answers["slider_rate"]}
    a["ballast"] |= {
        "range": [-answers["ballast"], answers["ballast"]], "rate": answers["pump"],
        "plunger_area": answers["plunger_area"],
    }  # fmt: skip
    table["uncertainty"] = UNCERTAINTY
    table["trim"] = None
    rounded = _rounded(table)
    text = (
        "# A first vehicle file by `glider vehicle new`: masses and lengths as answered, hull as a spheroid,\n"
        "# the water's coefficients scaled from the shipped vehicle. Fly it, then `glider identify`.\n"
    ) + toml_text(rounded, inline=("sensors",))
    decode_vehicle(text, name)
    return text


def _rounded(value: Any) -> Any:
    """Numbers with five digits: nothing here is known better."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value
