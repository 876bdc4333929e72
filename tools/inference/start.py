"""Where each window starts: the estimator run over the recorded flight, never looking past the row it stands at."""

from dataclasses import dataclass

import numpy as np

from firmware.core.estimation import estimator_layout as kf
from firmware.core.estimation.estimator_layout import N_E
from firmware.core.maths.rotations import quaternion_from_euler
from firmware.estimation.settings import START_SPEEDS, estimator_settings, first_spread
from tools.data.runs import columns as names
from tools.data.runs.case import Case
from tools.data.runs.run import Run
from tools.inference.channels import measured, recorded
from tools.inference.core.flights import estimate_runs
from tools.inference.model import Model
from tools.inference.windows import START

COAST = 1.0  # s without motion capture


@dataclass
class Recording:
    """Runs as the kernels want them: one table of all rows, run after run."""

    bounds: np.ndarray  # (runs + 1,) first row of each run
    early: np.ndarray  # (runs,) end of the rows that may say how the run began
    modes: np.ndarray  # (runs,) actuators that are driven rather than commanded
    settings: np.ndarray  # (runs, N_S)
    t: np.ndarray  # (rows,) s
    inputs: np.ndarray  # (rows, 3) command, or speed where driven
    drawn: np.ndarray  # (rows, 2) slider and ballast where they are driven, NaN where they are commanded
    z: np.ndarray  # (rows, N_Z) measurements
    starts: np.ndarray  # (runs, N_XE)
    spreads: np.ndarray  # (runs, N_E)


@dataclass
class Estimates:
    """The filter's state (rows, N_XE) and 1 sigma of its errors (rows, N_E) after each row's measurements."""

    x: np.ndarray
    sd: np.ndarray


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


def _first(run: Run, values: np.ndarray) -> np.ndarray:
    """First reading of each column within the first window's start, shape (columns,); NaN where there is none."""
    early = values[run.t < run.t[0] + START]
    return np.array([column[np.isfinite(column)][0] if np.isfinite(column).any() else np.nan for column in early.T])


def measurements(run: Run, table: np.ndarray) -> np.ndarray:
    """What the filter is given, shape (rows, N_Z), of the run in prediction columns (rows, N_Y).

    Where motion capture sees the vehicle, the filter follows it and not the onboard attitude and depth: an offset of
    those is then in the gap and not in the start, and two sensors that disagree cannot pull the filter apart. Where
    it has not been seen for COAST seconds, onboard takes over.
    """
    z = np.full((run.rows, kf.N_Z), np.nan)
    z[:, : kf.Z_MOCAP_Z] = table
    for onboard, mocap, slot in zip(
        (kf.Z_ROLL, kf.Z_PITCH, kf.Z_YAW, kf.Z_DEPTH),
        (*names.MOCAP_ATTITUDE, names.MOCAP_POSITION[2]),
        (kf.Z_MOCAP_ROLL, kf.Z_MOCAP_PITCH, kf.Z_MOCAP_YAW, kf.Z_MOCAP_Z),
        strict=True,
    ):
        if not recorded(run, mocap):
            continue
        z[:, slot] = run.columns[mocap]
        seen = np.where(np.isfinite(z[:, slot]), run.t, -np.inf)
        z[run.t - np.maximum.accumulate(seen) < COAST, onboard] = np.nan
    return z


def record(case: Case, model: Model, runs: list[Run]) -> Recording:
    """The runs' tables for the kernels."""
    bounds = np.concatenate([[0], np.cumsum([run.rows for run in runs])])
    rows, count = int(bounds[-1]), len(runs)
    made = Recording(
        bounds=bounds,
        early=bounds[:-1] + [np.searchsorted(run.t, run.t[0] + START) for run in runs],
        modes=np.zeros(count, dtype=np.int64),
        settings=np.zeros((count, kf.N_S)),
        t=np.concatenate([run.t for run in runs]),
        inputs=np.zeros((rows, 3)),
        drawn=np.zeros((rows, 2)),
        z=np.full((rows, kf.N_Z), np.nan),
        starts=np.zeros((count, kf.N_XE)),
        spreads=np.zeros((count, N_E)),
    )
    for n, run in enumerate(runs):
        at = slice(bounds[n], bounds[n + 1])
        mode, made.inputs[at], made.drawn[at] = _inputs(run)
        made.modes[n] = mode
        made.settings[n] = estimator_settings(case.sensors, case.disturbance, mode)
        table = measured(run)
        made.z[at] = measurements(run, table)
        first = np.nan_to_num(_first(run, table))
        seen = (not mode & kf.SERVO_DRIVEN, *np.isfinite(_first(run, table))[[kf.Z_SLIDER, kf.Z_BALLAST]])
        x = made.starts[n]
        x[0:3] = first[kf.Z_MOCAP_X], first[kf.Z_MOCAP_Y], first[kf.Z_DEPTH]
        x[3:7] = quaternion_from_euler(*first[:3])
        x[10:13] = first[3:6]
        x[14:16] = first[7:9]
        made.spreads[n] = first_spread(model.P, mode, seen)
    return made


def estimate(recording: Recording, model: Model) -> Estimates:
    """Run the filter over every run."""
    rows = len(recording.t)
    X, sd = np.empty((rows, kf.N_XE)), np.empty((rows, N_E))
    estimate_runs(
        model.P, recording.settings, model.sigma, recording.modes, recording.bounds, recording.early, recording.t,
        recording.inputs, recording.z, recording.starts, np.array(START_SPEEDS), recording.spreads, X, sd,
    )  # fmt: skip
    return Estimates(X, sd)
