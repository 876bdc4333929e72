"""Anybody's CSV log into run data, by a mapping file."""

import fnmatch
import re
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import numpy as np

from glider.hal.units import units_of
from glider.tools.data.errors import InputError
from glider.tools.data.importers import resample
from glider.tools.data.importers.commands import CommandTable, rebuild, says, seen_direction
from glider.tools.data.importers.mapping import (
    RUN_DATA,
    TIME_UNITS,
    ColumnTable,
    CutTable,
    MapTable,
    Target,
    load_map,
    vehicle_of,
)
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.gate import refuse_impossible, wrong_times
from glider.tools.data.runs.origin import moment_text
from glider.tools.data.runs.run import Run

MAX_ROWS = 10_000_000  # of one run: what a mistaken time unit would ask for
CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d*)?))?")
ATMOSPHERE_M = (7.0, 12.0)  # depths that the atmosphere alone would be, from high lakes to the sea
HALF_A_DAY = 43200.0  # s; a time of day that goes back by more is of the next day


@dataclass
class Imported:
    """A case that was written, what of the files is not in it, and what else a person should know of it."""

    folder: Path
    runs: list[Run]
    files: list[Path]
    left_out: list[dict[str, int]]  # by file: rows by the reason why
    notes: list[str] = field(default_factory=list)


def import_csv(paths: list[Path], map_name: str, out: Path, strict: bool = False, into: Target = RUN_DATA) -> Imported:
    """Write the files as the runs of a case; InputError or ConfigError, one line, where that cannot be.

    strict: no row is left out, whatever the mapping allows; into: the columns that its vehicle has.
    """
    mapping, base = load_map(map_name, into)
    if strict:
        text = msgspec.structs.replace(mapping.text, broken_rows="refuse", bad_fields="refuse")
        time = msgspec.structs.replace(mapping.time, not_increasing="refuse")
        mapping = msgspec.structs.replace(mapping, text=text, time=time)
    vehicle, vehicle_text = vehicle_of(mapping, base, out, into)
    sources = [_Source(path, mapping, into) for path in paths]
    runs = [source.run(f"run{number:02d}") for number, source in enumerate(sources)]
    notes = [note for source in sources for note in source.said()]
    if into.vehicle is None:
        refuse_impossible(runs)
    rate = mapping.rate_hz
    if rate is None:
        steps = np.concatenate([np.diff(run.t) for run in runs])
        if not steps.size:
            raise InputError("one row and no rate_hz: the rate is not known", source=paths[0])
        rate = float(f"{1.0 / np.median(steps):.4g}")
        notes.append(f"taken row by row; log_rate_hz = {rate:g} from the times")
    everything = {**mapping.columns, **mapping.extra}
    files = write_case(
        out, runs, vehicle=vehicle, vehicle_text=vehicle_text, site=mapping.site, log_rate_hz=rate,
        water_density_kg_m3=mapping.water_density_kg_m3,
        decimals={name: column.decimals for name, column in everything.items() if column.decimals is not None},
    )  # fmt: skip
    left_out = [{reason: len(lines) for reason, lines in source.left_out.items()} for source in sources]
    return Imported(out, runs, files, left_out, notes)


