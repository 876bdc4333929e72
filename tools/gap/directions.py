"""What each part of the model or of the vehicle could do to a flight: one direction a line, plausibly sized.

A direction changes either what is flown (parameters, extras, inputs) or what the sensors make of it. They are the
coarse shapes with which `where` shares out a gap, not the catalogue of effects: no direction says why.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from firmware.core.estimation import estimator_layout as kf
from firmware.core.vehicle import layout
from tools.data.runs import columns as names
from tools.data.runs.run import Run
from tools.inference.channels import measured_column
from tools.inference.core import flights as ex
from tools.inference.predict import Flown, Inputs, Variant
from tools.inference.start import drawn_position

_ATT, _YAW, _DEPTH, _XY = (0, 1, 2), (kf.Z_YAW,), (kf.Z_DEPTH,), (ex.Y_X, ex.Y_Y)
SMOOTHED = 5  # samples of a draw-wire whose median is taken


@dataclass
class Scene:
    """What directions are taken at: the case's runs as prepared, and the model."""

    runs: list[Run]
    flown: Flown
    P: np.ndarray
    Y: np.ndarray  # (rows, N_Y) the model's prediction
    wire_doubt: tuple[float, float]  # m and kg: as far as the draw-wires' bias and noise may go


@dataclass(frozen=True)
class Direction:
    """A part's way to differ: `size` (1 sigma, own unit) times an amplitude."""

    subsystem: str
    element: str
    name: str
    size: float
    change: Callable[[Scene, Variant, float], Variant] | None = None  # of what is flown
    sense: Callable[[Scene], np.ndarray] | None = None  # (rows, N_Y) what one unit adds to the measured
    parameter: int = -1  # of P, which [uncertainty] may allow for
    relative: bool = False  # `size` is a share of that parameter
    sensor: str = ""  # whose bias in [sensors] allows for it

    def changed(self, scene: Scene, variant: Variant, amplitude: float) -> Variant:
        """The variant moved along this direction."""
        return variant if self.change is None else self.change(scene, variant, amplitude * self.size)

    def sensed(self, scene: Scene) -> np.ndarray:
        """What one `size` of it adds to the measured, (rows, N_Y)."""
        return np.zeros_like(scene.Y) if self.sense is None else self.size * self.sense(scene)


def parameter(subsystem: str, element: str, name: str, size: float, index: int, relative: bool = False) -> Direction:
    """A direction along one parameter of P."""

    def change(scene: Scene, variant: Variant, value: float) -> Variant:
        P = variant.P.copy()
        P[index] += value * (abs(scene.P[index]) if relative else 1.0)
        return replace(variant, P=P)

    return Direction(subsystem, element, name, size, change, parameter=index, relative=relative)


def _extra(index: int):
    def change(scene: Scene, variant: Variant, value: float) -> Variant:
        extras = variant.extras.copy()
        extras[index] += value
        return replace(variant, extras=extras)

    return change


def _servo_offset(scene: Scene, variant: Variant, value: float) -> Variant:
    values, starts = variant.inputs.values.copy(), variant.inputs.starts.copy()
    values[:, 0] += value
    starts[:, layout.X_ACT] += value
    return replace(variant, inputs=replace(variant.inputs, values=values, starts=starts))


def _servo_backlash(scene: Scene, variant: Variant, value: float) -> Variant:
    """The servo's load follows its command only once the play is taken up; half of it either side."""
    recording, values = scene.flown.recording, variant.inputs.values.copy()
    half = 0.5 * abs(value)
    for first, last in zip(recording.bounds[:-1], recording.bounds[1:], strict=True):
        at_rest = 0.0
        for i in range(first, last):
            at_rest = min(max(at_rest, values[i, 0] - half), values[i, 0] + half)
            values[i, 0] = at_rest
    return replace(variant, inputs=replace(variant.inputs, values=values))


def _command_delay(scene: Scene, variant: Variant, value: float) -> Variant:
    recording, values = scene.flown.recording, variant.inputs.values.copy()
    for first, last in zip(recording.bounds[:-1], recording.bounds[1:], strict=True):
        t = recording.t[first:last]
        late = np.maximum(np.searchsorted(t, t - value + 1e-9, side="right") - 1, 0)
        values[first:last] = values[first:last][late]
    return replace(variant, inputs=replace(variant.inputs, values=values))


