"""Board files of real devices: which device on which port, its address, scale, direction and limits. Strict TOML.

A calibrated number is counts, microseconds or microamperes per SI unit, its sign the direction. `calibration` is a hash
over all of these: an edit behind the bench's back is seen, and the board does not arm.
"""

import hashlib
import json
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, Literal

import msgspec

from glider.hal.ports import SLOTS
from glider.hal.protocols.registers import RegisterMap, Role, channel_of, fits, preset, presets
from glider.hal.strict import ConfigError, Table, decode

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
DeviceId = Annotated[int, msgspec.Meta(ge=1, le=247)]
Rate = Annotated[float, msgspec.Meta(gt=0.0, le=200.0)]
Pair = tuple[float, float]
Channel = Annotated[int, msgspec.Meta(ge=1, le=8)]


def _ordered(name: str, pair: Pair) -> None:
    if not pair[0] < pair[1]:
        raise ValueError(f"{name}: expected [low, high] with low < high, got [{pair[0]}, {pair[1]}]")


def _not_zero(name: str, value: float) -> None:
    if value == 0.0:
        raise ValueError(f"{name}: 0 would lose the measurement; its sign is the direction")


class PortTable(Table):
    """[port.NAME]: 8N1. On Modbus lines: how long a device may take to begin its reply, and how late it may come."""

    path: Name
    baud: Annotated[int, msgspec.Meta(ge=1200, le=1_000_000)] = 115_200
    timeout_s: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)] = 0.05
    longest_s: Annotated[float, msgspec.Meta(gt=0.0, le=2.0)] = 0.1


class DeviceTable(Table):
    """What every device has: what it is, and the port that it is on."""

    device: Name
    port: Name


class ImuTable(DeviceTable):
    """[imu]. `mount_deg`: roll, pitch and yaw of the sensor in a level hull; `output`: the sensor's serial port."""

    rate_hz: Annotated[float, msgspec.Meta(ge=1.0, le=200.0)] = 100.0
    output: Literal[1, 2, 3] = 2
    mount_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    delay_s: Annotated[float, msgspec.Meta(ge=0.0, le=0.1)] = 0.0
    rate_limit_rad_s: Positive = 35.0

    def __post_init__(self):
        if 800.0 % self.rate_hz:
            raise ValueError(f"rate_hz: expected a divisor of the sensor's 800 Hz, got {self.rate_hz:g}")


class BeaconTable(DeviceTable):
    """[beacon]: absolute pressure. `zero_pa` is taken off; `range_pa` is what the transmitter can read."""

    id: DeviceId = 1
    rate_hz: Rate = 25.0
    zero_pa: Annotated[float, msgspec.Meta(ge=-50_000.0, le=50_000.0)] = 0.0
    range_pa: Pair = (50_000.0, 1.2e7)
    surface_pa: Annotated[float, msgspec.Meta(ge=80_000.0, le=110_000.0)] = 101_325.0

    def __post_init__(self):
        _ordered("range_pa", self.range_pa)


class WireTable(DeviceTable):
    """[slider_wire], [plunger_wire]: metres = (reading - zero) / per_m; readings in uA, mV or counts."""

    per_m: float
    zero: float
    id: DeviceId = 1
    channel: Channel | None = None
    rate_hz: Rate = 25.0
    range_m: Pair = (-0.5, 0.5)
    broken_below: float | None = None  # a reading under which the wire counts as broken: 3800 uA of 4-20 mA

    def __post_init__(self):
        _ordered("range_m", self.range_m)
        _not_zero("per_m", self.per_m)


class LeakTable(DeviceTable):
    """[leak]: wet where the reading is above `wet_above` (or below, with `inverted`)."""

    channel: Channel
    wet_above: float
    id: DeviceId = 1
    inverted: bool = False
    rate_hz: Rate = 5.0


class BatteryTable(DeviceTable):
    """[battery]: volts = reading / per_volt."""

    channel: Channel
    per_volt: float
    id: DeviceId = 1
    rate_hz: Rate = 5.0
    range_v: Pair = (0.0, 60.0)

    def __post_init__(self):
        _ordered("range_v", self.range_v)
        _not_zero("per_volt", self.per_volt)


