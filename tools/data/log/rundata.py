"""Onboard log to run data and back, bit for bit.

The tick record's fields that run data knows become its columns; the others (references, lateness, ...) follow under
their own names, which readers of run data keep and ignore; a simulation's truth follows as `true_*`.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs

from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import decode_vehicle
from glider.firmware.telemetry import REPLAYED
from glider.hal.recorder import disk
from glider.hal.recorder.logfile import LogFile
from glider.hal.recorder.schema import Field, RecordSpec
from glider.hal.strict import Table, decode
from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import Log, Topic
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.case import (
    CASE_FILE,
    VEHICLE_FILE,
    Case,
    CaseTable,
    DisturbancePart,
    SensorsPart,
    case_text,
    write_case,
)
from glider.tools.data.runs.overview import unit_of
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import name_or_path

TICK, TRUTH = "/tick", "/truth"
EXTRA_FILE = "extra.csv"  # an imported run's columns that are no numbers, behind its time
# Metadata of a log that was made from run data: there a column of gaps was recorded, elsewhere it was not.
SOURCE, RUN_DATA = "source", "run data"
FLIGHT_FILE, FLIGHT_START = "flight_file", "flight_start_utc"  # of the flight that the run data were made of


@dataclass
class Exported:
    """Run data out of a log, and what a person should know of it; of a case, `files` and `rows` of all its runs."""

    run: Run
    notes: list[str] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    rows: int = 0


def _spread(topic: Topic) -> dict[str, np.ndarray]:
    """The topic's columns; an array field becomes name_0, name_1, ..."""
    columns: dict[str, np.ndarray] = {}
    for item in topic.fields:
        values = topic.column(item.name)
        if item.count:
            columns |= {f"{item.name}_{place}": values[:, place] for place in range(item.count)}
        else:
            columns[item.name] = values
    return columns


def _increasing(t: np.ndarray) -> np.ndarray:
    """Where time is there and greater than at every row before, shape of `t`."""
    known = np.where(np.isfinite(t), t, -np.inf)
    before = np.concatenate(([-np.inf], np.maximum.accumulate(known)[:-1]))
    return known > before


# What is of one sample, and where its time is.
_SAMPLES = {
    "imu_time_s": (*names.ATTITUDE, *names.RATES), "beacon_time_s": (names.DEPTH, "pressure_pa", "temperature_c"),
    "slider_time_s": ("slider_m",), "plunger_time_s": ("ballast_kg",),
}  # fmt: skip


