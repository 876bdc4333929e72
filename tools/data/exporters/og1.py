"""A case of an ocean glider as a mission in OceanGliders' common format (OG-1.0), with what was found out about it.

Dimension, mandatory variables and attributes are those of the format's manual, 2026
(https://oceangliderscommunity.github.io/OG-format-user-manual/OG_Format.html).
"""

import datetime as dt
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.exporters.variables import Variable, found_in
from glider.tools.data.files import whole
from glider.tools.data.importers.ocean import og1_names
from glider.tools.data.runs.case import load_runs
from glider.tools.data.runs.origin import Origin, read_fixes, read_origins
from glider.tools.data.runs.run import Run

UNKNOWN = "unknown"  # an attribute that the format wants and the case does not hold
ROLES = "http://vocab.nerc.ac.uk/collection/W08/current/"
VARIABLES = "http://vocab.nerc.ac.uk/collection/OG1/current"
TIME_FILL, PLACE_FILL, SEGMENT_FILL = -1.0, -9999.9, -9999  # of the manual


@dataclass(frozen=True)
class MissionAttributes:
    """What the format wants of a mission, and a case does not hold."""

    contributor: str = UNKNOWN  # principal investigator
    email: str = UNKNOWN
    institution: str = UNKNOWN  # operator
    wmo: str = UNKNOWN
    data_mode: str = "R"

    @property
    def missing(self) -> list[str]:
        """The names of those that are not given."""
        return [name for name in ("contributor", "email", "institution", "wmo") if getattr(self, name) == UNKNOWN]


_ANGLE = ("degrees", 180.0 / np.pi)
# Run data, the words of its variable, its unit there and the factor to it.
WRITTEN = {
    "pitch_rad": ("vehicle pitch, nose up positive", *_ANGLE),
    "roll_rad": ("vehicle roll, starboard down positive", *_ANGLE),
    "yaw_rad": ("vehicle heading", *_ANGLE),
    "oil_m3": ("volume of the buoyancy engine, positive lighter", "m3", 1.0),
    "battery_m": ("position of the pitch mass, positive forward", "m", 1.0),
    "fin_rad": ("rudder angle", *_ANGLE),
    "pump": ("1 while the buoyancy engine runs", "1", 1.0),
    "speed_m_s": ("measured speed through the water", "m/s", 1.0),
    "vn_m_s": ("measured velocity through the water, north", "m/s", 1.0),
    "ve_m_s": ("measured velocity through the water, east", "m/s", 1.0),
}
_MEASURED = {"sensor": og1_names.CTD, "coordinates": "TIME, LONGITUDE, LATITUDE, DEPTH"}
WATER: dict[str, tuple[str, str, str, dict[str, Any]]] = {
    "depth_m": (
        og1_names.DEPTH, "depth below surface of the water body", "metres",
        {"positive": "down", "standard_name": "depth", "valid_min": 0.0, "valid_max": 10000.0,
         "_FillValue": PLACE_FILL, "vocabulary": f"{VARIABLES}/DEPTH/"},
    ),
    "temperature_c": (
        og1_names.TEMPERATURE, "in-situ temperature", "degrees_Celsius",
        {"standard_name": "sea_water_temperature", "vocabulary": f"{VARIABLES}/TEMP/", **_MEASURED},
    ),
    "density_kg_m3": (
        og1_names.DENSITY, "in-situ density", "kg/m3", {"standard_name": "sea_water_density", **_MEASURED},
    ),
}  # fmt: skip


def export_og1(
    folder: Path,
    out: Path,
    answers: list[Path],
    about: MissionAttributes = MissionAttributes(),
) -> list[Variable]:
    """Write a case as one file; the variables beside the runs' own. InputError, one line, where that cannot be."""
    table, runs = load_runs(folder)
    if table.vehicle not in og1_names.MODEL_NAMES:
        known = ", ".join(og1_names.MODEL_NAMES)
        raise InputError(
            f"'{table.vehicle}' is no ocean glider: expected one of {known}", source=folder, column="vehicle"
        )
    origins = read_origins(folder, runs)
    found = [variable for answer in answers for variable in found_in(answer, runs)]
    write_og1(out, table.vehicle, runs, origins, found, read_fixes(folder), about)
    return found


