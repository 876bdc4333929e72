"""What the model says a recorded flight should have been: every window from its start (docs/GAP.md, Measures)."""

from dataclasses import dataclass, field, replace

import numpy as np

from firmware.core.vehicle.layout import X_ACT
from sim_backend.core import effect_layout as ef
from tools.data.runs import columns as names
from tools.data.runs.case import Case
from tools.data.runs.run import Run
from tools.inference import start
from tools.inference.channels import INSTEAD, ONBOARD
from tools.inference.core.flights import N_EXTRAS, N_Y, fly_windows, observe_rows
from tools.inference.model import Model
from tools.inference.windows import Window, windows


@dataclass
class Inputs:
    """What drives the windows: as recorded, or with something in it changed."""

    modes: np.ndarray  # (runs,)
    values: np.ndarray  # (rows, 3)
    starts: np.ndarray  # (windows, N_XE) state at row first - 1
    shaken: np.ndarray | None = None  # (rows, 6) accelerations from each row on


@dataclass
class Variant:
    """One model flown: parameters, extras (tools/inference/core/flights) and inputs."""

    P: np.ndarray
    inputs: Inputs
    extras: np.ndarray = field(default_factory=lambda: np.zeros(N_EXTRAS))


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
    inputs: Inputs  # as recorded


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
    inputs = Inputs(recording.modes, recording.inputs, starts)
    return Flown(recording, estimates, found, first, last, run_of, scored, inputs)


def fly(flown: Flown, models: list[Variant]) -> np.ndarray:
    """Predictions (models, rows, N_Y); the windows' first 2 s hold the filter's estimate."""
    recording = flown.recording
    rows = len(recording.t)
    Y = np.empty((len(models), rows, N_Y))
    observe_rows(flown.estimates.x, Y[0])
    Y[1:] = Y[0]
    begins = np.repeat(recording.t[recording.bounds[:-1]], np.diff(recording.bounds))
    # Variants that share their inputs share one copy: the list may be long and the rows many.
    kinds = list({id(model.inputs): model.inputs for model in models}.values())
    which = np.array([next(n for n, kind in enumerate(kinds) if kind is model.inputs) for model in models])
    fly_windows(
        np.array([model.P for model in models]),
        np.array([model.extras for model in models]),
        which,
        np.array([kind.modes for kind in kinds]),
        recording.t,
        recording.t - begins,
        np.array([kind.values for kind in kinds]),
        np.array([np.zeros((rows, 6)) if kind.shaken is None else kind.shaken for kind in kinds]),
        np.array([kind.starts for kind in kinds]),
        flown.first,
        flown.last,
        flown.run_of,
        Y,
    )
    return Y


def as_run(run: Run, Y: np.ndarray) -> Run:
    """A prediction (rows, N_Y) with the rows and columns of the measured run, no gaps."""
    columns = {}
    for name, values in run.columns.items():
        if name in ONBOARD:
            columns[name] = Y[:, ONBOARD.index(name)]
        elif name in INSTEAD:
            # motion capture beside onboard sensors, where the prediction tells them apart
            own = ef.Y_MOCAP_X + (*names.MOCAP_POSITION, *names.MOCAP_ATTITUDE).index(name)
            columns[name] = Y[:, own if own < Y.shape[1] else INSTEAD.index(name)]
        else:  # time and commands are not predicted, only without gaps
            columns[name] = start.held(values)
    return replace(run, columns=columns, path=None)


def predict(case: Case, model: Model, runs: list[Run]) -> list[np.ndarray]:
    """A prediction (rows, N_Y) for every run."""
    if model.F is not None:
        return predict_effects(case, model, runs)
    flown = prepare(case, model, runs)
    Y = fly(flown, [Variant(model.P, flown.inputs)])[0]
    bounds = flown.recording.bounds
    return [Y[bounds[n] : bounds[n + 1]] for n in range(len(runs))]


def predict_effects(case: Case, model: Model, runs: list[Run]) -> list[np.ndarray]:
    """The same for a model with effects: each window starts where that model's own filter stands."""
    from tools.inference import problem as whole

    assert model.F is not None
    posed = whole.pose(case, model, runs)
    gains = posed.filter(model.P, model.F, begin=True)
    scored = whole.cut(posed)
    Y = whole.estimated(posed, model.F, gains)
    whole.fly_on(posed, scored, model.P, model.F, gains, Y)
    bounds = posed.recording.bounds
    return [Y[bounds[n] : bounds[n + 1]] for n in range(len(runs))]
