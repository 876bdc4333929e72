"""What drives an ocean glider's model row by row, and where it does not fly steadily.

See docs/explanation/ocean.md, Steady.
"""

from math import radians

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import recorded

NEEDED = (names.ATTITUDE[1], names.DEPTH, names.OIL, names.DENSITY)
TEMPERATURE = 10.0  # degC where none was recorded: the expansion of the hull is then nothing to be asked for
PUMPED = 2e-6  # m3 by which the engine's volume moves from row to row
FLATTEST_PITCH, STEEPEST_PITCH = radians(10.0), radians(50.0)  # pitch of a glide that the angle of attack is known in
TURNING = radians(0.7)  # rad/s of pitch
ROLLED = radians(20.0)  # in a turn the lift is not upright
SURFACE = 5.0  # m
UNSEEN = 120.0  # s from the nearest sample of the water
HOLE = 65.0  # s between rows
OTHER_DEPTH, OTHER_PITCH, OTHER_OIL = 100.0, radians(3.0), 4e-5  # m, rad, m3: flown otherwise
BEFORE, AFTER = 20.0, 60.0  # s about what is not steady: speed settles in some 20 s, wings and oil in less


def drawn(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples with the missing ones drawn in straight, and the time from the nearest sample, s, both (rows,)."""
    given = np.isfinite(values)
    if not given.any():
        return np.zeros(len(t)), np.full(len(t), np.inf)
    after = np.minimum(np.searchsorted(t[given], t), given.sum() - 1)
    before = np.maximum(after - 1, 0)
    away = np.minimum(np.abs(t[given][after] - t), np.abs(t[given][before] - t))
    return np.interp(t, t[given], values[given]), away


def missing_input(run: Run) -> str | None:
    """The first column that the model is driven by and the run has nothing of; None where all are there."""
    return next((name for name in NEEDED if not recorded(run, name)), None)


def states(run: Run) -> dict[str, np.ndarray]:
    """Why a glider does not fly steadily, and in which rows, (rows,) bool each."""
    t, columns = run.t, run.columns
    oil, _ = drawn(t, columns[names.OIL])
    pitch, _ = drawn(t, columns[names.ATTITUDE[1]])
    depth, far = drawn(t, columns[names.DEPTH])
    _, dry = drawn(t, columns[names.DENSITY])
    pumping = np.abs(np.diff(oil, prepend=oil[:1])) > PUMPED
    if recorded(run, names.PUMP):
        pumping |= np.nan_to_num(columns[names.PUMP]) > 0.0
    rolled = np.zeros(run.rows, dtype=bool)
    if recorded(run, names.ATTITUDE[0]):
        rolled = np.abs(drawn(t, columns[names.ATTITUDE[0]])[0]) > ROLLED
    rate = np.gradient(pitch, t) if run.rows > 1 else np.zeros(run.rows)
    return {
        "at the surface": depth < SURFACE,
        "the engine runs": pumping,
        "level or too steep": (np.abs(pitch) < FLATTEST_PITCH) | (np.abs(pitch) > STEEPEST_PITCH),
        "pitching": np.abs(rate) > TURNING,
        "on its side": rolled,
        "no samples of the water": dry > UNSEEN,
        "no samples": (far > HOLE) | (np.diff(t, prepend=t[:1]) > HOLE),
    }


def unsteady(run: Run) -> np.ndarray:
    """Where the engine runs, the vehicle turns, is level, on its side, at the surface or not seen; (rows,) bool."""
    return spread_out(run.t, np.any(list(states(run).values()), axis=0))


def steady_seconds(run: Run) -> float:
    """For how long a run flies steadily, s."""
    return float(np.diff(run.t, append=run.t[-1:])[~unsteady(run)].sum())


def spread_out(t: np.ndarray, state: np.ndarray) -> np.ndarray:
    """A state (rows,) with BEFORE and AFTER s about it."""
    where = t[state]
    if not len(where):
        return state
    last = np.searchsorted(where, t, side="right") - 1
    follows = np.searchsorted(where, t, side="left")
    since = np.where(last >= 0, t - where[np.maximum(last, 0)], np.inf)
    until = np.where(follows < len(where), where[np.minimum(follows, len(where) - 1)] - t, np.inf)
    return (since <= AFTER) | (until <= BEFORE)


def regime(run: Run) -> np.ndarray:
    """How a run was flown, (5,): depth reached, pitch and oil of dive and climb, in units that make a difference.

    NaN where it did not glide that way.
    """
    t, steady = run.t, ~unsteady(run)
    pitch, oil = (drawn(t, run.columns[name])[0] for name in (names.ATTITUDE[1], names.OIL))
    found = [float(np.nanmax(run.columns[names.DEPTH])) / OTHER_DEPTH]
    for way in (steady & (pitch < 0.0), steady & (pitch > 0.0)):
        angle, volume = (float(np.median(one[way])) if way.any() else np.nan for one in (pitch, oil))
        found += [angle / OTHER_PITCH, volume / OTHER_OIL]
    return np.array(found)


def input_table(run: Run) -> np.ndarray:
    """The inputs of every row, (rows, N_U), SI; InputError where one is not there at all."""
    missing = missing_input(run)
    if missing is not None:
        raise InputError("an ocean glider's run needs it", source=run.path or run.name, column=missing)
    t, table = run.t, np.zeros((run.rows, at.N_U))
    for place, name in ((at.U_PITCH, names.ATTITUDE[1]), (at.U_OIL, names.OIL), (at.U_DENSITY, names.DENSITY)):
        table[:, place] = drawn(t, run.columns[name])[0]
    if run.rows > 1:
        table[:, at.U_PITCH_RATE] = np.gradient(table[:, at.U_PITCH], t)
    if recorded(run, names.ATTITUDE[2]):
        yaw = run.columns[names.ATTITUDE[2]]
        given = np.isfinite(yaw)
        table[:, at.U_YAW] = np.interp(t, t[given], np.unwrap(yaw[given]))
    warm = recorded(run, names.TEMPERATURE)
    table[:, at.U_TEMPERATURE] = drawn(t, run.columns[names.TEMPERATURE])[0] if warm else TEMPERATURE
    table[:, at.U_UNSTEADY] = unsteady(run)
    return table
