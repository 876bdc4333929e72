"""Onboard readings against motion capture's pose.

An onboard angle less that of motion capture, on a constant (bias), the angle (scale), its rate (delay), and for the
heading its harmonics (compass). Depth less motion capture's height, on a constant, the depth (scale), the depth rate
(lag), sin(pitch) (a pressure port ahead of or behind the origin). Whose clock is late is asked of the rates, which have
no part in it: attitude and motion capture are each compared with them (rates.compare).
"""

import math
from dataclasses import replace

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.readings.findings import CERTAIN_SIGMA, MATERIAL_OFFSET, TOLERANCE, Finding, certain, spoken
from glider.tools.readings.pairs import rms
from glider.tools.readings.rates import compare, lateness
from glider.tools.readings.regression import Estimate, Fit, fit
from glider.tools.readings.signals import SignalTable, steps, unwrapped

LAG_TURNS = 4
RATE_SPAN = 0.5  # s over which a derivative is taken
BIAS_LABEL = {"roll_rad": "imu_roll_bias", "pitch_rad": "imu_pitch_bias", "yaw_rad": "compass"}


def judge_capture(table: SignalTable) -> list[Finding]:
    """What is wrong between the vehicle's readings and motion capture."""
    late = _capture_late(table)
    found, delay = (late[0], late[1]) if late is not None else ([], Estimate(0.0, 0.0, 30))
    if any(one.finding == "delay" for one in found):
        table, delay = advanced(table, names.MOCAP, delay.value), replace(delay, value=0.0)
    for onboard, mocap in zip(names.ATTITUDE, names.MOCAP_ATTITUDE, strict=True):
        if table.has(onboard, mocap):
            found += _angle(table, onboard, mocap)
    if table.has(names.DEPTH, names.MOCAP_POSITION[2]):
        found += _depth(table, delay)
    return found


def advanced(table: SignalTable, columns: tuple[str, ...], delay: float) -> SignalTable:
    """The table with these columns as they were read `delay` s later: a late instrument put right."""
    moved = dict(table.columns)
    for name in columns:
        if name not in table.columns:
            continue
        values = table.columns[name]
        if name in names.WRAPPING:
            values = unwrapped(values, table.run)
        moved[name] = np.full(len(values), np.nan)
        for n in np.unique(table.run):
            here = table.run == n
            t, good = table.t[here], np.isfinite(values[here])
            if good.sum() > 1:
                known = np.interp(t + delay, t[good], values[here][good], left=np.nan, right=np.nan)
                near = np.interp(t + delay, t, (~good).astype(float), left=1.0, right=1.0) < 0.5
                moved[name][here] = np.where(near, known, np.nan)
    return replace(table, columns=moved)


def derivative(table: SignalTable, values: np.ndarray) -> np.ndarray:
    """Central difference over RATE_SPAN, (rows,), per second; NaN near a gap or a run's end."""
    half = max(1, round(0.5 * RATE_SPAN / table.period))
    out = np.full(len(values), np.nan)
    if len(values) > 2 * half:
        same = table.run[2 * half :] == table.run[: -2 * half]
        step = np.where(same, table.t[2 * half :] - table.t[: -2 * half], np.nan)
        out[half:-half] = (values[2 * half :] - values[: -2 * half]) / step
    broken = np.isnan(steps(table))
    broken[np.flatnonzero(np.diff(table.run, prepend=-1))] = False
    out[broken] = np.nan
    return out


def _capture_late(table: SignalTable) -> tuple[list[Finding], Estimate] | None:
    """How late motion capture's poses are by the rates, and by how much more as time goes on."""
    if not table.has(*names.RATES, *names.MOCAP_ATTITUDE):
        return None
    plain = compare(table, names.MOCAP_ATTITUDE)
    compared = compare(table, names.MOCAP_ATTITUDE, skew=True, delay=plain.delay)
    late = lateness(plain)
    if late is None:
        return None
    speed = rms(derivative(table, table.columns[names.MOCAP_POSITION[0]])) + rms(
        derivative(table, table.columns[names.MOCAP_POSITION[1]])
    )
    found = []
    skew = _skew(compared)
    length = float(max(table.t))
    if skew is not None and skew.sigma() >= CERTAIN_SIGMA and abs(skew.value) * length * max(speed, 0.1) >= 0.015:
        text = f"Motion capture's clock gains {spoken(skew.value, skew.interval, 's/s')} on the vehicle's."
        found.append(
            Finding("mocap", "rates", "drift", skew.value, skew.interval, "s/s", "clock_skew", True, text,
                    {"skew": skew.value})
        )  # fmt: skip
    elif late.sigma() >= CERTAIN_SIGMA and abs(late.value) * max(speed, 0.1) >= 0.1 * 0.15:
        text = f"Motion capture's poses come {spoken(late.value, late.interval, 's')} after the rates."
        found.append(
            Finding("mocap", "rates", "delay", late.value, late.interval, "s", "mocap_delay", True, text,
                    {"delay": late.value})
        )  # fmt: skip
    return found, late


def _skew(compared) -> Estimate | None:
    """Lateness gained a second, by the axes' weights."""
    found = [
        solved[5].scaled(1.0 / solved.coefficients[axis])
        for axis, solved in enumerate(compared.fits)
        if solved is not None and abs(solved.coefficients[axis]) > 0.3
    ]
    if not found:
        return None
    weight = np.array([1.0 / max(one.error, 1e-9) ** 2 for one in found])
    value = float(weight @ [one.value for one in found] / weight.sum())
    return Estimate(value, 1.0 / math.sqrt(weight.sum()), min(one.freedom for one in found))


