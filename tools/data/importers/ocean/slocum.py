"""Slocum: engineering and science binaries (dbd and ebd, sbd and tbd, mbd and nbd, compressed too) as segments.

The values are read by the dbdreader package, which is under the GPL: it comes with an extra of its own and is imported
here alone.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
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
    require_unit,
    usable_fixes,
)
from glider.tools.data.importers.ocean.slocum_files import Binary, check_binary, find_caches, in_pairs, unpacked

HOLE_S = 15.0  # CTD values are interpolated over no longer holes
CLOCKS_S = 5.0  # about one row: a smaller offset of the clocks cannot be distinguished from a sensor's own lag
INCH = 0.0254
# Run data, the sensor, its unit in the list of sensors, and the factor to SI.
NEEDED = (("pitch_rad", "m_pitch", "rad", 1.0),)
OPTIONAL = (  # what is sent ashore (sbd) has not all of them
    ("roll_rad", "m_roll", "rad", 1.0),
    ("yaw_rad", "m_heading", "rad", 1.0),
    ("battery_m", "m_battpos", "in", INCH),
    ("fin_rad", "m_fin", "rad", 1.0),
)
# Buoyancy engines, shallow and deep: volume, and whether the pump runs.
ENGINES = (("m_ballast_pumped", "m_is_ballast_pump_moving"), ("m_de_oil_vol", "m_is_de_pump_moving"))
CTD = (("sci_water_cond", "s/m", 1.0), ("sci_water_temp", "degc", 1.0), ("sci_water_pressure", "bar", 10.0))
CTD_CLOCKS = ("sci_ctd41cp_timestamp", "sci_rbrctd_timestamp", "sci_m_present_time")


def read_slocum(paths: list[Path], caches: Path | None, advance: Callable[[int], None]) -> list[Segment]:
    """The segments of the files, a pair each; InputError where one cannot be used, before any other is read.

    caches: folder of header caches (*.cac), beside those that lie with the files or are among them.
    """
    given = {path.stem.lower(): path for path in paths if path.suffix.lower() == ".cac"}
    paths = [path for path in paths if path.suffix.lower() != ".cac"]
    if not paths:
        raise InputError("no engineering or science file among the files")
    known = find_caches(paths, caches) | given
    segments = []
    for engineering, science in in_pairs([check_binary(path, known) for path in paths]):
        segments.append(_segment(engineering, science, known))
        advance(2)
    return segments


class _Log:
    """One binary's sensors on its own rows."""

    def __init__(self, binary: Binary, caches: dict[str, Path], folder: Path):
        import dbdreader

        crc = binary.header["sensor_list_crc"].lower()
        if crc in caches:
            (folder / f"{crc}.cac").write_bytes(caches[crc].read_bytes())
        copy = folder / f"unpacked.{binary.kind}"
        copy.write_bytes(unpacked(binary.path))
        self.path = binary.path
        try:
            self._file = dbdreader.DBD(str(copy), cacheDir=str(folder))
        except (dbdreader.DbdError, ValueError, IndexError, KeyError) as error:
            raise InputError(f"cannot be read: {error}".replace("\n", " "), source=self.path) from None
        self.units: dict[str, str] = self._file.parameterUnits

    def has(self, sensor: str) -> bool:
        """Whether the file logs this sensor."""
        return sensor in self.units

    def rows(self, wanted: list[tuple[str, str]]) -> dict[str, np.ndarray]:
        """Sensors (name, unit) by row, NaN where one was not logged; InputError for one that is not there."""
        for sensor, unit in wanted:
            if not self.has(sensor):
                raise InputError("the sensor is not in this file", source=self.path, column=sensor)
            require_unit(self.units[sensor], {unit: 1.0}, self.path, sensor)
        found: Any = self._file.get(*(sensor for sensor, _ in wanted), return_nans=True, decimalLatLon=False)
        pairs = found if len(wanted) > 1 else [found]
        return {sensor: np.asarray(values, dtype=float) for (sensor, _), (_, values) in zip(wanted, pairs, strict=True)}

    def position(self, kind: str) -> float:
        """Median latitude or longitude, deg, `kind` lat or lon, by GPS or else as reckoned; NaN where there is none."""
        for sensor in (f"m_gps_{kind}", f"m_{kind}"):
            if self.has(sensor):
                require_unit(self.units[sensor], {kind: 1.0}, self.path, sensor)
                _, values = self._file.get(sensor)
                if len(values):
                    return float(np.median(values))
        return float("nan")

    def fixes(self) -> np.ndarray:
        """Fixes by GPS, (n, 3) as a Segment has them: none where it has no receiver."""
        if not (self.has("m_gps_lat") and self.has("m_gps_lon")):
            return np.zeros((0, 3))
        for kind in ("lat", "lon"):
            require_unit(self.units[f"m_gps_{kind}"], {kind: 1.0}, self.path, f"m_gps_{kind}")
        (t, latitude), (t_lon, longitude) = (self._file.get(f"m_gps_{kind}") for kind in ("lat", "lon"))
        _, first, second = np.intersect1d(t, t_lon, return_indices=True)
        return usable_fixes(np.asarray(t)[first], np.asarray(latitude)[first], np.asarray(longitude)[second])


def _segment(engineering: Binary, science: Binary, caches: dict[str, Path]) -> Segment:
    with tempfile.TemporaryDirectory() as folder:
        log = _Log(engineering, caches, Path(folder))
        ctd = _Log(science, caches, Path(folder))
        return _assemble(engineering, science, log, ctd)


