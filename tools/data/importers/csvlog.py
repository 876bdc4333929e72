"""Anybody's CSV log into run data, by a mapping file."""

import fnmatch
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from firmware.model.library import shipped
from tools.data.errors import InputError
from tools.data.importers import resample
from tools.data.importers.mapping import TIME_UNITS, ColumnTable, CutTable, MapTable, load_map
from tools.data.runs import columns as names
from tools.data.runs import csvfile
from tools.data.runs.case import write_case
from tools.data.runs.run import Run
from tools.data.sources import name_or_path

MAX_ROWS = 10_000_000  # of one run: what a mistaken time unit would ask for


@dataclass
class Imported:
    """A case that was written, and what a person should know of it."""

    folder: Path
    runs: list[Run]
    files: list[Path]
    notes: list[str] = field(default_factory=list)


def import_csv(paths: list[Path], map_name: str, out: Path) -> Imported:
    """Write the files as the runs of a case; InputError or ConfigError, one line, where that cannot be."""
    mapping, base = load_map(map_name)
    vehicle, vehicle_text = mapping.vehicle, None
    if vehicle not in shipped("model/vehicles"):
        vehicle_text, _ = name_or_path(vehicle, "vehicle", "model/vehicles", base=base)
    notes: list[str] = []
    runs = [import_run(path, mapping, f"run{number:02d}", notes) for number, path in enumerate(paths)]
    rate = mapping.rate_hz
    if rate is None:
        steps = np.concatenate([np.diff(run.t) for run in runs])
        if not steps.size:
            raise InputError("one row and no rate_hz: the rate is not known", source=paths[0])
        rate = float(f"{1.0 / np.median(steps):.4g}")
        notes.append(f"taken row by row; log_rate_hz = {rate:g} from the times")
    everything = {**mapping.columns, **mapping.extra}
    decimals = {name: column.decimals for name, column in everything.items() if column.decimals is not None}
    files = write_case(
        out,
        runs,
        vehicle=vehicle,
        vehicle_text=vehicle_text,
        site=mapping.site,
        log_rate_hz=rate,
        water_density_kg_m3=mapping.water_density_kg_m3,
        decimals=decimals,
    )
    return Imported(out, runs, files, notes)


def import_run(path: Path, mapping: MapTable, name: str, notes: list[str]) -> Run:
    """One file as a run; lines worth saying are added to `notes`."""
    text = mapping.text
    table = csvfile.read_table(
        path,
        csvfile.Dialect(
            delimiter=text.delimiter,
            decimal=text.decimal,
            encoding=text.encoding,
            skip_lines=text.skip_lines,
            header=text.header,
            missing=frozenset(text.missing),
            drop_broken_rows=text.broken_rows == "drop",
        ),
    )
    if table.dropped:
        notes.append(f"{path}: {table.dropped} broken rows left out")
    everything = {**mapping.columns, **mapping.extra}
    for column in [mapping.time.column, *(item.source for item in everything.values())]:
        if column not in table.header:
            raise InputError(f"no column '{column}'; it has {', '.join(table.header)}", source=path)
    t, keep = _times(table, mapping, path, notes)
    cut = next((cut for cut in mapping.cut if fnmatch.fnmatch(path.name, cut.file)), None)
    if cut is None:
        cut = CutTable()
        if mapping.cut:
            notes.append(f"{path}: no [[cut]] is for a file of this name; it is taken whole")
    density = mapping.water_density_kg_m3
    values = {
        target: _converted(table.numbers(item.source)[keep], item, density) for target, item in everything.items()
    }
    columns = _rows(path, t, values, cut, mapping)
    if mapping.rates_from_attitude:
        rates = resample.body_rates(columns[names.TIME], *(columns[angle] for angle in names.ATTITUDE))
        columns |= {rate: found for rate, found in zip(names.RATES, rates, strict=True) if rate not in columns}
    numbers = {target: columns[target] for target in names.in_order(list(columns)) if target in names.KNOWN}
    extra = {target: csvfile.as_texts(target, columns[target], item.decimals) for target, item in mapping.extra.items()}
    return Run(name=name, path=path, columns=numbers, extra=extra)


