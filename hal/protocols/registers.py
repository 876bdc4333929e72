"""Register maps as data: which registers of a device hold what, as which type; and numbers to registers and back.

A map is a file of hal/presets. Floats and 32-bit integers stand high word first.
"""

import struct
from functools import lru_cache
from importlib.resources import files
from typing import Annotated, Literal

import msgspec

from hal.protocols import modbus
from hal.strict import ConfigError, Table, decode

Address = Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)]
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}
Kind = Literal["u16", "i16", "u32", "i32", "f32"]


class Value(Table):
    """A number in a block: its first register counted from the block's, its type, `scale` to `unit`."""

    at: Annotated[int, msgspec.Meta(ge=0, le=124)]
    type: Kind
    unit: str = "1"
    scale: float = 1.0


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


class Line(Table):
    """How the device talks: speed, and the longest it takes to begin its reply."""

    baud: Annotated[int, msgspec.Meta(ge=1200, le=1_000_000)]
    turnaround_s: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]


class RegisterMap(Table):
    """A preset: what is known of a device on a Modbus line."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: str
    role: Literal["pressure", "analog", "encoder", "drive"]
    line: Line
    block: dict[str, Block]
    command: dict[str, Address] = msgspec.field(default_factory=dict)
    word: dict[str, Address] = msgspec.field(default_factory=dict)
    description: str = ""

    def read(self, device: int, block: str) -> modbus.Request:
        """The request for a whole block."""
        item = self.block[block]
        return modbus.read(device, item.function, item.address, item.count)


def to_registers(kind: str, number: float) -> list[int]:
    """A number as its registers; integers are rounded, and held within their type."""
    code = CODES[kind]
    if kind == "f32":
        data = struct.pack(">f", number)
    else:
        bits = 8 * struct.calcsize(code)
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if code.islower() else (0, (1 << bits) - 1)
        data = struct.pack(">" + code, min(max(round(number), low), high))
    return list(struct.unpack(f">{len(data) // 2}H", data))


def from_registers(kind: str, registers: list[int], at: int = 0) -> float:
    """The number that begins at register `at`."""
    code = CODES[kind]
    words = struct.calcsize(code) // 2
    return struct.unpack(">" + code, struct.pack(f">{words}H", *registers[at : at + words]))[0]


def value_of(block: Block, name: str, registers: list[int]) -> float:
    """A named value of a block that was read, in its unit."""
    value = block.value[name]
    return from_registers(value.type, registers, value.at) * value.scale


@lru_cache(maxsize=32)
def preset(name: str) -> RegisterMap:
    """A shipped register map; ConfigError for a name that is none."""
    found = files("hal").joinpath("presets", f"{name}.toml")
    if not name.replace("-", "").isalnum() or not found.is_file():
        raise ConfigError("preset", f"no device '{name}'; known: {', '.join(presets())}")
    return decode(found.read_text(encoding="utf-8"), RegisterMap, f"{name} (preset)")


def presets() -> list[str]:
    """Names of the shipped register maps."""
    entries = files("hal").joinpath("presets").iterdir()
    return sorted(entry.name.removesuffix(".toml") for entry in entries if entry.name.endswith(".toml"))
