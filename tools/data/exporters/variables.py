"""What was found out about the runs of a case, as variables by row: velocity through the water, verdicts."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.run import Run

WATCH_FILE, DIAGNOSIS_FILE = "watch.json", "diagnosis.json"
SAME_S = 2e-3  # times of a row in two files: written with three digits
# Columns of `glider gap velocity`: the variable, its name in words. Those of a model in OG1 begin with GLIDER.
VELOCITY = {
    "u_m_s": ("GLIDER_HORZ_VELO_MODEL", "horizontal speed of the glider through the water"),
    "w_m_s": ("GLIDER_VERT_VELO_MODEL", "vertical velocity of the glider through the water"),
    "vn_m_s": ("GLIDER_NORTH_VELO_MODEL", "velocity of the glider through the water, north"),
    "ve_m_s": ("GLIDER_EAST_VELO_MODEL", "velocity of the glider through the water, east"),
}
VERDICTS = ("none", "cause", "unknown", "skipped")


@dataclass
class Variable:
    """A variable by row: its values of each run in turn, NaN where it has none."""

    name: str
    units: str
    long_name: str
    values: list[np.ndarray]  # (rows of the run,) each
    attributes: dict[str, Any] = field(default_factory=dict)


def found_in(folder: Path, runs: list[Run]) -> list[Variable]:
    """The variables that an answer's folder holds: velocity run by run, verdicts; InputError where it has none."""
    if not folder.is_dir():
        raise InputError("not a folder" if folder.exists() else "no such folder", source=folder)
    found = _velocity(folder, runs)
    for name, read in ((WATCH_FILE, _watch), (DIAGNOSIS_FILE, _diagnosis)):
        if (folder / name).is_file():
            found += read(folder / name, runs)
    if not found:
        wanted = f"neither {WATCH_FILE}, {DIAGNOSIS_FILE} nor {runs[0].name}.csv with {', '.join(VELOCITY)}"
        raise InputError(wanted, source=folder)
    return found


def _velocity(folder: Path, runs: list[Run]) -> list[Variable]:
    tables = {}
    for run in runs:
        path = next((one for end in (".csv", ".csv.gz") if (one := folder / f"{run.name}{end}").is_file()), None)
        if path is not None:
            tables[run.name] = csvfile.read_table(path)
    found = []
    for column, (name, words) in VELOCITY.items():
        for prefix, suffix, of in (("", "", ""), ("sd_", "_SD", "standard deviation of the ")):
            if not any(f"{prefix}{column}" in table.header for table in tables.values()):
                continue
            values = [_at(run, tables.get(run.name), f"{prefix}{column}") for run in runs]
            found.append(Variable(f"{name}{suffix}", "m/s", f"{of}{words}", values))
    return found


def _at(run: Run, table: csvfile.CsvTable | None, column: str) -> np.ndarray:
    """A column of a table at the run's rows, by their times; InputError for a time that is none of the run's."""
    values = np.full(run.rows, np.nan)
    if table is None or column not in table.header:
        return values
    if "t_s" not in table.header:
        raise table.error("the column is missing", column="t_s")
    t = table.numbers("t_s")
    place = np.clip(np.searchsorted(run.t, t - SAME_S), 0, run.rows - 1)
    other = np.flatnonzero(~(np.abs(run.t[place] - t) <= SAME_S))
    if other.size:
        raise table.error(f"no row of {run.name} is at this time", row=int(other[0]), column="t_s")
    values[place] = table.numbers(column)
    return values


@dataclass(frozen=True)
class _Verdict:
    """What was said of a run."""

    verdict: str  # one of VERDICTS
    label: str | None = None  # of the most probable cause
    probability: float = np.nan
    size: float = np.nan


def _watch(path: Path, runs: list[Run]) -> list[Variable]:
    """Verdicts of single runs."""
    found = {}
    try:
        for one in json.loads(path.read_text(encoding="utf-8"))["runs"]:
            verdict = "skipped" if one["skipped"] else one["verdict"]
            cause = one["causes"][0] if one["causes"] else None
            found[str(one["run"])] = _verdict(verdict, cause, None if cause is None else cause["size"])
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("not the answer of `glider gap watch`", source=path) from None
    return _variables("DIVE", "whether the dive's flight changed", runs, [found.get(run.name) for run in runs])


def _diagnosis(path: Path, runs: list[Run]) -> list[Variable]:
    """The one verdict of all runs."""
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
        cause = next((one for one in answer["causes"] if one["label"] in answer["selected"]), None)
        found = _verdict(answer["verdict"], cause, None)
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("not the answer of `glider gap diagnose`", source=path) from None
    return _variables("MISSION", "whether the flights are those of the vehicle file", runs, [found] * len(runs))


def _verdict(verdict: Any, cause: Any, size: Any) -> _Verdict:
    """ValueError where it is none of VERDICTS."""
    VERDICTS.index(verdict)
    if cause is None:
        return _Verdict(verdict)
    return _Verdict(verdict, str(cause["label"]), float(cause["probability"]), np.nan if size is None else float(size))


def _variables(prefix: str, words: str, runs: list[Run], found: list[_Verdict | None]) -> list[Variable]:
    """Verdict, most probable cause, its probability and size, each the same for all rows of a run."""
    labels = sorted({one.label for one in found if one is not None and one.label is not None})
    table = np.full((len(runs), 4), np.nan)
    for row, one in zip(table, found, strict=True):
        if one is not None:
            cause = np.nan if one.label is None else float(labels.index(one.label))
            row[:] = VERDICTS.index(one.verdict), cause, one.probability, one.size
    columns = [[np.full(run.rows, value) for run, value in zip(runs, column, strict=True)] for column in table.T]
    verdict = {"flag_values": list(range(len(VERDICTS))), "flag_meanings": " ".join(VERDICTS)}
    cause_flags = {"flag_values": list(range(len(labels))), "flag_meanings": " ".join(labels)} if labels else {}
    variables = [
        Variable(f"{prefix}_VERDICT", "1", words, columns[0], verdict),
        Variable(f"{prefix}_CAUSE", "1", "most probable cause", columns[1], cause_flags),
        Variable(f"{prefix}_CAUSE_PROBABILITY", "1", "probability of that cause", columns[2]),
        Variable(f"{prefix}_CAUSE_SIZE", "", "size of that cause, in the unit of its label", columns[3]),
    ]
    return [one for one in variables if one.units or np.isfinite(table[:, 3]).any()]
