"""The paper's likelihood: equation (1), linear in the twelve coefficients, along velocities out of the capture's poses.

Written for momentum and integrated against test functions (the weak form), no acceleration is needed: for a bump phi
that vanishes at both ends of its stretch,

    - integral phi' M nu dt = integral phi (N + K k) dt,

so that poses are differentiated once and never twice. Velocities come from a local cubic over SMOOTHING_S (Savitzky
and Golay); its half-power bandwidth at 50 Hz is 2.3 Hz (Schafer, IEEE Signal Processing Magazine 28(4), 2011, eq. 12).
Residuals of the six axes have a variance each. Actuators: the draw-wires' readings smoothed alike, the servo as the
model says. Neither the capture's frame and clock nor the masses are free here: what they are off biases the result,
which is what the trajectory likelihood (flights.py) is for.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.identify.core.regressors import N_K, flown_servo, momentum_rows
from glider.tools.identify.statistics import Quadratic, collect, inflation
from glider.tools.inference.model import Model
from glider.tools.inference.vehicle_parameters import Parameters, coefficients

SMOOTHING_S = 0.6  # s, of the local cubic
STRETCH = 1.5  # s, of a test function; one begins every third of it
HOLE = 0.2  # s that are bridged where poses are missing
REWEIGHTED = 6  # times that the axes' variances are taken from the residuals
AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
BLOCK = 3.0  # s


@dataclass
class Kinematics:
    """A run on an even grid: attitude (rows, 3), nu (rows, 6), actuators (rows, 3), and where poses were there."""

    t: np.ndarray
    attitude: np.ndarray
    nu: np.ndarray
    actuators: np.ndarray
    sound: np.ndarray


def _width(rate: float) -> int:
    return max(2 * round(0.5 * SMOOTHING_S * rate) + 1, 7)


def _even(t: np.ndarray, grid: np.ndarray, values: np.ndarray, wraps: bool = False) -> np.ndarray:
    seen = np.isfinite(values)
    return np.interp(grid, t[seen], np.unwrap(values[seen]) if wraps else values[seen])


def kinematics(run: Run, P: np.ndarray) -> Kinematics:
    """Smoothed motion of a run out of its poses; body rates by equation (5) turned round."""
    from scipy.signal import savgol_filter  # a second to import: for who fits accelerations

    rate = 1.0 / float(np.median(np.diff(run.t)))
    grid = np.arange(run.t[0], run.t[-1], 1.0 / rate)
    width = min(_width(rate), 2 * ((len(grid) - 1) // 2) - 1)
    poses = np.column_stack([
        _even(run.t, grid, run.columns[name], name in names.WRAPPING) for name in names.MOCAP
    ])  # fmt: skip
    smooth = savgol_filter(poses, width, 3, axis=0)
    speed = savgol_filter(poses, width, 3, deriv=1, delta=1.0 / rate, axis=0)
    attitude, turning = smooth[:, 3:], speed[:, 3:]
    V = Rotation.from_euler("ZYX", attitude[:, ::-1]).inv().apply(speed[:, :3])
    sf, cf = np.sin(attitude[:, 0]), np.cos(attitude[:, 0])
    st, ct = np.sin(attitude[:, 1]), np.cos(attitude[:, 1])
    fd, td, pd = turning.T
    omega = np.column_stack([fd - st * pd, cf * td + sf * ct * pd, -sf * td + cf * ct * pd])
    commands = np.interp(grid, run.t, np.nan_to_num(run.columns[names.COMMANDS[0]]))
    servo = np.empty(len(grid))
    flown_servo(grid, commands, *P[layout.SERVO_MIN : layout.SERVO_MIN + 4], servo)
    wires = [savgol_filter(_even(run.t, grid, run.columns[name]), width, 3) for name in names.DRAW_WIRES]
    whole = np.isfinite(np.column_stack([run.columns[name] for name in names.MOCAP])).all(axis=1)
    nearest = np.abs(
        grid[:, None] - run.t[whole][np.searchsorted(run.t[whole], grid).clip(0, whole.sum() - 1)][:, None]
    )
    return Kinematics(
        grid, attitude, np.column_stack([V, omega]), np.column_stack([servo, *wires]), nearest[:, 0] < HOLE
    )


def weak_rows(motion: Kinematics, P: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Equation (1) against every test function: left side less what is known (windows, 6), columns (windows, 6, 12),
    and each window's middle (s)."""
    rows = len(motion.t)
    M, N, K = np.empty((rows, 6)), np.empty((rows, 6)), np.empty((rows, 6, N_K))
    momentum_rows(P, motion.attitude, motion.nu, motion.actuators, M, N, K)
    h = motion.t[1] - motion.t[0]
    length = round(STRETCH / h)
    s = np.linspace(-1.0, 1.0, length + 1)
    phi, slope = (1.0 - s**2) ** 2, -4.0 * s * (1.0 - s**2) * 2.0 / (length * h)
    left, columns, middle = [], [], []
    for first in range(0, rows - length - 1, max(1, length // 3)):
        part = slice(first, first + length + 1)
        if motion.sound[part].all():
            left.append(-h * (slope @ M[part]) - h * (phi @ N[part]))
            columns.append(h * np.tensordot(phi, K[part], axes=1))
            middle.append(motion.t[first + length // 2])
    if not left:
        return np.empty((0, 6)), np.empty((0, 6, N_K)), np.empty(0)
    return np.array(left), np.array(columns), np.array(middle)


def suited(runs: list[Run]) -> list[Run]:
    """The runs that have what this likelihood needs."""
    return [run for run in runs if run.has(*names.MOCAP, *names.COMMANDS, *names.DRAW_WIRES)]


def fit_accelerations(model: Model, runs: list[Run]) -> tuple[Quadratic, Parameters]:
    """Statistics of the coefficients' posterior, and its parameters; InputError where the runs do not suit."""
    runs = suited(runs)
    if not runs:
        raise InputError("the accelerations' likelihood needs motion capture, commands and draw-wires in one run")
    free = Parameters(coefficients(model.P), model.P[layout.K_D0 : layout.K_R + 1].copy())
    left, columns, block, total = [], [], [], 0
    for n, run in enumerate(runs):
        y, X, middle = weak_rows(kinematics(run, model.P), model.P)
        left.append(y)
        columns.append(X)
        block.append(1000 * n + (middle // BLOCK).astype(int))
        total += len(y)
    if total < len(COEFFICIENTS):
        raise InputError(f"{total} stretches of {STRETCH} s with motion capture are too few")
    y, X = np.concatenate(left), np.concatenate(columns)
    _, block_of = np.unique(np.repeat(np.concatenate(block), 6), return_inverse=True)
    e0 = (X @ free.nominal - y).reshape(-1)  # what the nominal coefficients miss
    J0 = (X * free.spreads).reshape(-1, N_K).T
    axis = np.tile(np.arange(6), len(y))
    sigma = np.array([max(float(e0[axis == a].std()), 1e-9) for a in range(6)])
    values = np.zeros(N_K)
    for _ in range(REWEIGHTED):
        weight = 1.0 / sigma[axis]
        J, e = J0 * weight, e0 * weight
        values = -np.linalg.solve(J @ J.T + np.eye(N_K), J @ e)
        rest = e0 + values @ J0
        sigma = np.array([max(float(np.sqrt(np.mean(rest[axis == a] ** 2))), 1e-9) for a in range(6)])
    weight = 1.0 / sigma[axis]
    J, e = J0 * weight, (e0 + values @ J0) * weight
    low = np.array([f.low for f in free.free])
    statistics = collect(values, low, e, J, axis, AXES)
    return statistics.tempered(max(inflation(e, J, block_of), 1.0)), free
