"""OceanGliders' common format (OG-1.0): a mission's NetCDF as segments, one a dive; measurements alone."""

import datetime as dt
import re
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.importers.ocean import netcdf, og1_names, seaexplorer, seaglider, seawater, slocum
from glider.tools.data.importers.ocean.netcdf import NetCDF
from glider.tools.data.importers.ocean.segment import Segment, at_rows, clean, count, in_the_mission, usable_fixes

HOLES_S = {"slocum": slocum.HOLE_S, "seaglider": seaglider.HOLE_S, "seaexplorer": seaexplorer.HOLE_S}
SINCE = re.compile(r"(?P<unit>\w+)\s+since\s+(?P<moment>.+)\Z")
SECONDS = {"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "seconds": 1.0, "s": 1.0, "minutes": 60.0,
           "hours": 3600.0, "days": 86400.0}  # fmt: skip
POSITIONS = ((og1_names.LATITUDE, "degrees_north"), (og1_names.LONGITUDE, "degrees_east"))
# Where a file does not number its dives one ends at a surfacing: a hole, or a time near the surface.
SURFACED_S, SURFACED_M = 180.0, 2.0


def read_og1(path: Path, vehicle: str | None) -> tuple[str, list[Segment]]:
    """The vehicle and the dives of a mission; InputError where the file cannot be used.

    vehicle: stands in for what PLATFORM_MODEL says.
    """
    file = NetCDF(path)
    size = file.size(og1_names.ROWS)
    if size is None or not file.has(og1_names.TIME):
        hint = " (a base station's dive file: glider import seaglider)" if file.has("eng_pitchAng") else ""
        raise InputError(f"no mission in {og1_names.CONVENTION}: no {og1_names.ROWS} or no TIME{hint}", source=path)
    vehicle = vehicle or _vehicle(file)
    logged_t = _times(file, og1_names.TIME)
    logged = {
        name: _first(file, names, size)
        for name, names in {**og1_names.ATTITUDE, **og1_names.OPTIONAL}.items()
        if name == "pitch_rad" or any(file.has(one) for one, _ in names)
    }
    flown = np.any([np.isfinite(logged[name]) for name in og1_names.ATTITUDE if name in logged], axis=0)
    numbers = _dives(file, logged_t, flown, size)
    segments = []
    for number in np.unique(numbers[flown & np.isfinite(numbers)]):
        left_out: dict[str, int] = {}
        dive = np.flatnonzero(numbers == number)
        rows = dive[flown[dive]]
        count(left_out, "rows without attitude", len(dive) - len(rows))
        rows = rows[in_the_mission(logged_t[rows], left_out)]
        t = logged_t[rows]
        columns = {"t_s": t - t[0] if len(t) else t}
        for name, values in logged.items():
            columns[name] = clean(name, t, values[rows], left_out)
        latitude, longitude = (_position(file, name, unit, dive, size) for name, unit in POSITIONS)
        start = float(t[0]) if len(t) else 0.0
        variation = _variation(file, dive, size)
        segment = Segment([path], _glider(file), start, columns, latitude, longitude, variation, left_out)
        _add_water(segment, file, t, rows, HOLES_S[vehicle], size)
        if "oil_m3" in columns and "pump" not in columns and not file.has(og1_names.OPTIONAL["oil_m3"][0][0]):
            columns["pump"] = seaglider.moving(t, columns["oil_m3"])
        segments.append(segment)
    if not segments:
        raise InputError("no row with attitude", source=path, column="PITCH")
    segments[0].fixes = _fixes(file, logged_t)  # the mission's: between dives rows are of none
    magnetic = file.has("HEADING") and "magnetic" in file.about("HEADING", "comment").lower()
    if magnetic and not file.has(og1_names.VARIATION):
        segments[0].notes.append("HEADING is magnetic, and so is yaw, of all runs")
    return vehicle, segments


def _vehicle(file: NetCDF) -> str:
    """The vehicle that PLATFORM_MODEL names; InputError where it is none that is known here."""
    model = file.text(og1_names.MODEL)
    for word, vehicle in og1_names.VEHICLES.items():
        if word in model.lower():
            return vehicle
    message = f"{model!r} is no vehicle that is known here; --vehicle names one of {', '.join(HOLES_S)}"
    raise InputError(message, source=file.path, column=og1_names.MODEL)


def _glider(file: NetCDF) -> str:
    return file.text(og1_names.SERIAL) or file.text(og1_names.TRAJECTORY) or file.attribute("id")


def _times(file: NetCDF, name: str) -> np.ndarray:
    """A variable, s since 1970-01-01 UTC, (rows,); InputError where its unit is no time since a date."""
    unit = file.about(name, "units")
    parts = SINCE.fullmatch(unit)
    try:
        if parts is None:
            raise ValueError
        factor = SECONDS[parts["unit"].lower()]
        moment = dt.datetime.fromisoformat(parts["moment"].strip().removesuffix(" UTC"))
    except (ValueError, KeyError):
        message = f"unit {unit!r}, expected {og1_names.EPOCH}"
        raise InputError(message, source=file.path, column=name) from None
    zero = (moment if moment.tzinfo else moment.replace(tzinfo=dt.UTC)).timestamp()
    return zero + file.values(name, {unit: factor})


def _first(file: NetCDF, names: og1_names.Names, size: int) -> np.ndarray:
    """The first of these variables that the file has, in SI, NaN where its flag says that it is bad."""
    name, units = next((one for one in names if file.has(one[0])), names[0])
    values = file.values(name, units, size)
    return np.where(_bad(file, name, size), np.nan, values)


