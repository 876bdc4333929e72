"""A case of an ocean glider as a mission in OceanGliders' common format (OG-1.0), with what was found out about it."""

import datetime as dt
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
WATER = {
    "depth_m": (og1_names.DEPTH, "glider depth", "m", {"positive": "down", "standard_name": "depth"}),
    "temperature_c": (
        og1_names.TEMPERATURE, "in-situ temperature", "degrees_Celsius", {"standard_name": "sea_water_temperature"},
    ),
    "density_kg_m3": (og1_names.DENSITY, "in-situ density", "kg/m3", {"standard_name": "sea_water_density"}),
}  # fmt: skip


def export_og1(folder: Path, out: Path, answers: list[Path]) -> list[Variable]:
    """Write a case as one file; the variables beside the runs' own. InputError, one line, where that cannot be."""
    table, runs = load_runs(folder)
    if table.vehicle not in og1_names.MODEL_NAMES:
        known = ", ".join(og1_names.MODEL_NAMES)
        raise InputError(
            f"'{table.vehicle}' is no ocean glider: expected one of {known}", source=folder, column="vehicle"
        )
    origins = read_origins(folder, runs)
    found = [variable for answer in answers for variable in found_in(answer, runs)]
    write_og1(out, table.vehicle, runs, origins, found, read_fixes(folder))
    return found


def write_og1(
    out: Path,
    vehicle: str,
    runs: list[Run],
    origins: list[Origin],
    variables: list[Variable],
    fixes: np.ndarray | None = None,
) -> None:
    """Write runs of a vehicle, each with its origin, and variables by row, as a mission in OG-1.0.

    fixes: (n, 3) as glider.tools.data.runs.origin.read_fixes gives them.
    """
    import xarray

    for variable in variables:
        if [len(one) for one in variable.values] != [run.rows for run in runs]:
            raise ValueError(f"{variable.name}: not as many values as rows")
    start = dt.datetime.fromtimestamp(origins[0].start, dt.UTC)
    first = f"{start:%Y%m%dT%H%M%S}"
    more = {one.name: _variable(one) for one in variables}
    dataset = xarray.Dataset(
        {**_own(runs, origins), **_fixes(fixes), **more, **_platform(vehicle, origins, first)},
        attrs={
            "title": "OceanGliders trajectory file", "id": f"{origins[0].glider}_{first}", "start_date": first,
            "platform": "sub-surface gliders", "featureType": "trajectory", "Conventions": "CF-1.10,OG-1.0",
            "platform_vocabulary": "https://vocab.nerc.ac.uk/collection/L06/current/27",
        },
    )  # fmt: skip
    packed = {name: {"zlib": True} for name, one in dataset.variables.items() if one.dims}
    with whole(out) as (temporary,):
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=packed)


def _by_row(runs: list[Run], values: list[Any]) -> np.ndarray:
    return np.concatenate([np.full(run.rows, one) for run, one in zip(runs, values, strict=True)])


def _own(runs: list[Run], origins: list[Origin]) -> dict[str, Any]:
    """The runs' own columns, and when and where they were."""
    rows = og1_names.ROWS
    time = np.concatenate([one.start + run.t for run, one in zip(runs, origins, strict=True)])
    position = {"comment": "of the dive's fixes, the same for all its rows"}
    found: dict[str, Any] = {
        og1_names.TIME: (rows, time, {"units": og1_names.EPOCH, "calendar": "gregorian", "standard_name": "time"}),
        og1_names.LATITUDE: (
            rows, _by_row(runs, [one.latitude for one in origins]),
            {"units": "degrees_north", "standard_name": "latitude", **position},
        ),
        og1_names.LONGITUDE: (
            rows, _by_row(runs, [one.longitude for one in origins]),
            {"units": "degrees_east", "standard_name": "longitude", **position},
        ),
        og1_names.DIVE: (rows, _by_row(runs, list(range(1, len(runs) + 1))).astype(np.int32), {"long_name": "dive"}),
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


def _fixes(fixes: np.ndarray | None) -> dict[str, Any]:
    """Fixes at the surface, at times of their own."""
    if fixes is None:
        return {}
    rows, word = og1_names.FIXES, "of fixes by GPS"
    return {
        og1_names.TIME_GPS: (
            rows, fixes[:, 0], {"units": og1_names.EPOCH, "calendar": "gregorian", "long_name": f"time {word}"},
        ),
        f"{og1_names.LATITUDE}_GPS": (rows, fixes[:, 1], {"units": "degrees_north", "long_name": f"latitude {word}"}),
        f"{og1_names.LONGITUDE}_GPS": (rows, fixes[:, 2], {"units": "degrees_east", "long_name": f"longitude {word}"}),
    }  # fmt: skip


def _column(runs: list[Run], column: str) -> np.ndarray:
    return np.concatenate([run.columns.get(column, np.full(run.rows, np.nan)) for run in runs])


def _variable(one: Variable) -> tuple[str, np.ndarray, dict[str, Any]]:
    about = {"long_name": one.long_name, "observation_type": "calculated", **one.attributes}
    if one.units:
        about["units"] = one.units
    return og1_names.ROWS, np.concatenate(one.values), about


def _platform(vehicle: str, origins: list[Origin], first: str) -> dict[str, Any]:
    return {
        og1_names.MODEL: ((), og1_names.MODEL_NAMES[vehicle], {"long_name": "model of the glider"}),
        og1_names.SERIAL: ((), origins[0].glider, {"long_name": "glider serial number"}),
        og1_names.WMO: ((), "unknown", {"long_name": "wmo id"}),
        og1_names.TRAJECTORY: ((), f"{origins[0].glider}_{first}", {"cf_role": "trajectory_id"}),
    }
