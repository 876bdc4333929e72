"""Logs of messages into run data, by a mapping file: topic and field of a message -> column, unit, scale, sign.

What ROS 2 bags and ArduSub's logs have in common: each topic has times of its own. A run has even rows at `rate_hz`,
each the mean of the samples nearest to it; a command holds from its message until the next one (docs/how-to/import.md).
"""

import fnmatch
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from glider.hal.strict import Table
from glider.tools.data.errors import InputError
from glider.tools.data.importers import resample
from glider.tools.data.importers.csvlog import MAX_ROWS, Imported
from glider.tools.data.importers.mapping import (
    RUN_DATA,
    ConversionTable,
    CutTable,
    Target,
    check_columns,
    check_common,
    decode_checked,
    load_mapping,
    vehicle_of,
)
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.gate import refuse_impossible, wrong_times
from glider.tools.data.runs.origin import moment_text
from glider.tools.data.runs.run import Run

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=300)]
EULER = ("roll", "pitch", "yaw")  # last parts of a field that are computed of a quaternion x, y, z, w
FOLDER, TEMPLATE = "stream_maps", "stream_template.toml"


class StreamColumn(ConversionTable, kw_only=True):
    """[columns.NAME] or [extra.NAME]: the topic and the field of its messages that a column comes from."""

    topic: Name
    field: Name


class StreamMap(Table, kw_only=True):
    """A mapping file."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    vehicle: Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
    rate_hz: Annotated[float, msgspec.Meta(gt=0.0, le=10_000.0)]
    columns: Annotated[dict[str, StreamColumn], msgspec.Meta(min_length=1)]
    # of a user's model only where a pressure or a volume is turned into a depth or a mass
    water_density_kg_m3: Annotated[float, msgspec.Meta(ge=900.0, le=1300.0)] | None = None
    extra: dict[str, StreamColumn] = msgspec.field(default_factory=dict)
    site: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    frame: Literal["enu", "ned"] = "enu"  # of quaternions: body x forward, y left, z up in ENU; or y right, z down
    time: Literal["header", "receipt"] = "header"  # stamp of the message, or when it was recorded
    max_gap_s: Annotated[float, msgspec.Meta(ge=0.0)] = 0.0
    rates_from_attitude: bool = False
    cut: tuple[CutTable, ...] = ()


def _check(mapping: StreamMap, source: str, target: Target) -> None:
    check_columns(mapping.columns, source, target)
    check_common(mapping, source, target)


def decode_stream_map(text: str, source: str, target: Target = RUN_DATA) -> StreamMap:
    """A mapping file's text; raises ConfigError with file, line and key."""
    by_name = {"columns": StreamColumn, "extra": StreamColumn}
    return decode_checked(text, source, StreamMap, partial(_check, target=target), by_name)


