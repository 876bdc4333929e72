"""How fine the steps of a user's model have to be, how slow the model is, and whether its filter follows a run."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.own import kernels as names
from glider.tools.own.compiled import RaisedError, plain
from glider.tools.own.declare import Declaration
from glider.tools.own.effects import ModelPoint
from glider.tools.own.load import LoadedVehicle, called, user_error
from glider.tools.own.runs import OwnRun

STEPS_AT_START, TRIED_RUNS, STATES_TRIED = 20, 8, 20  # by which how fine a step has to be is found
HORIZON = (5.0, 20.0)  # s: of windows, where the vehicle's time constants set it
TIME_CONSTANTS = 3.0  # in a window
PARTS_TOLERANCE, MOST_PARTS = 0.02, 64  # of a state's scale a second, by which steps and half steps may differ


class Followed(Protocol):
    """What a filter has found of a run."""

    @property
    def states(self) -> np.ndarray: ...  # (rows, n + o), NaN where it is lost


class Flown(Protocol):
    """What is asked of a vehicle's model along runs: an observer (observer.py)."""

    vehicle: LoadedVehicle
    declared: Declaration
    runs: list[OwnRun]
    point: ModelPoint
    kinds: np.ndarray
    scales: np.ndarray
    parts: int
    notes: list[str]

    def start(self, n: int, point: ModelPoint) -> tuple[np.ndarray, np.ndarray]: ...
    def filter(self, n: int, point: ModelPoint) -> Followed: ...


def choose_parts(observer: Flown) -> None:
    """Steps in which a row's step is taken: doubled until a step and two halves of it agree where runs begin, and
    at most states that they pass through; a filter that is lost may be so by its steps."""
    tried = range(min(len(observer.runs), TRIED_RUNS))
    for n in tried:
        x, _ = observer.start(n, observer.point)
        while _halves_differ(observer, n, x, 0, STEPS_AT_START) >= PARTS_TOLERANCE:
            observer.parts *= 2
            if observer.parts >= MOST_PARTS:
                if (raised := _raised(observer, n, x, 0, STEPS_AT_START)) is not None:
                    raise raised
                dt = float(np.median(np.diff(observer.runs[n].t)))
                raise InputError(
                    f"the model is stiff: {MOST_PARTS} parts of a step of {dt:.3g} s do not agree with "
                    f"{2 * MOST_PARTS}; declare slower states, or solve its fast ones inside step",
                    source=observer.vehicle.source,
                )  # fmt: skip
    enough = observer.parts
    followed = [_states(observer, n) for n in tried]
    while (unsteady := _unsteady(observer, followed)) and observer.parts < MOST_PARTS:
        observer.parts *= 2
        followed = [_states(observer, n) for n in tried]
    if unsteady:  # smaller steps are no help
        observer.parts = enough
        observer.notes.append("steps and halves of them do not agree along the runs: the model jumps, or is lost")
    elif observer.parts > 1:  # what is stable so at the file's numbers has to be so at others
        observer.parts *= 2
    observer.notes += [said for n, states in enumerate(followed) if (said := _lost(observer, n, states))]
    if observer.parts > 1:
        observer.notes.append(f"the model is stiff for the rows' step: every step is taken in {observer.parts} parts")


def _halves_differ(observer: Flown, n: int, x: np.ndarray, row: int, steps: int) -> float:
    """By how much steps of a row and two halves of each differ at last, of a state's scale: the most of states."""
    ends, error = list[np.ndarray](), np.zeros(len(observer.scales))
    for count in (observer.parts, 2 * observer.parts):
        end = x
        for _ in range(steps):
            end = _advanced(observer, n, end, row, count)
        ends.append(end)
    names.minus(ends[0], ends[1], observer.kinds, error)
    return float(np.abs(error / observer.scales).max()) if np.isfinite(error).all() else np.inf


