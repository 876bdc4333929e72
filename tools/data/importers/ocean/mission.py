"""Segments of one glider's mission as a case: in order of time, with the hours of each beside it."""

import itertools
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.errors import InputError
from glider.tools.data.importers.ocean.segment import Segment
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.gate import refuse_impossible
from glider.tools.data.runs.origin import FIXES_FILE, ORIGIN_FILE, fix_columns, moment_text
from glider.tools.data.runs.run import Run

MISSION_FILE = "mission.csv"  # run, hours since the first run's start
FEWEST_ROWS = 3
DECIMALS = {
    "t_s": 3, "depth_m": 3, "pitch_rad": 6, "roll_rad": 6, "yaw_rad": 6, "oil_m3": 9, "battery_m": 6, "fin_rad": 5,
    "density_kg_m3": 4, "temperature_c": 4, "pump": 0, "speed_m_s": 5, "vn_m_s": 5, "ve_m_s": 5,
}  # fmt: skip


@dataclass
class ImportedMission:
    """A case that was written, what of the files is not in it, and what else a person should know of it."""

    folder: Path
    vehicle: str
    runs: list[Run]
    files: list[Path]
    hours: list[float]  # of each run's start since the first
    left_out: list[dict[str, int]]  # by run: samples by the reason why
    notes: list[str]


def write_mission(segments: list[Segment], out: Path, vehicle: str) -> ImportedMission:
    """Write segments as the runs of a case; InputError where they are not of one glider, overlap, or hold no flight."""
    gliders = sorted({segment.glider for segment in segments})
    if len(gliders) > 1:
        where = next(segment.files[0] for segment in segments if segment.glider == gliders[1])
        raise InputError(f"files of two gliders in one call: {gliders[0]} and {gliders[1]}", source=where)
    notes = []
    flights = []
    for segment in sorted(segments, key=lambda one: (one.start, str(one.files[0]))):
        rows = len(segment.columns[names.TIME])
        if rows < FEWEST_ROWS:
            notes.append(f"{segment.files[0]}: no run of it: {rows} rows with attitude")
        else:
            flights.append(segment)
    if not flights:
        raise InputError("no row with attitude in any file", source=segments[0].files[0])
    for one, other in itertools.pairwise(flights):
        if other.start <= one.end:
            raise InputError(f"the same time is in {one.files[0]} too", source=other.files[0])
    digits = max(3, len(str(len(flights) - 1)))
    runs = [Run(f"run{number:0{digits}d}", one.files[0], _columns(one)) for number, one in enumerate(flights)]
    hours = np.array([one.start - flights[0].start for one in flights]) / 3600.0
    for run, one in zip(runs, flights, strict=True):
        notes += [f"{run.name} ({one.files[0].name}): {text}" for text in [*_said(one), *one.notes]]
    beside = {
        MISSION_FILE: {"run": [run.name for run in runs], "hours_since_start": csvfile.as_texts("hours", hours, 4)},
        ORIGIN_FILE: _origin(runs, flights),
    }
    fixes = np.concatenate([one.fixes for one in segments])  # of what is no run, too
    if len(fixes):
        beside[FIXES_FILE] = fix_columns(fixes)
    refuse_impossible(runs, sparse_rows=True)
    files = write_case(
        out, runs, vehicle=vehicle, site="ocean", log_rate_hz=_rate(runs), water_density_kg_m3=_density(runs),
        motion_capture=False, suffix=".csv.gz", decimals=DECIMALS, digits=digits,
        beside={name: csvfile.encode_table(table) for name, table in beside.items()},
    )  # fmt: skip
    return ImportedMission(out, vehicle, runs, files, hours.tolist(), [one.left_out for one in flights], notes)


def total(left_out: list[dict[str, int]]) -> dict[str, int]:
    """What was left out of all runs together, the most first."""
    return dict(sum((Counter(one) for one in left_out), Counter()).most_common())


def _columns(segment: Segment) -> dict[str, np.ndarray]:
    """A run's columns as they are written: those with samples, in order, yaw wrapped."""
    found = {name: values for name, values in segment.columns.items() if np.isfinite(values).any()}
    if "yaw_rad" in found:
        yaw = found["yaw_rad"]
        found["yaw_rad"] = np.where(np.abs(yaw) > np.pi + 1e-6, wrap(yaw), yaw)  # pi as written is above pi
    return {name: found[name] for name in names.in_order(list(found))}


def _said(segment: Segment) -> list[str]:
    reasons = ", ".join(f"{samples} {reason}" for reason, samples in segment.left_out.items())
    return [f"left out: {reasons}"] if reasons else []


def _origin(runs: list[Run], flights: list[Segment]) -> dict[str, list[str]]:
    return {
        "run": [run.name for run in runs],
        "start_utc": [moment_text(one.start) for one in flights],
        "latitude": csvfile.as_texts("latitude", np.array([one.latitude for one in flights]), 5),
        "longitude": csvfile.as_texts("longitude", np.array([one.longitude for one in flights]), 5),
        "magnetic_variation_rad": csvfile.as_texts("variation", np.array([one.variation for one in flights]), 5),
        "glider": [one.glider for one in flights],
        "files": [" ".join(path.name for path in one.files) for one in flights],
    }


def _rate(runs: list[Run]) -> float:
    """Rows a second, by the median step."""
    steps = np.concatenate([np.diff(run.t) for run in runs])
    return float(f"{1.0 / np.median(steps):.4g}")


def _density(runs: list[Run]) -> float:
    """Mean density of the water over all rows that have one, kg/m3; InputError where none has."""
    found = [run.columns["density_kg_m3"] for run in runs if run.has("density_kg_m3")]
    values = np.concatenate(found) if found else np.array([])
    values = values[np.isfinite(values)]
    if not values.size:
        raise InputError("no row has a density: no usable sample of the CTD", source=runs[0].path)
    return round(float(values.mean()), 2)
