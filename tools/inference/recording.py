"""Runs as the kernels want them, one behind the other in one table: what drove the vehicle, and how each run began."""

from dataclasses import dataclass

import numpy as np

from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import recorded
from glider.tools.inference.kind import Kind


@dataclass
class Recording:
    """Everything of the runs but what was measured."""

    bounds: np.ndarray  # (runs + 1,) first row of each run
    early: np.ndarray  # (runs,) end of the rows that may say how the run began
    modes: np.ndarray  # (runs,) actuators that are driven rather than commanded
    t: np.ndarray  # (rows,) s
    inputs: np.ndarray  # (rows, inputs) command, or speed where driven
    drawn: np.ndarray  # (rows, inputs) positions of what is driven, NaN where it is commanded
    begins: np.ndarray  # (runs, n_state) state by the first readings


def held(values: np.ndarray) -> np.ndarray:
    """Commands in force: the last one given, and before the first the first."""
    given = np.flatnonzero(np.isfinite(values))
    if not given.size:
        return np.zeros(len(values))
    at = np.searchsorted(given, np.arange(len(values)), side="right") - 1
    return values[given[np.maximum(at, 0)]]


def drawn_position(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Draw-wire positions (one reading at least) with the missing ones drawn in straight; constant beyond the ends."""
    given = np.isfinite(values)
    return np.interp(t, t[given], values[given])


def _inputs(kind: Kind, run: Run) -> tuple[int, np.ndarray, np.ndarray]:
    """Mode, inputs and driven positions, both (rows, inputs), of a run."""
    if kind.input_table is not None:
        table = kind.input_table(run)
        return 0, table, np.full(table.shape, np.nan)
    mode, t, shape = 0, run.t, (run.rows, len(kind.inputs))
    inputs, drawn = np.zeros(shape), np.full(shape, np.nan)
    for i, entry in enumerate(kind.inputs):
        if recorded(run, entry.command):
            inputs[:, i] = held(run.columns[entry.command])
            continue
        mode |= entry.driven
        if entry.position is not None and recorded(run, entry.position):
            drawn[:, i] = drawn_position(t, run.columns[entry.position])
            if run.rows > 1:
                inputs[:-1, i] = np.diff(drawn[:, i]) / np.diff(t)
    return mode, inputs, drawn


def _first_state(kind: Kind, run: Run) -> np.ndarray:
    """State (n_state,) by each column's first reading within the first window's start, 0 where there is none."""
    early = kind.measures.measured(run)[run.t < run.t[0] + kind.measures.look_in]
    first = [column[np.isfinite(column)][0] if np.isfinite(column).any() else 0.0 for column in early.T]
    return kind.first_state(np.array(first))


def record(kind: Kind, runs: list[Run]) -> Recording:
    """The runs' tables for the kernels."""
    bounds = np.concatenate([[0], np.cumsum([run.rows for run in runs])])
    early = bounds[:-1] + [np.searchsorted(run.t, run.t[0] + kind.measures.look_in) for run in runs]
    modes, inputs, drawn = zip(*(_inputs(kind, run) for run in runs), strict=True)
    return Recording(
        bounds, early, np.array(modes, dtype=np.int64), np.concatenate([run.t for run in runs]),
        np.concatenate(inputs), np.concatenate(drawn), np.array([_first_state(kind, run) for run in runs]),
    )  # fmt: skip