def write_og1(
    out: Path,
    vehicle: str,
    runs: list[Run],
    origins: list[Origin],
    variables: list[Variable],
    fixes: np.ndarray | None = None,
    about: MissionAttributes = MissionAttributes(),
) -> None:
    """Write runs of a vehicle, each with its origin, and variables by row, as a mission in OG-1.0.

    fixes: (n, 3) as glider.tools.data.runs.origin.read_fixes gives them. Each is a measurement of its own, of no
    segment.
    """
    import xarray

    for variable in variables:
        if [len(one) for one in variable.values] != [run.rows for run in runs]:
            raise ValueError(f"{variable.name}: not as many values as rows")
    deployed = dt.datetime.fromtimestamp(origins[0].start, dt.UTC)
    first = _formatted(deployed)
    by_row = _with_fixes({**_own(runs, origins), **{one.name: _variable(one) for one in variables}}, fixes)
    dataset = xarray.Dataset(
        {**by_row, **_platform(vehicle, origins, first, about)},
        attrs={
            "title": "OceanGliders trajectory file", "id": f"{origins[0].glider}_{first}_{about.data_mode}",
            "platform": "sub-surface gliders", "platform_vocabulary": "http://vocab.nerc.ac.uk/collection/L06/current/27/",
            "contributor_name": about.contributor, "contributor_email": about.email,
            "contributor_role": "principal investigator", "contributor_role_vocabulary": ROLES,
            "contributing_institutions": about.institution, "contributing_institutions_role": "operating agency",
            "contributing_institutions_role_vocabulary": ROLES,
            "rtqc_method": "No QC applied", "start_date": first, "date_created": _formatted(_now()),
            "featureType": "trajectory", "Conventions": "CF-1.10, ACDD-1.3, OG-1.0",
        },
    )  # fmt: skip
    packed = {name: {"zlib": True} for name, one in dataset.variables.items() if one.dims}
    with whole(out) as (temporary,):
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=packed, unlimited_dims=[og1_names.ROWS])


def _formatted(moment: dt.datetime) -> str:
    return f"{moment:%Y%m%dT%H%M%S}"


def _now() -> dt.datetime:
    """The time of writing; SOURCE_DATE_EPOCH, s since 1970, where the environment sets it (reproducible builds)."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return dt.datetime.fromtimestamp(int(epoch), dt.UTC) if epoch.isdigit() else dt.datetime.now(dt.UTC)


def _by_row(runs: list[Run], values: list[Any]) -> np.ndarray:
    return np.concatenate([np.full(run.rows, one) for run, one in zip(runs, values, strict=True)])


def _own(runs: list[Run], origins: list[Origin]) -> dict[str, Any]:
    """The runs' own columns, and when and where they were."""
    rows = og1_names.ROWS
    time = np.concatenate([one.start + run.t for run, one in zip(runs, origins, strict=True)])
    position = {"comment": "of the segment's fixes, the same for all its rows; of each fix its own"}
    segment = {
        "long_name": "Identifier of numbered segment within the dataset", "_FillValue": np.int32(SEGMENT_FILL),
        "segment_number_calculation_method": "a segment is a run of the case",
    }  # fmt: skip
    found: dict[str, Any] = {
        og1_names.TIME: (rows, time, _of_time("Time elapsed since 1970-01-01T00:00:00Z", "TIME")),
        og1_names.LATITUDE: (
            rows, _by_row(runs, [one.latitude for one in origins]), {**_of_place("latitude", "LAT"), **position},
        ),
        og1_names.LONGITUDE: (
            rows, _by_row(runs, [one.longitude for one in origins]), {**_of_place("longitude", "LON"), **position},
        ),
        og1_names.SEGMENT: (rows, _by_row(runs, list(range(1, len(runs) + 1))).astype(np.int32), segment),
    }  # fmt: skip
    for column, (name, words, unit, attributes) in WATER.items():
        found[name] = (rows, _column(runs, column), {"units": unit, "long_name": words, **attributes})
    names = {column: og1_names.ATTITUDE[column][0][0] for column in og1_names.ATTITUDE}
    names |= {column: og1_names.OPTIONAL[column][0][0] for column in og1_names.OPTIONAL}
    for column, name in names.items():
        words, unit, factor = WRITTEN[column]
        if column in og1_names.ATTITUDE or any(run.has(column) for run in runs):
            found[name] = (rows, factor * _column(runs, column), {"units": unit, "long_name": words})
    variation = _by_row(runs, [one.variation for one in origins])
    if variation.any():
        found["HEADING"][2]["comment"] = f"magnetic; {og1_names.VARIATION} is to be added"
        about = {"units": "degrees", "long_name": "magnetic variation, positive east"}
        found[og1_names.VARIATION] = (rows, np.degrees(variation), about)
    return found


