"""Where a vehicle file is written to another folder, what it needs there: its model's file and the modules beside it.

A program is no file to copy: its vehicle file names the folder in which it runs (`model_folder`).
"""

import os
from pathlib import Path
from typing import Any

from glider.tools.own.load import PROGRAM, LoadedVehicle
from glider.tools.own.neighbours import neighbours


def moved_to(out: Path, vehicle: LoadedVehicle, tables: dict[str, Any]) -> tuple[dict[Path, bytes], dict[str, Any]]:
    """Files beside a vehicle's file in the folder `out`, and its tables, which name its model as it is found there."""
    folder, out, source = vehicle.folder.resolve(), out.resolve(), vehicle.source
    tables = {key: value for key, value in tables.items() if key != "model_folder"}
    if folder == out:
        return {}, tables
    if vehicle.file.model.startswith(PROGRAM):
        return {}, tables | {"model_folder": os.path.relpath(folder, out)}
    if source is None or source.parent != folder:  # installed
        return {}, tables
    return {out / one.relative_to(folder): one.read_bytes() for one in (source, *neighbours(source))}, tables
