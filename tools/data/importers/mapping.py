"""The mapping file of `glider import csv`: which column of a foreign log becomes which column of run data, and how.

    value = sign * scale * (logged - zero), in `unit`, turned into SI, + offset

docs/how-to/import.md explains every key with an example.
"""

import json
import os
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, TypeVar

import msgspec
import numpy as np

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.model.library import shipped
from glider.hal.strict import ConfigError, Table, decode, locate
from glider.hal.units import UNITS, units_of
from glider.tools.data.errors import InputError
from glider.tools.data.importers.commands import CommandTable
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.csvfile import Dialect, write_bytes
from glider.tools.data.sources import name_or_path, read_text

# 'counts' is for values that `scale` alone turns into the target's SI unit.
COLUMN_UNITS = units_of(
    "length", "angle", "rate", "mass", "volume", "pressure", "speed", "acceleration", "frequency", "force", "share",
    "counts",
)  # fmt: skip
TIME_TEXTS = ("iso8601", "clock")  # dates and times; times of day
TIME_UNITS = {name: UNITS[name].factor for name in units_of("time")}
_KINDS = (("_rad_s", "rate"), ("_rad", "angle"), ("_kg", "mass"), ("_m", "length"), (names.OIL, "volume"))

Factor = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]


@dataclass(frozen=True)
class Target:
    """The columns that a log is brought into: those of run data, or those that a user's model declares."""

    columns: tuple[str, ...] = names.ALL  # in the order in which they are written
    held: frozenset[str] = frozenset(names.COMMANDS)  # stay until they are given again
    angles: frozenset[str] = names.WRAPPING
    vehicle: Path | None = None  # file of a user's model
    units: Mapping[str, str] = field(default_factory=dict)  # of its columns, as it declares them


RUN_DATA = Target()


class ConversionTable(Table):
    """How logged numbers become those of a column."""

    unit: str = "counts"
    scale: Factor = 1.0  # units a step of the logged number
    zero: Factor = 0.0  # the logged number that means nothing
    sign: Literal[1, -1] = 1
    offset: Factor = 0.0  # added at the end, SI
    valid: tuple[Factor, Factor] | None = None  # SI; what is outside becomes missing
    decimals: Annotated[int, msgspec.Meta(ge=0, le=17)] | None = None  # of the written file; exact without

    def __post_init__(self):
        if self.unit not in COLUMN_UNITS:
            raise ValueError(f"unit: expected one of {', '.join(COLUMN_UNITS)}, got {self.unit!r}")
        if self.scale == 0.0:
            raise ValueError("scale: expected anything but 0")
        if self.valid is not None and not self.valid[0] < self.valid[1]:
            raise ValueError(f"valid: expected [low, high] with low < high, got {list(self.valid)}")

    def needs_density(self, name: str) -> bool:
        """Whether the water's density turns this into the column of a name."""
        kind = UNITS[self.unit].kind
        return kind == "pressure" or (kind == "volume" and name.endswith("_kg"))

    def factor(self, density: float | None, mass: bool = False) -> float:
        """From logged steps to SI; a pressure becomes a depth of water of this density, kg/m3, a volume its `mass`."""
        kind, factor = UNITS[self.unit]
        density = np.nan if density is None else density  # is there where it is needed (`check_common`)
        if kind == "volume" and mass:
            factor *= density
        if kind == "pressure":
            factor /= density * GRAVITY
        return self.sign * self.scale * factor

    def converted(self, logged: np.ndarray, density: float | None, mass: bool = False) -> np.ndarray:
        """Logged numbers in SI; what is outside `valid` is missing."""
        values = self.factor(density, mass) * (logged - self.zero) + self.offset
        if self.valid is not None:
            values[(values < self.valid[0]) | (values > self.valid[1])] = np.nan
        return values


class ColumnTable(ConversionTable, kw_only=True):
    """[columns.NAME] or [extra.NAME]: where a column comes from."""

    source: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    words: dict[str, Factor] = msgspec.field(default_factory=dict)  # what is logged, and the number it stands for


class TimeTable(Table):
    """[time]: the log's clock."""

    column: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    unit: str = "s"  # one of TIME_UNITS, or of TIME_TEXTS
    not_increasing: Literal["refuse", "drop"] = "refuse"

    def __post_init__(self):
        if self.unit not in (*TIME_UNITS, *TIME_TEXTS):
            raise ValueError(f"unit: expected one of {', '.join((*TIME_UNITS, *TIME_TEXTS))}, got {self.unit!r}")


class CutTable(Table):
    """[[cut]]: the part of a file to take, s from its first row; `file` is its name, * for anything."""

    file: Annotated[str, msgspec.Meta(min_length=1, max_length=200)] = "*"
    start_s: Annotated[float, msgspec.Meta(ge=0.0)] = 0.0
    end_s: Annotated[float, msgspec.Meta(gt=0.0)] | None = None

    def __post_init__(self):
        if self.end_s is not None and self.end_s <= self.start_s:
            raise ValueError(f"end_s: expected more than start_s = {self.start_s}, got {self.end_s}")


