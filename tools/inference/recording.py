"""Runs as the kernels want them, one behind the other in one table: what drove the vehicle, and how each run began."""

from dataclasses import dataclass

import numpy as np

from firmware.core.layouts import estimator_layout as kf
from firmware.core.maths.rotations import quaternion_from_euler
from firmware.core.vehicle.layout import N_X
from tools.data.runs import columns as names
from tools.data.runs.run import Run
from tools.inference.channels import measured
from tools.inference.windows import START


@dataclass
class Recording:
    """Everything of the runs but what was measured."""

    bounds: np.ndarray  # (runs + 1,) first row of each run
    early: np.ndarray  # (runs,) end of the rows that may say how the run began
    modes: np.ndarray  # (runs,) actuators that are driven rather than commanded
    t: np.ndarray  # (rows,) s
    inputs: np.ndarray  # (rows, 3) command, or speed where driven
    drawn: np.ndarray  # (rows, 2) slider and ballast where they are driven, NaN where they are commanded
    begins: np.ndarray  # (runs, N_X) state by the first readings


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


def _inputs(run: Run) -> tuple[int, np.ndarray, np.ndarray]:
    """Mode, inputs (rows, 3) and driven positions (rows, 2) of a run."""
    mode, t = kf.COMMANDED, run.t
    inputs, drawn = np.zeros((run.rows, 3)), np.full((run.rows, 2), np.nan)
    for i, command in enumerate(names.COMMANDS):
        values = run.columns.get(command)
        if values is not None and np.isfinite(values).any():
            inputs[:, i] = held(values)
            continue
        mode |= 1 << i
        wire = run.columns.get(names.DRAW_WIRES[i - 1]) if i else None
        if wire is not None and np.isfinite(wire).any():
            drawn[:, i - 1] = drawn_position(t, wire)
            if run.rows > 1:
                inputs[:-1, i] = np.diff(drawn[:, i - 1]) / np.diff(t)
    return mode, inputs, drawn


def _first_state(run: Run) -> np.ndarray:
    """State (N_X,) by each column's first reading within the first window's start, 0 where there is none."""
    early = measured(run)[run.t < run.t[0] + START]
    first = [column[np.isfinite(column)][0] if np.isfinite(column).any() else 0.0 for column in early.T]
    x = np.zeros(N_X)
    x[0:3] = first[9], first[10], first[6]
    x[3:7] = quaternion_from_euler(*first[:3])
    x[10:13], x[14:16] = first[3:6], first[7:9]
    return x


def record(runs: list[Run]) -> Recording:
    """The runs' tables for the kernels."""
    bounds = np.concatenate([[0], np.cumsum([run.rows for run in runs])])
    early = bounds[:-1] + [np.searchsorted(run.t, run.t[0] + START) for run in runs]
    modes, inputs, drawn = zip(*(_inputs(run) for run in runs), strict=True)
    return Recording(
        bounds, early, np.array(modes, dtype=np.int64), np.concatenate([run.t for run in runs]),
        np.concatenate(inputs), np.concatenate(drawn), np.array([_first_state(run) for run in runs]),
    )  # fmt: skip