class _Source:
    """One file on its way to a run: its table, the rows that are good, and why the others are not."""

    def __init__(self, path: Path, mapping: MapTable, into: Target):
        self.path, self.mapping, self.into = path, mapping, into
        self.table = csvfile.read_table(path, mapping.text)
        self.everything = {**mapping.columns, **mapping.extra}
        states = [s for c in mapping.commands.values() for s in (c.to_low, c.to_high) if s is not None]
        asked = [item.source for item in self.everything.values()] + [state.source for state in states]
        for column in [mapping.time.column, *asked]:
            if column not in self.table.header:
                raise InputError(f"no column '{column}'; it has {', '.join(self.table.header)}", source=path)
        self.began: datetime | None = None  # the first row's date and time; without a time zone they are UTC
        self.left_out: dict[str, list[int]] = {}  # lines, by the reason why
        self.notes: list[str] = []
        if self.table.broken:
            self.left_out["broken"] = self.table.broken
        self.numbers, self.keep = self._read()
        self.t = self._times()

    def _leave_out(self, reason: str, rows: np.ndarray) -> None:
        if rows.size:
            self.left_out[reason] = [self.table.line(int(row)) for row in rows]

    def _read(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Every column that is asked for as it was logged, and the rows of which all fields are numbers."""
        keep, bad_fields = np.ones(self.table.rows, dtype=bool), self.mapping.text.bad_fields
        numbers = {}
        for target, item in self.everything.items():
            if bad_fields == "refuse":
                numbers[target] = self.table.numbers(item.source, item.words)
                continue
            numbers[target], bad = self.table.numbers_and_bad(item.source, item.words)
            if bad_fields == "drop":
                keep &= ~bad
            elif bad.any():
                line = self.table.line(int(np.flatnonzero(bad)[0]))
                self.notes.append(f"{target}: {np.count_nonzero(bad)} fields are no numbers, missing now (line {line})")
        self._leave_out("with a field that is no number", np.flatnonzero(~keep))
        return numbers, keep

    def said(self) -> list[str]:
        """What a person should know of this file, a line each."""
        count = sum(map(len, self.left_out.values()))
        reasons = ", ".join(f"{len(lines)} {why} (line {lines[0]})" for why, lines in self.left_out.items())
        total = self.table.rows + len(self.table.broken)
        said = [f"{count} of {total} rows left out: {reasons}"] if count else []
        said += [f"{self.table.joined} rows put together that a line's end had broken"] if self.table.joined else []
        return [f"{self.path}: {note}" for note in [*said, *self.notes]]

    def run(self, name: str) -> Run:
        """The file as a run."""
        mapping = self.mapping
        cut = next((cut for cut in mapping.cut if fnmatch.fnmatch(self.path.name, cut.file)), None)
        if cut is None:
            cut = CutTable()
            if mapping.cut:
                self.notes.append("no [[cut]] is for a file of this name; it is taken whole")
        values = {target: self._converted(target, item) for target, item in self.everything.items()}
        values |= {target: self._rebuilt(target, command, values) for target, command in mapping.commands.items()}
        columns = _rows(self.path, self.t, values, cut, mapping, self.into)
        if mapping.rates_from_attitude:
            rates = resample.body_rates(columns[names.TIME], *(columns[angle] for angle in names.ATTITUDE))
            columns |= {rate: found for rate, found in zip(names.RATES, rates, strict=True) if rate not in columns}
        self._note_atmosphere(columns.get(names.DEPTH))
        numbers = {name: columns[name] for name in (names.TIME, *self.into.columns) if name in columns}
        extra = {
            target: csvfile.as_texts(target, columns[target], item.decimals) for target, item in mapping.extra.items()
        }
        start = "" if self.began is None else moment_text(self.began.timestamp() + cut.start_s)
        return Run(name, self.path, numbers, extra, self.path.name, start)

    def _note_atmosphere(self, depth: np.ndarray | None) -> None:
        """Note a pressure whose least depth is that of the atmosphere, without its reading at the surface."""
        item = self.mapping.columns.get(names.DEPTH)
        if depth is None or item is None or item.unit not in units_of("pressure") or item.zero or item.offset:
            return
        least = float(np.nanmin(depth, initial=np.inf))
        if ATMOSPHERE_M[0] < least < ATMOSPHERE_M[1]:
            hint = "an absolute pressure? `zero` in [columns.depth_m] is what it reads at the surface"
            self.notes.append(f"{names.DEPTH}: never less than {least:.1f} m: {hint}")

    def _converted(self, target: str, item: ColumnTable) -> np.ndarray:
        """Logged numbers in SI; what is outside `valid` is missing."""
        logged = self.numbers[target][self.keep]
        values = item.converted(logged, self.mapping.water_density_kg_m3, target.endswith("_kg"))
        outside = np.count_nonzero(np.isnan(values) & ~np.isnan(logged))
        if outside:
            self.notes.append(f"{target}: {outside} samples outside `valid`, missing now")
        return values

    def _rebuilt(self, target: str, command: CommandTable, values: dict[str, np.ndarray]) -> np.ndarray:
        """A command by its rule, in SI."""
        where = values[command.follows]
        if command.to_low is not None and command.to_high is not None:
            low, high = (says(self.table.texts(one.source), one) for one in (command.to_low, command.to_high))
            direction = (high.astype(np.int64) - low)[self.keep]
        else:
            direction = seen_direction(self.t, where, command.rate or np.inf, command.over_s)
        found = rebuild(command, direction, where)
        ended = f", {found.ended_between} that ended between them" if found.ended_between else ""
        self.notes.append(f"{target}: rebuilt of {command.follows}: {found.to_a_stop} runs to a stop{ended}")
        return found.command

    def _times(self) -> np.ndarray:
        """Time of the good rows from the first, s, strictly increasing; rows whose time does not go on are not good."""
        time, table = self.mapping.time, self.table
        if time.unit == "iso8601":
            logged, per_unit = self._iso_seconds(), 1.0
        elif time.unit == "clock":
            logged, per_unit = self._clock_seconds(), 1.0
        elif self.mapping.text.bad_fields == "refuse":
            logged, per_unit = table.numbers(time.column), TIME_UNITS[time.unit]
        else:
            (logged, _), per_unit = table.numbers_and_bad(time.column), TIME_UNITS[time.unit]
        good = np.flatnonzero(self.keep & ~np.isnan(logged))
        if not good.size:
            raise InputError("no row has a time", source=self.path, column=time.column)
        kept = good[resample.longest_increasing(logged[good])]
        wrong = np.setdiff1d(np.flatnonzero(self.keep), kept)
        # Differences first: whole milliseconds or nanoseconds since long ago are exact, their seconds are not.
        whole = round(1.0 / per_unit)
        t = (logged - logged[kept[0]]) / whole if whole else (logged - logged[kept[0]]) * per_unit
        if wrong.size and time.not_increasing == "refuse":
            back = np.flatnonzero(np.diff(logged[good]) <= 0.0)
            row, what = int(wrong[0]), "a missing time"
            if back.size and not np.isnan(logged[row]):
                before, row = (int(good[back[0] + ahead]) for ahead in (0, 1))
                what = f"time does not go on: {t[row]:g} s after {t[before]:g} s"
            what += ' (time.not_increasing = "drop" leaves such rows out)'
            raise table.error(what, row=row, column=time.column)
        self._leave_out("whose time does not go on", wrong)
        self.keep = np.zeros(table.rows, dtype=bool)
        self.keep[kept] = True
        return np.asarray(t[kept])

    def _iso_seconds(self) -> np.ndarray:
        """Dates and times as seconds from the first, NaN where there is none, (rows,)."""
        table, column = self.table, self.mapping.time.column
        seconds, first = np.full(table.rows, np.nan), None
        for row, text in enumerate(table.texts(column)):
            if not text.strip():
                continue
            try:
                moment = datetime.fromisoformat(text.strip())
                first = first or moment
                self.began = first if first.tzinfo else first.replace(tzinfo=UTC)
                seconds[row] = (moment - first).total_seconds()
            except (ValueError, TypeError):  # no date, or some with and some without a time zone
                if self.mapping.text.bad_fields == "refuse":
                    raise table.error(f"not a date and time: {text[:40]!r}", row=row, column=column) from None
        return seconds

    def _clock_seconds(self) -> np.ndarray:
        """Times of day as seconds, going on through midnight; NaN where there is none, (rows,)."""
        table, column = self.table, self.mapping.time.column
        seconds, days, before = np.full(table.rows, np.nan), 0, 0.0
        for row, text in enumerate(table.texts(column)):
            match = CLOCK.fullmatch(text.strip().replace(",", "."))
            if match is not None:
                hours, minutes, of_minute = match.groups()
                value = 3600.0 * float(hours) + 60.0 * float(minutes) + float(of_minute or 0.0)
                days += value < before - HALF_A_DAY
                seconds[row], before = value + 2.0 * HALF_A_DAY * days, value
            elif text.strip() and self.mapping.text.bad_fields == "refuse":
                raise table.error(f"not a time of day (12:34:56.7): {text[:40]!r}", row=row, column=column)
        return seconds


def _rows(
    path: Path, t: np.ndarray, values: dict[str, np.ndarray], cut: CutTable, mapping: MapTable, into: Target
) -> dict[str, np.ndarray]:
    """The run's columns, t_s first: even means at rate_hz, or the rows as they are."""
    end = t[-1] if cut.end_s is None else cut.end_s
    wrong = None if names.OIL in values else wrong_times(t[(t >= cut.start_s) & (t <= end)])
    if wrong is not None:
        raise InputError(wrong, source=path, column=mapping.time.column)
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
        if name in into.held:
            columns[name] = resample.zero_order_hold(t, column, grid + cut.start_s)
            continue
        angle = name in into.angles
        mean = resample.means(column, bins, count, angle)
        columns[name] = resample.fill_gaps(mean, grid + cut.start_s, t, column, mapping.max_gap_s, angle)
    return columns
