"""A first vehicle file from what can be weighed and measured; `glider identify` takes it from there.

What is not answered is the shipped vehicle's, scaled by mass and length: with no answer at all the file is the shipped
one. The hull scales as a prolate spheroid of the vehicle's length and displaced volume does, its added masses by Lamb
(Hydrodynamics, 6th ed., art. 114, 373). What nobody measured stands in [assumed], with how far off it may be.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import msgspec

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.model.vehicle import Vehicle, decode_vehicle
from glider.tools.data.errors import InputError
from glider.tools.data.sources import load_vehicle
from glider.tools.data.tomltext import toml_text

PATTERN, PATTERN_LENGTH = "roughie", 1.2  # the shipped vehicle, m
WATER = 1000.0  # kg/m3
# 1 sigma of such a first file: masses weighed to 1 %, lengths measured to 2 %; the rest is what a flight may find
UNCERTAINTY = {"K": 0.5, "mass": 0.01, "added": 0.3, "net_mass": 0.05, "cg": 0.002, "length": 0.02}
FORCES, MOMENTS = ("K_D0", "K_D", "K_L0", "K_L", "K_beta"), ("K_MR", "K_M0", "K_M", "K_MY")
DAMPINGS = ("K_p", "K_q", "K_r")
# Factors to which a guess is known, 1 sigma. Wings damp roll ten times as much as a bare hull.
INERTIA, ADDED, WATER_FORCE, DAMPING = 2.0, 1.5, 2.0, 3.0
CAMBER, TRIM_ANGLE = 0.025, 0.03  # rad of attack by which lift and pitch moment may be displaced, 90 %
SWINGS = ("pitch", "roll")  # axes of swing tests


@dataclass(frozen=True)
class Question:
    """One thing to weigh or to measure: key, words, unit, limits, and what stands for it where nobody does.

    usual: table and key of the shipped vehicle's number, or None where there is none; powers: how it grows with mass,
    length and diameter; factor: how well it is then known, for what the model of the motion has of it.
    """

    key: str
    words: str
    unit: str
    low: float
    high: float
    usual: tuple[str, ...] | None = None
    powers: tuple[float, float, float] = (0.0, 0.0, 0.0)
    factor: float | None = None


def _swing(axis: str, how: str) -> tuple[Question, ...]:
    return (
        Question(f"{axis}_period", f"period of a swing on two wires, {how} (it gives the inertia)", "s", 0.1, 100.0),
        Question(f"{axis}_apart", "how far apart those wires hang", "m", 0.01, 10.0),
        Question(f"{axis}_wires", "how long they are", "m", 0.05, 50.0),
    )


_M, _A = "mass", "actuators"
QUESTIONS = (
    Question("m_t", "mass of the whole vehicle, dry, trimmed neutral", "kg", 0.5, 2000.0, (_M, "m_t"), factor=1.1),
    Question("length", "length of the hull", "m", 0.2, 10.0, (), factor=None),
    Question("m_r", "mass of the rail and all that turns with the servo and does not slide", "kg", 0.01, 500.0,
             (_M, "m_r"), (1.0, 0.0, 0.0), 1.3),
    Question("R_r", "how far that mass hangs below the roll axis", "m", 0.0, 0.5, (_M, "R_r"), (0.0, 0.0, 1.0), 1.3),
    Question("m_s", "mass of what slides", "kg", 0.01, 500.0, (_M, "m_s"), (1.0, 0.0, 0.0), 1.3),
    Question("R_s", "how far that hangs below the roll axis", "m", 0.0, 0.5, (_M, "R_s"), (0.0, 0.0, 1.0), 1.3),
    Question("r_sx0", "where along the hull it slides about, ahead of the middle", "m", -3.0, 3.0, (_M, "r_sx0"),
             (0.0, 1.0, 0.0)),
    Question("x_b", "where the ballast tank is, ahead of the middle", "m", -4.0, 4.0, (_M, "x_b"),
             (0.0, 1.0, 0.0), 1.2),
    Question("ballast", "largest ballast to either side of neutral", "kg", 0.01, 50.0, (_A, "ballast", "range"),
             (1.0, 0.0, 0.0)),
    Question("pump", "how fast the pump takes it in", "kg/s", 1e-4, 10.0, (_A, "ballast", "rate"), (1.0, 0.0, 0.0)),
    Question("plunger_area", "area of the plunger", "m2", 1e-5, 1.0, (_A, "ballast", "plunger_area"), (0.0, 0.0, 2.0)),
    Question("travel", "how far the slider goes to either side", "m", 0.001, 2.0, (_A, "slider", "range"),
             (0.0, 1.0, 0.0)),
    Question("slider_rate", "how fast it slides", "m/s", 1e-4, 1.0, (_A, "slider", "rate"), (0.0, 1.0, 0.0)),
    Question("servo", "how far the servo turns to either side", "deg", 1.0, 90.0, (_A, "servo", "range")),
    Question("servo_rate", "how fast it turns", "deg/s", 1.0, 1000.0, (_A, "servo", "rate")),
    *_swing("pitch", "hung level, turning about the vertical"),
    *_swing("roll", "hung nose up, turning about the long axis"),
)  # fmt: skip
ASKED = {one.key: one for one in QUESTIONS}


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


class FirstVehicle:
    """The answers so far, by key, and what follows from them."""

    def __init__(self, answers: dict[str, float] | None = None):
        self.shipped: Vehicle = load_vehicle(PATTERN)
        self.answers = {} if answers is None else answers

    def value(self, key: str) -> float | None:
        """The answer, or what stands for it; None where nothing does."""
        return self.answers[key] if key in self.answers else self.usual(key)

    def usual(self, key: str) -> float | None:
        """The shipped vehicle's number, scaled, in the question's unit."""
        asked = ASKED[key]
        if asked.usual is None:
            return None
        if not asked.usual:
            return PATTERN_LENGTH
        found: Any = self.shipped
        for name in asked.usual:
            found = getattr(found, name)
        found = found[1] if isinstance(found, tuple) else found
        scale = math.prod(r**power for r, power in zip(self.ratios, asked.powers, strict=True) if power)
        return float(math.degrees(found) if asked.unit.startswith("deg") else found) * scale

    def source_words(self, key: str) -> str:
        """Where the default comes from, in words."""
        names = ("mass", "length", "diameter")
        by = [n for n, r, power in zip(names, self.ratios, ASKED[key].powers, strict=True) if power and r != 1.0]
        return f"the shipped vehicle's, scaled by your {' and '.join(by)}" if by else "the shipped vehicle's"

    @property
    def whole(self) -> tuple[float, float]:
        """Mass and length of the whole vehicle."""
        return self.answers.get("m_t", self.shipped.mass.m_t), self.answers.get("length", PATTERN_LENGTH)

    @property
    def ratios(self) -> tuple[float, float, float]:
        """Mass, length and diameter over the shipped vehicle's."""
        (m, length), m0 = self.whole, self.shipped.mass.m_t
        return m / m0, length / PATTERN_LENGTH, diameter_of(m, length) / diameter_of(m0, PATTERN_LENGTH)

    def asks(self, key: str) -> bool:
        """Whether a question is asked: of wires only where there was a swing."""
        axis, _, what = key.partition("_")
        return axis not in SWINGS or what == "period" or f"{axis}_period" in self.answers

    def wrong(self, key: str, value: float) -> str | None:
        """What is wrong with an answer, in a line; None: nothing."""
        asked, (m, length) = ASKED[key], self.whole
        low, high, because = asked.low, asked.high, ""
        if key == "m_r":
            high, because = m, f" (the whole vehicle has {m:g} kg)"
        elif key == "m_s":
            rail = self.value("m_r") or 0.0
            high, because = m - rail, f" (the whole vehicle has {m:g} kg, the rail {rail:g} kg)"
        elif key in ("x_b", "r_sx0"):
            low, high, because = -0.5 * length, 0.5 * length, f" (the hull is {length:g} m long)"
        if low <= value <= high and (value < high or key not in ("m_r", "m_s")):
            return None
        return f"{value:g} {asked.unit}: expected {low:g} to {high:g} {asked.unit}{because}"

    def text(self, name: str) -> str:
        """The file's text; ConfigError or InputError where the answers do not make a vehicle."""
        table = self._table()
        table["name"] = name
        text = (
            "# A first vehicle file by `glider vehicle new`: masses and lengths as answered, the rest the shipped\n"
            "# vehicle's, scaled. [assumed] names what nobody measured. Fly it, then `glider identify`.\n"
        ) + toml_text(_rounded(table), inline=("sensors", "assumed"))
        decode_vehicle(text, name)
        return text

    def _table(self) -> dict[str, Any]:
        table: dict[str, Any] = msgspec.to_builtins(self.shipped)
        values = {one.key: self.value(one.key) or 0.0 for one in QUESTIONS}
        (m, length), (by_mass, l, w) = self.whole, self.ratios
        at, a = table["mass"], table["actuators"]
        at |= {key: values[key] for key in ("m_t", "m_r", "m_s", "R_r", "R_s", "r_sx0", "x_b")}
        pattern = spheroid(PATTERN_LENGTH, diameter_of(self.shipped.mass.m_t, PATTERN_LENGTH))
        own = spheroid(length, diameter_of(m, length))
        along, across, turning = (by_mass * k / k0 for k, k0 in zip(own, pattern, strict=True))
        stretched = by_mass * l**2, by_mass * w**2
        at["J"] = [J * by for J, by in zip(at["J"], (stretched[1], stretched[0], stretched[0]), strict=True)]
        at["added_mass"] = [A * by for A, by in zip(at["added_mass"], (along, across, across), strict=True)]
        at["added_inertia"] = [
            B * by for B, by in zip(at["added_inertia"], (stretched[1], turning * l**2, turning * l**2), strict=True)
        ]
        for names, scale in ((FORCES, l * w), (MOMENTS, l**2 * w), (DAMPINGS, l**3 * w)):
            table["hydrodynamics"] |= {name: table["hydrodynamics"][name] * scale for name in names}
        turn = math.radians(values["servo"])
        a["servo"] |= {"range": [-turn, turn], "rate": math.radians(values["servo_rate"])}
        a["slider"] |= {"range": [-values["travel"], values["travel"]], "rate": values["slider_rate"]}
        a["ballast"] |= {
            "range": [-values["ballast"], values["ballast"]], "rate": values["pump"],
            "plunger_area": values["plunger_area"],
        }  # fmt: skip
        self._swung(at)
        table["uncertainty"] = UNCERTAINTY
        table["assumed"] = self._assumed(table["hydrodynamics"])
        table["trim"] = None
        return table

    def _swung(self, at: dict[str, Any]) -> None:
        """The hull's inertia by swing tests, the moving masses at rest taken off."""
        m = at["m_t"]
        low = (at["m_r"] * at["R_r"] + at["m_s"] * at["R_s"]) / m  # the centre of gravity, about which it swings
        parts = ((at["m_r"], at["x_r"], at["R_r"]), (at["m_s"], at["r_sx0"], at["R_s"]))
        for axis, places in (("pitch", (1, 2)), ("roll", (0,))):
            if f"{axis}_period" not in self.answers:
                continue
            missing = next((key for key in (f"{axis}_apart", f"{axis}_wires") if key not in self.answers), None)
            if missing is not None:
                raise InputError(f"{ASKED[missing].words}: a swing without it says nothing")
            whole = swing_inertia(m, *(self.answers[f"{axis}_{what}"] for what in ("period", "apart", "wires")))
            for place in places:
                own = sum(mass * ((place > 0) * x**2 + (place < 2) * R**2) for mass, x, R in parts)
                J = whole + (place < 2) * m * low**2 - own
                if J <= 0.0:
                    raise InputError(
                        f"the {axis} swing says {whole:.3g} kg m2 in all, the moving masses alone have {own:.3g}"
                    )
                at["J"][place] = J

    def _assumed(self, water: dict[str, float]) -> dict[str, dict[str, Any]]:
        """[assumed]: everything that nobody weighed or measured."""
        found: dict[str, dict[str, Any]] = {
            one.key: {"factor": one.factor}
            for one in QUESTIONS if one.factor is not None and one.key not in self.answers
        }  # fmt: skip
        swung = {axis for axis in SWINGS if f"{axis}_period" in self.answers}
        found |= {} if "roll" in swung else {"J_x": {"factor": INERTIA}}
        found |= {} if "pitch" in swung else {f"J_{axis}": {"factor": INERTIA} for axis in "yz"}
        found |= {f"added_{what}_{axis}": {"factor": ADDED} for what in ("mass", "inertia") for axis in "xyz"}
        found |= {name: {"factor": WATER_FORCE} for name in (*FORCES, *MOMENTS)}
        found |= {name: {"factor": DAMPING} for name in DAMPINGS}
        for name, size in (("K_L0", CAMBER * water["K_L"]), ("K_M0", TRIM_ANGLE * water["K_M"])):
            found[name] = {"range": [water[name] - abs(size), water[name] + abs(size)]}
        return {name: one for name, one in found.items() if "range" in one or water.get(name) != 0.0}


def swing_inertia(mass: float, period: float, apart: float, wires: float) -> float:
    """Inertia of a body on two parallel wires about the vertical through its middle, kg m2."""
    return mass * GRAVITY * (period * apart / (4.0 * math.pi)) ** 2 / wires


def in_words(assumed: Iterable[str]) -> str:
    """Numbers that a file calls assumed, those of a kind together."""
    kinds = {
        "m": "masses", "J": "inertia", "R": "lengths", "x": "lengths", "added": "added mass and inertia",
        "K": "water forces",
    }  # fmt: skip
    return ", ".join(dict.fromkeys(kinds.get(name.split("_")[0], name) for name in assumed))


def _rounded(value: Any) -> Any:
    """Numbers with five digits: nothing here is known better."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value
