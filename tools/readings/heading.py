"""The heading against the yaw rate, and what the difference goes with.

The Euler rate of the heading by the corrected rates, integrated, is what the heading should do; what it does beside,
over a whole unbroken piece of a run, is compared with the heading itself (a compass disturbed by its own mount), with
pitch and roll (a tilt that is not compensated) and with the actuators' positions (iron or currents that move).
"""

import math

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.readings.findings import CERTAIN_SIGMA, MATERIAL_OFFSET, TOLERANCE, Finding, spoken
from glider.tools.readings.regression import Estimate, Fit, fit, within
from glider.tools.readings.signals import Rates, SignalTable, pieces, summed, unwrapped

HEADING = names.ATTITUDE[2]
BETTER = 0.8  # of the residual, that one regressor has to come to
LEAST_STEP = 200  # rows of a piece that is long enough for slow errors


def judge_heading(table: SignalTable) -> list[Finding]:
    """What the heading's error goes with, if with anything; only where motion capture gives no heading."""
    if not table.has(*names.RATES, *names.ATTITUDE) or table.has(names.MOCAP_ATTITUDE[2]):
        return []
    error, group, usable = residual_heading(table)
    if usable.sum() < LEAST_STEP:
        return []
    yaw = table.columns[HEADING]
    tried = {"heading": np.column_stack([np.sin(yaw), np.cos(yaw), np.sin(2.0 * yaw), np.cos(2.0 * yaw)])}
    for name in (names.ATTITUDE[1], names.ATTITUDE[0], *names.DRAW_WIRES):
        if table.has(name):
            tried[name] = table.columns[name][:, None]
    bare = _fitted(table, error, [], group, usable)
    best: tuple[str, Fit, float] | None = None
    for name, columns in tried.items():
        solved = _fitted(table, error, [columns], group, usable)
        if solved is None or bare is None:
            continue
        ratio = solved.rms / max(bare.rms, 1e-12)
        sure = max(solved[1 + n].sigma() for n in range(columns.shape[1]))
        good = usable & np.isfinite(columns).all(axis=1)
        moved = within(columns[good], group[good]) @ solved.coefficients[1:]
        moves = float(np.sqrt(np.mean(moved**2)))
        if ratio < BETTER and sure >= CERTAIN_SIGMA and moves >= MATERIAL_OFFSET * TOLERANCE[HEADING] * 0.5:
            best = (name, solved, ratio) if best is None or ratio < best[2] else best
    return [] if best is None else [_said(*best)]


def residual_heading(table: SignalTable) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heading less the integral of its Euler rate, rad, its piece, and which rows are used; (rows,) each."""
    roll, pitch, yaw = (table.flown(table.columns[name]) for name in names.ATTITUDE)
    rates = np.column_stack([table.columns[name] for name in names.RATES])
    turning = (rates[:, 1] * np.sin(roll) + rates[:, 2] * np.cos(roll)) / np.maximum(np.cos(pitch), 0.2)
    moved = Rates(table, turning[:, None]).integrated()
    heading = unwrapped(yaw, table.run)
    usable = np.isfinite(moved[:, 0]) & np.isfinite(heading)
    return heading - summed(moved, usable)[:, 0], pieces(usable), usable


def _fitted(table: SignalTable, error, columns, group, usable) -> Fit | None:
    """The error on time (a gyro's bias) and the columns, within pieces; blocks of time for the errors."""
    X = np.column_stack([table.t, *columns])
    good = usable & np.isfinite(X).all(axis=1)
    if good.sum() < LEAST_STEP:
        return None
    return fit(within(error[good], group[good]), within(X[good], group[good]), table.block[good])


def _said(name: str, solved: Fit, ratio: float) -> Finding:
    if name == "heading":
        first = math.hypot(solved.coefficients[1], solved.coefficients[2])
        second = math.hypot(solved.coefficients[3], solved.coefficients[4])
        size = max(first, second)
        error = Estimate(size, max(solved[n].error for n in (1, 2, 3, 4)), solved[1].freedom)
        text = f"The heading's error goes with the heading: {spoken(size, error.interval, 'rad')} at its largest."
        return Finding(HEADING, "yaw rate", "goes_with", size, error.interval, "rad", "compass", False, text)
    slope = solved[1]
    unit = f"rad/{name.rpartition('_')[2]}"
    text = (
        f"The heading moves with {name} beside what the rates say: {spoken(slope.value, slope.interval, unit)}; "
        f"that takes {100.0 * (1.0 - ratio**2):.0f} % of the square of the difference."
    )
    return Finding(HEADING, "yaw rate", "goes_with", slope.value, slope.interval, unit, None, False, text)