def _splice(which: int):
    """The draw-wire in place of the simulated actuator: all of it, whatever the amplitude."""

    def change(scene: Scene, variant: Variant, value: float) -> Variant:
        from scipy.ndimage import median_filter

        flown, inputs = scene.flown, variant.inputs
        modes, values, starts = inputs.modes.copy(), inputs.values.copy(), inputs.starts.copy()
        for n, run in enumerate(scene.runs):
            wire = run.columns.get(names.DRAW_WIRES[which - 1])
            if wire is None or not np.isfinite(wire).any() or modes[n] & (1 << which):
                continue
            first, last = flown.recording.bounds[n], flown.recording.bounds[n + 1]
            simulated = scene.Y[first:last, kf.Z_DEPTH + which]
            apart = median_filter(drawn_position(run.t, wire) - simulated, SMOOTHED, mode="nearest")
            # What bias and noise could be is left out, else the splice would bring them in and seem to explain them.
            position = simulated + np.sign(apart) * np.maximum(np.abs(apart) - scene.wire_doubt[which - 1], 0.0)
            values[first:last, which] = np.append(np.diff(position) / np.diff(run.t), 0.0)
            modes[n] |= 1 << which
            here = flown.run_of == n
            starts[here, layout.X_ACT + which] = position[flown.first[here] - 1 - first]
        return replace(variant, inputs=Inputs(modes, values, starts, inputs.shaken))

    return change


def _anchored(scene: Scene, values: np.ndarray, columns: tuple[int, ...]) -> np.ndarray:
    """What of an error of the measured columns is left when the start was taken from that very sensor."""
    flown, left = scene.flown, values.copy()
    for w, (first, last) in enumerate(zip(flown.first, flown.last, strict=True)):
        run = scene.runs[flown.run_of[w]]
        for column in columns:
            if not _by_mocap(run, column):
                left[first:last, column] -= values[first - 1, column]
    return left


def _by_mocap(run: Run, column: int) -> bool:
    """Whether the start of this column comes from motion capture while the column itself is measured onboard."""
    if column in _XY:
        return False
    mocap = names.MOCAP_POSITION[2] if column == kf.Z_DEPTH else names.MOCAP_ATTITUDE[column]
    return mocap in run.columns and measured_column(run, column) != mocap


def _rate(scene: Scene, values: np.ndarray) -> np.ndarray:
    """Time derivative of predicted columns (rows, n) along each window, 1/s."""
    t, flown, out = scene.flown.recording.t, scene.flown, np.zeros_like(values)
    for first, last in zip(flown.first, flown.last, strict=True):
        rows = slice(first - 1, last)
        if last - first >= 1:
            out[rows] = np.gradient(np.unwrap(values[rows], axis=0), t[rows], axis=0)
    return out


def _sensed(columns: tuple[int, ...], shape: Callable[[Scene], np.ndarray], anchored: tuple[int, ...] = ()):
    """A sensor's error: `shape` gives (rows,) or (rows, columns)."""

    def sense(scene: Scene) -> np.ndarray:
        out = np.zeros_like(scene.Y)
        values = shape(scene)
        out[:, list(columns)] = values[:, None] if values.ndim == 1 else values
        return _anchored(scene, out, anchored)

    return sense


def _constant(scene: Scene) -> np.ndarray:
    return np.ones(len(scene.Y))


