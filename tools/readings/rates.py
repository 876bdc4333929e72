"""Angular rates against the attitude's own motion.

The attitude's body increments summed up, A (rad), are those of the rates integrated, G: over a block
A_i = c_i + sum_j M_ij G_j + b_i t - m_i w_i with M the unit matrix, b and m nought, if both instruments are right.
M_ii = 1 / (1 + scale of the gyro); an axis that is another's shows off the diagonal; b = -bias M_ii; m_i / M_ii is how
much later the attitude comes than the rates, s. The noise of the regressor G is that of an integral, and attenuates
nothing that could be seen.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.readings.findings import CERTAIN_SIGMA, TOLERANCE, WHOLE, Finding, certain, spoken
from glider.tools.readings.pairs import DEGREES, Weighed, rms
from glider.tools.readings.regression import Estimate, Fit, fit, within
from glider.tools.readings.signals import Rates, SignalTable, body_increments, pieces, summed, unwrapped

DELAYS = np.arange(-2.0, 2.01, 0.1)  # s, tried before the fit
UNIT_FACTOR_TOLERANCE = 0.2  # of a whole unit's factor, for a scale to be a matter of units
FOREIGN = 2.0  # times its own axis, that another must bring for the axes to be exchanged
EULER = 0.7  # of the residual, that Euler rates must come to for the rates to be of the Euler angles
LEAST_MOTION = 3.0  # tolerances, rms within a block, below which an axis has not moved enough to be judged


@dataclass(frozen=True)
class Compared:
    """One attitude against the rates: a fit for each axis (None where it hardly moved), and the delay tried first."""

    fits: list[Fit | None]
    delay: float


def attitude_of(table: SignalTable, columns: tuple[str, ...]) -> np.ndarray:
    """Attitude (rows, 3), rad, NaN where the vehicle does not fly."""
    return table.flown(np.column_stack([table.columns[name] for name in columns]))


def rates_of(table: SignalTable) -> Rates:
    """Body rates (rows, 3), rad/s."""
    return Rates(table, np.column_stack([table.columns[name] for name in names.RATES]))


def angle_increments(table: SignalTable, attitude: np.ndarray, euler: bool) -> np.ndarray:
    """Increments of the body's rotation, or of the Euler angles, (rows, 3); NaN at a run's first row."""
    if euler:
        plain = np.column_stack([unwrapped(column, table.run) for column in attitude.T])
        increments = np.diff(plain, axis=0, prepend=np.full((1, 3), np.nan))
    else:
        increments = body_increments(attitude)
    increments[np.flatnonzero(np.diff(table.run)) + 1] = np.nan
    return increments


def moved_and_turned(
    table: SignalTable, turned: np.ndarray, rates: Rates, delay: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A (rows, 3), the three integrals and time (rows, 4), both within blocks, less their means; which rows are used,
    and the block of each of them.

    turned (rows, 3): the attitude's increments.
    """
    moved = rates.integrated(delay)
    usable = np.isfinite(moved).all(axis=1) & np.isfinite(turned).all(axis=1)
    A, G = summed(turned, usable), summed(moved, usable)
    group = table.block[usable] * 100_003 + pieces(usable)[usable]
    both = within(np.column_stack([A[usable], G[usable], table.t[usable]]), group)
    return both[:, :3], both[:, 3:], usable, group


