"""Kernels of the gap: the filter over whole runs, and windows flown on from its estimates, on all cores.

Runs stand one behind the other in tables of all rows; `bounds` (runs + 1) says where each begins.
"""

import math

import numpy as np

from firmware.core.estimation.estimator import estimator_predict, estimator_start, estimator_update, flight_derivative
from firmware.core.estimation.estimator_layout import (
    FRESH,
    GATE,
    MAX_STEP,
    N_E,
    N_W,
    N_WORK_ROWS,
    N_XE,
    N_Z,
    X_ERR,
    X_WATER,
)
from firmware.core.jit import kernel, parallel_kernel, prange
from firmware.core.maths.rotations import euler_from_quaternion
from firmware.core.vehicle.flight import normalise_attitude
from firmware.core.vehicle.layout import CG_X, M_S, M_T, N_X, NET_MASS, X_B
from firmware.core.vehicle.mass import inertia

# extras: what a model may have beside the vehicle file's parameters
ROLL_TRIM, YAW_TRIM = 0, 1  # moment over squared speed, kg
BALLAST_SCALE, SLIDER_SCALE = 2, 3  # share by which tank and slider do more than their draw-wires say
NET_DEPTH, NET_TIME = 4, 5  # net mass, kg/m of depth, kg/s of run
WATER_N, WATER_E = 6, 7  # m/s
SHEAR_N, SHEAR_E = 8, 9  # m/s per m of depth
N_EXTRAS = 10

# columns of a prediction Y: as z (firmware/core/estimation/estimator) up to the ballast, then the horizontal position
Y_X, Y_Y = 9, 10
N_Y = 11


@kernel
def observe(x, y):
    """What sensors without bias and noise would read at x, into y (N_Y)."""
    y[0], y[1], y[2] = euler_from_quaternion(x[3], x[4], x[5], x[6])
    y[3], y[4], y[5] = x[10], x[11], x[12]
    y[6], y[7], y[8] = x[2], x[14], x[15]
    y[Y_X], y[Y_Y] = x[0], x[1]


@kernel
def observe_rows(X, Y):
    """observe, row by row: X (rows, N_XE), Y (rows, N_Y)."""
    for i in range(X.shape[0]):
        observe(X[i], Y[i])


@kernel
def flight_step(P, x, mode, c_servo, c_slider, c_ballast, dt, work):
    """One step of the classical fourth-order Runge-Kutta method, in place; x (N_XE), work (5, N_XE)."""
    k1, k2, k3, k4, y = work[0], work[1], work[2], work[3], work[4]
    for i in range(N_X, N_XE):
        y[i] = x[i]
    flight_derivative(P, x, mode, c_servo, c_slider, c_ballast, k1)
    for i in range(N_X):
        y[i] = x[i] + 0.5 * dt * k1[i]
    flight_derivative(P, y, mode, c_servo, c_slider, c_ballast, k2)
    for i in range(N_X):
        y[i] = x[i] + 0.5 * dt * k2[i]
    flight_derivative(P, y, mode, c_servo, c_slider, c_ballast, k3)
    for i in range(N_X):
        y[i] = x[i] + dt * k3[i]
    flight_derivative(P, y, mode, c_servo, c_slider, c_ballast, k4)
    for i in range(N_X):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    normalise_attitude(x)


@kernel
def estimate_rows(P, S, sigma, mode, t, inputs, z, first, last, x, spread, X, sd, work, cov, stress, beyond, scores):
    """The filter from x over rows first .. last - 1, kept in X and sd; returns the sum of squared scores, each bounded.

    Arguments as in estimate_runs, of one run; work to scores are scratch.
    """
    estimator_start(P, S, sigma, x, cov, spread, work)
    beyond[:] = 0.0
    stress[:] = 1.0
    misfit, dt = 0.0, 0.0
    for i in range(first, last):
        if i > first:
            dt = t[i] - t[i - 1]
            servo, slider, ballast = inputs[i - 1, 0], inputs[i - 1, 1], inputs[i - 1, 2]
            estimator_predict(P, S, sigma, x, cov, stress, mode | FRESH, servo, slider, ballast, dt, work)
        estimator_update(P, S, x, cov, stress, z[i], beyond, scores, dt, work)
        for j in range(N_Z):
            if not math.isnan(scores[j]):
                misfit += min(scores[j] * scores[j], GATE * GATE)
        for j in range(N_XE):
            X[i, j] = x[j]
        for j in range(N_E):
            sd[i, j] = math.sqrt(cov[j, j])
    return misfit