class ServoTable(DeviceTable):
    """[servo]: pulse in us = zero_us + us_per_rad * angle, within limits_us."""

    channel: Annotated[int, msgspec.Meta(ge=0, le=23)]
    us_per_rad: float
    zero_us: Annotated[float, msgspec.Meta(ge=500.0, le=2500.0)]
    limits_us: Pair
    number: Annotated[int, msgspec.Meta(ge=0, le=127)] | None = None  # the device's, in Pololu's longer protocol
    crc: bool = True

    def __post_init__(self):
        _ordered("limits_us", self.limits_us)
        _not_zero("us_per_rad", self.us_per_rad)
        if not (400.0 <= self.limits_us[0] <= self.zero_us <= self.limits_us[1] <= 2600.0):
            raise ValueError("limits_us: expected zero_us inside, and both within 400 to 2600 us")


class DriveTable(DeviceTable):
    """[slider], [ballast]: counts = zero_counts + counts_per_m * metres (slider position, plunger travel).

    follow = "wire": a slow loop on the draw-wire follows the drift of the zero: lost steps and slip do not stay;
    "drive": the drive's own count is trusted. A move that does not show for stall_s is a stall.
    """

    counts_per_m: float
    limits_m: Pair
    speed_m_s: Positive
    id: DeviceId = 1
    zero_counts: float = 0.0
    counts_per_rev: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)] = 10_000
    ramp_ms: Annotated[int, msgspec.Meta(ge=1, le=30_000)] = 100
    rate_hz: Rate = 25.0
    follow: Literal["wire", "drive"] = "drive"
    deadband_m: Annotated[float, msgspec.Meta(ge=0.0, le=0.01)] = 0.00005
    stall_s: Positive = 1.0
    stall_m: Positive = 0.002

    def __post_init__(self):
        _ordered("limits_m", self.limits_m)
        _not_zero("counts_per_m", self.counts_per_m)
        if not 1 <= self.rpm <= 6000:
            raise ValueError(f"speed_m_s: {self.speed_m_s:g} m/s is {self.rpm} rpm, expected 1 to 6000")

    @property
    def rpm(self) -> int:
        return round(self.speed_m_s * abs(self.counts_per_m) / self.counts_per_rev * 60.0)


