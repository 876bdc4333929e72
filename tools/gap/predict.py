"""What the model says a recorded flight should have been: every window flown on from its start (GAP.md, Measures)."""

from dataclasses import dataclass, replace

import numpy as np

from firmware.core.layout import X_ACT
from tools.gap import start
from tools.gap.channels import INSTEAD, ONBOARD
from tools.gap.core.flights import N_Y, fly_windows, observe_rows
from tools.gap.model import Model
from tools.gap.windows import Window, windows
from tools.runs.case import Case
from tools.runs.run import Run


@dataclass
class Flown:
    """A case's windows, their starts, and what one or more models make of them."""

    recording: start.Recording
    estimates: start.Estimates
    windows: list[list[Window]]  # by run
    first: np.ndarray  # (windows,) first row flown, in the recording's table
    last: np.ndarray  # (windows,) one past the last
    run_of: np.ndarray  # (windows,)
    scored: np.ndarray  # (windows,) bool
    starts: np.ndarray  # (windows, N_XE) state at row first - 1


def prepare(case: Case, model: Model, runs: list[Run]) -> Flown:
    """The filter over the runs, and the start of each window out of it."""
    recording = start.record(case, model, runs)
    estimates = start.estimate(recording, model)
    found = [windows(run.t) for run in runs]
    flat = [(n, window) for n, listed in enumerate(found) for window in listed if window.start < window.end]
    offset = recording.bounds[:-1]
    run_of = np.array([n for n, _ in flat], dtype=np.int64)
    first = np.array([offset[n] + window.start for n, window in flat], dtype=np.int64)
    last = np.array([offset[n] + window.end for n, window in flat], dtype=np.int64)
    starts = estimates.x[first - 1].copy()
    # Driven actuators stand where the draw-wires say; the speeds between samples keep them there.
    for i in (0, 1):
        at = recording.drawn[first - 1, i]
        starts[:, X_ACT + 1 + i] = np.where(np.isfinite(at), at, starts[:, X_ACT + 1 + i])
    scored = np.array([window.scored for _, window in flat], dtype=bool)
    return Flown(recording, estimates, found, first, last, run_of, scored, starts)


def fly(flown: Flown, P: np.ndarray) -> np.ndarray:
    """Predictions (models, rows, N_Y) of models P (models, N_P); the windows' first 2 s hold the filter's estimate."""
    Y = np.empty((len(P), len(flown.recording.t), N_Y))
    observe_rows(flown.estimates.x, Y[0])
    Y[1:] = Y[0]
    fly_windows(
        P, flown.recording.modes, flown.recording.t, flown.recording.inputs, flown.starts, flown.first, flown.last,
        flown.run_of, Y,
    )  # fmt: skip
    return Y


def as_run(run: Run, Y: np.ndarray) -> Run:
    """A prediction (rows, N_Y) with the rows and columns of the measured run, no gaps."""
    columns = {}
    for name, values in run.columns.items():
        if name in ONBOARD:
            columns[name] = Y[:, ONBOARD.index(name)]
        elif name in INSTEAD:
            columns[name] = Y[:, INSTEAD.index(name)]
        else:  # time and commands are not predicted, only without gaps
            columns[name] = start.held(values)
    return replace(run, columns=columns, path=None)


def predict(case: Case, model: Model, runs: list[Run]) -> list[np.ndarray]:
    """A prediction (rows, N_Y) for every run."""
    flown = prepare(case, model, runs)
    Y = fly(flown, model.P[None, :])[0]
    bounds = flown.recording.bounds
    return [Y[bounds[n] : bounds[n + 1]] for n in range(len(runs))]
