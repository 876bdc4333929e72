"""What the out-of-band process knows of the vehicle: a small file written at arming, under a check sum.

Addresses and numbers alone, no code: how each is put on the wire is written in wire.py a second time. Standard library
alone.
"""

import json
import os
import struct
import zlib
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

NAME = "outofband.json"
FORMAT = 3
BEAT_LIMIT_S = 1.5  # a heartbeat older than this is gone; with what looking takes, noticed within 2 s
MAX_PLAN_BYTES = 20_000  # bytes of a file
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}  # of struct
WORDS = {kind: struct.calcsize(code) // 2 for kind, code in CODES.items()}
INTEGERS = ("u16", "i16", "u32", "i32")


class PlanError(ValueError):
    """A plan that cannot be used; str() says what and where."""


@dataclass(frozen=True)
class NumberPlan:
    """A number among registers that are read or written together."""

    at: int  # its first register, counted from the first of them
    kind: str  # u16, i16, u32, i32 or f32, high word first
    step: float  # what 1 of it is worth

    def __post_init__(self) -> None:
        if self.kind not in CODES or self.at < 0 or not self.step > 0.0:
            raise ValueError(f"NumberPlan: no such number: {self}")

    @property
    def places(self) -> range:
        """Its registers."""
        return range(self.at, self.at + WORDS[self.kind])


def _check_span(name: str, address: int, words: int) -> None:
    if not (0 <= address <= 0xFFFF and 1 <= words <= 125):
        raise ValueError(f"{name}: {words} registers from {address}")


@dataclass(frozen=True)
class ReadPlan:
    """A number to read: `words` registers from `address`, and where it stands among them."""

    function: int
    address: int
    words: int
    number: NumberPlan

    def __post_init__(self) -> None:
        _check_span("ReadPlan", self.address, self.words)
        if self.number.places.stop > self.words:
            raise ValueError("ReadPlan: the number reaches past its registers")


@dataclass(frozen=True)
class PathPlan:
    """A drive's path to write: `words` registers from `address`, each of which belongs to one of the numbers."""

    address: int
    words: int
    mode: NumberPlan
    position: NumberPlan
    speed: NumberPlan
    acceleration: NumberPlan
    deceleration: NumberPlan
    pause: NumberPlan
    trigger: NumberPlan

    def __post_init__(self) -> None:
        _check_span("PathPlan", self.address, self.words)
        numbers = [item for item in vars(self).values() if isinstance(item, NumberPlan)]
        if sorted(place for number in numbers for place in number.places) != [*range(self.words)]:
            raise ValueError("PathPlan: its numbers do not fill its registers")


@dataclass(frozen=True)
class WirePlan:
    """A draw-wire: metres = (reading - zero) / per_m."""

    port: str
    baud: int
    id: int
    reading: ReadPlan
    zero: float
    per_m: float
    low_m: float  # readings outside are rejected
    high_m: float


@dataclass(frozen=True)
class AxisPlan:
    """A drive and where to send it. `auxiliary` is the register that `clear_alarm` is written to."""

    name: str
    port: str
    baud: int
    id: int
    status: ReadPlan
    position: ReadPlan
    path: PathPlan
    auxiliary: int
    absolute: int
    trigger: int
    clear_alarm: int
    zero_counts: float
    counts_per_m: float
    end_m: float
    last_m: float  # beyond it, where the vehicle does not rise: as far as the drive may go at all
    tolerance_m: float
    rpm: int
    ramp_ms: int
    wire: WirePlan | None  # whose reading says where the count begins; None: the drive's own count is trusted

    def __post_init__(self) -> None:
        if not {self.status.number.kind, self.position.number.kind} <= set(INTEGERS):
            raise ValueError(f"{self.name}: status and position have to be integers")
        if self.counts_per_m == 0.0 or (self.wire is not None and self.wire.per_m == 0.0):
            raise ValueError(f"{self.name}: a scale of 0")


@dataclass(frozen=True)
class ServoPlan:
    """The servo's middle."""

    port: str
    baud: int
    channel: int
    number: int | None
    crc: bool
    quarter_us: int


@dataclass(frozen=True)
class PressurePlan:
    """The pressure transmitter, and when a vehicle counts as rising; depth = (pressure - zero - surface) / pa_per_m."""

    port: str
    baud: int
    id: int
    reading: ReadPlan  # Pa
    zero_pa: float
    surface_pa: float  # absolute, where depth is zero
    pa_per_m: float
    low_pa: float  # readings outside are rejected
    high_pa: float
    surface_m: float  # at the surface above this depth
    step_m: float  # less than this within patience_s is no rise
    patience_s: float

    def __post_init__(self) -> None:
        if not (self.pa_per_m > 0.0 and self.patience_s > 0.0):
            raise ValueError("PressurePlan: pa_per_m and patience_s have to be positive")


@dataclass(frozen=True)
class AscentPlan:
    """`axes` in the order in which they are served: the pump first."""

    flight: str
    axes: tuple[AxisPlan, ...]
    servo: ServoPlan | None
    pressure: PressurePlan | None = None
    beat_limit_s: float = BEAT_LIMIT_S
    give_up_s: float = 0.0  # ports gone for so long end the process; 0: never
    watchdog: str = ""  # the hardware watchdog's device; empty: none


def write_plan(path: Path, plan: AscentPlan) -> None:
    """Onto the disk, whole or not at all."""
    body = json.dumps(asdict(plan), separators=(",", ":"), sort_keys=True)
    text = json.dumps({"format": FORMAT, "crc32": f"{zlib.crc32(body.encode()):08x}", "plan": body}) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(path.name + ".new")
    with fresh.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(fresh, path)


def read_plan(path: Path) -> AscentPlan:
    """A plan as it was written; PlanError for anything else."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_PLAN_BYTES + 1)
    except OSError as error:
        raise PlanError(f"{path}: {error.strerror}") from None
    try:
        if len(data) > MAX_PLAN_BYTES:
            raise ValueError("too long")
        outer = json.loads(data)
        body = outer["plan"]
        if outer["format"] != FORMAT:
            raise ValueError(f"format {outer['format']!r}, expected {FORMAT}: written by another release")
        if outer["crc32"] != f"{zlib.crc32(body.encode()):08x}":
            raise ValueError("its check sum fails")
        return _plan(json.loads(body))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise PlanError(f"{path}: {error}") from None


def _plan(table: dict[str, Any]) -> AscentPlan:
    plan: AscentPlan = _decode(AscentPlan, table)
    if not plan.axes:
        raise ValueError("no pump")
    return plan


_KINDS: dict[Any, tuple[type, ...]] = {
    str: (str,), int: (int,), float: (int, float), bool: (bool,), int | None: (int, type(None)),
}  # fmt: skip


def _decode(kind: Any, table: dict[str, Any]) -> Any:
    """A dataclass from exactly its keys, each of its type, dataclasses in it likewise; numbers finite."""
    names = {field.name: field.type for field in fields(kind)}
    if set(table) != set(names):
        raise ValueError(f"{kind.__name__}: unknown or missing keys {sorted(set(table) ^ set(names))}")
    return kind(**{name: _value(wanted, table[name], f"{kind.__name__}: {name}") for name, wanted in names.items()})


def _value(wanted: Any, value: Any, place: str) -> Any:
    options = get_args(wanted) or (wanted,)
    inner = next((option for option in options if is_dataclass(option)), None)
    if get_origin(wanted) is tuple:
        return tuple(_decode(inner, item) for item in value)
    if inner is not None and not (value is None and NoneType in options):
        return _decode(inner, value)
    if wanted in _KINDS:
        if not isinstance(value, _KINDS[wanted]) or (isinstance(value, bool) and wanted is not bool):
            raise ValueError(f"{place}: {value!r}")
        if isinstance(value, float) and not abs(value) < 1e12:
            raise ValueError(f"{place}: {value!r}")
    return value