def _advanced(observer: Flown, n: int, x: np.ndarray, row: int, parts: int) -> np.ndarray:
    """The state (n,) a row's step later; InputError where a function of the user's raises an error."""
    run, w = observer.runs[n], np.zeros(len(observer.declared.noises))
    dt = float(np.median(np.diff(run.t)))
    try:
        with np.errstate(all="ignore"):  # a model that diverges is far off
            end = observer.vehicle.kernels.advance(x, run.inputs[row], w, observer.point.theta, dt, parts)
    except RaisedError as raised:
        raise user_error(raised.error, observer.vehicle.source, run.name) from None
    return names.normalised(np.array(end), observer.kinds)


def _states(observer: Flown, n: int) -> np.ndarray:
    """States (rows, n) of the filter along a run, NaN where it is lost."""
    return observer.filter(n, observer.point).states[:, : len(observer.kinds)]


def _unsteady(observer: Flown, followed: Sequence[np.ndarray]) -> bool:
    """Whether a filter is lost, or a step and its halves differ at most states of some runs, or by a whole scale at
    any."""
    differ = list[float]()
    for n, states in enumerate(followed):
        if not np.isfinite(states).all():
            return True
        rows = np.linspace(0, len(states) - 2, STATES_TRIED).astype(int)
        differ += [_halves_differ(observer, n, states[row], row, 1) for row in rows]
    return float(np.median(differ)) >= PARTS_TOLERANCE or max(differ) >= 1.0


def _lost(observer: Flown, n: int, states: np.ndarray) -> str:
    """Where the filter of a run is lost, in words; empty: nowhere."""
    run = observer.runs[n]
    lost = np.flatnonzero(~np.isfinite(states).all(axis=1))
    if not len(lost):
        return ""
    before = states[max(lost[0] - 1, 0)]
    k = int(np.argmax(np.abs(before) / np.abs(states[: max(lost[0], 1)]).mean(axis=0).clip(1e-9)))
    at = f"{run.t[lost[0]] - run.t[0]:.3g} s"
    said = f"{run.name}: the filter is lost {at} after the start, {observer.declared.states[k].name} at {before[k]:.3g}"
    raised = _raised(observer, n, before, max(lost[0] - 1, 0), 2)
    return f"{said}; {raised}" if raised else said


def _raised(observer: Flown, n: int, x: np.ndarray, row: int, steps: int) -> InputError | None:
    """What the user's functions raise in steps from a state of a row on: compiled, they answer NaN instead."""
    run, slowly, theta = observer.runs[n], plain(observer.vehicle.model, "asked what it raises"), observer.point.theta
    u, w, dt = run.inputs[row], np.zeros(len(observer.declared.noises)), float(np.median(np.diff(run.t)))
    try:
        with np.errstate(all="ignore"):
            for _ in range(steps):
                called(observer.vehicle, "measure", x, u, theta)
                x = slowly.advance(x, u, w, theta, dt, observer.parts)
    except InputError as error:
        return error
    except RaisedError as raised:
        return user_error(raised.error, observer.vehicle.source, run.name)
    return None


def time_constant(observer: Flown, n: int) -> float:
    """Slowest decay of the model about a state of run n, s; what does not decay is left aside."""
    run, m = observer.runs[n], len(observer.scales)
    row = run.t.searchsorted(run.t[0] + 2.0, side="right") - 1
    x = observer.filter(n, observer.point).states[row, : len(observer.kinds)]
    base = _advanced(observer, n, x, 0, observer.parts)
    F, column = np.zeros((m, m)), np.zeros(m)
    for j in range(m):
        d = np.zeros(m)
        d[j] = names.DIFFERENCE_STEP * observer.scales[j]
        end = _advanced(observer, n, names.plus(x, d, observer.kinds), 0, observer.parts)
        names.minus(end, base, observer.kinds, column)
        F[:, j] = column / d[j]
    size = np.abs(np.linalg.eigvals(F)) if np.isfinite(F).all() else np.zeros(0)
    decaying = size[(size < 1.0 - 1e-4) & (size > 0.0)]
    dt = float(np.median(np.diff(run.t)))
    return float(np.max(-dt / np.log(decaying))) if len(decaying) else HORIZON[1] / TIME_CONSTANTS