def _angle(table: SignalTable, onboard: str, mocap: str) -> list[Finding]:
    """Bias and scale of an onboard angle; harmonics of a heading."""
    own, other = (table.flown(unwrapped(table.columns[name], table.run)) for name in (onboard, mocap))
    turns = 2.0 * np.pi * np.round((own - other) / (2.0 * np.pi))
    apart = own - other - turns
    turning = derivative(table, other)
    heading = onboard == "yaw_rad"
    shape = (
        [np.sin(other), np.cos(other), np.sin(2.0 * other), np.cos(2.0 * other)]
        if heading else [other - np.nanmean(other)]
    )  # fmt: skip
    solved = fit(apart, np.column_stack([np.ones(len(apart)), -turning, *shape]), table.block)
    if solved is None:
        return []
    found = []
    bias = solved[0]
    if certain(bias, abs(bias.value), onboard, least_motion=MATERIAL_OFFSET):
        text = f"{onboard} reads {spoken(bias.value, bias.interval, 'rad')} beside motion capture."
        found.append(
            Finding(onboard, mocap, "offset", bias.value, bias.interval, "rad", BIAS_LABEL[onboard], True, text,
                    {"offset": bias.value})
        )  # fmt: skip
    if heading:
        return found + _harmonics(solved, onboard, mocap)
    scale = solved[2]
    if certain(scale, abs(scale.value) * rms(other - np.nanmean(other)), onboard):
        label = "attitude_scale" if onboard == "pitch_rad" else None
        text = f"{onboard} moves {spoken(1.0 + scale.value, _plus_one(scale))} times as far as motion capture sees."
        found.append(
            Finding(onboard, mocap, "scale", scale.value, scale.interval, "1", label, True, text,
                    {"gain": 1.0 + scale.value})
        )  # fmt: skip
    return found


def _harmonics(solved, onboard: str, mocap: str) -> list[Finding]:
    """A heading whose error turns with the heading."""
    size = [math.hypot(solved.coefficients[2 + n], solved.coefficients[3 + n]) for n in (0, 2)]
    sure = [max(solved[2 + n].sigma(), solved[3 + n].sigma()) for n in (0, 2)]
    order = int(np.argmax(size))
    n = 2 + 2 * order
    if sure[order] < CERTAIN_SIGMA or size[order] < 0.35 * TOLERANCE[onboard]:
        return []
    leading = max((solved[n], solved[n + 1]), key=lambda one: abs(one.value))
    error = Estimate(size[order], leading.error, leading.freedom)
    text = f"The heading is off by {spoken(error.value, error.interval, 'rad')}, {order + 1} times round a turn."
    return [Finding(onboard, mocap, "goes_with", error.value, error.interval, "rad", "compass", False, text)]


def _depth(table: SignalTable, late: Estimate) -> list[Finding]:
    """Offset, scale, lag and lever of the depth."""
    pitch_name = names.MOCAP_ATTITUDE[1] if table.has(names.MOCAP_ATTITUDE[1]) else names.ATTITUDE[1]
    if not table.has(pitch_name):
        return []
    height = table.flown(table.columns[names.MOCAP_POSITION[2]])
    lever, sinking = -np.sin(table.columns[pitch_name]), derivative(table, height)
    middle, shifted = float(np.nanmean(height)), 0.0
    solved: Fit | None = None
    for turn in range(LAG_TURNS):  # a long lag is no small one: the depth is moved by it, and what is left asked again
        depth = table.flown(table.columns[names.DEPTH])
        columns = [np.ones(len(depth)), height - middle, -sinking, lever]
        solved = fit(depth - height, np.column_stack(columns), table.block)
        if solved is None:
            return []
        step = solved[2].value
        if turn == LAG_TURNS - 1 or abs(step) * rms(sinking) < 0.02 * TOLERANCE[names.DEPTH]:
            break
        shifted += step
        table = advanced(table, (names.DEPTH,), step)
    assert solved is not None
    found = []
    scale, lag, arm = solved[1], solved[2], solved[3]
    # The constant is asked at depth 0, as the catalogue's effect means it.
    offset = fit(depth - height, np.column_stack([columns[0], height, *columns[2:]]), table.block)
    lag = Estimate(lag.value + shifted + late.value, math.hypot(lag.error, late.error), lag.freedom)
    for one, moves, what, unit, label, words in (
        (scale, abs(scale.value) * rms(height - middle), "scale", "1", "depth_scale", "grows {} times too fast"),
        (lag, abs(lag.value) * rms(sinking), "delay", "s", "depth_lag", "comes {} late"),
        (arm, abs(arm.value) * rms(lever - np.nanmean(lever)), "goes_with", "m", "pressure_lever",
         "goes with sin(pitch): the port is {} ahead of the origin"),
    ):  # fmt: skip
        if certain(one, moves, names.DEPTH):
            if what == "scale":
                shown = spoken(1.0 + one.value, _plus_one(one))
            else:
                shown = spoken(one.value, one.interval, unit)
            found.append(
                Finding(names.DEPTH, names.MOCAP_POSITION[2], what, one.value, one.interval, unit, label, True,
                        f"The depth {words.format(shown)}.", {label: one.value})
            )  # fmt: skip
    if offset is not None:
        constant = offset[0]
        if certain(constant, abs(constant.value), names.DEPTH, least_motion=MATERIAL_OFFSET):
            text = f"The depth reads {spoken(constant.value, constant.interval, 'm')} beside motion capture."
            found.append(
                Finding(names.DEPTH, names.MOCAP_POSITION[2], "offset", constant.value, constant.interval, "m",
                        "depth_offset", True, text, {"offset": constant.value})
            )  # fmt: skip
    return found


def _plus_one(estimate: Estimate) -> tuple[float, float]:
    low, high = estimate.interval
    return 1.0 + low, 1.0 + high