DIRECTIONS = (
    Direction("actuation", "servo", "offset", 0.05, _servo_offset),
    Direction("actuation", "servo", "backlash", 0.1, _servo_backlash),
    parameter("actuation", "servo", "rate", -0.5, layout.SERVO_RATE, True),
    parameter("actuation", "servo", "time_constant", 5.0, layout.SERVO_TAU, True),
    parameter("actuation", "servo", "range", -0.3, layout.SERVO_MAX, True),
    Direction("actuation", "slider", "splice", 1.0, _splice(1)),
    Direction("actuation", "ballast", "splice", 1.0, _splice(2)),
    Direction("actuation", "ballast", "leak", 2e-4, _extra(ex.NET_TIME)),
    parameter("hydrodynamics", "surge", "K_D0", 0.2, layout.K_D0, True),
    parameter("hydrodynamics", "surge", "K_D", 0.2, layout.K_D, True),
    parameter("hydrodynamics", "heave", "K_L0", 2.0, layout.K_L0),
    parameter("hydrodynamics", "heave", "K_L", 0.2, layout.K_L, True),
    parameter("hydrodynamics", "heave", "A_z", 0.4, layout.A_Z, True),
    parameter("hydrodynamics", "sway", "K_beta", 0.3, layout.K_BETA, True),
    Direction("hydrodynamics", "roll", "trim", 0.1, _extra(ex.ROLL_TRIM)),
    parameter("hydrodynamics", "roll", "K_p", 0.3, layout.K_P, True),
    parameter("hydrodynamics", "roll", "K_MR", 0.3, layout.K_MR, True),
    parameter("hydrodynamics", "pitch", "K_M0", 0.2, layout.K_M0),
    parameter("hydrodynamics", "pitch", "K_M", 0.2, layout.K_M, True),
    parameter("hydrodynamics", "pitch", "K_q", 0.4, layout.K_Q, True),
    Direction("hydrodynamics", "yaw", "trim", 0.1, _extra(ex.YAW_TRIM)),
    parameter("hydrodynamics", "yaw", "K_MY", 0.3, layout.K_MY, True),
    parameter("hydrodynamics", "yaw", "K_r", 0.3, layout.K_R, True),
    parameter("mass", "net", "net_mass", 0.01, layout.NET_MASS),
    Direction("mass", "net", "ballast_scale", 0.05, _extra(ex.BALLAST_SCALE)),
    Direction("mass", "net", "with_depth", 0.002, _extra(ex.NET_DEPTH)),
    parameter("mass", "longitudinal", "cg_x", 0.0005, layout.CG_X),
    Direction("mass", "longitudinal", "slider_scale", 0.05, _extra(ex.SLIDER_SCALE)),
    parameter("mass", "lateral", "cg_y", 0.0005, layout.CG_Y),
    parameter("mass", "vertical", "cg_z", 0.0005, layout.CG_Z),
    parameter("mass", "inertia", "J_yy", 0.5, layout.B_Y, True),
    parameter("mass", "inertia", "J_zz", 0.5, layout.B_Z, True),
    Direction("environment", "water", "north", 0.1, _extra(ex.WATER_N)),
    Direction("environment", "water", "east", 0.1, _extra(ex.WATER_E)),
    Direction("environment", "water", "shear_north", 0.03, _extra(ex.SHEAR_N)),
    Direction("environment", "water", "shear_east", 0.03, _extra(ex.SHEAR_E)),
    Direction("sensing", "attitude", "roll", 0.03, sense=_sensed((0,), _constant), sensor="attitude"),
    Direction("sensing", "attitude", "pitch", 0.03, sense=_sensed((1,), _constant), sensor="attitude"),
    Direction("sensing", "attitude", "compass_sin", 0.1, sense=_sensed(_YAW, lambda s: np.sin(s.Y[:, 2]), _YAW)),
    Direction("sensing", "attitude", "compass_cos", 0.1, sense=_sensed(_YAW, lambda s: np.cos(s.Y[:, 2]), _YAW)),
    Direction("sensing", "attitude", "lag", 0.3, sense=_sensed(_ATT, lambda s: -_rate(s, s.Y[:, :3]))),
    Direction("sensing", "gyro", "bias_p", 0.01, sense=_sensed((3,), _constant), sensor="gyro"),
    Direction("sensing", "gyro", "bias_q", 0.01, sense=_sensed((4,), _constant), sensor="gyro"),
    Direction("sensing", "gyro", "bias_r", 0.01, sense=_sensed((5,), _constant), sensor="gyro"),
    Direction("sensing", "gyro", "scale", 0.1, sense=_sensed((3, 4, 5), lambda s: s.Y[:, 3:6])),
    Direction("sensing", "depth", "offset", 0.1, sense=_sensed(_DEPTH, _constant, _DEPTH), sensor="depth"),
    Direction("sensing", "depth", "scale", 0.05, sense=_sensed(_DEPTH, lambda s: s.Y[:, 6], _DEPTH)),
    Direction("sensing", "depth", "lag", 0.5, sense=_sensed(_DEPTH, lambda s: -_rate(s, s.Y[:, 6:7]), _DEPTH)),
    Direction("sensing", "depth", "lever", 0.3, sense=_sensed(_DEPTH, lambda s: -np.sin(s.Y[:, 1]), _DEPTH)),
    Direction("timing", "command", "delay", 0.2, _command_delay),
    Direction("timing", "command", "long_delay", 0.8, _command_delay),
    Direction("timing", "mocap", "delay", 0.3, sense=_sensed(_XY, lambda s: -_rate(s, s.Y[:, 9:11]), _XY)),
)
