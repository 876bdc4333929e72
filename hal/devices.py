"""A board of real devices: drivers on their ports, served in the time that the loop has left. Nothing is opened at
import.

Between two ticks `sleep_until` serves the ports and then sleeps the last millisecond; `read` and `command` only touch
memory. So a slow, silent or babbling device costs the tick nothing.
"""

import time
from collections.abc import Callable
from typing import Any

from glider.hal import boardfile
from glider.hal.board import BoardRequest
from glider.hal.clocks import MonotonicClock
from glider.hal.drivers.drive import Drive
from glider.hal.drivers.maestro import Servo
from glider.hal.drivers.modbus_sensors import AnalogModule, Beacon, EncoderWire, InputRegister, battery, leak, wire
from glider.hal.drivers.samples import Sensor
from glider.hal.ports import ACTUATORS, SENSORS, Board, BoardError, Hardware, OutOfBand, Validity
from glider.hal.protocols.modbus_master import ModbusBus
from glider.hal.recorder.schema import RecordSpec
from glider.hal.transport.hub import Hub, LineHandler, SerialLink
from glider.hal.transport.port import SerialPort, Unplugged

GUARD_S = 0.001  # before a deadline, in which ports are left alone
FIRST_ANSWER_S = 4.0  # for every device to answer after opening
STOPPING_S = 0.15


class ServingClock(MonotonicClock):
    """Real time; waiting serves the ports."""

    def __init__(self, board: "DeviceBoard"):
        super().__init__()
        self._board = board

    def start(self, now: float) -> None:
        """The board's time begins at `now` of the monotonic clock."""
        self._start = now

    def sleep_until(self, deadline: float) -> None:
        self._board.serve(self._start + deadline - GUARD_S)
        super().sleep_until(deadline)


