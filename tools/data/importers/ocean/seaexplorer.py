"""SeaExplorer: navigation (gli) and payload (pld1) tables, `sub` or `raw`, as segments."""

import datetime as dt
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file
from glider.tools.data.importers.ocean import seawater
from glider.tools.data.importers.ocean.segment import (
    OUT_OF_WATER_DBAR,
    Segment,
    at_rows,
    clean,
    clock_offset,
    count,
    in_the_mission,
    require_same_time,
    usable_fixes,
)
from glider.tools.data.runs.csvfile import CsvTable, Dialect, read_table

HOLE_S = 65.0  # CTD values are interpolated over no longer holes: it gives one in 30 s
CLOCKS_S = 20.0  # one row: a smaller offset of the clocks cannot be distinguished from a sensor's own lag
DEG = np.pi / 180.0
NAME = re.compile(r"(?P<glider>\w+)\.(?P<mission>\d+)\.(?P<kind>gli|pld\d)\.(sub|raw)\.(?P<segment>\d+)(\.gz)?\Z")
DIALECT = Dialect(delimiter=";", missing=("NaN", "nan"))
# Run data, column of the navigation table (units by the maker: deg, m, cm3, mm), and the factor to SI.
NAVIGATION = (
    ("depth_m", "Depth", 1.0), ("pitch_rad", "Pitch", DEG), ("roll_rad", "Roll", DEG), ("yaw_rad", "Heading", DEG),
    ("oil_m3", "BallastPos", 1e-6), ("battery_m", "LinPos", 1e-3),
)  # fmt: skip
# CTDs of payloads: columns of conductivity, temperature and pressure, and the factor of conductivity to S/m.
CTDS = (("GPCTD", 1.0), ("LEGATO", 0.1))
QUANTITIES = ("CONDUCTIVITY", "TEMPERATURE", "PRESSURE")
LARGEST_CONDUCTIVITY = 9.0  # S/m; sea water has 2 to 7
FLIES_DEG = 90.0
TRANSMITTING = 116  # NavState: afloat, with GPS and radio


@dataclass
class _Water:
    """Samples of a payload's CTD: time, depth, density, temperature (samples,)."""

    t: np.ndarray
    depth: np.ndarray
    density: np.ndarray
    temperature: np.ndarray


def read_seaexplorer(paths: list[Path], advance: Callable[[int], None]) -> list[Segment]:
    """The segments of the files; InputError where one cannot be used or has no other half."""
    pairs = _pairs(paths)
    segments, waters = [], []
    for navigation, payload in pairs:
        segment = _navigated(navigation)
        segment.files.append(payload)
        segments.append(segment)
        waters.append(_water(payload, segment))
        advance(2)
    # The CTD's samples go on from one segment into the next.
    order = np.argsort([water.t[0] if len(water.t) else np.inf for water in waters], kind="stable")
    joined = [np.concatenate([getattr(waters[n], name) for n in order]) for name in ("t", "density", "temperature")]
    for segment in segments:
        t = segment.start + segment.columns["t_s"]
        for name, values in (("density_kg_m3", joined[1]), ("temperature_c", joined[2])):
            segment.columns[name] = at_rows(joined[0], values, t, HOLE_S)
    return segments


def _pairs(paths: list[Path]) -> list[tuple[Path, Path]]:
    """Navigation and payload file of each segment, in order; InputError where one has no other, or is there twice."""
    found: dict[str, dict[int, Path]] = {"gli": {}, "pld": {}}
    missions: dict[str, Path] = {}
    for path in paths:
        parts = NAME.fullmatch(path.name)
        if parts is None:
            raise InputError("not named as a SeaExplorer's file (sea001.2.gli.sub.3, sea001.2.pld1.sub.3)", source=path)
        missions.setdefault(f"{parts['glider']}.{parts['mission']}", path)
        of_kind, segment = found[parts["kind"][:3]], int(parts["segment"])
        if segment in of_kind:
            raise InputError(f"the same segment ({segment}) is in {of_kind[segment]} too", source=path)
        of_kind[segment] = path
    if len(missions) > 1:
        (one, _), (other, path) = list(missions.items())[:2]
        raise InputError(f"files of two gliders or missions in one call: {one} and {other}", source=path)
    for segment, path in found["pld"].items():
        if segment not in found["gli"]:
            raise InputError(f"a payload file without the navigation file (gli) of segment {segment}", source=path)
    for segment, path in found["gli"].items():
        if segment not in found["pld"]:
            raise InputError(f"a navigation file without the payload file (pld1) of segment {segment}", source=path)
    return [(found["gli"][segment], found["pld"][segment]) for segment in sorted(found["gli"])]


def _table(path: Path, columns: tuple[str, ...]) -> CsvTable:
    require_file(path)
    table = read_table(path, DIALECT)
    if not path.name.endswith(".gz") and not path.read_bytes().endswith((b"\n", b"\r")):
        raise InputError("cut: its last line does not end", source=path)
    for column in columns:
        if column not in table.header:
            raise InputError(f"no column '{column}': not a table of this kind", source=path)
    return table


def _times(table: CsvTable, column: str) -> np.ndarray:
    """Times of a table, s since 1970-01-01 UTC, NaN where there is none, (rows,)."""
    found = np.full(table.rows, np.nan)
    for row, text in enumerate(table.texts(column)):
        text = text.strip()
        if not text:
            continue
        try:
            day, clock = text.split()
            number, month, year = day.split("/")
            moment = dt.datetime.fromisoformat(f"{year}-{month}-{number}T{clock}")
        except ValueError:
            raise table.error(f"not dd/mm/yyyy and a time: {text[:40]!r}", row=row, column=column) from None
        found[row] = moment.replace(tzinfo=dt.UTC).timestamp()
    return found


