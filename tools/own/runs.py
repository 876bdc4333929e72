"""Cases of a user's vehicle: the columns that its model declares, and no others."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from glider.hal.strict import Table, decode
from glider.tools.data.errors import InputError
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.case import CASE_FILE, run_files
from glider.tools.data.runs.columns import TIME
from glider.tools.data.runs.gate import misnamed, wrong_heading
from glider.tools.data.runs.run import run_name
from glider.tools.data.sources import read_text
from glider.tools.own.declare import Declaration

MIN_ROWS = 5
UNNAMED = "-"  # vehicle of a case without case.toml


class OwnCaseTable(Table):
    """case.toml of a vehicle of one's own."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    vehicle: Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
    site: str = ""
    log_rate_hz: Annotated[float, msgspec.Meta(gt=0.0)] | None = None
    water_density_kg_m3: float | None = None
    motion_capture: bool | None = None
    runs: Annotated[int, msgspec.Meta(ge=1)] | None = None


@dataclass(frozen=True)
class OwnRun:
    """A run as the model sees it; missing outputs are NaN."""

    name: str
    t: np.ndarray  # (rows,) s
    inputs: np.ndarray  # (rows, inputs)
    outputs: np.ndarray  # (rows, outputs)
    path: Path | None = None
    columns: tuple[str, ...] = ()  # of its file

    def __post_init__(self) -> None:
        for name in ("t", "inputs", "outputs"):  # kernels are compiled for rows that stand one behind the other
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.float64))


def case_table(folder: Path) -> OwnCaseTable:
    """case.toml, or what it is taken for where runs lie without one: --vehicle names their vehicle then.

    InputError or ConfigError where there is nothing of a case or it cannot be read.
    """
    path = folder / CASE_FILE
    if not folder.is_dir():
        raise InputError("not a folder" if folder.exists() else "no such folder", source=folder)
    if not path.is_file():
        if run_files(folder):
            return OwnCaseTable(format=1, vehicle=UNNAMED)
        raise InputError(f"neither {CASE_FILE} nor run*.csv in this folder", source=folder)
    return decode(read_text(path), OwnCaseTable, str(path))


def load_own_runs(folder: Path, declared: Declaration) -> list[OwnRun]:
    """All runs of a case; InputError with file, line and column where one cannot be used."""
    table, files = case_table(folder), run_files(folder)
    if not files or (table.runs is not None and len(files) != table.runs):
        message = f"{table.runs or 'some'} expected, {len(files)} files run*.csv found"
        raise InputError(message, source=folder / CASE_FILE, column="runs")
    runs = [load_own_run(path, declared) for path in files]
    known = [one.column for one in declared.outputs]
    for run in runs:
        found = misnamed(known, run.columns, [other.columns for other in runs if other is not run])
        if found is not None:
            raise InputError(found[1], source=run.path, column=found[0])
    return runs


def load_own_run(path: Path, declared: Declaration) -> OwnRun:
    """One run by the columns that a model declares."""
    table = csvfile.read_table(path)
    if TIME not in table.header:
        raise table.error("the column is missing", column=TIME)
    t = table.numbers(TIME)
    table.require_increasing(TIME, t)
    if len(t) < MIN_ROWS:
        raise InputError(f"{MIN_ROWS} rows at least are needed, got {len(t)}", source=path)
    inputs = np.empty((len(t), len(declared.inputs)))
    for n, one in enumerate(declared.inputs):
        if one.column not in table.header:
            raise table.error(f"the model's input {one.name} has no such column", column=one.column)
        inputs[:, n] = _filled(t, table.numbers(one.column), one.interpolated, table, one.column)
    outputs = np.full((len(t), len(declared.outputs)), np.nan)
    for n, output in enumerate(declared.outputs):
        if output.column in table.header:
            outputs[:, n] = table.numbers(output.column)
            read = outputs[np.isfinite(outputs[:, n]), n]
            reason = wrong_heading(read) if output.angle and len(read) else None
            if reason is not None:
                raise table.error(reason, column=output.column)
    if not np.isfinite(outputs).any():
        wanted = ", ".join(one.column for one in declared.outputs)
        raise InputError(f"no column of the model's outputs: {wanted}", source=path)
    return OwnRun(run_name(path), t, inputs, outputs, path, tuple(table.header))


def _filled(t: np.ndarray, values: np.ndarray, interpolated: bool, table, column: str) -> np.ndarray:
    """An input with missing samples held from before, or drawn in straight; one that is held has to begin with one."""
    missing = np.isnan(values)
    if interpolated and not missing.all():
        return np.interp(t, t[~missing], values[~missing])
    if missing[0]:
        raise table.error("the first value of an input is missing", row=0, column=column)
    last = np.maximum.accumulate(np.where(missing, 0, np.arange(len(values))))
    return values[last]
