"""Seaglider: a base station's dive files (p*.nc) as segments, one dive each; of what it computed, only S and T."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.importers.ocean import netcdf, og1_names, seawater
from glider.tools.data.importers.ocean.netcdf import NetCDF
from glider.tools.data.importers.ocean.segment import Segment, at_rows, clean, count, in_the_mission, usable_fixes

HOLE_S = 60.0  # CTD values are interpolated over no longer holes: it is sampled every 5 to 30 s
PUMP_RATE = 3e-7  # m3/s; the volume moves: the engine runs. Its pump makes 1e-6, its potentiometer's noise 1e-8
EPOCH = {f"seconds since 1970-{day} 00:00:00{zone}": 1.0 for day in ("1-1", "01-01") for zone in ("", " UTC", "Z")}
EPOCH |= {f"seconds since 1970-01-01T00:00:00{zone}": 1.0 for zone in ("", "Z", "+00:00")}
EPOCH |= {"seconds  since 1970-1-1 00:00:00": 1.0}  # as base stations of version 2 write it
CENTIMETRES = {"": 0.01, "cm": 0.01}  # some variables say their unit in their name alone
VOLUME = {"": 1e-6, **netcdf.CUBIC_CENTIMETRES}
DEGREES = {"": np.pi / 180.0, **netcdf.ANGLE}
COUNTS = {"": 1.0, "1": 1.0}
ON_EARTH = {"degrees_north": 1.0, "degrees_east": 1.0, "degrees": 1.0, "": 1.0}


def read_seaglider(paths: list[Path], advance: Callable[[int], None]) -> list[Segment]:
    """The dives of the files; InputError where one cannot be used.

    The volume's zero is that of the first dive: where the pilot moved it (C_VBD) later dives are taken back by it.
    """
    dives = []
    for path in paths:
        dives.append(_dive(path))
        advance(1)
    dives.sort(key=lambda one: one[0].start)
    first = dives[0][1]
    for segment, zero in dives:
        if np.isfinite(zero) and np.isfinite(first) and zero != first:
            segment.columns["oil_m3"] = segment.columns["oil_m3"] + (zero - first)
            segment.notes.append(f"the volume's zero was moved by {1e6 * (zero - first):+.1f} cm3 since the first dive")
    return [segment for segment, _ in dives]


def _dive(path: Path) -> tuple[Segment, float]:
    """A dive, and the volume at its zero of the buoyancy engine, m3, NaN where the file does not say."""
    file = NetCDF(path)
    if file.size("N_MEASUREMENTS") is not None:
        raise InputError("a mission in OG1, no dive file of a base station (glider import og1)", source=path)
    for name in ("time", "eng_pitchAng", "ctd_time"):
        if not file.has(name):
            raise InputError("no dive file of a base station: the variable is missing", source=path, column=name)
    left_out: dict[str, int] = {}
    logged_t = file.values("time", EPOCH)
    size = len(logged_t)
    pitch = file.values("eng_pitchAng", netcdf.ANGLE, size)
    attitude = np.flatnonzero(np.isfinite(pitch))
    count(left_out, "rows without attitude", size - len(attitude))
    rows = attitude[in_the_mission(logged_t[attitude], left_out)]
    t = logged_t[rows]
    latitude, longitude = _position(file)
    variation = file.number("magnetic_variation", DEGREES) if file.has("magnetic_variation") else np.nan
    logged = {
        "pitch_rad": pitch,
        "roll_rad": file.values("eng_rollAng", netcdf.ANGLE, size),
        "yaw_rad": file.values("eng_head", netcdf.ANGLE, size) + (variation if np.isfinite(variation) else 0.0),
        "oil_m3": file.values("eng_vbdCC", VOLUME, size),
        "battery_m": -file.values("eng_pitchCtl", CENTIMETRES, size),  # its sign is that of the pitch it makes
    }
    columns = {"t_s": t - t[0] if len(t) else t}
    columns |= {name: clean(name, t, values[rows], left_out) for name, values in logged.items()}
    columns["pump"] = _pump(file, t, columns["oil_m3"])
    glider = file.attribute("platform_id") or f"seaglider {file.attribute('glider')}"
    segment = Segment([path], glider, float(t[0]) if len(t) else 0.0, columns, latitude, longitude, 0.0, left_out)
    segment.fixes = _fixes(file)
    if not np.isfinite(variation):
        segment.notes.append("no magnetic variation in the file: yaw is magnetic")
    _add_water(segment, file, t)
    return segment, _zero(file)


def _position(file: NetCDF) -> tuple[float, float]:
    """Latitude and longitude, deg: of the dive's GPS fixes, or the file's means."""
    found = []
    for mean, fixes in (("avg_latitude", "log_gps_lat"), ("avg_longitude", "log_gps_lon")):
        name = mean if file.has(mean) else fixes
        values = file.values(name, ON_EARTH)
        values = values[np.isfinite(values)]
        if not values.size:
            raise InputError("no position", source=file.path, column=name)
        found.append(float(values.mean()))
    return found[0], found[1]


def _fixes(file: NetCDF) -> np.ndarray:
    """The fixes before and behind the dive, (n, 3) as a Segment has them."""
    if not all(file.has(f"log_gps_{name}") for name in ("time", "lat", "lon")):
        return np.zeros((0, 3))
    t = file.values("log_gps_time", EPOCH)
    return usable_fixes(t, *(file.values(f"log_gps_{name}", ON_EARTH, len(t)) for name in ("lat", "lon")))


def _zero(file: NetCDF) -> float:
    """Volume at the zero of this dive, on a scale that dives of one vehicle share, m3."""
    if not (file.has("log_C_VBD") and file.has("log_VBD_CNV")):
        return float("nan")
    return 1e-6 * file.number("log_C_VBD", COUNTS) * file.number("log_VBD_CNV", COUNTS)


def _pump(file: NetCDF, t: np.ndarray, oil: np.ndarray) -> np.ndarray:
    """1 where the log says that the buoyancy engine was moved, or where its volume moves; (rows,)."""
    runs = moving(t, oil) > 0.0
    if file.has("gc_st_secs"):
        begin, end = file.values("gc_st_secs", EPOCH), file.values("gc_end_secs", EPOCH)
        moved = file.values("gc_vbd_secs", netcdf.SECONDS, len(begin)) > 0.0
        for a, b in zip(begin[moved], end[moved], strict=True):
            runs |= (t >= a) & (t <= b)
    return runs.astype(np.float64)


def moving(t: np.ndarray, oil: np.ndarray) -> np.ndarray:
    """1 where the volume of the buoyancy engine moves by more than PUMP_RATE; oil (rows,) m3."""
    if len(t) < 2:
        return np.zeros(len(t))
    return (np.abs(np.nan_to_num(np.gradient(oil, t))) > PUMP_RATE).astype(np.float64)


def _add_water(segment: Segment, file: NetCDF, t: np.ndarray) -> None:
    """Depth, density and temperature at the rows' times, of the CTD's pressure and the corrected S and T."""
    left_out = segment.left_out
    logged_t = file.values("ctd_time", EPOCH)
    size = len(logged_t)
    rows = in_the_mission(logged_t, left_out, "of the CTD ")
    ctd_t = logged_t[rows]
    pressure = clean("pressure", ctd_t, file.values("ctd_pressure", netcdf.DBAR, size)[rows], left_out)
    temperature = clean("temperature", ctd_t, file.values("temperature", netcdf.CELSIUS, size)[rows], left_out)
    salinity = clean("salinity", ctd_t, file.values("salinity", netcdf.PRACTICAL, size)[rows], left_out)
    flags = [file.flags(f"{name}_qc", size)[rows] for name in ("salinity", "temperature")]
    bad = np.any([np.isfinite(one) & ~np.isin(one, og1_names.USABLE) for one in flags], axis=0)
    bad |= np.isnan(salinity) | np.isnan(temperature)
    count(left_out, "of the CTD that the base station calls bad or has not", np.count_nonzero(bad))
    temperature, salinity = np.where(bad, np.nan, temperature), np.where(bad, np.nan, salinity)
    density = seawater.density_of(salinity, temperature, pressure, segment.longitude, segment.latitude)
    depth = seawater.depth_of(pressure, segment.latitude)
    for name, values in (("depth_m", depth), ("density_kg_m3", density), ("temperature_c", temperature)):
        segment.columns[name] = at_rows(ctd_t, values, t, HOLE_S)