@dataclass
class Samples:
    """Numbers of one topic and field: t (n,) s on the log's clock, values (n,)."""

    t: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def sorted(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Times, values, and how many were left out because their time does not go on."""
        t, values = np.array(self.t), np.array(self.values)
        known = np.isfinite(t)
        t, values = t[known], values[known]
        if not t.size:
            return t, values, len(self.t)
        kept = resample.longest_increasing(t)
        return t[kept], values[kept], len(self.t) - len(kept)


@dataclass
class Stream:
    """What a reader took of one file: samples by (topic, field), the Unix time of t = 0 where it is known, notes."""

    samples: dict[tuple[str, str], Samples]
    epoch_s: float | None = None
    notes: list[str] = field(default_factory=list)
    topics: tuple[str, ...] = ()  # that the file has


Reader = Callable[[Path, StreamMap, bool], Stream]


def import_streams(
    paths: list[Path], map_name: str, out: Path, read: Reader, accept_cut: bool = False, into: Target = RUN_DATA
) -> Imported:
    """Write files as the runs of a case; InputError or ConfigError, one line, where that cannot be.

    read(path, mapping, accept_cut): of one file the samples that the mapping asks for; into: the columns that its
    vehicle has.
    """
    mapping, base = load_mapping(map_name, FOLDER, partial(decode_stream_map, target=into))
    vehicle, vehicle_text = vehicle_of(mapping, base, out, into)
    runs, notes = [], []
    for number, path in enumerate(paths):
        stream = read(path, mapping, accept_cut)
        run, said = run_of_stream(path, f"run{number:02d}", stream, mapping, into)
        runs.append(run)
        notes += [f"{path}: {note}" for note in [*stream.notes, *said]]
    if into.vehicle is None:
        refuse_impossible(runs)
    everything = {**mapping.columns, **mapping.extra}
    files = write_case(
        out, runs, vehicle=vehicle, vehicle_text=vehicle_text, site=mapping.site, log_rate_hz=mapping.rate_hz,
        water_density_kg_m3=mapping.water_density_kg_m3,
        decimals={name: column.decimals for name, column in everything.items() if column.decimals is not None},
    )  # fmt: skip
    return Imported(out, runs, files, [{} for _ in runs], notes)


def run_of_stream(
    path: Path, name: str, stream: Stream, mapping: StreamMap, into: Target = RUN_DATA
) -> tuple[Run, list[str]]:
    """The samples of a file as a run with even rows, and what a person should know of it."""
    wanted: Mapping[str, StreamColumn] = {**mapping.columns, **mapping.extra}
    taken, notes = {}, []
    for target, column in wanted.items():
        t, logged, late = stream.samples.get((column.topic, column.field), Samples()).sorted()
        if not t.size:
            known = ", ".join(stream.topics) or "none"
            raise InputError(f"no message of topic '{column.topic}'; it has {known}", source=path, column=target)
        values = column.converted(logged, mapping.water_density_kg_m3, target.endswith("_kg"))
        outside = np.count_nonzero(np.isnan(values) & ~np.isnan(logged))
        notes += [f"{target}: {late} samples left out: their time does not go on"] if late else []
        notes += [f"{target}: {outside} samples outside `valid`, missing now"] if outside else []
        taken[target] = (t, values)
    first = min(t[0] for t, _ in taken.values())
    cut = next((one for one in mapping.cut if fnmatch.fnmatch(path.name, one.file)), CutTable())
    begin = first + cut.start_s
    end = max(t[-1] for t, _ in taken.values()) if cut.end_s is None else first + cut.end_s
    count = int(np.floor((end - begin) * mapping.rate_hz + 1e-6)) + 1
    if count > MAX_ROWS:
        raise InputError(f"{count} rows at {mapping.rate_hz:g} Hz: are the times right?", source=path)
    if count < 2:
        raise InputError(f"nothing between {cut.start_s:g} s and {end - first:g} s", source=path)
    grid = np.arange(count) / mapping.rate_hz
    columns = {names.TIME: grid}
    for target, (t, values) in taken.items():
        if target in into.held:
            columns[target] = resample.zero_order_hold(t, values, grid + begin)
            continue
        angle = target in into.angles
        mean = resample.means(values, resample.bins_of(t, begin, mapping.rate_hz), count, angle)
        columns[target] = resample.fill_gaps(mean, grid + begin, t, values, mapping.max_gap_s, angle)
    wrong = wrong_times(grid)
    if wrong is not None:
        raise InputError(wrong, source=path)
    if mapping.rates_from_attitude:
        rates = resample.body_rates(grid, *(columns[angle] for angle in names.ATTITUDE))
        columns |= {rate: found for rate, found in zip(names.RATES, rates, strict=True) if rate not in columns}
    numbers = {target: columns[target] for target in (names.TIME, *into.columns) if target in columns}
    extra = {target: csvfile.as_texts(target, columns[target], item.decimals) for target, item in mapping.extra.items()}
    start = "" if stream.epoch_s is None else moment_text(stream.epoch_s + begin)
    return Run(name, path, numbers, extra, path.name, start), notes