def _bad(file: NetCDF, name: str, size: int) -> np.ndarray:
    flags = file.flags(f"{name}_QC", size)
    return np.isfinite(flags) & ~np.isin(flags, og1_names.USABLE)


def _dives(file: NetCDF, t: np.ndarray, flown: np.ndarray, size: int) -> np.ndarray:
    """The number of the dive that each row is of, by the file or by its surfacings; NaN where it is of none."""
    for name in og1_names.DIVES:
        if file.has(name):
            return file.values(name, {"": 1.0, "1": 1.0}, size)
    depth = file.values(og1_names.DEPTH, netcdf.METRES, size) if file.has(og1_names.DEPTH) else np.full(size, np.nan)
    rows = np.flatnonzero(flown & np.isfinite(t))
    numbers = np.full(size, np.nan)
    if rows.size:
        order = rows[np.argsort(t[rows], kind="stable")]
        numbers[order] = _by_surfacings(t[order], depth[order])
    return numbers


def _by_surfacings(t: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Numbers of dives, from 1: the next begins in the middle of a long time near the surface, or behind a hole."""
    first_rows = np.zeros(len(t), dtype=bool)
    first_rows[1:] = np.diff(t) > SURFACED_S
    near = np.isfinite(depth) & (depth < SURFACED_M)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], near, [False])).astype(np.int8)))
    for first, behind in zip(edges[::2], edges[1::2], strict=True):
        if first > 0 and behind < len(t) and t[behind - 1] - t[first] > SURFACED_S:
            first_rows[(first + behind) // 2] = True
    return 1.0 + np.cumsum(first_rows)


def _position(file: NetCDF, name: str, unit: str, dive: np.ndarray, size: int) -> float:
    """Median latitude or longitude of a dive, deg: of its GPS fixes where there are, or as reckoned."""
    for one in (f"{name}_GPS", name):
        if file.has(one):
            values = file.values(one, _spellings(unit))
            values = values[dive] if len(values) == size else values[:0]
            values = values[np.isfinite(values) & (np.abs(values) <= 360.0)]
            if values.size:
                return float(np.median(values))
    raise InputError("no position", source=file.path, column=name)


def _fixes(file: NetCDF, t: np.ndarray) -> np.ndarray:
    """A mission's fixes by GPS, (n, 3) as a Segment has them: at times of their own, or at the rows' (t); or none."""
    if not all(file.has(f"{name}_GPS") for name, _ in POSITIONS):
        return np.zeros((0, 3))
    found = [file.values(f"{name}_GPS", _spellings(unit)) for name, unit in POSITIONS]
    if file.has(og1_names.TIME_GPS):
        t = _times(file, og1_names.TIME_GPS)
    if {len(values) for values in found} != {len(t)}:
        return np.zeros((0, 3))
    bad = np.any([_bad(file, f"{name}_GPS", len(t)) for name, _ in POSITIONS], axis=0)
    return usable_fixes(np.where(bad, np.nan, t), *found)


def _spellings(unit: str) -> dict[str, float]:
    return dict.fromkeys((unit, unit.replace("degrees", "degree")), 1.0)


def _variation(file: NetCDF, dive: np.ndarray, size: int) -> float:
    """Magnetic variation that is still to be added to a dive's heading, rad; 0 where the file has none."""
    if not file.has(og1_names.VARIATION):
        return 0.0
    values = file.values(og1_names.VARIATION, netcdf.ANGLE, size)[dive]
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else 0.0


def _add_water(segment: Segment, file: NetCDF, t: np.ndarray, rows: np.ndarray, hole_s: float, size: int) -> None:
    """Depth, density and temperature of a dive's rows, holes of up to hole_s interpolated."""
    left_out = segment.left_out

    def read(name: str, units: dict[str, float], quantity: str) -> np.ndarray:
        bad = _bad(file, name, size)[rows]
        values = file.values(name, units, size)[rows]
        count(left_out, f"{name} that its flag calls bad", np.count_nonzero(bad & np.isfinite(values)))
        return clean(quantity, t, np.where(bad, np.nan, values), left_out)

    has_pressure = file.has(og1_names.PRESSURE)
    if has_pressure:
        pressure = read(og1_names.PRESSURE, netcdf.DBAR, "pressure")
        depth = seawater.depth_of(pressure, segment.latitude)
    else:
        pressure, depth = np.full(len(rows), np.nan), read(og1_names.DEPTH, netcdf.METRES, "depth_m")
    temperature = read(og1_names.TEMPERATURE, netcdf.CELSIUS, "temperature")
    if has_pressure and file.has(og1_names.SALINITY):
        salinity = read(og1_names.SALINITY, netcdf.PRACTICAL, "salinity")
    elif has_pressure and file.has(og1_names.CONDUCTIVITY):
        conductivity = read(og1_names.CONDUCTIVITY, netcdf.SIEMENS, "conductivity")
        salinity = seawater.practical_salinity(conductivity, temperature, pressure)
    else:
        salinity = None
    if salinity is None:
        density = file.values(og1_names.DENSITY, netcdf.DENSITY, size)[rows]
    else:
        density = seawater.density_of(salinity, temperature, pressure, segment.longitude, segment.latitude)
    for name, values in (("depth_m", depth), ("density_kg_m3", density), ("temperature_c", temperature)):
        segment.columns[name] = at_rows(t, values, t, hole_s)
