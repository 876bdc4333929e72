"""What was found out about the runs of a case, as variables by row: velocity through the water, verdicts of a watch."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tools.data.errors import InputError
from tools.data.runs import csvfile
from tools.data.runs.run import Run

WATCH_FILE = "watch.json"
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
    """The variables that an answer's folder holds: velocity run by run, or watch.json; InputError where neither."""
    if not folder.is_dir():
        raise InputError("not a folder" if folder.exists() else "no such folder", source=folder)
    found = _velocity(folder, runs)
    if (folder / WATCH_FILE).is_file():
        found += _watch(folder / WATCH_FILE, runs)
    if not found:
        raise InputError(f"neither {WATCH_FILE} nor {runs[0].name}.csv with {', '.join(VELOCITY)}", source=folder)
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


def _at(run: Run, table: csvfile.Table | None, column: str) -> np.ndarray:
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


def _watch(path: Path, runs: list[Run]) -> list[Variable]:
    """Verdict, most probable cause and its probability and size, each the same for all rows of a run."""
    try:
        answers = {str(one["run"]): one for one in json.loads(path.read_text(encoding="utf-8"))["runs"]}
        first = {name: one["causes"][0] for name, one in answers.items() if one["causes"]}
        labels = sorted({str(cause["label"]) for cause in first.values()})
        numbers: dict[str, tuple[float, ...]] = {}
        for name, one in answers.items():
            cause = first.get(name)
            verdict = "skipped" if one["skipped"] else one["verdict"]
            told = (np.nan, np.nan, np.nan)
            if cause is not None:
                size = np.nan if cause["size"] is None else float(cause["size"])
                told = (float(labels.index(str(cause["label"]))), float(cause["probability"]), size)
            numbers[name] = (float(VERDICTS.index(verdict)), *told)
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("not the answer of `glider gap watch`", source=path) from None
    nothing = (np.nan,) * 4
    rows = [np.tile(numbers.get(run.name, nothing), (run.rows, 1)) for run in runs]
    verdict = {"flag_values": list(range(len(VERDICTS))), "flag_meanings": " ".join(VERDICTS)}
    cause = {"flag_values": list(range(len(labels))), "flag_meanings": " ".join(labels)} if labels else {}
    return [
        Variable("DIVE_VERDICT", "1", "whether the dive's flight changed", [one[:, 0] for one in rows], verdict),
        Variable("DIVE_CAUSE", "1", "most probable cause of the change", [one[:, 1] for one in rows], cause),
        Variable("DIVE_CAUSE_PROBABILITY", "1", "probability of that cause", [one[:, 2] for one in rows]),
        Variable("DIVE_CAUSE_SIZE", "", "size of that cause, in the unit of its label", [one[:, 3] for one in rows]),
    ]
