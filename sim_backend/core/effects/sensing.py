"""Effects of the sensors: biases, scales, levers and lags; what is read of a state."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.rotations import wrap_angle
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.layout import X_BALLAST, X_DOWN, X_EAST, X_NORTH, X_NU, X_SLIDER
from glider.firmware.core.vehicle.state import euler_angles
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.actuation import backlash


@kernel
def before_lags(F, x, before):
    """What `update_lags` wants of a step's start: roll, pitch, yaw (rad) and depth (m), into before (4)."""
    if anywhere(F[ef.ATTITUDE_LAG] > 0.0):
        before[0], before[1], before[2] = euler_angles(x)
    before[3] = x[X_DOWN]


@kernel
def lagged(behind, change, tau, dt):
    """How far a reading is behind after a step of dt in which its signal changed; tau is its time constant, s."""
    kept = math.exp(-dt / tau)
    return where(tau > 0.0, kept * behind + tau * (1.0 - kept) / dt * change, behind)


@kernel
def update_lags(F, x, before, dt):
    """How far lagging readings are behind after a step of dt; before: as before_lags left it.

    A lag of time constant T reads s - d, with d' = s' - d / T, exact for a signal that moves evenly over the step; the
    model's error does not enter it, so that a filter may correct the state without disturbing the sensor's memory.
    """
    if anywhere(F[ef.ATTITUDE_LAG] > 0.0):
        roll, pitch, yaw = euler_angles(x)
        tau = F[ef.ATTITUDE_LAG]
        x[ef.X_LAG] = lagged(x[ef.X_LAG], wrap_angle(roll - before[0]), tau, dt)
        x[ef.X_LAG + 1] = lagged(x[ef.X_LAG + 1], wrap_angle(pitch - before[1]), tau, dt)
        x[ef.X_LAG + 2] = lagged(x[ef.X_LAG + 2], wrap_angle(yaw - before[2]), tau, dt)
    if anywhere(F[ef.DEPTH_LAG] > 0.0):
        x[ef.X_LAG_DEPTH] = lagged(x[ef.X_LAG_DEPTH], x[X_DOWN] - before[3], F[ef.DEPTH_LAG], dt)


@kernel
def read_state(x, y):
    """What the onboard sensors read at x without noise and without effects, into y (N_Y)."""
    y[ef.Y_ROLL], y[ef.Y_PITCH], y[ef.Y_YAW] = euler_angles(x)
    for i in range(3):
        y[ef.Y_P + i] = x[X_NU + 3 + i]
    y[ef.Y_DEPTH], y[ef.Y_SLIDER], y[ef.Y_BALLAST] = x[X_DOWN], x[X_SLIDER], x[X_BALLAST]


@kernel
def read(F, x, y):
    """What the sensors read at x without noise, into y (N_Y): onboard with its errors, motion capture without."""
    roll, pitch, yaw = euler_angles(x)
    y[ef.Y_MOCAP_X], y[ef.Y_MOCAP_Y], y[ef.Y_MOCAP_Z] = x[X_NORTH], x[X_EAST], x[X_DOWN]
    y[ef.Y_MOCAP_ROLL], y[ef.Y_MOCAP_PITCH], y[ef.Y_MOCAP_YAW] = roll, pitch, yaw
    y[ef.Y_ROLL] = roll - x[ef.X_LAG] + F[ef.ROLL_BIAS]
    y[ef.Y_PITCH] = (1.0 + F[ef.PITCH_SCALE]) * (pitch - x[ef.X_LAG + 1]) + F[ef.PITCH_BIAS]
    y[ef.Y_YAW] = yaw - x[ef.X_LAG + 2]
    if (
        anywhere(F[ef.COMPASS_S1] != 0.0) or anywhere(F[ef.COMPASS_C1] != 0.0)
        or anywhere(F[ef.COMPASS_S2] != 0.0) or anywhere(F[ef.COMPASS_C2] != 0.0)
    ):  # fmt: skip
        y[ef.Y_YAW] += F[ef.COMPASS_S1] * math.sin(yaw) + F[ef.COMPASS_C1] * math.cos(yaw)
        y[ef.Y_YAW] += F[ef.COMPASS_S2] * math.sin(2.0 * yaw) + F[ef.COMPASS_C2] * math.cos(2.0 * yaw)
    for i in range(3):
        y[ef.Y_P + i] = (1.0 + F[ef.GYRO_SCALE]) * x[X_NU + 3 + i] + F[ef.GYRO_P + i]
    lever = F[ef.DEPTH_LEVER] * math.sin(pitch) if anywhere(F[ef.DEPTH_LEVER] != 0.0) else 0.0
    y[ef.Y_DEPTH] = (1.0 + F[ef.DEPTH_SCALE]) * (x[X_DOWN] - lever - x[ef.X_LAG_DEPTH]) + F[ef.DEPTH_OFFSET]
    y[ef.Y_DEPTH] += F[ef.GAUGE_TANK] * x[X_BALLAST]
    y[ef.Y_SLIDER] = backlash(x[ef.X_GEAR_SLIDER], x[X_SLIDER], F[ef.SLIDER_PLAY])
    y[ef.Y_BALLAST] = x[X_BALLAST]
    for i in range(ef.Y_ONBOARD):
        y[i] += F[ef.BIAS + i]