def _assemble(engineering: Binary, science: Binary, log: _Log, ctd: _Log) -> Segment:
    left_out: dict[str, int] = {}
    engines = [(volume, moving) for volume, moving in ENGINES if log.has(volume)]
    wanted = [*((sensor, unit) for _, sensor, unit, _ in NEEDED), ("m_present_time", "timestamp")]
    wanted += [(sensor, unit) for _, sensor, unit, _ in OPTIONAL if log.has(sensor)]
    wanted += [(volume, "cc") for volume, _ in engines]
    wanted += [(moving, "bool") for _, moving in engines if log.has(moving)]
    wanted += [("m_pressure", "bar")] if log.has("m_pressure") else []
    logged = log.rows(wanted)
    attitude = np.flatnonzero(np.isfinite(logged["m_pitch"]))
    count(left_out, "rows without attitude", len(logged["m_pitch"]) - len(attitude))
    rows = attitude[in_the_mission(logged["m_present_time"][attitude], left_out)]
    t = logged["m_present_time"][rows]
    columns = {"t_s": t - t[0] if len(t) else t}
    for column, sensor, _, factor in (*NEEDED, *OPTIONAL):
        if sensor in logged:
            columns[column] = clean(column, t, factor * logged[sensor][rows], left_out)
    volume, moving = max(engines, key=lambda one: _travel(logged[one[0]][rows]), default=("", ""))
    if volume:
        columns["oil_m3"] = clean("oil_m3", t, 1e-6 * logged[volume][rows], left_out)
    if moving in logged:
        columns["pump"] = np.where(np.isnan(logged[moving][rows]), np.nan, logged[moving][rows] > 0.0)
    latitude, longitude = log.position("lat"), log.position("lon")
    if not (np.isfinite(latitude) and np.isfinite(longitude)):
        raise InputError("no position, neither m_gps_lat and _lon nor m_lat and _lon", source=engineering.path)
    segment = Segment(
        [engineering.path, science.path], engineering.glider, float(t[0]) if len(t) else 0.0, columns, latitude,
        longitude, _variation(log), left_out,
    )  # fmt: skip
    segment.fixes = log.fixes()
    for one in (engineering, science):
        if not one.ends_well:
            segment.notes.append(f"{one.path.name} ends without its mark; its cycles are whole")
    pressure = 10.0 * logged["m_pressure"] if "m_pressure" in logged else np.full(len(logged["m_pitch"]), np.nan)
    _add_water(segment, ctd, t, (logged["m_present_time"], pressure))
    return segment


def _add_water(segment: Segment, ctd: _Log, t: np.ndarray, own: tuple[np.ndarray, np.ndarray]) -> None:
    """Depth, density and temperature at the rows' times, from the science computer's CTD."""
    left_out = segment.left_out
    clock = next((one for one in CTD_CLOCKS if ctd.has(one)), CTD_CLOCKS[-1])
    found = ctd.rows([*((sensor, unit) for sensor, unit, _ in CTD), (clock, "timestamp")])
    conductivity, temperature, pressure = (factor * found[sensor] for sensor, _, factor in CTD)
    use = np.flatnonzero(np.isfinite(conductivity) & np.isfinite(temperature) & np.isfinite(pressure))
    wet = use[pressure[use] >= OUT_OF_WATER_DBAR]
    count(left_out, f"of the CTD above {OUT_OF_WATER_DBAR:g} dbar", len(use) - len(wet))
    use = wet[in_the_mission(found[clock][wet], left_out, "of the CTD ")]
    ctd_t = found[clock][use]
    require_same_time(ctd_t, ctd.path, t, segment.files[0])
    conductivity = clean("conductivity", ctd_t, conductivity[use], left_out)
    temperature = clean("temperature", ctd_t, temperature[use], left_out)
    pressure = clean("pressure", ctd_t, pressure[use], left_out)
    depth = seawater.depth_of(pressure, segment.latitude)
    row_t, row_pressure = own
    timed = np.isin(row_t, t) if len(t) else np.zeros(len(row_t), dtype=bool)
    offset = clock_offset(row_t[timed], seawater.depth_of(row_pressure[timed], segment.latitude), ctd_t, depth)
    if offset is not None and abs(offset) > CLOCKS_S:
        ctd_t = ctd_t + offset
        segment.notes.append(f"the science computer's clock moved by {offset:+.1f} s, by both pressures")
    salinity = seawater.practical_salinity(conductivity, temperature, pressure)
    density = seawater.density_of(salinity, temperature, pressure, segment.longitude, segment.latitude)
    for name, values in (("depth_m", depth), ("density_kg_m3", density), ("temperature_c", temperature)):
        segment.columns[name] = at_rows(ctd_t, values, t, HOLE_S)


def _travel(values: np.ndarray) -> float:
    there = values[np.isfinite(values)]
    return float(np.ptp(there)) if there.size else -1.0


def _variation(log: _Log) -> float:
    """Magnetic variation as the GPS gives it, rad, to be added to yaw; 0 where it is not logged."""
    if not log.has("m_gps_mag_var"):
        return 0.0
    found = log.rows([("m_gps_mag_var", "rad")])["m_gps_mag_var"]
    found = found[np.isfinite(found)]
    return -float(np.median(found)) if found.size else 0.0