def _positions(table: CsvTable, column: str) -> np.ndarray:
    """A position by row, deg, of degrees and minutes in one number (ddmm.mmm); NaN where there is none, (rows,)."""
    logged = table.numbers(column)
    return np.where(logged == 0.0, np.nan, np.sign(logged) * (np.abs(logged) // 100.0 + np.abs(logged) % 100.0 / 60.0))


def _fixes(table: CsvTable, t: np.ndarray) -> np.ndarray:
    """Fixes, (n, 3) as a Segment has them: rows at the surface whose position is not that of the row before."""
    if "NavState" not in table.header:
        return np.zeros((0, 3))
    latitude, longitude = _positions(table, "Lat"), _positions(table, "Lon")
    new = np.concatenate(([False], (np.diff(latitude) != 0.0) | (np.diff(longitude) != 0.0)))
    rows = new & (table.numbers("NavState") == TRANSMITTING)
    return usable_fixes(t[rows], latitude[rows], longitude[rows])


def _degrees(table: CsvTable, column: str, largest: float) -> float:
    """Median position, deg, of a table's rows; InputError where there is none."""
    degrees = _positions(table, column)
    degrees = degrees[np.isfinite(degrees)]
    if not degrees.size or np.abs(degrees).max() > largest:
        raise InputError("no position in degrees and minutes", source=table.path, column=column)
    return float(np.median(degrees))


def _navigated(path: Path) -> Segment:
    """The vehicle's own rows of a navigation table."""
    left_out: dict[str, int] = {}
    table = _table(path, ("Timestamp", "Lat", "Lon", *(column for _, column, _ in NAVIGATION)))
    numbers = {column: table.numbers(column) for _, column, _ in NAVIGATION}
    attitude = np.flatnonzero(np.isfinite(numbers["Pitch"]))
    count(left_out, "rows without attitude", table.rows - len(attitude))
    if np.abs(numbers["Pitch"][attitude]).max(initial=0.0) > FLIES_DEG:
        raise InputError("not in degrees: beyond 90", source=path, column="Pitch")
    logged_t = _times(table, "Timestamp")
    rows = attitude[in_the_mission(logged_t[attitude], left_out)]
    t = logged_t[rows]
    columns = {"t_s": t - t[0] if len(t) else t}
    for name, column, factor in NAVIGATION:
        columns[name] = clean(name, t, factor * numbers[column][rows], left_out)
    declination = table.numbers("Declination") if "Declination" in table.header else np.array([])
    declination = declination[np.isfinite(declination)]
    parts = NAME.fullmatch(path.name)
    assert parts is not None
    return Segment(
        [path], f"{parts['glider']}.{parts['mission']}", float(t[0]) if len(t) else 0.0, columns,
        _degrees(table, "Lat", 90.0), _degrees(table, "Lon", 180.0),
        DEG * float(np.median(declination)) if declination.size else 0.0, left_out, fixes=_fixes(table, logged_t),
    )  # fmt: skip


def _water(path: Path, segment: Segment) -> _Water:
    """The CTD's samples of a payload table, on the navigation's clock."""
    left_out = segment.left_out
    table = _table(path, ("PLD_REALTIMECLOCK",))
    maker, factor = next((one for one in CTDS if f"{one[0]}_CONDUCTIVITY" in table.header), ("", 0.0))
    if not maker:
        wanted = " or ".join(f"{name}_CONDUCTIVITY" for name, _ in CTDS)
        raise InputError(f"no column {wanted}: no CTD that is known here", source=path)
    for quantity in QUANTITIES:
        if f"{maker}_{quantity}" not in table.header:
            raise InputError(f"no column '{maker}_{quantity}'", source=path)
    conductivity, temperature, pressure = (table.numbers(f"{maker}_{quantity}") for quantity in QUANTITIES)
    conductivity = factor * conductivity
    sampled = np.flatnonzero(np.isfinite(conductivity) & np.isfinite(temperature) & np.isfinite(pressure))
    if sampled.size and np.median(conductivity[sampled]) > LARGEST_CONDUCTIVITY:
        unit = "S/m" if factor == 1.0 else "mS/cm"
        message = f"not in {unit}: beyond {LARGEST_CONDUCTIVITY / factor:g}"
        raise InputError(message, source=path, column=f"{maker}_CONDUCTIVITY")
    wet = sampled[pressure[sampled] >= OUT_OF_WATER_DBAR]
    count(left_out, f"of the CTD above {OUT_OF_WATER_DBAR:g} dbar", len(sampled) - len(wet))
    t = _times(table, "PLD_REALTIMECLOCK")
    rows = wet[in_the_mission(t[wet], left_out, "of the CTD ")]
    t = t[rows]
    require_same_time(t, path, segment.start + segment.columns["t_s"], segment.files[0])
    conductivity = clean("conductivity", t, conductivity[rows], left_out)
    temperature = clean("temperature", t, temperature[rows], left_out)
    pressure = clean("pressure", t, pressure[rows], left_out)
    depth = seawater.depth_of(pressure, segment.latitude)
    own_t = segment.start + segment.columns["t_s"]
    offset = clock_offset(own_t, segment.columns["depth_m"], t, depth)
    if offset is not None and abs(offset) > CLOCKS_S:
        t = t + offset
        segment.notes.append(f"the payload's clock moved by {offset:+.1f} s, by both depths")
    salinity = seawater.practical_salinity(conductivity, temperature, pressure)
    density = seawater.density_of(salinity, temperature, pressure, segment.longitude, segment.latitude)
    return _Water(t, depth, density, temperature)
