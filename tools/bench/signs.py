"""What `glider check --board` asks of a board: what each device says, and, with a person's help, its signs and axes.

A sensor or actuator with the wrong sign is the commonest fault before a first flight, and no software sees it alone.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.core.vehicle.seawater import STANDARD_PRESSURE
from glider.tools.bench.client import Bench, BenchError
from glider.tools.bench.units import UNITS, WIRES, shown_values

LEAST_DEG, LEAST_M = 5.0, 0.002
TRAVEL_SHARE = 0.5  # of an actuator's way
MOVE_S = 30.0
SILENT_S = 3.0  # until a device is taken for silent; the IMU is asked for its model once a second
WATER = 998.2  # kg/m3


@dataclass
class SignFinding:
    """One thing looked at."""

    check: str
    passed: bool
    message: str


def look(bench: Bench) -> list[SignFinding]:
    """What each device says; one that is silent is waited for."""
    end = time.monotonic() + SILENT_S
    time.sleep(0.5)  # rates and errors show
    while not _all_answer(state := bench.snapshot()) and time.monotonic() < end:
        time.sleep(0.1)
    found = [
        SignFinding(f"port {name}", port["up"], f"{port['bytes_in']} bytes in" if port["up"] else port["trouble"])
        for name, port in state["ports"].items()
    ]
    for name, item in state["sensors"].items():
        text = item["error"] or f"{item['validity']}: {shown_values(name, item['values'])}{_more(name, item, state)}"
        found.append(SignFinding(name, item["validity"] == "valid", text))
    for name, item in state["actuators"].items():
        found.append(SignFinding(name, item["answers"] and not item["error"], item["error"] or _actuator(item)))
    return found


def _all_answer(state: dict) -> bool:
    """Whether every device has said what it is asked: a sensor a reading, an actuator that it answers, the IMU its
    model."""
    sensors = all(item["validity"] == "valid" for item in state["sensors"].values())
    return sensors and all(item["answers"] for item in state["actuators"].values()) and bool(state["imu_model"])


def _more(name: str, item: dict, state: dict) -> str:
    values = item["values"]
    if None in values:
        return ""
    if name == "imu":
        return f"; model {state['imu_model'] or 'not said'}"
    if name == "beacon":
        return f"; {(values[0] - STANDARD_PRESSURE) / (WATER * GRAVITY):.2f} m deep under standard pressure"
    return f"; reads {item['reading']:g}" if item["reading"] is not None else ""


def _actuator(item: dict) -> str:
    if "counts" not in item:
        return "answers" if item["answers"] else "does not answer"
    if not item["answers"]:
        return "does not answer"
    said = "FAULT" if item["status"] & 1 else "on" if item["status"] & 2 else "off"
    apart = abs(item["position"] - item["measured"])
    return f"{said}, at {item['counts']:.10g} counts, {apart:.4g} off its wire"


class Signs:
    """Leads through signs and axes. ask(question) gives the person's answer; Enter goes on, `skip` leaves out."""

    def __init__(self, bench: Bench, ask: Callable[[str], str]):
        self._bench, self._ask = bench, ask
        self._level: list[float] = []

    def run(self) -> list[SignFinding]:
        """Every step, in order."""
        self._ask("Hold the hull level, nose where you like, and press Enter. ")
        self._level = self._attitude()
        found = [
            self._turn("nose up", "Lift the nose by 10 degrees or more, hold it, press Enter (or `skip`). ", 1),
            self._turn("roll to starboard", "Press the starboard side down by 10 degrees or more, Enter. ", 0),
            self._turn("turn to starboard", "Turn the nose to starboard by 10 degrees or more, Enter. ", 2),
            self._deeper(),
        ]
        answer = self._ask("Now the actuators move, over half their way. Hands and cables clear? (yes/no) ")
        if answer.lower() not in ("y", "yes"):
            return [*found, SignFinding("actuators", False, "not moved: not clear")]
        self._bench.ask("enable", on=True)
        try:
            found += [
                self._move("slider", "mass forward", "Did the mass move forward? (yes/no) "),
                self._move("ballast", "pump in", "Did the plunger draw water in? (yes/no) "),
                self._move("servo", "servo to starboard", "Did the mass swing to starboard? (yes/no) "),
            ]
        finally:
            self._bench.ask("enable", on=False)
        return found

    def _attitude(self) -> list[float]:
        values = self._bench.snapshot()["sensors"]["imu"]["values"]
        return [math.nan if value is None else math.degrees(value) for value in values[:3]]

    def _turn(self, what: str, question: str, axis: int) -> SignFinding:
        if self._ask(question) == "skip":
            return SignFinding(what, False, "left out")
        change = (self._attitude()[axis] - self._level[axis] + 180.0) % 360.0 - 180.0
        name = ("roll", "pitch", "yaw")[axis]
        if not abs(change) >= LEAST_DEG:
            return SignFinding(what, False, f"{name} changed by {change:.1f} deg only; another axis, or no motion")
        verdict = "right" if change > 0 else "WRONG SIGN: see imu.mount_deg"
        return SignFinding(what, change > 0, f"{name} {change:+.1f} deg: {verdict}")

    def _deeper(self) -> SignFinding:
        before = self._bench.snapshot()["sensors"]["beacon"]["values"][0]
        if self._ask("Lower it by 10 cm of water, or press on the transmitter's port, Enter (or `skip`). ") == "skip":
            return SignFinding("deeper", False, "left out")
        after = self._bench.snapshot()["sensors"]["beacon"]["values"][0]
        if before is None or after is None:
            return SignFinding("deeper", False, "the beacon gives no reading")
        return SignFinding("deeper", after - before > 300.0, f"pressure {after - before:+.0f} Pa")

    def _move(self, name: str, what: str, question: str) -> SignFinding:
        high = self._bench.limits(name)[1]
        wire = WIRES.get(name)
        try:
            # From the middle: from beyond the goal it would move the other way.
            self._bench.wait_there(name, self._bench.target(name, 0.0), MOVE_S)
            before = self._wire(wire)
            sent = self._bench.target(name, TRAVEL_SHARE * high)
            there = self._bench.wait_there(name, sent, MOVE_S)
            moved = self._wire(wire) - before
            seen = self._ask(question).lower() in ("y", "yes")
            self._bench.wait_there(name, self._bench.target(name, 0.0), MOVE_S)
        except BenchError as error:
            return SignFinding(what, False, str(error))
        if not seen:
            return SignFinding(what, False, f"the other way: change the sign of {_scale_of(name)}")
        if wire is not None and not moved > LEAST_M:
            return SignFinding(what, False, f"{wire} moved {1e3 * moved:+.1f} mm: change the sign of {wire}.per_m")
        if not there:
            return SignFinding(what, False, f"did not get to {sent:.1f} {UNITS[name]}")
        return SignFinding(what, True, "right" if wire is None else f"right; {wire} {1e3 * moved:+.1f} mm")

    def _wire(self, wire: str | None) -> float:
        if wire is None:
            return 0.0
        value: Any = self._bench.snapshot()["sensors"][wire]["values"][0]
        return math.nan if value is None else value


def _scale_of(name: str) -> str:
    return "servo.us_per_rad" if name == "servo" else f"{name}.counts_per_m"
