"""Register maps as data: which registers of a device hold what, as which type; and numbers to registers and back.

A map is a file of hal/presets, or anybody's own. Floats and 32-bit integers stand high word first.
"""

import math
import struct
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from glider.hal.protocols import modbus
from glider.hal.strict import ConfigError, Table, decode
from glider.hal.units import UNITS, units_of

Address = Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)]
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}
WORDS = {kind: struct.calcsize(code) // 2 for kind, code in CODES.items()}  # registers of a number
INTEGERS = [kind for kind in CODES if kind != "f32"]
Kind = Literal["u16", "i16", "u32", "i32", "f32"]
Role = Literal["pressure", "analog", "encoder", "drive"]
RAMP = "ms per 1000 rpm"
OWN_UNITS = ("1", "counts", "rpm", RAMP)  # what the drivers themselves work in: never turned into SI
# What the driver of a role reads and writes, by block and name, and the units that it may stand in.
NEEDED: dict[Role, dict[str, dict[str, list[str]]]] = {
    "pressure": {"all": {"pressure": units_of("pressure")}},
    "analog": {"all": {"channel": ["1"]}},
    "encoder": {"all": {"count": ["counts"]}, "low": {"count": ["counts"]}},
    "drive": {
        "status": {"status": ["1"]},
        "position": {"position": ["counts"]},
        "position_low": {"position": ["counts"]},
        "path": {
            "mode": ["1"], "position": ["counts"], "speed": ["rpm"], "acceleration": [RAMP], "deceleration": [RAMP],
            "pause": ["ms"], "trigger": ["1"],
        },
    },
}  # fmt: skip
ALLOWED = {"pressure": units_of("pressure"), "temperature": units_of("temperature")}  # wherever they stand
# Role -> the block that is read where a late reply to another could be mistaken, that other one, the number in both.
LOW = {"encoder": ("low", "all", "count"), "drive": ("position_low", "position", "position")}
# What the driver of a drive writes beside its path: registers, and what goes into them.
DRIVE_WORDS = ("control", "auxiliary")
DRIVE_COMMANDS = ("absolute", "trigger", "quick_stop", "clear_alarm")


class Value(Table):
    """A number in a block: its first register counted from the block's, its type; `scale` of `unit` a step."""

    at: Annotated[int, msgspec.Meta(ge=0, le=124)]
    type: Kind
    unit: str = "1"
    scale: Annotated[float, msgspec.Meta(gt=0.0)] = 1.0

    @property
    def places(self) -> range:
        """Its registers, counted from the block's first."""
        return range(self.at, self.at + WORDS[self.type])


class Block(Table):
    """Registers in a row that are read together."""

    address: Address
    count: Annotated[int, msgspec.Meta(ge=1, le=125)]
    function: Literal[3, 4] = 3
    value: dict[str, Value] = msgspec.field(default_factory=dict)

    def __post_init__(self):
        if self.address + self.count > 0x10000:
            raise ValueError(f"count: {self.count} registers from {self.address:#06x} reach past 0xffff")
        for name, value in self.value.items():
            if value.places.stop > self.count:
                raise ValueError(f"value.{name}: reaches past the block's {self.count} registers")


class RegisterMap(Table):
    """A preset: what is known of a device on a Modbus line."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: str
    role: Role
    block: dict[str, Block]
    command: dict[str, Address] = msgspec.field(default_factory=dict)
    word: dict[str, Address] = msgspec.field(default_factory=dict)
    description: str = ""

    def __post_init__(self):
        for block, values in NEEDED[self.role].items():
            if block not in self.block:
                raise ValueError(f"block.{block}: missing, a device of role '{self.role}' is read by it")
            for name in values:
                if name not in self.block[block].value:
                    raise ValueError(f"block.{block}.value.{name}: missing, role '{self.role}' needs it")
        for block, table in self.block.items():
            for name, value in table.value.items():
                allowed = NEEDED[self.role].get(block, {}).get(name) or ALLOWED.get(name) or list(UNITS)
                if value.unit not in allowed:
                    expected = ", ".join(allowed)
                    raise ValueError(f"block.{block}.value.{name}.unit: expected {expected}, got {value.unit!r}")
        if self.role == "pressure" and "pressure" in self.block and "pressure" not in self.block["pressure"].value:
            raise ValueError("block.pressure.value.pressure: missing, the block is read for it")
        if self.role in LOW:
            self._check_integers()
            self._check_low(*LOW[self.role])
        if self.role == "drive":
            self._check_commands()
            self._check_path()

    def _check_integers(self) -> None:
        """Refuse counts, bits and commands that are not whole numbers, and a status that is scaled."""
        for block, names in NEEDED[self.role].items():
            for name in names:
                value = self.block[block].value[name]
                if value.type not in INTEGERS:
                    raise ValueError(
                        f"block.{block}.value.{name}.type: expected {', '.join(INTEGERS)}, got {value.type}"
                    )
                if value.unit == "1" and value.scale != 1.0:
                    raise ValueError(f"block.{block}.value.{name}.scale: expected 1, got {value.scale:g}")

    def _check_low(self, low: str, whole: str, name: str) -> None:
        """The low block has to hold the number of the whole one, or its low word."""
        part, number = self.block[low].value[name], self.block[whole].value[name]
        expected = {number.type} if WORDS[number.type] == 1 else {number.type, "u16", "i16"}
        if part.type not in expected:
            raise ValueError(
                f"block.{low}.value.{name}.type: expected {', '.join(sorted(expected))}, because block.{whole} has "
                f"{number.type}, got {part.type}"
            )
        if part.scale != number.scale:
            raise ValueError(f"block.{low}.value.{name}.scale: expected {number.scale:g} as in block.{whole}")

    def _check_commands(self) -> None:
        for table, names in (("word", DRIVE_WORDS), ("command", DRIVE_COMMANDS)):
            for name in names:
                if name not in getattr(self, table):
                    raise ValueError(f"{table}.{name}: missing, role 'drive' needs it")
        for name, command in (("mode", "absolute"), ("trigger", "trigger")):
            value, number = self.block["path"].value[name], self.command[command]
            if not fits(value, number):
                raise ValueError(f"command.{command}: {number} does not fit {value.type} of block.path.value.{name}")

    def _check_path(self) -> None:
        """The path is written whole, so that each of its registers has to be of one known number."""
        path = self.block["path"]
        owners: dict[int, str] = {}
        for name, value in path.value.items():
            if name not in NEEDED["drive"]["path"]:
                known = ", ".join(NEEDED["drive"]["path"])
                raise ValueError(f"block.path.value.{name}: the driver has nothing to write there; it knows {known}")
            for place in value.places:
                other = owners.setdefault(place, name)
                if other != name:
                    raise ValueError(f"block.path.value.{name}.at: register {place} is {other}'s too")
        for place in range(path.count):
            if place not in owners:
                raise ValueError(
                    f"block.path.count: register {place} belongs to no value, and the path is written whole"
                )

    def read(self, device: int, block: str) -> modbus.Request:
        """The request for a whole block."""
        item = self.block[block]
        return modbus.read(device, item.function, item.address, item.count)


def bounds_of(kind: str) -> tuple[float, float]:
    """The smallest and the largest number of a type; infinite for f32."""
    if kind == "f32":
        return -math.inf, math.inf
    bits = 16 * WORDS[kind]
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if CODES[kind].islower() else (0, (1 << bits) - 1)


def to_registers(kind: str, number: float) -> list[int]:
    """A number as its registers; integers are rounded, and held within their type (NaN as its largest)."""
    if kind != "f32":
        low, high = bounds_of(kind)
        number = int(high) if math.isnan(number) else round(min(max(number, low), high))
    data = struct.pack(">" + CODES[kind], number)
    return list(struct.unpack(f">{len(data) // 2}H", data))


def from_registers(kind: str, registers: list[int], at: int = 0) -> float:
    """The number that begins at register `at`."""
    words = WORDS[kind]
    return struct.unpack(">" + CODES[kind], struct.pack(f">{words}H", *registers[at : at + words]))[0]


def step_of(value: Value) -> float:
    """What a step of a register's number is worth, SI (deg C for temperatures) or one of `OWN_UNITS`."""
    return value.scale * (1.0 if value.unit in OWN_UNITS else UNITS[value.unit].factor)


def value_of(block: Block, name: str, registers: list[int]) -> float:
    """A named value of a block that was read, in SI (deg C for temperatures)."""
    value = block.value[name]
    return from_registers(value.type, registers, value.at) * step_of(value)


def registers_of(block: Block, name: str, number: float) -> dict[int, int]:
    """The registers that hold a named value, in SI, by address: the inverse of `value_of`."""
    value = block.value[name]
    words = to_registers(value.type, number / step_of(value))
    return {block.address + value.at + i: word for i, word in enumerate(words)}


def channel_of(registers: RegisterMap, channel: int) -> Value:
    """Where a channel (from 1) of an analog module stands in block `all`: `channel` there is the first, the others
    follow it in a row. The value reaches past the block where the module has no such channel."""
    first = registers.block["all"].value["channel"]
    return msgspec.structs.replace(first, at=first.at + (channel - 1) * WORDS[first.type])


def fits(value: Value, number: float) -> bool:
    """True where a value's type can hold a number (SI), so that writing it does not change it."""
    low, high = bounds_of(value.type)
    return low <= number / step_of(value) <= high


def preset(name: str) -> RegisterMap:
    """A register map by shipped name, or by the path of a file of one's own (it ends in .toml); ConfigError."""
    if name.endswith(".toml"):
        try:
            return decode(Path(name).read_text(encoding="utf-8"), RegisterMap, name)
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(name, f"cannot be read: {error}") from None
    return _shipped(name)


@lru_cache(maxsize=32)
def _shipped(name: str) -> RegisterMap:
    found = files("glider.hal").joinpath("presets", f"{name}.toml")
    if not name.replace("-", "").isalnum() or not found.is_file():
        raise ConfigError("preset", f"no device '{name}'; known: {', '.join(presets())}")
    return decode(found.read_text(encoding="utf-8"), RegisterMap, f"{name} (preset)")


def presets() -> list[str]:
    """Names of the shipped register maps."""
    entries = files("glider.hal").joinpath("presets").iterdir()
    return sorted(entry.name.removesuffix(".toml") for entry in entries if entry.name.endswith(".toml"))
