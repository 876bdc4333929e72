"""Of which flights the runs of a case are, when and where they began, and fixes at the surface: files beside them."""

import datetime as dt
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.csvfile import CsvTable
from glider.tools.data.runs.run import Run

ORIGIN_FILE = "origin.csv"  # run, when and where it began, of which files
FIXES_FILE = "fixes.csv"  # of the whole mission: when, where


@dataclass(frozen=True)
class Origin:
    """When and where a run began."""

    start: float  # s since 1970-01-01 UTC
    latitude: float  # deg
    longitude: float  # deg
    variation: float  # magnetic, rad, to be added to yaw
    glider: str


def read_origins(folder: Path, runs: Sequence[Run]) -> list[Origin]:
    """When and where each run began, by the file that an import left in the case; InputError where it does not say."""
    path = folder / ORIGIN_FILE
    if not path.is_file():
        raise InputError(f"no {ORIGIN_FILE}: when and where its runs began is not known", source=folder)
    table = csvfile.read_table(path)
    _require(table, "run", "start_utc", "glider", "latitude", "longitude", "magnetic_variation_rad")
    starts = _moments(table, "start_utc")
    numbers = [table.numbers(name) for name in ("latitude", "longitude", "magnetic_variation_rad")]
    found = {}
    for row, (name, glider) in enumerate(zip(table.texts("run"), table.texts("glider"), strict=True)):
        latitude, longitude, variation = (float(column[row]) for column in numbers)
        found[name] = Origin(float(starts[row]), latitude, longitude, variation, glider)
    for run in runs:
        if run.name not in found:
            raise InputError(f"{run.name} is not in it", source=path)
    return [found[run.name] for run in runs]


def flight_columns(runs: Sequence[Run]) -> dict[str, list[str]]:
    """Of which flights the runs are, as columns of ORIGIN_FILE."""
    return {
        "run": [run.name for run in runs],
        "start_utc": [run.start_utc for run in runs],
        "files": [run.source for run in runs],
    }


def set_flights(folder: Path, runs: Sequence[Run]) -> None:
    """Set `source` and `start_utc` of runs by the case's ORIGIN_FILE; where it does not say, they stay empty."""
    try:
        table = csvfile.read_table(folder / ORIGIN_FILE)
        _require(table, "run", "start_utc", "files")
    except InputError:  # a file that only read_origins needs
        return
    rows = zip(table.texts("run"), table.texts("start_utc"), table.texts("files"), strict=True)
    said = {name: (files, start) for name, start, files in rows}
    for run in runs:
        run.source, run.start_utc = said.get(run.name, ("", ""))


def flights_of(runs: Iterable[Run]) -> dict[str, str]:
    """Run -> its flight in words, of those that know it."""
    return {run.name: run.flight for run in runs if run.flight}


def with_flight(name: str, flights: Mapping[str, str]) -> str:
    """'run05 (w06.mcap, 2026-11-20)', or the run's name alone."""
    return f"{name} ({flights[name]})" if name in flights else name


def read_fixes(folder: Path) -> np.ndarray | None:
    """Fixes of a case in the order of their times, (n, 3): s since 1970-01-01 UTC, latitude, longitude, deg.

    None where the case has no such file; InputError where it is not usable.
    """
    path = folder / FIXES_FILE
    if not path.is_file():
        return None
    table = csvfile.read_table(path)
    _require(table, "time_utc", "latitude", "longitude")
    times = _moments(table, "time_utc")
    table.require_increasing("time_utc", times)
    found = [times]
    for column, largest in (("latitude", 90.0), ("longitude", 360.0)):
        values = table.numbers(column)
        wrong = np.flatnonzero(~(np.abs(values) <= largest))
        if wrong.size:
            raise table.error(f"no sample, or beyond {largest:g}", row=int(wrong[0]), column=column)
        found.append(values)
    return np.column_stack(found)


def fix_columns(fixes: np.ndarray) -> dict[str, list[str]]:
    """Fixes (n, 3) as read_fixes gives them, in any order, as columns of FIXES_FILE; of several at one time one."""
    fixes = fixes[np.lexsort(fixes.T[::-1])]
    fixes = fixes[np.unique(np.round(fixes[:, 0], 3), return_index=True)[1]]
    return {
        "time_utc": [moment_text(t) for t in fixes[:, 0]],
        "latitude": csvfile.as_texts("latitude", fixes[:, 1], 6),
        "longitude": csvfile.as_texts("longitude", fixes[:, 2], 6),
    }


def moment_text(seconds: float) -> str:
    """Seconds since 1970-01-01 UTC as ISO 8601, to the millisecond."""
    moment = dt.datetime.fromtimestamp(round(seconds, 3), dt.UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _moments(table: CsvTable, column: str) -> np.ndarray:
    """A column of times, s since 1970-01-01 UTC, (rows,)."""
    found = np.empty(table.rows)
    for row, text in enumerate(table.texts(column)):
        try:
            moment = dt.datetime.fromisoformat(text)
            found[row] = (moment if moment.tzinfo else moment.replace(tzinfo=dt.UTC)).timestamp()
        except ValueError:
            raise table.error(f"not a time: {text[:40]!r}", row=row, column=column) from None
    return found


def _require(table: CsvTable, *columns: str) -> None:
    for column in columns:
        if column not in table.header:
            raise InputError("no such column", source=table.path, column=column)
