"""The bench's other half: `python -m glider.tools.bench.worker` holds the ports; a dead console stops the actuators.

Standard input brings a line of JSON (the board), then requests, one a line, each answered by a line of JSON with its
`number`. The end of standard input, or silence of HEARTBEAT_S while actuators are enabled, stops them. Nothing moves
before `enable`.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from glider.hal.board import BoardRequest, board_builder
from glider.hal.devices import DeviceBoard
from glider.hal.drivers.drive import Drive
from glider.hal.drivers.maestro import Servo
from glider.hal.ports import BoardError
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus import Frame
from glider.hal.transport.port import Unplugged
from glider.tools.bench.units import finite
from glider.tools.data.sources import load_vehicle

STEP_S = 0.01
HEARTBEAT_S = 3.0
LISTEN_S = 0.3  # for the answer to raw bytes
ROWS_LIMIT = 100 * 3600


class Requests:
    """Lines from standard input, without waiting."""

    def __init__(self) -> None:
        os.set_blocking(0, False)
        self._data = b""
        self.ended = False

    def take(self) -> dict | None:
        """The next request, if one is there."""
        if b"\n" not in self._data and not self.ended:
            try:
                piece = os.read(0, 65_536)
            except BlockingIOError:
                return None
            self.ended = not piece
            self._data += piece
        line, found, rest = self._data.partition(b"\n")
        if not found:
            return None
        self._data = rest
        return json.loads(line)


class Worker:
    """A board at the bench: served a hundred times a second, asked by a console."""

    def __init__(self, board: DeviceBoard):
        self.board = board
        self.enabled = False
        self.rows: list[list[float]] | None = None
        self._profile: list[tuple[float, str, float]] = []
        self._began = 0.0

    # --- what it is asked -------------------------------------------------------------------------------------------
    def answer(self, request: dict) -> dict:
        """The answer to a request; {"error": ...} where it cannot be done."""
        try:
            return {"ok": getattr(self, f"do_{request['do']}")(**{k: v for k, v in request.items() if k != "do"})}
        except (BoardError, ValueError, KeyError, Unplugged) as error:
            return {"error": str(error)}

    def do_beat(self) -> None:
        """The console is alive."""

    def do_snapshot(self) -> dict:
        """Everything that can be known."""
        board, now = self.board, time.monotonic()
        sensors = {
            name: {
                "validity": port.validity.name.lower(), "values": [finite(value) for value in port.values],
                "reading": finite(getattr(port, "reading", None)), "error": port.health.error,
                "timeouts": port.health.timeouts,
            }
            for name, port in board.sensors.items()
        }  # fmt: skip
        actuators = {name: self._actuator(name, port, now) for name, port in board.actuators.items()}
        ports = {
            name: {"up": link.up, "trouble": link.trouble, "bytes_in": link.bytes_in, "opened": link.connections}
            for name, link in board.links.items()
        }
        buses = {name: vars(bus.counts) for name, bus in board.buses.items()}
        return {
            "sensors": sensors, "actuators": actuators, "ports": ports, "buses": buses, "enabled": self.enabled,
            "kg_per_m": board.ballast.unit, "imu_model": board.imu.model, "name": board.file.name,
        }  # fmt: skip

    def _actuator(self, name: str, port: Servo | Drive, now: float) -> dict:
        target = port.target
        common = {
            "target": target, "limits": port.limits, "answers": port.answering(now), "error": port.health.error,
            "timeouts": port.health.timeouts,
        }  # fmt: skip
        if isinstance(port, Servo):
            return {**common, "pulse_us": None if target is None else port.quarter_us(target) / 4.0}
        if target is not None:
            common["target"] = target * port.unit
        return {
            **common, "position": port.position() * port.unit, "measured": port.measured() * port.unit,
            "counts": port.counts, "status": port.status, "fault": port.fault,
        }  # fmt: skip

    def do_enable(self, on: bool) -> None:
        self.board.enable(on)
        self.enabled = on
        if not on:
            self.do_stop()

    def do_target(self, actuator: str, value: float) -> float:
        """Move to a position in the port's unit; what is really sent."""
        self._need_enabled()
        self._profile.clear()
        return self.board.actuators[actuator].command(value)

    def do_profile(self, steps: list) -> None:
        """Targets at times from now: [seconds, actuator, value]."""
        self._need_enabled()
        self._began = time.monotonic()
        self._profile = sorted((float(t), str(name), float(value)) for t, name, value in steps)

    def _need_enabled(self) -> None:
        if not self.enabled:
            raise BoardError("nothing moves before `enable`")

    def do_stop(self) -> None:
        """Stop everything, and send it out before answering."""
        self._profile.clear()
        self.board.stop()
        self.board.serve(time.monotonic() + 0.05)

    def do_reset(self) -> None:
        for port in self.board.actuators.values():
            port.reset()

    def do_record(self, on: bool) -> list:
        """Begin a recording, or end it: rows of time, commands (3), positions (3), draw-wires (2), roll, pitch."""
        rows, self.rows = self.rows or [], [] if on else None
        return [[finite(value) for value in row] for row in rows]

    def do_raw(self, port: str, data: str) -> str:
        """Bytes (hex) to a port; what came back, in hex. On Modbus lines the check sum is added."""
        link, raw = self.board.links[port], bytes.fromhex(data)
        if port in self.board.buses:
            return self._raw_modbus(port, raw)
        heard = bytearray()
        feed = link.handler.feed

        def listen(piece: bytes, now: float) -> None:
            heard.extend(piece)
            feed(piece, now)

        link.handler.feed = listen  # type: ignore[method-assign, assignment]
        try:
            link.send(raw)
            self.board.serve(time.monotonic() + LISTEN_S)
        finally:
            link.handler.feed = feed  # type: ignore[method-assign, assignment]
        return bytes(heard[:2000]).hex(" ")

    def _raw_modbus(self, port: str, raw: bytes) -> str:
        frames = modbus.RtuDecoder(requests=True).feed(modbus.with_check_sum(raw))
        if len(frames) != 1:
            raise ValueError("not one whole Modbus request of function 3, 4, 6 or 16 (its check sum is added)")
        pdu, frame = frames[0].pdu, frames[0]
        if frame.function in (modbus.READ_HOLDING, modbus.READ_INPUT):
            request = modbus.read(frame.device, frame.function, pdu.address, pdu.count)
        else:
            request = modbus.Request(frame.raw, frame.device, frame.function, 8, frame.raw[2:6])
        heard: list[tuple[Frame | None, int]] = []
        self.board.buses[port].ask(request, lambda reply, code: heard.append((reply, code)))
        end = time.monotonic() + 2.0
        while not heard and time.monotonic() < end:
            self.board.serve(time.monotonic() + STEP_S)
        if heard and heard[0][0] is not None:
            return heard[0][0].raw.hex(" ")
        raise BoardError(f"exception {heard[0][1]}" if heard and heard[0][1] else "no answer")

    # --- running ----------------------------------------------------------------------------------------------------
    def step(self) -> None:
        """A hundredth of a second: profile, ports, recording."""
        now = time.monotonic()
        while self._profile and now - self._began >= self._profile[0][0]:
            _, name, value = self._profile.pop(0)
            self.board.actuators[name].command(value)
        self.board.serve(now + STEP_S)
        if self.rows is not None and len(self.rows) < ROWS_LIMIT:
            self.rows.append(self._row())

    def _row(self) -> list[float]:
        board = self.board
        drives = (board.slider, board.ballast)
        targets = [
            np.nan if port.target is None else port.target * (port.unit if isinstance(port, Drive) else 1.0)
            for port in board.actuators.values()
        ]
        places = [drive.position() * drive.unit for drive in drives]
        wires = [board.slider_wire.values[0], board.plunger_wire.values[0] * board.ballast.unit]
        return [time.monotonic(), *targets, *places, *wires, *board.imu.values[:2]]


