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

from hal.protocols import modbus
from hal.strict import ConfigError, Table, decode
from hal.units import UNITS, units_of

Address = Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)]
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}
Kind = Literal["u16", "i16", "u32", "i32", "f32"]
Role = Literal["pressure", "analog", "encoder", "drive"]
RAMP = "ms per 1000 rpm"
# What the driver of a role reads and writes, by block and name, and the units that it may stand in: those of a kind are
# turned into SI; others are what the driver itself works in.
NEEDED: dict[Role, dict[str, dict[str, list[str]]]] = {
    "pressure": {"all": {"pressure": units_of("pressure")}},
    "analog": {"all": {}},
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


class Value(Table):
    """A number in a block: its first register counted from the block's, its type; `scale` of `unit` a step."""

    at: Annotated[int, msgspec.Meta(ge=0, le=124)]
    type: Kind
    unit: str = "1"
    scale: Annotated[float, msgspec.Meta(gt=0.0)] = 1.0


class Block(Table):
    """Registers in a row that are read together."""

    address: Address
    count: Annotated[int, msgspec.Meta(ge=1, le=125)]
    function: Literal[3, 4] = 3
    value: dict[str, Value] = msgspec.field(default_factory=dict)

    def __post_init__(self):
        for name, value in self.value.items():
            if value.at + struct.calcsize(CODES[value.type]) // 2 > self.count:
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
                allowed = NEEDED[self.role].get(block, {}).get(name) or ALLOWED.get(name) or [*UNITS, "1"]
                if value.unit not in allowed:
                    expected = ", ".join(allowed)
                    raise ValueError(f"block.{block}.value.{name}.unit: expected {expected}, got {value.unit!r}")

    def read(self, device: int, block: str) -> modbus.Request:
        """The request for a whole block."""
        item = self.block[block]
        return modbus.read(device, item.function, item.address, item.count)


def to_registers(kind: str, number: float) -> list[int]:
    """A number as its registers; integers are rounded, and held within their type (NaN as its largest)."""
    code = CODES[kind]
    if kind == "f32":
        data = struct.pack(">f", number)
    else:
        bits = 8 * struct.calcsize(code)
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if code.islower() else (0, (1 << bits) - 1)
        data = struct.pack(">" + code, high if math.isnan(number) else round(min(max(number, low), high)))
    return list(struct.unpack(f">{len(data) // 2}H", data))


def from_registers(kind: str, registers: list[int], at: int = 0) -> float:
    """The number that begins at register `at`."""
    code = CODES[kind]
    words = struct.calcsize(code) // 2
    return struct.unpack(">" + code, struct.pack(f">{words}H", *registers[at : at + words]))[0]


def step_of(value: Value) -> float:
    """What a step of a register's number is worth, SI (deg C for temperatures)."""
    return value.scale * (UNITS[value.unit].factor if value.unit in UNITS else 1.0)


def value_of(block: Block, name: str, registers: list[int]) -> float:
    """A named value of a block that was read, in SI (deg C for temperatures)."""
    value = block.value[name]
    return from_registers(value.type, registers, value.at) * step_of(value)


def registers_of(block: Block, name: str, number: float) -> dict[int, int]:
    """The registers that hold a named value, in SI, by address: the inverse of `value_of`."""
    value = block.value[name]
    words = to_registers(value.type, number / step_of(value))
    return {block.address + value.at + i: word for i, word in enumerate(words)}


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
    found = files("hal").joinpath("presets", f"{name}.toml")
    if not name.replace("-", "").isalnum() or not found.is_file():
        raise ConfigError("preset", f"no device '{name}'; known: {', '.join(presets())}")
    return decode(found.read_text(encoding="utf-8"), RegisterMap, f"{name} (preset)")


def presets() -> list[str]:
    """Names of the shipped register maps."""
    entries = files("hal").joinpath("presets").iterdir()
    return sorted(entry.name.removesuffix(".toml") for entry in entries if entry.name.endswith(".toml"))