def design(
    table: SignalTable, turned: np.ndarray, rates: Rates, delay: float, skew: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A (rows, 3), regressors (rows, 3 axes, k) and which rows are used; within blocks, less their means.

    Regressors of an axis: those of moved_and_turned, minus the axis' rate, with `skew` also minus time times it.
    """
    A, shared, usable, group = moved_and_turned(table, turned, rates, delay)
    w = rates.shifted(delay)[usable]
    by_axis = [within(part, group) for part in (w, *([table.t[usable, None] * w] if skew else []))]
    X = [np.column_stack([shared, *(-part[:, axis] for part in by_axis)]) for axis in range(3)]
    return A, np.stack(X, axis=1), usable


def compare(
    table: SignalTable, columns: tuple[str, ...], euler: bool = False, skew: bool = False, delay: float | None = None
) -> Compared:
    """The fits of an attitude on the rates, at the delay that leaves least (of DELAYS), unless it is known."""
    turned, rates = angle_increments(table, attitude_of(table, columns), euler), rates_of(table)
    best = _best_delay(table, turned, rates) if delay is None else delay
    A, X, usable = design(table, turned, rates, best, skew)
    block = table.block[usable]
    fits = []
    for axis in range(3):
        motion = float(np.sqrt(np.mean(A[:, axis] ** 2))) if len(A) else 0.0
        enough = motion >= LEAST_MOTION * TOLERANCE[names.ATTITUDE[axis]] * 0.3
        fits.append(fit(A[:, axis], X[:, axis], block) if enough else None)
    return Compared(fits, best)


def _best_delay(table: SignalTable, turned: np.ndarray, rates: Rates) -> float:
    """Of DELAYS, the one that leaves least of the attitude's increments."""
    best, least = 0.0, math.inf
    for delay in sorted(DELAYS, key=abs):
        A, regressors, _, _ = moved_and_turned(table, turned, rates, float(delay))
        if len(A) < 20:
            continue
        solved = np.linalg.lstsq(regressors, A, rcond=None)[0]
        missed, moved = ((rows**2).mean(axis=0) for rows in (A - regressors @ solved, A))
        left = float((missed / np.maximum(moved, 1e-12)).sum())
        if left < least * 0.98:
            best, least = float(delay), left
    return best


def judge_rates(table: SignalTable, weighed: Weighed | None = None) -> list[Finding]:
    """What is wrong between rates and the onboard attitude; `weighed`: what of it is a matter of sign, unit or axes."""
    if not table.has(*names.RATES, *names.ATTITUDE):
        return []
    body = compare(table, names.ATTITUDE)
    exchanged = _exchanged(body)
    found = _single(table, body, exchanged, [_scale(table, axis, solved) for axis, solved in enumerate(body.fits)])
    if weighed is None:  # a mixture that no single fault explains: said, and left as it is
        return [replace(one, mended=one.mended and one.finding not in WHOLE) for one in found]
    at_fault = weighed.fault.columns if weighed.decided else ()
    of_rates = {one.channel for one in found if one.finding == weighed.fault.kind and one.channel in at_fault}
    if at_fault and of_rates == set(at_fault):  # measured with its size
        return [
            replace(one, text=f"{one.text[:-1]} ({weighed.odds_said}).") if one.channel in at_fault
            and one.finding in WHOLE else one for one in found
        ]  # fmt: skip
    if not weighed.decided:
        return []
    return judge_rates(weighed.fault.fix_axes_signs_units(table))


def _single(table: SignalTable, body: Compared, exchanged: list[Finding], scales: list[list[Finding]]) -> list[Finding]:
    """What is wrong with rates beside an attitude that is right."""
    found = [*_euler(table, body), *exchanged]
    for axis, solved in enumerate(body.fits):
        if solved is None or any(names.RATES[axis] == other.channel for other in exchanged):
            continue
        scale = scales[axis]
        if scale and scale[0].finding == "scale" and _acquitted(table, axis, scale[0].size):
            scale = []
        found += [*scale, *_offset(axis, solved)]
    return found + _late(table, body)


def _acquitted(table: SignalTable, axis: int, error: float) -> bool:
    """Whether motion capture's attitude turns as the rate says: then the onboard attitude has the scale, not the rate.

    It has to be sure that the rate's own error is not `error`, and to put it at less than half of that.
    """
    if not table.has(*names.MOCAP_ATTITUDE):
        return False
    solved = compare(table, names.MOCAP_ATTITUDE).fits[axis]
    if solved is None:
        return False
    own = inverse(solved[axis])
    return abs(own.value - 1.0) < 0.5 * abs(error) and own.sigma(1.0 + error) >= CERTAIN_SIGMA


def _scale(table: SignalTable, axis: int, solved: Fit | None) -> list[Finding]:
    """Sign, units or scale of one rate."""
    if solved is None:
        return []
    name, angle, slope = names.RATES[axis], names.ATTITUDE[axis], solved[axis]
    motion = rms(table.flown(table.columns[name]))
    scale = inverse(slope)
    if not certain(scale, abs(scale.value - 1.0) * motion / max(abs(scale.value), 1e-9), name, 1.0):
        return []
    size, (low, high) = scale.value, scale.interval
    against = f"derivative of {angle}"
    if abs(abs(size) * DEGREES - 1.0) < UNIT_FACTOR_TOLERANCE or abs(abs(size) / DEGREES - 1.0) < UNIT_FACTOR_TOLERANCE:
        unit = "degrees where radians are meant" if abs(size) > 1.0 else "radians where degrees were taken for them"
        text = f"{name} is {size:.3g} times the rate of the attitude: {unit}."
        return [Finding(name, against, "units", size, (low, high), "1", None, True, text, {"gain": size})]
    if size < 0.0:
        text = f"{name} has the opposite sign of the attitude's own rate, {spoken(size, (low, high))} times it."
        return [Finding(name, against, "sign", size, (low, high), "1", None, True, text, {"gain": size})]
    text = f"{name} reads {spoken(size, (low, high))} times the rate at which the attitude turns."
    error = size - 1.0
    return [
        Finding(name, against, "scale", error, (low - 1.0, high - 1.0), "1", "gyro_scale", True, text, {"gain": size})
    ]


def _offset(axis: int, solved: Fit) -> list[Finding]:
    """A constant error of one rate."""
    name = names.RATES[axis]
    slope, drift = solved[axis], solved[3]
    bias = drift.scaled(-1.0 / slope.value)
    if not certain(bias, abs(bias.value), name):
        return []
    text = f"{name} reads {spoken(bias.value, bias.interval, 'rad/s')} where the attitude does not turn."
    return [
        Finding(
            name, f"derivative of {names.ATTITUDE[axis]}", "offset", bias.value, bias.interval, "rad/s", "gyro_bias",
            True, text, {"offset": bias.value},
        )
    ]  # fmt: skip


def _exchanged(body: Compared) -> list[Finding]:
    """Axes that read another's rate."""
    found = []
    for axis, solved in enumerate(body.fits):
        if solved is None:
            continue
        own = abs(solved.coefficients[axis])
        other = max((n for n in range(3) if n != axis), key=lambda n: abs(solved.coefficients[n]))
        slope = solved[other]
        if abs(slope.value) < FOREIGN * own or slope.sigma() < CERTAIN_SIGMA or abs(slope.value) < 0.3:
            continue
        name, source = names.RATES[axis], names.RATES[other]
        size = spoken(slope.value, slope.interval)
        text = f"The attitude turns about the axis of {name} as {source} says, {size} times."
        found.append(
            Finding(
                name, f"derivative of {names.ATTITUDE[axis]}", "axes", slope.value, slope.interval, "1", None, True,
                text, {"from": float(other), "sign": math.copysign(1.0, slope.value)},
            )
        )  # fmt: skip
    return found


def _euler(table: SignalTable, body: Compared) -> list[Finding]:
    """Rates that are those of the Euler angles instead of the body's."""
    angles = compare(table, names.ATTITUDE, euler=True, delay=body.delay)
    better = []
    for axis in (0, 2):
        of_body, of_angles = body.fits[axis], angles.fits[axis]
        if of_body is None or of_angles is None or len(of_body.residual) != len(of_angles.residual):
            continue
        # Own axis alone: what the other axes' integrals take over is the very question.
        ratio, sure = _own_axis(table, body.delay, axis)
        if sure:
            better.append((axis, ratio))
    if not better:
        return []
    axis, ratio = min(better, key=lambda item: item[1])
    text = (
        f"{names.RATES[axis]} follows the derivative of the Euler angle {names.ATTITUDE[axis]}, not the body's rate: "
        f"the residual is {ratio:.2f} of that of body rates."
    )
    return [
        Finding(names.RATES[axis], names.ATTITUDE[axis], "axes", ratio, (ratio, ratio), "1", None, True, text,
                {"euler": 1.0})
    ]  # fmt: skip


def _own_axis(table: SignalTable, delay: float, axis: int) -> tuple[float, bool]:
    """Residual of the Euler angle on its rate over that of the body's, and whether it is less in nearly every block."""
    attitude, rates = attitude_of(table, names.ATTITUDE), rates_of(table)
    squares = []
    for euler in (False, True):
        A, X, usable = design(table, angle_increments(table, attitude, euler), rates, delay)
        solved = fit(A[:, axis], X[:, axis][:, [axis, 3]], table.block[usable])
        if solved is None:
            return 1.0, False
        _, at = np.unique(table.block[usable], return_inverse=True)
        squares.append(np.bincount(at, solved.residual**2) / np.maximum(np.bincount(at), 1))
    body, angle = squares
    ratio = math.sqrt(float(angle.sum() / max(body.sum(), 1e-30)))
    change = body - angle
    error = float(np.std(change, ddof=1)) / math.sqrt(len(change))
    return ratio, ratio < EULER and float(change.mean()) > 3.0 * error


def lateness(body: Compared) -> Estimate | None:
    """How much later the attitude comes than the rates, s: the axes' estimates by their weights."""
    found = []
    for axis, solved in enumerate(body.fits):
        if solved is not None and abs(solved.coefficients[axis]) > 0.01 and solved[axis].sigma() > CERTAIN_SIGMA:
            found.append(solved[4].scaled(1.0 / solved.coefficients[axis]))
    if not found:
        return None
    weight = np.array([1.0 / max(one.error, 1e-9) ** 2 for one in found])
    value = float(weight @ [one.value for one in found] / weight.sum())
    spread = float(weight @ [(one.value - value) ** 2 for one in found] / weight.sum()) / max(len(found) - 1, 1)
    error = math.sqrt(1.0 / weight.sum() + (spread if len(found) > 1 else 0.0))
    return Estimate(value + body.delay, error, min(one.freedom for one in found))


def _late(table: SignalTable, body: Compared) -> list[Finding]:
    """The attitude later than the rates, or earlier."""
    late = lateness(body)
    if late is None:
        return []
    attitude = attitude_of(table, names.ATTITUDE)
    turning = [rms(column) for column in (body_increments(attitude) / table.period).T]
    moves = max(abs(late.value) * rate / TOLERANCE[name] for rate, name in zip(turning, names.ATTITUDE, strict=True))
    if late.sigma() < CERTAIN_SIGMA or moves < 0.1:
        return []
    text = f"The attitude comes {spoken(late.value, late.interval, 's')} after the rates."
    label = "attitude_lag" if late.value > 0.0 else None
    return [
        Finding("attitude", "rates", "delay", late.value, late.interval, "s", label, True, text, {"delay": late.value})
    ]


def inverse(slope: Estimate) -> Estimate:
    """The estimate of 1 / slope."""
    return Estimate(1.0 / slope.value, slope.error / slope.value**2, slope.freedom)
