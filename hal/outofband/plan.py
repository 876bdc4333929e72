"""What the out-of-band process knows of the vehicle: a small file written at arming, under a check sum.

Addresses and numbers alone, no code: how each is put on the wire is written in wire.py a second time. Standard library
alone.
"""

import json
import os
import struct
import zlib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

NAME = "outofband.json"
FORMAT = 2
BEAT_LIMIT_S = 1.5  # a heartbeat older than this is gone; with what looking takes, noticed within 2 s
LONGEST = 20_000  # bytes of a file
CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}  # of struct
WORDS = {kind: struct.calcsize(code) // 2 for kind, code in CODES.items()}


class PlanError(ValueError):
    """A plan that cannot be used; str() says what and where."""


@dataclass(frozen=True)
class WirePlan:
    """A draw-wire: metres = (reading - zero) / per_m; `words` registers, high first, from `address`."""

    port: str
    baud: int
    id: int
    function: int
    address: int
    words: int
    zero: float
    per_m: float
    low_m: float  # readings outside are rejected
    high_m: float


@dataclass(frozen=True)
class AxisPlan:
    """A drive and where to send it. Addresses are those of its registers."""

    name: str
    port: str
    baud: int
    id: int
    status: int
    position: int
    path: int
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
    function: int
    address: int
    words: int  # read together
    at: int  # where the pressure begins among them
    kind: str  # u16, i16, u32, i32 or f32, high word first
    pa_per_step: float
    zero_pa: float
    surface_pa: float  # absolute, where depth is zero
    pa_per_m: float
    low_pa: float  # readings outside are rejected
    high_pa: float
    surface_m: float  # at the surface above this depth
    step_m: float  # less than this within patience_s is no rise
    patience_s: float


@dataclass(frozen=True)
class Plan:
    """`axes` in the order in which they are served: the pump first."""

    flight: str
    axes: tuple[AxisPlan, ...]
    servo: ServoPlan | None
    pressure: PressurePlan | None = None
    beat_limit_s: float = BEAT_LIMIT_S
    give_up_s: float = 0.0  # ports gone for so long end the process; 0: never
    watchdog: str = ""  # the hardware watchdog's device; empty: none


def write_plan(path: Path, plan: Plan) -> None:
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


def read_plan(path: Path) -> Plan:
    """A plan as it was written; PlanError for anything else."""
    try:
        with path.open("rb") as file:
            data = file.read(LONGEST + 1)
    except OSError as error:
        raise PlanError(f"{path}: {error.strerror}") from None
    try:
        if len(data) > LONGEST:
            raise ValueError("too long")
        outer = json.loads(data)
        body = outer["plan"]
        if outer["format"] != FORMAT or outer["crc32"] != f"{zlib.crc32(body.encode()):08x}":
            raise ValueError("its check sum fails")
        return _plan(json.loads(body))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise PlanError(f"{path}: {error}") from None


def _plan(table: dict[str, Any]) -> Plan:
    axes = tuple(_made(AxisPlan, {**axis, "wire": _optional(WirePlan, axis["wire"])}) for axis in table["axes"])
    servo, pressure = _optional(ServoPlan, table["servo"]), _optional(PressurePlan, table["pressure"])
    plan = _made(Plan, {**table, "axes": axes, "servo": servo, "pressure": pressure})
    if not axes:
        raise ValueError("no pump")
    if pressure is not None:
        _check_pressure(pressure)
    for axis in axes:
        if axis.counts_per_m == 0.0 or (axis.wire is not None and axis.wire.per_m == 0.0):
            raise ValueError(f"{axis.name}: a scale of 0")
    return plan


def _check_pressure(pressure: PressurePlan) -> None:
    if pressure.kind not in CODES or not 0 <= pressure.at <= pressure.words - WORDS[pressure.kind]:
        raise ValueError("PressurePlan: no such number in its registers")
    if not (pressure.pa_per_m > 0.0 and pressure.patience_s > 0.0):
        raise ValueError("PressurePlan: pa_per_m and patience_s have to be positive")


_KINDS: dict[Any, tuple[type, ...]] = {
    str: (str,), int: (int,), float: (int, float), bool: (bool,), int | None: (int, type(None)),
}  # fmt: skip


def _made(kind: Any, table: dict[str, Any]) -> Any:
    """A dataclass from exactly its keys, each of its type; numbers finite."""
    names = {field.name: field.type for field in fields(kind)}
    if set(table) != set(names):
        raise ValueError(f"{kind.__name__}: unknown or missing keys {sorted(set(table) ^ set(names))}")
    for name, wanted in names.items():
        value = table[name]
        if wanted in _KINDS:
            if not isinstance(value, _KINDS[wanted]) or (isinstance(value, bool) and wanted is not bool):
                raise ValueError(f"{kind.__name__}: {name}: {value!r}")
            if isinstance(value, float) and not abs(value) < 1e12:
                raise ValueError(f"{kind.__name__}: {name}: {value!r}")
    return kind(**table)


def _optional(kind: Any, table: dict[str, Any] | None) -> Any:
    return None if table is None else _made(kind, table)
