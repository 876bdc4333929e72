"""Flights of the foreign plant: what its sensors read, a pilot who turns at depths, and windows flown on from truth."""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler, rotation_nb
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.layout import N_P
from glider.sim_backend.core.noise import gaussian, uniform
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.foreign_plant import foreign_step, gusts, loose_place, steady_share

SLIDER_PER_PITCH, SLIDER_PER_RATE, SLIDER_PER_BALLAST = 0.030, 0.025, -0.12  # m/rad, m s/rad, m/kg
SLIDER_MOST = 0.055  # m
JITTER_BLOCK = 0.5  # s


@kernel
def start_memory(F, x):
    """Fill what the effects remember as if the vehicle had long been as it is."""
    for i in range(16, fo.N_FX):
        x[i] = 0.0
    phi, theta, psi = euler_from_quaternion(x[3], x[4], x[5], x[6])
    for stage in (fo.X_ATT_1, fo.X_ATT_2):
        x[stage], x[stage + 1], x[stage + 2] = phi, theta, psi
    x[fo.X_DEPTH_1] = x[fo.X_DEPTH_2] = x[2]
    x[fo.X_ALPHA] = math.atan2(x[9], x[7] + 0.0)
    x[fo.X_LOOSE] = loose_place(-math.sin(theta))


@kernel
def wire_position(F, x):
    """Where the sliding mass is, m: the draw-wire is fixed to it."""
    return x[14] - (x[fo.X_SLIDER_Z] if F[fo.FS_SLIDER_BACKLASH] > 0.0 else 0.0)


@kernel
def read_attitude(F, x, t, y):
    """Attitude readings without bias and noise of the nominal sensors, into y."""
    if F[fo.FS_ATTITUDE_LAG] > 0.0:
        phi, theta, psi = x[fo.X_ATT_2], x[fo.X_ATT_2 + 1], x[fo.X_ATT_2 + 2]
    else:
        phi, theta, psi = euler_from_quaternion(x[3], x[4], x[5], x[6])
    pulled = F[fo.FS_ROLL_PULL] * wire_position(F, x) / 0.06
    y[fo.FR_ROLL] = phi + F[fo.FS_IMU_ROLL] * (1.0 + 0.1 * math.cos(2.0 * theta)) + pulled
    y[fo.FR_PITCH] = theta + F[fo.FS_IMU_PITCH] * (1.0 - 0.15 * math.exp(-t / 30.0))
    y[fo.FR_PITCH] += 0.5 * F[fo.FS_PITCH_SCALE] * math.sin(2.0 * theta)
    bent = F[fo.FS_COMPASS_1] * math.sin(psi - F[fo.FS_COMPASS_PHASE_1])
    bent += F[fo.FS_COMPASS_2] * math.sin(2.0 * psi - F[fo.FS_COMPASS_PHASE_2])
    y[fo.FR_YAW] = psi + bent


@kernel
def read_sensors(F, x, t, y):
    """All readings without bias and noise of the nominal sensors, into y (N_FR)."""
    read_attitude(F, x, t, y)
    p, q, r, scale = x[10], x[11], x[12], F[fo.FS_GYRO_SCALE]
    steady = steady_share(F, t)
    y[fo.FR_P] = p * (1.0 + 0.95 * scale) + 0.03 * scale * q + F[fo.FS_GYRO_P] * steady
    y[fo.FR_Q] = q * (1.0 + 1.05 * scale) + 0.03 * scale * r + F[fo.FS_GYRO_Q] * steady + F[fo.FS_GYRO_DEPTH] * x[2]
    y[fo.FR_R] = r * (1.0 + scale) + 0.03 * scale * p + F[fo.FS_GYRO_R] * steady - 0.6 * F[fo.FS_GYRO_DEPTH] * x[2]
    depth = x[fo.X_DEPTH_2] if F[fo.FS_DEPTH_LAG] > 0.0 else x[2]
    if F[fo.FS_LEVER] != 0.0:  # a port ahead or behind, a little above the middle
        _, _, _, _, _, _, r31, _, r33 = rotation_nb(x[3], x[4], x[5], x[6])
        depth += F[fo.FS_LEVER] * r31 - 0.08 * abs(F[fo.FS_LEVER]) * r33
    z = max(depth, 0.0)
    y[fo.FR_DEPTH] = depth + F[fo.FS_DEPTH_OFFSET] * steady + F[fo.FS_DEPTH_SCALE] * depth * (0.9 + 0.2 * z / (z + 5.0))
    y[fo.FR_SLIDER] = wire_position(F, x) + F[fo.FS_WIRE_DRIFT] * (1.0 - math.exp(-t / 40.0))
    y[fo.FR_BALLAST] = x[15]


@kernel
def delayed_row(F, seed, t, row):
    """The row whose commands are in force at t: late by a delay that wanders; row is where t falls."""
    delay = F[fo.FS_COMMAND_DELAY]
    if delay == 0.0:
        return row
    wander = 2.0 * uniform(seed, fo.STREAM_JITTER, int(t / JITTER_BLOCK)) - 1.0
    return max(0, math.floor((t - delay * (1.0 + F[fo.FS_JITTER] * wander)) / fo.ROW_S + 1e-9))