def _times(table: csvfile.Table, mapping: MapTable, path: Path, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Time from the first row, s, strictly increasing, and the rows that have one."""
    column = mapping.time.column
    if mapping.time.unit == "iso8601":
        t = _iso_seconds(table, column)
    else:
        logged = table.numbers(column)
        known = logged[~np.isnan(logged)]
        # Differences first: whole milliseconds or nanoseconds since long ago are exact, their seconds are not.
        per_second = round(1.0 / TIME_UNITS[mapping.time.unit])
        t = logged - (known[0] if known.size else 0.0)
        t = t / per_second if per_second else t * TIME_UNITS[mapping.time.unit]
    ahead = np.concatenate(([-np.inf], np.maximum.accumulate(np.where(np.isnan(t), -np.inf, t))[:-1]))
    keep = t > ahead
    wrong = np.flatnonzero(~keep)
    if wrong.size:
        row = int(wrong[0])
        if mapping.time.not_increasing == "refuse":
            what = "a missing time" if np.isnan(t[row]) else f"time does not go on: {t[row]:g} s after {ahead[row]:g} s"
            raise table.error(f'{what} (time.not_increasing = "drop" leaves such rows out)', row=row, column=column)
        notes.append(f"{path}: {wrong.size} rows left out, their time does not go on")
    if not keep.any():
        raise InputError("no row has a time", source=path, column=column)
    return t[keep], keep


def _iso_seconds(table: csvfile.Table, column: str) -> np.ndarray:
    seconds = np.full(table.rows, np.nan)
    first: datetime | None = None
    for row, text in enumerate(table.texts(column)):
        if not text.strip():
            continue
        try:
            moment = datetime.fromisoformat(text.strip())
            first = first or moment
            seconds[row] = (moment - first).total_seconds()
        except (ValueError, TypeError):  # no date, or some with and some without a time zone
            raise table.error(f"not a date and time: {text[:40]!r}", row=row, column=column) from None
    return seconds


def _converted(logged: np.ndarray, item: ColumnTable, density: float) -> np.ndarray:
    """Logged numbers in SI; what is outside `valid` is missing."""
    values = item.factor(density) * (logged - item.zero) + item.offset
    if item.valid is not None:
        values[(values < item.valid[0]) | (values > item.valid[1])] = np.nan
    return values


def _rows(
    path: Path, t: np.ndarray, values: dict[str, np.ndarray], cut: CutTable, mapping: MapTable
) -> dict[str, np.ndarray]:
    """The run's columns, t_s first: even means at rate_hz, or the rows as they are."""
    end = t[-1] if cut.end_s is None else cut.end_s
    if mapping.rate_hz is None:
        use = (t >= cut.start_s) & ((t < end) | (cut.end_s is None))
        if not use.any():
            raise InputError(f"nothing between {cut.start_s:g} s and {end:g} s", source=path)
        return {names.TIME: t[use] - cut.start_s, **{name: column[use] for name, column in values.items()}}
    count = round((end - cut.start_s) * mapping.rate_hz) + (cut.end_s is None)
    if t[0] > end or cut.start_s > t[-1] or count < 1:
        raise InputError(f"nothing between {cut.start_s:g} s and {end:g} s", source=path)
    if count > MAX_ROWS:
        raise InputError(f"{count} rows at {mapping.rate_hz:g} Hz: is the time's unit right?", source=path)
    bins = resample.bins_of(t, cut.start_s, mapping.rate_hz)
    grid = np.arange(count) / mapping.rate_hz
    columns = {names.TIME: grid}
    for name, column in values.items():
        angle = name in names.WRAPPING
        mean = resample.means(column, bins, count, angle)
        columns[name] = resample.fill_gaps(mean, grid + cut.start_s, t, column, mapping.max_gap_s, angle)
    return columns