ROW = (
    "t_s", "cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg", "drive_slider_m", "drive_ballast_kg", "slider_m",
    "ballast_kg", "roll_rad", "pitch_rad",
)  # fmt: skip


def serve(worker: Worker, requests: Requests, say: Callable[[dict], None]) -> None:
    """Until the console is gone."""
    heard = time.monotonic()
    while not requests.ended:
        worker.step()
        while (request := requests.take()) is not None:
            heard = time.monotonic()
            number = request.pop("number")
            say(worker.answer(request) | {"number": number})
        if worker.enabled and time.monotonic() - heard > HEARTBEAT_S:
            worker.do_enable(False)


def main() -> None:
    for name in ("SIGINT", "SIGHUP", "SIGQUIT", "SIGTSTP"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    requests = Requests()
    while (config := requests.take()) is None and not requests.ended:
        time.sleep(0.005)
    if config is None:
        return

    first = {"number": config["number"]}

    def say(item: dict) -> None:
        try:
            sys.stdout.write(json.dumps(item) + "\n")
            sys.stdout.flush()
        except BrokenPipeError:
            requests.ended = True

    vehicle: Any = load_vehicle(config["vehicle"])
    request = BoardRequest(text=config["text"], source=config["source"], vehicle=vehicle)
    board = board_builder(config["kind"])(request)
    assert isinstance(board, DeviceBoard), "a simulated board has no devices"

    def end(*_: object) -> None:
        requests.ended = True

    signal.signal(signal.SIGTERM, end)
    try:
        board.connect_available()
        worker = Worker(board)
        worker.do_enable(False)
        board.wait_for_answers(config.get("wait_s", 2.0))
        say({"ok": True} | first)
        serve(worker, requests, say)
    except BoardError as error:
        say({"error": str(error)} | first)
    finally:
        board.close(stop=True)


if __name__ == "__main__":
    main()
