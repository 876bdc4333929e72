"""Kernels of the gap: the filter over whole runs, and windows flown on from its estimates, on all cores.

Runs stand one behind the other in tables of all rows; `bounds` (runs + 1) says where each begins.
"""

import math

import numpy as np

from firmware.core.estimator import estimator_predict, estimator_start, estimator_update, flight_derivative
from firmware.core.estimator_layout import GATE, MAX_STEP, N_E, N_W, N_WORK_ROWS, N_XE, N_Z
from firmware.core.flight import normalise_attitude
from firmware.core.jit import kernel, parallel_kernel, prange
from firmware.core.layout import N_X
from firmware.core.rotations import euler_from_quaternion

# columns of a prediction Y: as z (firmware/core/estimator) up to the ballast, then the horizontal position
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
            estimator_predict(P, S, sigma, x, cov, stress, mode, servo, slider, ballast, dt, work)
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
def estimate_runs(P, settings, sigma, modes, bounds, early, t, inputs, z, starts, speeds, penalties, spreads, X, sd):
    """The filter over every run: X (rows, N_XE) its state and sd (rows, N_E) its 1 sigma after each row's measurements.

    P (N_P), settings (runs, N_S), sigma (N_P), modes (runs), t (rows), inputs (rows, 3), z (rows, N_Z),
    starts (runs, N_XE), spreads (runs, N_E). Of the initial forward speeds (m/s) the one is taken whose squared
    scores over the rows below early (runs), with its penalty, add up to the least: one linearisation does not reach
    from a vehicle at rest to one that glides.
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
            if n < len(speeds) and misfit + penalties[n] < least:
                least, speed = misfit + penalties[n], speeds[n]


@parallel_kernel
def fly_windows(P, modes, t, inputs, starts, first, last, run_of, Y):
    """Fly every window with every model on: Y (models, rows, N_Y) for rows first[w] .. last[w] - 1.

    P (models, N_P), modes (runs), starts (windows, N_XE): the state at row first[w] - 1, flown on without model error.
    """
    models, windows = P.shape[0], len(first)
    for n in prange(models * windows):
        m, w = n // windows, n % windows
        work = np.zeros((5, N_XE))
        x = starts[w].copy()
        x[N_X:] = 0.0
        mode = modes[run_of[w]]
        for i in range(first[w], last[w]):
            dt = t[i] - t[i - 1]
            steps = max(1, math.ceil(dt / MAX_STEP - 1e-9))
            for _ in range(steps):
                flight_step(P[m], x, mode, inputs[i - 1, 0], inputs[i - 1, 1], inputs[i - 1, 2], dt / steps, work)
            observe(x, Y[m, i])