class MapTable(Table):
    """A mapping file."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    vehicle: Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
    time: TimeTable
    columns: Annotated[dict[str, ColumnTable], msgspec.Meta(min_length=1)]
    # of a user's model only where a pressure or a volume is turned into a depth or a mass
    water_density_kg_m3: Annotated[float, msgspec.Meta(ge=900.0, le=1300.0)] | None = None
    site: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    extra: dict[str, ColumnTable] = msgspec.field(default_factory=dict)
    # Means at this rate; without it, row by row.
    rate_hz: Annotated[float, msgspec.Meta(gt=0.0, le=10_000.0)] | None = None
    max_gap_s: Annotated[float, msgspec.Meta(ge=0.0)] = 0.0  # longer holes are missing, shorter ones interpolated
    rates_from_attitude: bool = False  # p, q, r that are not mapped, out of roll, pitch and yaw
    cut: tuple[CutTable, ...] = ()
    text: Dialect = Dialect()
    commands: dict[str, CommandTable] = msgspec.field(default_factory=dict)


_BY_NAME = {"columns": ColumnTable, "extra": ColumnTable, "commands": CommandTable}
M = TypeVar("M", bound=Table)


def check_columns(columns: Mapping[str, ConversionTable], source: str, target: Target = RUN_DATA) -> None:
    """ConfigError where a column is none of the target's, or its unit measures something else."""
    for name, column in columns.items():
        if name not in target.columns or name == names.TIME:
            known = ", ".join(sorted({*target.columns} - {names.TIME}))
            whose = "run data" if target.vehicle is None else target.vehicle.name
            raise ConfigError(
                source, f"no column of {whose} (put it in [extra], or use {known})", key=f"columns.{name}"
            )
        wanted = next((kind for ending, kind in _KINDS if name.endswith(ending)), "counts")
        if name in target.units:
            wanted = UNITS[target.units[name]].kind if target.units[name] in UNITS else "counts"
        kind = UNITS[column.unit].kind
        also = {"length": "pressure" if name == names.DEPTH else wanted, "mass": "volume"}.get(wanted, wanted)
        if kind not in (wanted, also, "counts"):
            what = wanted if wanted != "counts" else f"what is declared in {target.units.get(name, 'counts')}"
            raise ConfigError(source, f"{column.unit!r} is no unit of {what}", key=f"columns.{name}.unit")


class AnyMap(Protocol):
    """What mappings of all kinds have."""

    @property
    def vehicle(self) -> str: ...
    @property
    def water_density_kg_m3(self) -> float | None: ...
    @property
    def columns(self) -> Mapping[str, ConversionTable]: ...
    @property
    def extra(self) -> Mapping[str, ConversionTable]: ...
    @property
    def rates_from_attitude(self) -> bool: ...


def check_common(mapping: AnyMap, source: str, target: Target) -> None:
    """ConfigError where the water's density or the attitude is needed and missing, or a name is taken."""
    if mapping.water_density_kg_m3 is None:
        by = [name for name, one in {**mapping.columns, **mapping.extra}.items() if one.needs_density(name)]
        if by or target.vehicle is None:
            why = f", which {by[0]} needs" if by else ""
            raise ConfigError(source, f"missing key{why}", key="water_density_kg_m3")
    for name in mapping.extra:
        if name in target.columns or not name.strip():
            raise ConfigError(source, "the name is taken by a column of run data", key=f"extra.{name}")
    if mapping.rates_from_attitude and not all(name in mapping.columns for name in names.ATTITUDE):
        raise ConfigError(source, f"needs {', '.join(names.ATTITUDE)}", key="rates_from_attitude")


def vehicle_of(mapping: AnyMap, base: Path, out: Path, target: Target) -> tuple[str, str | None]:
    """How the case in the folder `out` names its vehicle, and the text of a file that is copied beside it; `base`: the
    mapping's folder."""
    if target.vehicle is not None:
        return os.path.relpath(target.vehicle.resolve(), out.resolve()), None
    if mapping.vehicle in shipped("model/vehicles"):
        return mapping.vehicle, None
    return mapping.vehicle, name_or_path(mapping.vehicle, "vehicle", "model/vehicles", base=base)[0]


def _check(mapping: MapTable, source: str, target: Target) -> None:
    """What no single table can see; ConfigError."""
    check_columns(mapping.columns, source, target)
    check_common(mapping, source, target)
    for name, command in mapping.commands.items():
        if name not in names.COMMANDS or name in mapping.columns:
            raise ConfigError(
                source, f"expected one of {', '.join(names.COMMANDS)} that [columns] has not", key=f"commands.{name}"
            )
        if command.follows not in mapping.columns:
            raise ConfigError(source, f"[columns] has no {command.follows!r}", key=f"commands.{name}.follows")
    if mapping.max_gap_s and mapping.rate_hz is None:
        raise ConfigError(source, "needs rate_hz: a log taken row by row has no gaps to fill", key="max_gap_s")