def _of_time(words: str, vocabulary: str = "") -> dict[str, Any]:
    """Attributes of a time, as the manual has them."""
    named = {"vocabulary": f"{VARIABLES}/{vocabulary}/"} if vocabulary else {}
    return {
        "long_name": words, "standard_name": "time", "units": og1_names.EPOCH, "calendar": "gregorian",
        "_FillValue": TIME_FILL, "valid_min": 1e9, "valid_max": 4e9, **named,
    }  # fmt: skip


def _of_place(quantity: str, vocabulary: str = "") -> dict[str, Any]:
    """Attributes of a latitude or longitude, as the manual has them."""
    most, unit = (90.0, "degrees_north") if quantity == "latitude" else (180.0, "degrees_east")
    named = {"vocabulary": f"{VARIABLES}/{vocabulary}/"} if vocabulary else {}
    words = f"{quantity} of each measurement and GPS location" if vocabulary else f"{quantity} of each GPS location"
    return {
        "long_name": words, "standard_name": quantity, "units": unit, "_FillValue": PLACE_FILL, "valid_min": -most,
        "valid_max": most, **named,
    }  # fmt: skip


def _with_fixes(by_row: dict[str, Any], fixes: np.ndarray | None) -> dict[str, Any]:
    """Variables by row and the fixes of GPS, as rows of their own at their times."""
    fixes = np.zeros((0, 3)) if fixes is None else fixes
    rows = len(by_row[og1_names.TIME][1])
    order = np.argsort(np.concatenate((by_row[og1_names.TIME][1], fixes[:, 0])), kind="stable")
    empty = np.full(rows, np.nan)
    at_fixes = {og1_names.TIME: fixes[:, 0], og1_names.LATITUDE: fixes[:, 1], og1_names.LONGITUDE: fixes[:, 2]}
    at_fixes[og1_names.SEGMENT] = np.full(len(fixes), SEGMENT_FILL, dtype=np.int32)
    found = {}
    for name, (dimension, values, attributes) in by_row.items():
        behind = at_fixes.get(name, np.full(len(fixes), np.nan))
        found[name] = (dimension, np.concatenate((values, behind))[order], attributes)
    attributes_of = (_of_time("time of each GPS location"), _of_place("latitude"), _of_place("longitude"))
    names = (og1_names.TIME_GPS, f"{og1_names.LATITUDE}_GPS", f"{og1_names.LONGITUDE}_GPS")
    for name, column, attributes in zip(names, fixes.T, attributes_of, strict=True):
        found[name] = (og1_names.ROWS, np.concatenate((empty, column))[order], attributes)
    return found


def _column(runs: list[Run], column: str) -> np.ndarray:
    return np.concatenate([run.columns.get(column, np.full(run.rows, np.nan)) for run in runs])


def _variable(one: Variable) -> tuple[str, np.ndarray, dict[str, Any]]:
    about = {"long_name": one.long_name, "observation_type": "calculated", **one.attributes}
    if one.units:
        about["units"] = one.units
    return og1_names.ROWS, np.concatenate(one.values), about


def _platform(vehicle: str, origins: list[Origin], first: str, about: MissionAttributes) -> dict[str, Any]:
    """Variables of the vehicle, its deployment and its sensor, one value each."""
    start, north, east = origins[0], "degrees_north", "degrees_east"
    sensor = {
        "long_name": "CTD", "sensor_type_vocabulary": "http://vocab.nerc.ac.uk/collection/L05/current/130",
        "sensor_model": UNKNOWN, "sensor_model_vocabulary": "http://vocab.nerc.ac.uk/collection/L22/current/",
    }  # fmt: skip
    model = {
        "long_name": "model of the glider", "platform_model_vocabulary": "http://vocab.nerc.ac.uk/collection/B76/current/",
    }  # fmt: skip
    at = {"long_name": "date of deployment", "standard_name": "time", "calendar": "gregorian", "units": og1_names.EPOCH}
    return {
        og1_names.MODEL: ((), og1_names.MODEL_NAMES[vehicle], model),
        og1_names.SERIAL: ((), start.glider, {"long_name": "glider serial number"}),
        og1_names.WMO: ((), about.wmo, {"long_name": "wmo id"}),
        og1_names.TRAJECTORY: (
            (), f"{start.glider}_{first}", {"cf_role": "trajectory_id", "long_name": "trajectory name"},
        ),
        "DEPLOYMENT_TIME": ((), start.start, at),
        "DEPLOYMENT_LATITUDE": ((), start.latitude, {"long_name": "latitude of deployment", "units": north}),
        "DEPLOYMENT_LONGITUDE": ((), start.longitude, {"long_name": "longitude of deployment", "units": east}),
        og1_names.CTD: ((), "", sensor),
    }  # fmt: skip