@kernel
def pilot_commands(L, leg, since, y, out):
    """Servo, slider and ballast commands of a leg, `since` seconds into it, from readings y; into out (3)."""
    stepped = 1.0 if since >= L[leg, fo.L_STEP_TIME] else 0.0
    out[0] = L[leg, fo.L_SERVO] + stepped * L[leg, fo.L_STEP_SERVO]
    out[2] = L[leg, fo.L_BALLAST]
    if L[leg, fo.L_FIXED] > 0.5:
        out[1] = L[leg, fo.L_SLIDER] + stepped * L[leg, fo.L_STEP_SLIDER]
    else:
        wanted = L[leg, fo.L_PITCH] + stepped * L[leg, fo.L_STEP_PITCH]
        out[1] = (
            SLIDER_PER_PITCH * (y[fo.FR_PITCH] - wanted) + SLIDER_PER_RATE * y[fo.FR_Q]
            - 0.035 * math.tan(wanted) + SLIDER_PER_BALLAST * out[2]
        )  # fmt: skip
    out[1] = clip(out[1], -SLIDER_MOST, SLIDER_MOST)


@kernel
def leg_over(L, leg, since, depth):
    """Whether a leg has reached its depth or its time."""
    if since >= L[leg, fo.L_TIME]:
        return True
    if L[leg, fo.L_BALLAST] > 0.0:
        return depth > L[leg, fo.L_DEPTH]
    return depth < L[leg, fo.L_DEPTH]


@kernel
def move_row(P, F, waves, seed, x, commands, row, acc, linear, angular, blow, Pw, work):
    """Move the plant from sample `row` to the next, in place; blow: turbulence goes on."""
    dt = fo.ROW_S / fo.ROW_STEPS
    for k in range(fo.ROW_STEPS):
        t = row * fo.ROW_S + k * dt
        c = delayed_row(F, seed, t, row)
        if blow:
            gusts(F, linear, angular, seed, row * fo.ROW_STEPS + k, dt, x)
        foreign_step(P, F, waves, seed, x, commands[c, 0], commands[c, 1], commands[c, 2], t, dt, acc, Pw, work)


@allocating_kernel
def fly_foreign(P, F, waves, errors, linear, angular, seed, x, L, commands, X, Y):
    """A whole run from x (N_FX, in place): commands (rows, 3), states X (rows, N_FX), noisy readings Y (rows, N_FR).

    errors (2, N_FR) bias and noise of the readings; linear, angular: the disturbance, held one row.
    """
    acc, Pw, work = np.zeros(6), np.empty(N_P), np.empty((3, fo.N_FX))
    start_memory(F, x)
    leg, begun = 0, 0
    for row in range(X.shape[0]):
        for i in range(fo.N_FX):
            X[row, i] = x[i]
        read_sensors(F, x, row * fo.ROW_S, Y[row])
        for i in range(fo.N_FR):
            Y[row, i] += errors[0, i] + errors[1, i] * gaussian(seed, fo.STREAM_NOISE + i, row)
        since = (row - begun) * fo.ROW_S
        if leg_over(L, leg, since, Y[row, fo.FR_DEPTH]) and leg + 1 < L.shape[0]:
            leg, begun, since = leg + 1, row, 0.0
        pilot_commands(L, leg, since, Y[row], commands[row])
        for i in range(6):
            acc[i] = (linear if i < 3 else angular) * gaussian(seed, fo.STREAM_PUSH + i, row)
        move_row(P, F, waves, seed, x, commands, row, acc, linear, angular, True, Pw, work)


@allocating_kernel
def fly_on(P, F, waves, seed, commands, X, first, last, Xw, Yw):
    """Windows flown on without noise, disturbance and turbulence: from X[first - 1] over rows first .. last - 1.

    X (rows, N_FX) true states; commands (rows, 3); first, last (windows,); the flights go into Xw (windows, longest,
    N_FX) and their readings into Yw (windows, longest, N_FR).
    """
    acc, Pw, work, x = np.zeros(6), np.empty(N_P), np.empty((3, fo.N_FX)), np.empty(fo.N_FX)
    for n in range(len(first)):
        for i in range(fo.N_FX):
            x[i] = X[first[n] - 1, i]
        for i in range(6):
            x[fo.X_GUST + i] = 0.0
        for row in range(first[n], last[n]):
            move_row(P, F, waves, seed, x, commands, row - 1, acc, 0.0, 0.0, False, Pw, work)
            for i in range(fo.N_FX):
                Xw[n, row - first[n], i] = x[i]
            read_sensors(F, x, row * fo.ROW_S, Yw[n, row - first[n]])


@allocating_kernel
def start_from_readings(F, X, rows):
    """Put depth and attitude of states X (rows, N_FX), in place, at what sensors under effects F make of them."""
    y = np.empty(fo.N_FR)
    for i in rows:
        read_sensors(F, X[i], i * fo.ROW_S, y)
        X[i, 2] = y[fo.FR_DEPTH]
        X[i, 3], X[i, 4], X[i, 5], X[i, 6] = quaternion_from_euler(y[fo.FR_ROLL], y[fo.FR_PITCH], y[fo.FR_YAW])


@kernel
def pose_rows(X, out):
    """Position and Euler angles of states X (rows, N_FX), into out (rows, 6)."""
    for i in range(X.shape[0]):
        for k in range(3):
            out[i, k] = X[i, k]
        out[i, 3], out[i, 4], out[i, 5] = euler_from_quaternion(X[i, 3], X[i, 4], X[i, 5], X[i, 6])
