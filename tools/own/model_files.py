"""Where a vehicle file is written to another folder, what it needs there: its model's file and the modules beside it.

A program is no file to copy, nor is one that lies elsewhere: the vehicle file names the folder then (`model_folder`).
"""

import os
from pathlib import Path
from typing import Any

from glider.tools.data.files import write_files
from glider.tools.own.load import PROGRAM, LoadedVehicle
from glider.tools.own.neighbours import neighbours


def moved_to(out: Path, vehicle: LoadedVehicle, tables: dict[str, Any]) -> tuple[dict[Path, bytes], dict[str, Any]]:
    """Files beside a vehicle's file in the folder `out`, and its tables, which name its model as it is found there."""
    folder, out, source = vehicle.folder.resolve(), out.resolve(), vehicle.source
    wanted = vehicle.file.model
    tables = {key: value for key, value in tables.items() if key != "model_folder"}
    if folder == out:
        return {}, tables
    if source is not None and source.parent == folder:
        return {out / one.relative_to(folder): one.read_bytes() for one in (source, *neighbours(source))}, tables
    file = folder / (wanted if wanted.endswith(".fmu") else f"{wanted.partition(':')[0]}.py")
    if wanted.startswith(PROGRAM) or file.is_file():  # else it is installed
        tables["model_folder"] = os.path.relpath(folder, out)
    return {}, tables


def write_with_folders(files: dict[Path, bytes]) -> None:
    """Write files, some of them in folders that are not there yet."""
    for one in files:
        one.parent.mkdir(parents=True, exist_ok=True)
    write_files(files)