@parallel_kernel
def estimate_runs(P, settings, sigma, modes, bounds, early, t, inputs, z, starts, speeds, spreads, X, sd):
    """The filter over every run: X (rows, N_XE) its state and sd (rows, N_E) its 1 sigma after each row's measurements.

    P (N_P), settings (runs, N_S), sigma (N_P), modes (runs), t (rows), inputs (rows, 3), z (rows, N_Z),
    starts (runs, N_XE), spreads (runs, N_E). Of the initial forward speeds (m/s) the one is taken whose squared
    scores over the rows below early (runs) add up to the least: one linearisation does not reach from a vehicle at
    rest to one that glides.
    """
    for run in prange(len(bounds) - 1):
        work, cov = np.zeros((N_WORK_ROWS, N_W)), np.empty((N_E, N_E))
        stress, beyond, scores, x = np.empty(2), np.empty(N_Z), np.empty(N_Z), np.empty(N_XE)
        least, speed = math.inf, speeds[0]
        for n in range(len(speeds) + 1):
            last = early[run] if n < len(speeds) else bounds[run + 1]
            x[:] = starts[run]
            x[7] = speeds[n] if n < len(speeds) else speed
            misfit = estimate_rows(
                P, settings[run], sigma, modes[run], t, inputs, z, bounds[run], last, x, spreads[run], X, sd,
                work, cov, stress, beyond, scores,
            )  # fmt: skip
            if n < len(speeds) and misfit < least:
                least, speed = misfit, speeds[n]


@kernel
def apply_extras(P, extras, x, since, Pw):
    """What the vehicle file has no entry for, at x: into Pw, a copy of P, and into x's model error and water.

    Masses and centres of gravity that follow the state are entries of P held over a step; trims are moments growing
    with the square of the speed; the water is uniform or sheared. since (s) counts from the run's start.
    """
    Pw[NET_MASS] = P[NET_MASS] + extras[BALLAST_SCALE] * x[15] + extras[NET_DEPTH] * x[2] + extras[NET_TIME] * since
    shift = extras[SLIDER_SCALE] * P[M_S] * x[14] + extras[BALLAST_SCALE] * x[15] * P[X_B]
    Pw[CG_X] = P[CG_X] + shift / P[M_T]
    i1, _, i3, _, _, _ = inertia(P, x[13], x[14], x[15])
    v_squared = x[7] * x[7] + x[8] * x[8] + x[9] * x[9]
    x[X_ERR + 3] += extras[ROLL_TRIM] * v_squared / i1
    x[X_ERR + 5] += extras[YAW_TRIM] * v_squared / i3
    x[X_WATER] = extras[WATER_N] + extras[SHEAR_N] * x[2]
    x[X_WATER + 1] = extras[WATER_E] + extras[SHEAR_E] * x[2]


@parallel_kernel
def fly_windows(P, extras, which, modes, t, since, inputs, shaken, starts, first, last, run_of, Y):
    """Fly every window with every model on: Y (models, rows, N_Y) for rows first[w] .. last[w] - 1.

    P (models, N_P), extras (models, N_EXTRAS); which (models): the variant of modes (variants, runs), inputs
    (variants, rows, 3), shaken (variants, rows, 6): accelerations added from each row on, and starts (variants,
    windows, N_XE): the state at row first[w] - 1, flown on without the filter's model error.
    """
    models, windows = P.shape[0], len(first)
    for n in prange(models * windows):
        m, w = n // windows, n % windows
        v = which[m]
        work, Pw = np.zeros((5, N_XE)), P[m].copy()
        x, kept = starts[v, w].copy(), np.empty(N_XE)
        x[N_X:] = 0.0
        mode = modes[v, run_of[w]]
        for i in range(first[w], last[w]):
            dt = t[i] - t[i - 1]
            steps = max(1, math.ceil(dt / MAX_STEP - 1e-9))
            servo, slider, ballast = inputs[v, i - 1, 0], inputs[v, i - 1, 1], inputs[v, i - 1, 2]
            for k in range(steps):
                for j in range(6):
                    x[X_ERR + j] = shaken[v, i - 1, j]
                apply_extras(P[m], extras[m], x, since[i - 1] + k * dt / steps, Pw)
                kept[:] = x
                flight_step(Pw, x, mode, servo, slider, ballast, dt / steps, work)
                # A model far from any vehicle may fly to where no number is: it stays where it was.
                if not math.isfinite(x.sum()):
                    x[:] = kept
            observe(x, Y[m, i])