def _at_their_times(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Samples in the rows of the times when they were taken; a tick holds those that had come by then, some of them
    milliseconds old. Of two that fall into one row the later stays.
    """
    t, moved = columns[names.TIME], dict(columns)
    for time, of_a_sample in _SAMPLES.items():
        if time not in columns:
            continue
        middles = 0.5 * (t[1:] + t[:-1])
        for name in set(of_a_sample) & set(columns):
            seen = np.flatnonzero(np.isfinite(columns[name]) & np.isfinite(columns[time]))
            moved[name] = np.full(len(t), np.nan)
            moved[name][np.searchsorted(middles, columns[time][seen] - 1e-9)] = columns[name][seen]
    return moved


def _aligned_truth(truth: Topic, times_ns: np.ndarray) -> dict[str, np.ndarray]:
    """The truth's columns at the ticks' times; NaN where a tick has none."""
    order = np.argsort(truth.times_ns, kind="stable")
    sorted_ns = truth.times_ns[order]
    place = np.searchsorted(sorted_ns, times_ns, side="right") - 1
    there = (place >= 0) & (sorted_ns[np.maximum(place, 0)] == times_ns)
    rows = order[np.maximum(place, 0)]
    columns = {}
    for name, values in _spread(truth).items():
        if name != names.TIME:
            columns[name if name.startswith("true_") else f"true_{name}"] = np.where(there, values[rows], np.nan)
    return columns


def run_of(log: Log, name: str = "run00") -> Exported:
    """A log's run, native rate; InputError where it holds no tick records."""
    tick = log.topics.get(TICK)
    if tick is None or tick.data is None or names.TIME not in [item.name for item in tick.fields]:
        raise InputError(f"holds no {TICK} records with {names.TIME}", source=log.path)
    notes = []
    columns = _spread(tick)
    if log.metadata.get(SOURCE) != RUN_DATA:  # what a replay needs is not run data
        columns = {column: values for column, values in columns.items() if column not in REPLAYED}
    keep = _increasing(columns[names.TIME])
    if not keep.any():
        raise InputError(f"holds no {TICK} record with a time", source=log.path)
    if not keep.all():
        notes.append(f"{np.count_nonzero(~keep)} records left out: their time does not go on")
    columns = {column: values[keep] for column, values in columns.items()}
    if log.metadata.get(SOURCE) != RUN_DATA:
        columns = _at_their_times(columns)
    truth = log.topics.get(TRUTH)
    if truth is not None and truth.data is not None and truth.count:
        columns |= _aligned_truth(truth, tick.times_ns[keep])
    numbers: dict[str, np.ndarray] = {}
    extra: dict[str, list[str]] = {}
    for column in names.in_order(list(columns)):
        values = columns[column]
        if column not in names.KNOWN:
            extra[column] = _exact_texts(values)
            continue
        infinite = np.isinf(values)
        if infinite.any():
            values = np.where(infinite, np.nan, values)
            notes.append(f"{column}: {np.count_nonzero(infinite)} infinite values left empty")
        if np.isnan(values).all() and log.metadata.get(SOURCE) != RUN_DATA:
            continue
        numbers[column] = np.array(values)
    if EXTRA_FILE in log.attachments:
        table = csvfile.CsvTable(log.path / EXTRA_FILE, log.attachments[EXTRA_FILE].encode("utf-8"))
        if table.rows == tick.count:
            for column in table.header[1:]:
                words = table.texts(column)
                extra[column] = [words[row] for row in np.flatnonzero(keep)]
        else:
            notes.append(f"{', '.join(table.header[1:])} left out: they are no numbers, and the log is cut")
    source, start = log.metadata.get(FLIGHT_FILE, log.path.name), log.metadata.get(FLIGHT_START, log.began)
    return Exported(Run(name, None, numbers, extra, source, start), notes)


def export_case(log: Log, folder: Path, *, vehicle: str | None = None, more: Sequence[Log] = ()) -> Exported:
    """Write a log as a case's first run, `more` as those after it; `vehicle` stands in for the log's own vehicle file.

    InputError where the log does not say what a case must (and nothing can stand in), where one of `more` says
    something else, or where the folder holds a case.
    """
    exported = run_of(log)
    vehicle_name, vehicle_text = _vehicle(log, vehicle)
    runs = [exported.run]
    for other in more:
        for key in ("site", "log_rate_hz", "water_density_kg_m3"):
            if other.metadata.get(key) != log.metadata.get(key):
                here, there = (one.metadata.get(key, "not given") for one in (log, other))
                raise InputError(
                    f"{key} {there}, in {log.path.name} {here}: one case has one {key}; export the two apart, "
                    "each with an --out of its own", source=other.path,
                )  # fmt: skip
        if _vehicle(other, vehicle) != (vehicle_name, vehicle_text):
            raise InputError(f"another vehicle than that of {log.path.name}", source=other.path)
        found = run_of(other, f"run{len(runs):02d}")
        runs.append(found.run)
        exported.notes += [f"{other.path.name}: {note}" for note in found.notes]
    rate = _number(log, "log_rate_hz")
    if rate is None:
        if exported.run.rows < 2:
            raise InputError("one record and no log_rate_hz: the rate is not known", source=log.path)
        rate = float(f"{1.0 / np.median(np.diff(exported.run.t)):.4g}")
        exported.notes.append(f"the log does not give log_rate_hz; {rate:g} from its times")
    density = _number(log, "water_density_kg_m3")
    if density is None:
        raise InputError("the log does not give water_density_kg_m3", source=log.path)
    table = None
    if CASE_FILE in log.attachments:
        table = decode(log.attachments[CASE_FILE], CaseTable, f"{log.path}: {CASE_FILE}")
    exported.files = write_case(
        folder,
        runs,
        vehicle=vehicle_name,
        vehicle_text=vehicle_text,
        site=log.metadata.get("site", ""),
        log_rate_hz=rate,
        water_density_kg_m3=density,
        motion_capture=table.motion_capture if table else None,
        sensors=table.sensors if table else None,
        disturbance=table.disturbance if table else None,
    )
    exported.rows = sum(run.rows for run in runs)
    return exported


def _vehicle(log: Log, wanted: str | None) -> tuple[str, str | None]:
    """The vehicle as case.toml names it, and the text to write beside it if it is not a shipped one."""
    library = shipped("model/vehicles")
    text = log.attachments.get(VEHICLE_FILE)
    if wanted is not None:
        text, source = name_or_path(wanted, "vehicle", "model/vehicles")
        decode_vehicle(text, source)
    for name, shipped_text in library.items():
        if text == shipped_text:
            return name, None
    if text is not None:
        return VEHICLE_FILE, text
    name = log.metadata.get("vehicle", "")
    if name in library:
        return name, None
    raise InputError("the log holds no vehicle file: name one with --vehicle", source=log.path)


def _number(log: Log, key: str) -> float | None:
    try:
        return float(log.metadata[key])
    except (KeyError, ValueError):
        return None


def _exact_texts(values: np.ndarray) -> list[str]:
    """Shortest texts that read back as the same numbers; empty for NaN."""
    return ["" if value != value else repr(value) for value in values.tolist()]


def _exact_numbers(texts: list[str]) -> np.ndarray | None:
    """The numbers whose exact texts these are; None where any is written otherwise."""
    try:
        values = np.array([float(text) if text else np.nan for text in texts])
    except ValueError:
        return None
    return values if _exact_texts(values) == texts else None


def _field(name: str) -> Field | None:
    try:
        return Field(name, unit_of(name))
    except ValueError:
        return None


def _own(table: Table, vehicles: Table) -> dict[str, Any]:
    """The entries that a case has of its own."""
    given, usual = structs.asdict(table), structs.asdict(vehicles)
    return {name: value for name, value in given.items() if value != usual[name]}


def write_log(path: Path | str, case: Case, run: Run) -> Path:
    """Write one run of a case as a log that export_case turns back into the same run data; a new file only."""
    path = Path(path)
    fields, values = [], []
    texts: dict[str, list[str]] = {}
    for name, column in run.columns.items():
        fields.append(Field(name, unit_of(name)))
        values.append(column)
    for name, words in run.extra.items():
        item, numbers = _field(name), _exact_numbers(words)
        if item is not None and numbers is not None:
            fields.append(item)
            values.append(numbers)
        else:
            texts[name] = words
    spec = RecordSpec(TICK, "glider/msg/Tick", tuple(fields))
    facts = {
        "vehicle": case.vehicle_name, "site": case.site, "log_rate_hz": float(case.log_rate_hz),
        "water_density_kg_m3": float(case.water_density_kg_m3), "motion_capture": case.motion_capture, "runs": 1,
    }  # fmt: skip
    sensors = SensorsPart(**_own(case.sensors, case.roughie.sensors))
    disturbance = DisturbancePart(**_own(case.disturbance, case.roughie.disturbance))
    attachments = {
        VEHICLE_FILE: name_or_path(case.vehicle_name, "vehicle", "model/vehicles", base=case.folder)[0],
        CASE_FILE: case_text(facts, sensors, disturbance),
    }
    if texts:
        texts = {names.TIME: _exact_texts(run.t), **texts}
        attachments[EXTRA_FILE] = csvfile.encode_table(texts).decode("utf-8")
    metadata = {
        SOURCE: RUN_DATA,
        "run": run.name,
        "vehicle": case.vehicle.name,
        "site": case.site,
        "log_rate_hz": repr(case.log_rate_hz),
        "water_density_kg_m3": repr(case.water_density_kg_m3),
        **({FLIGHT_FILE: run.source, FLIGHT_START: run.start_utc} if run.flight else {}),
    }
    _write(path, spec, np.column_stack(values), run.t, attachments, metadata)
    return path


def _write(
    path: Path, spec: RecordSpec, rows: np.ndarray, t: np.ndarray, attachments: dict[str, str], metadata: dict[str, str]
) -> None:
    fd = disk.create(str(path))
    file = disk.DiskFile(fd)
    done = False
    try:
        log = LogFile(file, [spec], attachments=attachments, metadata=metadata)
        data = np.ascontiguousarray(rows, dtype="<f8")
        for number, (time_s, row) in enumerate(zip(t.tolist(), data, strict=True), start=1):
            log.record(0, number, time_s, row.tobytes())
        log.finish({"written": str(len(t)), "dropped": "0", "damaged": "0"})
        done = file.sync()
        if not done:
            raise OSError(file.last_errno, os.strerror(file.last_errno), str(path))
    finally:
        disk.close(fd, str(path), keep=done)