def decode_map(text: str, source: str, target: Target = RUN_DATA) -> MapTable:
    """A mapping file's text; raises ConfigError with file, line and key."""
    return decode_checked(text, source, MapTable, partial(_check, target=target), _BY_NAME)


def decode_checked(
    text: str, source: str, kind: type[M], check: Callable[[M, str], None], by_name: Mapping[str, Any]
) -> M:
    """Decode a mapping of some kind and check it.

    by_name: what stands in its groups of tables by name. ConfigError with file, line and key.
    """
    try:
        mapping = decode(text, kind, source)
    except ConfigError as error:
        raise _at_key(_with_column(error, text, source, by_name), text) from None
    try:
        check(mapping, source)
    except ConfigError as error:
        raise ConfigError(source, error.message, key=error.key, line=locate(text, [*error.key.split(".")])) from None
    return mapping


def _at_key(error: ConfigError, text: str) -> ConfigError:
    """An error that a table says of one of its keys, at that key."""
    key, colon, message = error.message.partition(": ")
    if not colon or not key.isidentifier():
        return error
    path: list[str | int] = [*error.key.split("."), key]
    return ConfigError(error.source, message, key=f"{error.key}.{key}", line=locate(text, path))


def _with_column(error: ConfigError, text: str, source: str, by_name: Mapping[str, Any]) -> ConfigError:
    """An error inside a group of tables by name with the table's name, which the decoder leaves out."""
    group, *rest = error.key.split(".")
    tables = tomllib.loads(text).get(group) if group in by_name else None
    if not isinstance(tables, dict):
        return error
    for name, table in tables.items():
        try:
            msgspec.convert(table, by_name[group], strict=True)
        except msgspec.ValidationError:
            path: list[str | int] = [group, name, *rest]
            return ConfigError(source, error.message, key=".".join(map(str, path)), line=locate(text, path))
    return error


def template(name: str, units: Mapping[str, str] | None = None, vehicle: str = "") -> str:
    """A shipped mapping with every key, commented, to be filled in.

    units: of the columns that the user's model in the file `vehicle` declares, instead of run data's.
    """
    text = files("glider.tools.data.importers").joinpath(name).read_text(encoding="utf-8")
    if units is None:
        return text
    head, _, rest = text.partition(f"[columns.{names.DEPTH}]\n")
    head = re.sub(r"(?m)^vehicle = .*\n( +#.*\n)?", f"vehicle = {json.dumps(vehicle)}\n", head)
    head = re.sub(r"(?m)^water_density", "# water_density", head)
    keys = rest.partition("\n\n")[0].splitlines()
    needed = [key for key in keys if key.startswith(("source", "topic", "field"))]
    optional = [key if key.startswith("#") else f"# {key}" for key in keys if key not in needed]
    tables = list[str]()
    for column, unit in units.items():
        lines = [re.sub(r'(source|topic) = "[^"]*"', rf'\1 = "{column}"', key) for key in needed]
        known = [f'# unit = "{unit}"'] if unit in COLUMN_UNITS else []
        if tables:
            lines, optional = [line.partition("  #")[0].rstrip() for line in lines], known
        elif known:
            optional = [re.sub(r'^# unit = "[^"]*"', known[0], key) for key in optional]
        tables.append("\n".join([f"[columns.{column}]", *lines, *optional]))
    return head + "\n\n".join([*tables, rest[rest.index("# [extra.") :]])


def write_template(path: Path, text: str) -> None:
    """Write a mapping to be filled in; InputError where the file is there already."""
    if path.exists():
        raise InputError("is there already: name another file", source=path)
    write_bytes(path, text.encode("utf-8"))


def load_map(wanted: str, target: Target = RUN_DATA) -> tuple[MapTable, Path]:
    """A mapping by shipped name or by path, and the folder that its vehicle file is looked for in."""
    return load_mapping(wanted, "maps", partial(decode_map, target=target))


def load_mapping(wanted: str, folder: str, decode_text: Callable[[str, str], M]) -> tuple[M, Path]:
    """The same of another kind of mapping, whose shipped ones stand in `folder`."""
    ours = {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in files("glider.tools.data.importers").joinpath(folder).iterdir()
        if entry.name.endswith(".toml")
    }
    if wanted in ours:
        return decode_text(ours[wanted], f"{wanted} (shipped)"), Path()
    path = Path(wanted)
    if path.is_file():
        return decode_text(read_text(path), str(path)), path.parent
    raise InputError(f"no mapping '{wanted}': neither a file nor one of {', '.join(sorted(ours))}")
