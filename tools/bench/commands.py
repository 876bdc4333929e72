"""What can be typed at the bench: one method a command; its docstring is its help, its first line the short one."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hal.boardfile import DeviceFile, calibration_hash
from hal.protocols.vn100 import TextMessage, Vn100Decoder, encode_text
from hal.strict import ConfigError, decode
from tools.bench import boardtext, calibrate, record, sweep
from tools.bench.client import Bench, BenchError, check_actuator
from tools.bench.units import ACTUATORS, UNITS, WIRES, from_port, shown_values, to_port

MOVE_LIMIT_S = 30.0
CALIBRATION_SHARES = (-0.8, -0.4, 0.0, 0.4, 0.8)


class UsageError(BenchError):
    """A command was typed that cannot be understood."""


def number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise UsageError(f"expected a number, got '{word}'") from None
    if not math.isfinite(value):
        raise UsageError(f"expected a finite number, got '{word}'")
    return value


class Commands:
    """The commands, over a bench, a way to say things, a way to ask, and a way to see a key pressed."""

    def __init__(
        self, bench: Bench, say: Callable[[str], None], ask: Callable[[str], str],
        pressed: Callable[[], bool], show_table: Callable[[Callable[[], Any], float], None], out: Path,
    ):  # fmt: skip
        self.bench, self.say, self.ask, self.pressed, self._show, self.out = bench, say, ask, pressed, show_table, out

    @classmethod
    def names(cls) -> list[str]:
        return sorted(name.removeprefix("do_") for name in dir(cls) if name.startswith("do_"))

    def run(self, line: str) -> None:
        """One line; BenchError says why it could not be done, SystemExit ends the console."""
        words = line.split("#")[0].split()
        if not words:
            return
        method = getattr(self, f"do_{words[0]}", None)
        if method is None:
            raise UsageError(f"no command '{words[0]}'; `help` lists them")
        try:
            method(*words[1:])
        except TypeError as error:
            if "positional argument" not in str(error):
                raise
            usage = (method.__doc__ or "").splitlines()[0]
            raise UsageError(f"usage: {usage}") from None

    # --- looking ----------------------------------------------------------------------------------------------------
    def do_help(self, name: str = "") -> None:
        """help [COMMAND]: what can be typed."""
        if name:
            method = getattr(self, f"do_{name}", None)
            if method is None:
                raise UsageError(f"no command '{name}'")
            self.say("\n".join(line.strip() for line in (method.__doc__ or "").strip().splitlines()))
            return
        for item in self.names():
            self.say("  " + (getattr(self, f"do_{item}").__doc__ or "").splitlines()[0])

    def do_read(self, device: str = "") -> None:
        """read [DEVICE]: the newest values; fails where a device named has none that is valid."""
        state = self.bench.snapshot()
        known = [*state["sensors"], *state["actuators"]]
        if device and device not in known:
            raise UsageError(f"no device '{device}'; there are {', '.join(known)}")
        for name in [device] if device else known:
            self.say(f"{name:<13} {self.describe(name, state)}")
        if device in state["sensors"] and state["sensors"][device]["validity"] != "valid":
            raise BenchError(f"{device}: {state['sensors'][device]['validity']}")
        if device in state["actuators"] and not state["actuators"][device]["answers"]:
            raise BenchError(f"{device}: does not answer")

    def describe(self, name: str, state: dict) -> str:
        """A device's line."""
        if name in state["sensors"]:
            item = state["sensors"][name]
            text = f"{item['validity']:<8} {shown_values(name, item['values'])}"
            if item["reading"] is not None:
                text += f"  (reads {item['reading']:g})"
        else:
            item, kg = state["actuators"][name], state["kg_per_m"]
            target = "-" if item["target"] is None else f"{from_port(name, item['target'], kg):.2f}"
            text = f"{'answers' if item['answers'] else 'SILENT':<8} target {target} {UNITS[name]}"
            if "position" in item:
                places = [from_port(name, item[key], kg) for key in ("position", "measured")]
                text += f", drive {places[0]:.2f}, wire {places[1]:.2f}, {item['counts']} counts"
            elif item["pulse_us"] is not None:
                text += f", pulse {item['pulse_us']:.2f} us"
        return text + (f"  [{item['error']}]" if item["error"] else "")

    def do_watch(self, seconds: str = "") -> None:
        """watch [SECONDS]: a live table of everything, until a key is pressed."""
        self._show(self.bench.snapshot, number(seconds) if seconds else math.inf)

    def do_health(self) -> None:
        """health: ports, lines, counts of what went wrong."""
        state = self.bench.snapshot()
        for name, port in state["ports"].items():
            where = "open" if port["up"] else f"NOT OPEN: {port['trouble']}"
            self.say(f"port {name:<9} {where}, {port['bytes_in']} bytes in, opened {port['opened']} times")
        for name, bus in state["buses"].items():
            self.say(f"line {name:<9} " + ", ".join(f"{key} {value}" for key, value in bus.items() if value))
        for name, item in {**state["sensors"], **state["actuators"]}.items():
            if item["error"] or item["timeouts"]:
                self.say(f"{name:<14} {item['timeouts']} timeouts {item['error']}")

    # --- moving -----------------------------------------------------------------------------------------------------
    def do_enable(self) -> None:
        """enable: let actuators move; nothing does before."""
        self.bench.ask("enable", on=True)
        self.say("enabled: actuators move when told")

    def do_disable(self) -> None:
        """disable: stop, and move no more."""
        self.bench.ask("enable", on=False)
        self.say("disabled")

    def do_stop(self) -> None:
        """stop: stop all actuators at once (so does Ctrl-C, and any key while something moves)."""
        self.bench.stop()
        self.say("stopped")

    def do_reset(self) -> None:
        """reset: forget a stall or alarm, after you have looked."""
        self.bench.ask("reset")

    def do_goto(self, actuator: str, position: str) -> None:
        """goto ACTUATOR POSITION: move there (servo deg, slider mm, ballast mm of plunger) and wait."""
        self._move(check_actuator(actuator), number(position))

    def do_jog(self, actuator: str, step: str) -> None:
        """jog ACTUATOR STEP: move by so much from where it is (deg, mm)."""
        check_actuator(actuator)
        item = self.bench.snapshot()
        target = item["actuators"][actuator]["target"]
        here = self.bench.place(actuator, item)
        if target is not None:
            here = from_port(actuator, target, item["kg_per_m"])
        self._move(actuator, here + number(step))

    def _move(self, name: str, goal: float) -> float:
        sent = self.bench.target(name, goal)
        unit = UNITS[name]
        if abs(sent - goal) > 1e-6:
            self.say(f"{name}: limited to {sent:.2f} {unit}")
        there = self.bench.wait_there(name, sent, MOVE_LIMIT_S, self.pressed)
        where = self.bench.place(name)
        self.say(f"{name}: at {where:.2f} {unit}" + ("" if there else f", not at {sent:.2f}"))
        if not there:
            raise BenchError(f"{name} did not get to {sent:.2f} {unit} within {MOVE_LIMIT_S:g} s")
        return where

    def do_sweep(self, actuator: str, low: str = "", high: str = "") -> None:
        """sweep ACTUATOR [LOW HIGH]: travel time, lag, backlash, dead band; run data and a picture.

        Without LOW and HIGH over 80 % of the way between the limits. Any key stops it.
        """
        check_actuator(actuator)
        state = self.bench.snapshot()
        limits = self.bench.limits(actuator, state)
        ends = tuple(sweep.SHARE * end for end in limits) if not low else (number(low), number(high or "x"))
        if not limits[0] <= ends[0] < ends[1] <= limits[1]:
            raise BenchError(f"expected LOW < HIGH within {limits[0]:.2f} to {limits[1]:.2f} {UNITS[actuator]}")
        result = sweep.SweepResult(actuator, UNITS[actuator], *ends)
        the_plan = sweep.plan(ends[0], ends[1], self._speed(actuator))
        self.say(f"sweeping {actuator} from {ends[0]:.1f} to {ends[1]:.1f} {UNITS[actuator]}, {the_plan.seconds:.0f} s")
        rows = self._run_profile(actuator, the_plan, state["kg_per_m"])
        self._finish_sweep(result, the_plan, rows, state["kg_per_m"])

    def _speed(self, actuator: str) -> float:
        """What an actuator can do, by the vehicle's file, in deg/s or mm/s."""
        from tools.sources import load_vehicle

        vehicle: Any = load_vehicle(self.bench.vehicle)
        kg_per_m = self.bench.snapshot()["kg_per_m"]
        return from_port(actuator, getattr(vehicle.actuators, actuator).rate, kg_per_m)

    def _run_profile(self, actuator: str, the_plan: sweep.SweepPlan, kg_per_m: float) -> list:
        self.bench.ask("record", on=True)
        try:
            steps = [(t, actuator, to_port(actuator, value, kg_per_m)) for t, value in the_plan.targets]
            self.bench.ask("profile", steps=steps)
            end = time.monotonic() + the_plan.seconds
            while time.monotonic() < end:
                if self.pressed():
                    self.bench.stop()
                    raise BenchError("stopped")
                try:
                    self.bench.raise_trouble(actuator, self.bench.snapshot()["actuators"][actuator])
                except BenchError:
                    self.bench.stop()
                    raise
                time.sleep(0.1)
        finally:
            rows = self.bench.ask("record", on=False)
        return rows

    def _finish_sweep(self, result: sweep.SweepResult, the_plan: sweep.SweepPlan, rows: list, kg_per_m: float) -> None:
        data = record.table(rows)
        name, unit = result.actuator, result.unit
        columns = {"servo": (1, 8), "slider": (2, 6), "ballast": (3, 7)}[name]
        scale = from_port(name, 1.0, kg_per_m)
        times, command, position = data[:, 0], *(scale * data[:, column] for column in columns)
        folder = record.free_folder(self.out, f"sweep-{name}")
        run = record.write_case(folder, data, self.bench.vehicle)
        if name == "servo":
            self.say("servo: it knows nothing of its shaft; the run data have the roll that follows")
        else:
            sweep.analyse(result, the_plan, times, command, position)
            self.say(f"travel time {result.travel_s:.2f} s ({result.speed:.1f} {unit}/s), lag {result.lag_s:.3f} s")
            self.say(
                f"backlash {result.backlash:.3f} {unit}, dead band {result.dead_band:g} {unit}, "
                f"reading's noise {result.noise:.3f} {unit}"
            )
        sweep.picture(folder / f"sweep-{name}.png", result, times, command, position)
        self.say(f"{run}, {folder / f'sweep-{name}.png'}")

    # --- changing the board file ------------------------------------------------------------------------------------
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
            answer = self.ask(f"where is it really, {unit}? ")
            if not answer:
                continue
            state = self.bench.snapshot()
            item = state["actuators"][name]
            places.append(number(answer))
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
            answer = self.ask(f"put it to a place and say which, mm (empty: {len(places)} places are enough): ")
            if not answer:
                break
            places.append(number(answer))
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
        if self.ask(f"write {path}? (yes/no) ").lower() not in ("y", "yes"):
            raise BenchError("not written")
        kept = boardtext.keep_old(path)
        boardtext.replace_file(path, text)
        self.say(f"written; the old one is {kept.name}; actuators are stopped and want `enable` again")
        self.bench.restart(text)

    # --- below ------------------------------------------------------------------------------------------------------
    def do_raw(self, port: str, *data: str) -> None:
        """raw PORT BYTES...: hex bytes to a port, after a confirmation; on Modbus lines the check sum is added.

        A text command of the IMU goes as it is: `raw imu VNRRG,01`. Limits do not hold for what is sent here.
        """
        if port not in self.bench.snapshot()["ports"]:
            raise UsageError(f"no port '{port}'; there are {', '.join(self.bench.snapshot()['ports'])}")
        if not data:
            raise UsageError("usage: raw PORT BYTES...")
        text = " ".join(data)
        if text.startswith("VN"):
            raw = encode_text(text).hex()
        else:
            try:
                raw = bytes.fromhex(text).hex()
            except ValueError:
                raise UsageError(f"expected hex bytes, got '{text}'") from None
        if self.ask("limits do not hold for raw bytes; send them? (yes/no) ").lower() not in ("y", "yes"):
            raise BenchError("not sent")
        answer = bytes.fromhex(self.bench.ask("raw", port=port, data=raw))
        messages = [item for item in Vn100Decoder().feed(answer) if isinstance(item, TextMessage)]
        if messages:
            self.say("\n".join(f"${item.header},{','.join(item.fields)}" for item in messages))
            return
        answer = answer[:64]
        printable = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in answer)
        self.say(f"{answer.hex(' ') or 'nothing came'}  {printable}")

    def do_wait(self, seconds: str) -> None:
        """wait SECONDS: for scripts."""
        end = time.monotonic() + number(seconds)
        while time.monotonic() < end and not self.pressed():
            time.sleep(min(0.05, max(0.0, end - time.monotonic())))

    def do_quit(self) -> None:
        """quit: stop the actuators and leave."""
        raise SystemExit(0)