class DeviceBoard:
    """Every device of a board file. Drop weight, watchdog and a way to the out-of-band process are not fitted."""

    drop_weight = watchdog = None
    hardware = Hardware.REAL
    records: tuple[RecordSpec, ...] = ()
    imu: Sensor
    beacon: Beacon
    slider_wire: InputRegister
    plunger_wire: InputRegister
    leak: InputRegister | None
    battery: InputRegister | None
    servo: Servo
    slider: Drive
    ballast: Drive

    def __init__(self, file: boardfile.DeviceFile, source: str, vehicle: Any, water_density: float):
        self.name, self.file, self.source, self.loop_hz = file.name, file, source, file.loop_hz
        self.surface_pressure, self.armed_depth = file.beacon.surface_pa, file.armed_depth_m
        self.out_of_band: OutOfBand | None = None
        self.periods = {
            "imu": 1.0 / file.imu.rate_hz,
            "beacon": 1.0 / file.beacon.rate_hz,
            "wires": 1.0 / min(file.slider_wire.rate_hz, file.plunger_wire.rate_hz),
            **{name: 1.0 / table.rate_hz for name in ("leak", "battery") if (table := getattr(file, name)) is not None},
        }
        self.buses: dict[str, ModbusBus] = {}
        self._handlers: dict[str, LineHandler] = {}  # by port
        self._build(file, source, vehicle, water_density)
        self.sensors: dict[str, Sensor] = {name: port for name in SENSORS if (port := getattr(self, name)) is not None}
        self.actuators: dict[str, Servo | Drive] = {name: getattr(self, name) for name in ACTUATORS}
        self.links = {name: self._link(name) for name in file.port}
        self.hub = Hub(list(self.links.values()), time.monotonic)
        self.hub.set_period(1.0 / file.loop_hz)
        self.clock = ServingClock(self)

    # --- building ---------------------------------------------------------------------------------------------------
    def _build(self, file: boardfile.DeviceFile, source: str, vehicle: Any, density: float) -> None:
        presets = {
            name: boardfile.preset_of(file, name, source) for name in boardfile.ROLES if getattr(file, name) is not None
        }
        for name in boardfile.DRIVERS:
            table = getattr(file, name)
            driver = boardfile.driver_builder(name, table.device)(table, file.port[table.port], vehicle)
            setattr(self, name, driver)
            self._handlers[table.port] = driver
        self.beacon = Beacon(file.beacon, presets["beacon"])
        self._bus(file.beacon.port).add(self.beacon.poll)
        self.slider_wire, self.plunger_wire = (
            wire(name, getattr(file, name)) for name in ("slider_wire", "plunger_wire")
        )
        self.leak = None if file.leak is None else leak(file.leak)
        self.battery = None if file.battery is None else battery(file.battery)
        self._build_inputs(presets)
        kg_per_m = density * vehicle.actuators.ballast.plunger_area
        for name, unit, feedback in (("slider", 1.0, self.slider_wire), ("ballast", kg_per_m, self.plunger_wire)):
            table, limits = getattr(file, name), getattr(vehicle.actuators, name).range
            drive = Drive(name, table, presets[name], unit, limits, feedback)
            drive.join(self._bus(table.port))
            setattr(self, name, drive)

    def _build_inputs(self, presets: dict) -> None:
        """Draw-wires, leak and battery: those on one analog module share its reads."""
        modules: dict[tuple[str, int], list[tuple[int, InputRegister]]] = {}
        maps = {}
        for name in ("slider_wire", "plunger_wire", "leak", "battery"):
            table, item = getattr(self.file, name), getattr(self, name)
            if item is None:
                continue
            if presets[name].role == "encoder":
                self._bus(table.port).add(EncoderWire(table.id, presets[name], item).poll)
            else:
                modules.setdefault((table.port, table.id), []).append((table.channel, item))
                maps[table.port, table.id] = presets[name]
        self.modules = [AnalogModule(key[1], maps[key], inputs) for key, inputs in modules.items()]
        for key, module in zip(modules, self.modules, strict=True):
            self._bus(key[0]).add(module.poll)

    def _bus(self, port: str) -> ModbusBus:
        if port not in self.buses:
            table = self.file.port[port]
            self.buses[port] = ModbusBus(table.baud, timeout_s=table.timeout_s, longest_s=table.longest_s)
            self._handlers[port] = self.buses[port]
        return self.buses[port]

    def _link(self, name: str) -> SerialLink:
        table = self.file.port[name]
        return SerialLink(name, SerialPort(table.path, table.baud), self._handlers[name])

    # --- opening and closing ----------------------------------------------------------------------------------------
    def open(self) -> None:
        """For a flight: calibration as looked through, every port open, every device answering; then time begins."""
        self.check_calibration()
        self.connect()
        silent = self.wait_for_answers(FIRST_ANSWER_S)
        if silent:
            self.close()
            raise BoardError("; ".join(silent))
        self.enable(True)
        self.start()

    def check_calibration(self) -> str:
        """BoardError where the file is not as it was when someone last looked it through."""
        found = boardfile.calibration_hash(self.file)
        if not self.file.calibration:
            raise BoardError(f"{self.source}: never calibrated; look it through with glider bench, then `accept`")
        if found != self.file.calibration:
            raise BoardError(
                f"{self.source}: calibration: changed since it was looked through (is {found}, was "
                f"{self.file.calibration}); look it through with glider bench, then `accept`"
            )
        return "as accepted"

    def connect(self) -> None:
        """Open every port; BoardError names the one that cannot be, and its devices."""
        for name, link in self.links.items():
            try:
                link.open(time.monotonic())
            except Unplugged as error:
                self.close()
                raise BoardError(f"port {name} ({', '.join(self.devices_on(name))}): {error}") from None

    def connect_available(self) -> None:
        """Open every port that is there, for the bench; the rest is tried again and again."""
        for link in self.links.values():
            try:
                link.open(time.monotonic())
            except Unplugged as error:
                link.trouble = str(error)

    def devices_on(self, port: str) -> list[str]:
        return [name for name, table in boardfile.devices_of(self.file).items() if table.port == port]

    def wait_for_answers(self, seconds: float) -> list[str]:
        """Serve until every device has answered, at most so long; a line for each that has not."""
        end = time.monotonic() + seconds
        while True:
            self.serve(time.monotonic() + 0.02)
            silent = self.silent()
            if not silent or time.monotonic() > end:
                return silent

    def silent(self) -> list[str]:
        """A line for each device that gives nothing, or nothing good."""
        now, found = time.monotonic(), []
        for name, table in boardfile.devices_of(self.file).items():
            port = getattr(self, name)
            good = port.validity == Validity.VALID if isinstance(port, Sensor) else port.answering(now)
            if not good:
                number = getattr(table, "id", None)
                place = f"port {table.port}" + ("" if number is None else f", id {number}")
                found.append(f"{name} ({table.device}, {place}): {port.health.error or 'does not answer'}")
        return found

    def enable(self, on: bool) -> None:
        """Let actuators be moved, or not."""
        for actuator in self.actuators.values():
            actuator.enabled = on
            if not on:
                actuator.target = None

    def start(self) -> None:
        """The board's time begins."""
        now = time.monotonic()
        self.clock.start(now)
        for port in (*self.sensors.values(), *self.actuators.values()):
            port.start(now)

    def stop(self) -> None:
        """Stop all actuators, at once as far as their lines go."""
        for actuator in self.actuators.values():
            actuator.stop()

    def close(self, *, stop: bool = False) -> None:
        """Give the ports back; the drives hold, or go on to, where they were sent last, or `stop` where they stand.
        Never raises; twice does no harm."""
        if stop and any(link.up for link in self.links.values()):
            self.stop()
            self.serve(time.monotonic() + STOPPING_S)
        for link in self.links.values():
            link.port.close()

    # --- running ----------------------------------------------------------------------------------------------------
    def serve(self, until: float) -> None:
        """Serve all ports until `until` of the monotonic clock; then say what has grown old."""
        self.hub.serve(until)
        now = time.monotonic()
        for sensor in self.sensors.values():
            sensor.age(now)
        self.slider.age(now)
        self.ballast.age(now)

    def health(self) -> dict[str, dict[str, Any]]:
        """How every device does."""
        return {name: port.health.plain() for name, port in (*self.sensors.items(), *self.actuators.items())}

    def state(self) -> dict[str, float]:
        """Nobody knows where a real vehicle is."""
        return {}

    def recording(self, channel: Callable[[str], Any]) -> tuple[Callable[[float], None], ...]:
        """Nothing beside the ticks."""
        return ()


def build_board(request: BoardRequest) -> Board:
    """A board of real devices from its file's text."""
    file = boardfile.decode_device_file(request.text, request.source)
    return DeviceBoard(file, request.source, request.vehicle, request.water_density)
