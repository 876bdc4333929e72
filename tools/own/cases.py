"""Which vehicle a case is asked by: a file with `model`, by --vehicle or named in case.toml, or in a mapping."""

import os
import tomllib
from pathlib import Path

from glider.tools.data.importers.mapping import RUN_DATA, Target, template
from glider.tools.data.runs.case import CASE_FILE
from glider.tools.data.sources import read_text, vehicle_text
from glider.tools.own.check import load_own
from glider.tools.own.files import is_own
from glider.tools.own.load import LoadedVehicle, read_own
from glider.tools.own.runs import case_table


def own_vehicle(case: Path, wanted: str | None) -> LoadedVehicle | None:
    """The user's own model of a case (or of the case of a run file); None where its vehicle is none.

    InputError or ConfigError where it is one and cannot be used.
    """
    if wanted is not None:
        text, source = vehicle_text(wanted)
        return load_own(Path(source)) if is_own(text) else None
    folder = case if case.is_dir() else case.parent
    if not (folder / CASE_FILE).is_file():
        return None
    try:
        named = case_table(folder).vehicle
    except ValueError:
        return None  # the strict reader of cases says what is wrong
    path = folder / named
    return load_own(path) if path.is_file() and is_own(read_text(path)) else None


def import_template(name: str, vehicle: Path | None, out: Path) -> str:
    """A shipped mapping to be filled in at `out`, of the columns that the model of a vehicle file declares."""
    if vehicle is None:
        return template(name)
    target = _columns_of(vehicle)
    return template(name, target.units, os.path.relpath(vehicle.resolve(), out.resolve().parent))


def import_target(mapping: str) -> Target:
    """The columns into which a mapping file brings a log: those that its vehicle's model declares, if it has one."""
    path = Path(mapping)
    try:
        named = tomllib.loads(read_text(path))["vehicle"] if path.is_file() else ""
    except (ValueError, KeyError):
        return RUN_DATA  # its reader says what is wrong
    for file in (path.parent / str(named), Path(str(named))):
        if file.is_file() and is_own(read_text(file)):
            return _columns_of(file)
    return RUN_DATA


def _columns_of(file: Path) -> Target:
    """The columns that the model of a vehicle file declares; InputError or ConfigError where it is none."""
    declared = read_own(file).declared
    units = {one.column: one.unit for one in declared.inputs} | {one.column: one.unit for one in declared.outputs}
    held = frozenset(one.column for one in declared.inputs if not one.interpolated)
    angles = frozenset(one.column for one in declared.outputs if one.angle)
    return Target(tuple(units), held, angles, file, units)
