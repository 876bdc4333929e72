"""The bench's commands that change the board file: each shows what, asks, and keeps the old one."""

import math
import time
from typing import Any

from glider.hal.boardfile import DeviceFile, calibration_hash
from glider.hal.ports import ACTUATORS
from glider.hal.strict import ConfigError, decode
from glider.tools.bench import boardtext, calibrate
from glider.tools.bench.client import BenchError, check_actuator
from glider.tools.bench.desk import UsageError, number
from glider.tools.bench.moving import Moving
from glider.tools.bench.units import UNITS, WIRES
from glider.tools.data.files import write_bytes

CALIBRATION_SHARES = (-0.8, -0.4, 0.0, 0.4, 0.8)


class Changing(Moving):
    """calibrate, zero, limits, accept."""

    def do_calibrate(self, what: str) -> None:
        """calibrate ACTUATOR|WIRE: guided, with a ruler or protractor; writes the board file, keeps the old one.

        An actuator is moved to five places, and you say where it is; its draw-wire is calibrated with it. A draw-wire
        (slider_wire, plunger_wire) alone is put to places by hand. An empty answer leaves a place out.
        """
        if what in ACTUATORS:
            changes = self._calibrate_actuator(what)
        elif what in WIRES.values():
            changes = self._calibrate_wire(what)
        else:
            raise UsageError(f"expected one of {', '.join([*ACTUATORS, *WIRES.values()])}")
        self._write(changes)

    def _calibrate_actuator(self, name: str) -> dict[str, Any]:
        low, high = self.bench.limits(name)
        unit, middle, half = UNITS[name], 0.5 * (low + high), 0.5 * (high - low)
        places: list[float] = []
        drives: list[float] = []
        wires: list[float] = []
        for share in CALIBRATION_SHARES:
            self._move(name, middle + share * half)
            time.sleep(0.0 if name == "servo" else 0.5)
            place = self.ask_number(f"where is it really, {unit}? ")
            if place is None:
                continue
            state = self.bench.snapshot()
            item = state["actuators"][name]
            places.append(place)
            drives.append(item["pulse_us"] if name == "servo" else item["counts"])
            if name in WIRES:
                wires.append(self._mean_reading(WIRES[name]))
        spread = calibrate.LEAST_SPREAD[name]
        found = calibrate.fit(places, drives, spread)
        self.say(f"{name}: worst place off the line by {found.residual:.2f} {unit}")
        if name == "servo":
            return calibrate.servo_changes(found)
        line = calibrate.fit(places, wires, spread)
        self.say(f"{WIRES[name]}: worst place off the line by {line.residual:.2f} {unit}")
        return {**calibrate.drive_changes(name, found), **calibrate.wire_changes(WIRES[name], line)}

    def _calibrate_wire(self, name: str) -> dict[str, Any]:
        places: list[float] = []
        readings: list[float] = []
        while True:
            place = self.ask_number(f"put it to a place and say which, mm (empty: {len(places)} places are enough): ")
            if place is None:
                break
            places.append(place)
            readings.append(self._mean_reading(name))
            self.say(f"{name} reads {readings[-1]:g}")
        found = calibrate.fit(places, readings, 5.0)
        self.say(f"{name}: worst place off the line by {found.residual:.2f} mm")
        return calibrate.wire_changes(name, found)

    def _mean_reading(self, wire: str, samples: int = 20) -> float:
        """The mean of a draw-wire's next readings; BenchError where it gives none."""
        readings = []
        for _ in range(samples):
            item = self.bench.snapshot()["sensors"][wire]
            if item["reading"] is not None and item["error"] == "":
                readings.append(item["reading"])
            time.sleep(0.04)
        if len(readings) < samples // 2:
            raise BenchError(f"{wire}: gives no readings")
        return sum(readings) / len(readings)

    def do_zero(self, device: str) -> None:
        """zero DEVICE: where it is now is zero: imu (hull level), beacon (at the surface), a draw-wire, an actuator."""
        state = self.bench.snapshot()
        file = self._file()
        if device == "imu":
            roll, pitch, _ = (math.degrees(value) for value in state["sensors"]["imu"]["values"][:3])
            if file.imu.mount_deg[:2] != (0.0, 0.0):
                raise BenchError("set imu.mount_deg to zeros first: the reading has to be the sensor's own")
            changes: dict[str, Any] = {"imu.mount_deg": (round(roll, 2), round(pitch, 2), file.imu.mount_deg[2])}
        elif device == "beacon":
            pressure = state["sensors"]["beacon"]["values"][0]
            if pressure is None:
                raise BenchError("beacon: gives no reading")
            changes = {"beacon.zero_pa": round(file.beacon.zero_pa + pressure - file.beacon.surface_pa, 1)}
        elif device in WIRES.values():
            changes = {f"{device}.zero": round(self._mean_reading(device), 3)}
        elif device in ("slider", "ballast"):
            changes = {f"{device}.zero_counts": float(state["actuators"][device]["counts"])}
        elif device == "servo":
            pulse = state["actuators"]["servo"]["pulse_us"]
            if pulse is None:
                raise BenchError("servo: has no pulse yet; `goto servo` to where zero is")
            changes = {"servo.zero_us": pulse}
        else:
            raise UsageError(f"expected imu, beacon, {', '.join(WIRES.values())} or an actuator")
        self._write(changes)

    def do_limits(self, actuator: str = "", low: str = "", high: str = "") -> None:
        """limits [ACTUATOR [LOW HIGH]]: show the limits, or write new ones into the board file (deg, mm)."""
        if not low:
            for name in [check_actuator(actuator)] if actuator else ACTUATORS:
                ends = self.bench.limits(name)
                self.say(f"{name:<8} {ends[0]:.2f} to {ends[1]:.2f} {UNITS[name]}")
            return
        ends = number(low), number(high or "x")
        if check_actuator(actuator) == "servo":
            servo = self._file().servo
            pulses = sorted(servo.zero_us + servo.us_per_rad * math.radians(end) for end in ends)
            self._write({"servo.limits_us": tuple(round(pulse, 2) for pulse in pulses)})
        else:
            self._write({f"{actuator}.limits_m": (round(ends[0] * 1e-3, 6), round(ends[1] * 1e-3, 6))})

    def do_accept(self) -> None:
        """accept: what stands in the board file was looked through; writes its hash, without which nothing arms."""
        file = self._file()
        if file.calibration == calibration_hash(file):
            self.say("accepted already")
            return
        self._write({})

    def _file(self) -> DeviceFile:
        try:
            return decode(self.bench.text, DeviceFile, self.bench.source)
        except ConfigError:
            raise BenchError("a twin's own board has nothing to change; start `glider twin` and use its file") from None

    def _write(self, changes: dict[str, Any]) -> None:
        """Show the changes, ask, write the board file with its hash, keep the old one, go on with the new one."""
        path = self.bench.path
        if path is None:
            raise BenchError("a shipped board is not written; copy it first")
        for key, value in changes.items():
            self.say(f"  {key} = {list(value) if isinstance(value, tuple) else value}")
        try:
            text = boardtext.accepted(boardtext.set_values(self.bench.text, changes), str(path))
        except ConfigError as error:
            raise BenchError(f"would not be a good board file: {error}") from None
        if not self.ask_yes(f"write {path}?", again=True):
            raise BenchError("not written")
        kept = boardtext.keep_old(path)
        write_bytes(path, text.encode(), kept=True)
        self.say(f"written; the old one is {kept.name}; actuators are stopped and want `enable` again")
        self.bench.restart(text)