class DeviceFile(Table):
    """A board file of kind "devices"."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    kind: str
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    port: dict[str, PortTable]
    imu: ImuTable
    beacon: BeaconTable
    slider_wire: WireTable
    plunger_wire: WireTable
    servo: ServoTable
    slider: DriveTable
    ballast: DriveTable
    leak: LeakTable | None = None
    battery: BatteryTable | None = None
    loop_hz: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 50.0
    armed_depth_m: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 0.0  # of the beacon when armed; 0: in air or awash
    calibration: str = ""  # hash of what was calibrated and looked through; empty: never


# Devices that speak a protocol of their own on a port of their own: place on the board -> name -> who builds its
# driver, loaded when a board file asks for it. What speaks Modbus is a register map of the role that its place takes.
DRIVERS = {"imu": {"vn100": "glider.hal.drivers.vn100:build"}, "servo": {"maestro": "glider.hal.drivers.maestro:build"}}
ROLES: dict[str, tuple[Role, ...]] = {
    "beacon": ("pressure",), "slider_wire": ("analog", "encoder"), "plunger_wire": ("analog", "encoder"),
    "leak": ("analog",), "battery": ("analog",), "slider": ("drive",), "ballast": ("drive",),
}  # fmt: skip


def devices_of(file: DeviceFile) -> dict[str, DeviceTable]:
    """The tables of the devices that are fitted, by their place on the board."""
    return {name: table for name in SLOTS if (table := getattr(file, name)) is not None}


def known_devices(place: str) -> list[str]:
    """Names of the devices that may stand in a place of the board."""
    maps = [name for name in presets() if preset(name).role in ROLES.get(place, ())]
    return [*DRIVERS.get(place, ()), *maps]


def driver_builder(place: str, device: str) -> Callable[..., Any]:
    """The function that builds the driver of a device with a port of its own, from its table, its port's and the
    vehicle."""
    module, _, name = DRIVERS[place][device].partition(":")
    return getattr(import_module(module), name)


def preset_of(file: DeviceFile, name: str, source: str) -> RegisterMap:
    """The register map of a Modbus device; ConfigError where it is none or of another sort."""
    table = getattr(file, name)
    own = table.device.endswith(".toml")
    if not own and table.device not in presets():
        raise _unknown(source, name, table.device)
    found = preset(table.device)
    if found.role not in ROLES[name]:
        raise ConfigError(source, f"'{table.device}' is no {' or '.join(ROLES[name])}", key=f"{name}.device")
    return found


def _unknown(source: str, place: str, device: str) -> ConfigError:
    known = ", ".join(known_devices(place))
    return ConfigError(source, f"no device '{device}'; known: {known}", key=f"{place}.device")


def calibration_hash(file: DeviceFile) -> str:
    """16 hex digits over every device's table: addresses, scales, zeros, directions, limits; and over register maps of
    one's own, whose units and scales are calibration too."""
    tables = {name: msgspec.to_builtins(table) for name, table in devices_of(file).items()}
    for name, table in devices_of(file).items():
        if table.device.endswith(".toml"):
            tables[name]["map"] = msgspec.to_builtins(preset(table.device))
    text = json.dumps(tables, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def check(file: DeviceFile, source: str) -> None:
    """What no single table can see: ports that are not there, shared by what cannot share, addresses used twice."""
    users: dict[str, list[str]] = {}
    for name, table in devices_of(file).items():
        if table.port not in file.port:
            raise ConfigError(source, f"no [port.{table.port}]", key=f"{name}.port")
        if name in DRIVERS and table.device not in DRIVERS[name]:
            raise _unknown(source, name, table.device)
        users.setdefault(table.port, []).append(name)
    for port, names in users.items():
        alone = [name for name in names if name in DRIVERS]
        others = [name for name in names if name != alone[0]] if alone else []
        if others:
            raise ConfigError(source, f"shares port '{port}' with {', '.join(others)}", key=f"{alone[0]}.port")
    for name in file.port:
        if name not in users:
            raise ConfigError(source, "no device is on it", key=f"port.{name}")
    paths = [line.path for line in file.port.values()]
    for name, line in file.port.items():
        if paths.count(line.path) > 1:
            raise ConfigError(source, f"{line.path} is another port's path too", key=f"port.{name}.path")
    _check_registers(file, source)


def _check_registers(file: DeviceFile, source: str) -> None:
    """Devices with registers: channels and numbers that they have, and addresses of their own."""
    taken: dict[tuple, tuple[str, str]] = {}
    for name in ROLES:
        table = getattr(file, name)
        if table is None:
            continue
        channel, registers = getattr(table, "channel", None), preset_of(file, name, source)
        if registers.role == "analog":
            _check_channel(registers, channel, name, source)
        elif registers.role == "drive":
            _check_drive(registers, table, name, source)
        for place in {(table.port, table.id, channel), (table.port, table.id, None)}:
            other, device = taken.setdefault(place, (name, table.device))
            if other != name and (place[2] == channel or device != table.device):
                raise ConfigError(source, f"is {other}'s on port '{table.port}' too", key=f"{name}.id")


def _check_channel(registers: RegisterMap, channel: int | None, name: str, source: str) -> None:
    if channel is None:
        raise ConfigError(source, "missing key", key=f"{name}.channel")
    if channel_of(registers, channel).places.stop > registers.block["all"].count:
        raise ConfigError(source, f"'{registers.name}' has no channel {channel}", key=f"{name}.channel")


def _check_drive(registers: RegisterMap, table: DriveTable, name: str, source: str) -> None:
    """Refuse numbers that the registers of a drive could not hold: they would be written as others."""
    ends = [table.zero_counts + table.counts_per_m * end for end in table.limits_m]
    path, position = registers.block["path"].value, registers.block["position"].value["position"]
    for key, value, numbers, unit in (
        ("limits_m", path["position"], ends, "counts"), ("limits_m", position, ends, "counts"),
        ("speed_m_s", path["speed"], [table.rpm], "rpm"), ("ramp_ms", path["acceleration"], [table.ramp_ms], "ms"),
        ("ramp_ms", path["deceleration"], [table.ramp_ms], "ms"),
    ):  # fmt: skip
        for number in numbers:
            if not fits(value, number):
                text = f"{number:.10g} {unit} do not fit the {value.type} of '{registers.name}'"
                raise ConfigError(source, text, key=f"{name}.{key}")


def decode_device_file(text: str, source: str) -> DeviceFile:
    """A board file's text, checked; raises ConfigError with file, line and key."""
    file = decode(text, DeviceFile, source)
    check(file, source)
    return file
