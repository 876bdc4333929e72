"""Kernels of the observer of an ocean glider: as core/filter and core/flight are ROUGHIE's, with the same arguments.

State, inputs and readings are those of sim_backend/ocean/core/layout. Errors are additive; the angle of the path is
no state of its own, it stands in x for the readings.
"""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel, parallel_kernel, prange
from glider.firmware.core.maths.matrices import product, transpose
from glider.sim_backend.ocean.core.glide import glide, net_buoyancy, next_speed, steady_speed, true_pitch
from glider.sim_backend.ocean.core.layout import (
    F_ROLL_TRIM,
    F_SPEED_BIAS,
    N_ERR,
    N_X,
    N_Y,
    Q_DEPTH,
    Q_ROLL,
    Q_SPEED,
    Q_WATER,
    ROLL_TIME,
    ROLL_TRIM,
    U_DENSITY,
    U_OIL,
    U_PITCH,
    U_PITCH_RATE,
    U_TEMPERATURE,
    U_UNSTEADY,
    U_YAW,
    UNSTEADY_SPEED,
    UNSTEADY_WALK,
    WATER_TIME,
    X_DEPTH,
    X_GLIDE,
    X_ROLL,
    X_SPEED,
    X_WATER,
    Y_DEPTH,
    Y_EAST,
    Y_NORTH,
    Y_ROLL,
    Y_SPEED,
)
from glider.tools.inference.core.gain import take_gain, take_measurement, take_valid


@kernel
def propagate(P, F, x, t, inputs, i, begin, Phi):
    """Fly x (N_X) from row i - 1 to row i, by the mean of both rows' inputs; Phi (N_ERR, N_ERR) is the derivative."""
    dt = t[i] - t[i - 1]
    pitch = 0.5 * (inputs[i - 1, U_PITCH] + inputs[i, U_PITCH])
    rate = 0.5 * (inputs[i - 1, U_PITCH_RATE] + inputs[i, U_PITCH_RATE])
    density = 0.5 * (inputs[i - 1, U_DENSITY] + inputs[i, U_DENSITY])
    temperature = 0.5 * (inputs[i - 1, U_TEMPERATURE] + inputs[i, U_TEMPERATURE])
    oil = 0.5 * (inputs[i - 1, U_OIL] + inputs[i, U_OIL])
    force = net_buoyancy(P, F, x[X_DEPTH], density, temperature, oil, t[i] - t[begin])
    path, drag = glide(P, F, x[X_SPEED], true_pitch(P, F, pitch, rate), density)
    speed, kept = next_speed(P, x[X_SPEED], dt, force * math.sin(path), drag)
    down = -math.sin(path)
    memory = math.exp(-dt / P[WATER_TIME])
    way = P[WATER_TIME] * (1.0 - memory)  # of 1 m/s of water that decorrelates
    x[X_DEPTH] += 0.5 * (x[X_SPEED] + speed) * down * dt + way * x[X_WATER]
    x[X_SPEED], x[X_GLIDE] = speed, path
    x[X_WATER] *= memory
    forgotten = math.exp(-dt / P[ROLL_TIME])
    x[X_ROLL] *= forgotten
    Phi[:] = 0.0
    Phi[X_DEPTH, X_DEPTH] = 1.0
    Phi[X_DEPTH, X_SPEED] = 0.5 * (1.0 + kept) * down * dt
    Phi[X_DEPTH, X_WATER] = way
    Phi[X_SPEED, X_SPEED] = kept
    Phi[X_WATER, X_WATER] = memory
    Phi[X_ROLL, X_ROLL] = forgotten


@kernel
def add_noise(P, spectral, dt, unsteady, cov):
    """Process noise of a step of dt s added to cov (N_ERR, N_ERR); unsteady 0 to 1: how little the model is to hold."""
    memory, forgotten = math.exp(-dt / P[WATER_TIME]), math.exp(-dt / P[ROLL_TIME])
    cov[X_WATER, X_WATER] += 0.5 * spectral[Q_WATER] * P[WATER_TIME] * (1.0 - memory * memory)
    cov[X_ROLL, X_ROLL] += 0.5 * spectral[Q_ROLL] * P[ROLL_TIME] * (1.0 - forgotten * forgotten)
    cov[X_DEPTH, X_DEPTH] += (spectral[Q_DEPTH] + unsteady * UNSTEADY_WALK) * dt + spectral[Q_WATER] * dt**3 / 3.0
    cov[X_SPEED, X_SPEED] += (spectral[Q_SPEED] + unsteady * UNSTEADY_SPEED) * dt


@kernel
def read_state(P, F, x, inputs, i, y):
    """What is read at row i of state x: y (N_Y)."""
    level = x[X_SPEED] * math.cos(x[X_GLIDE])
    y[Y_DEPTH] = x[X_DEPTH]
    y[Y_ROLL] = P[ROLL_TRIM] + F[F_ROLL_TRIM] + x[X_ROLL]
    y[Y_SPEED] = x[X_SPEED] + F[F_SPEED_BIAS]
    y[Y_NORTH] = level * math.cos(inputs[i, U_YAW])
    y[Y_EAST] = level * math.sin(inputs[i, U_YAW])


@kernel
def reading_derivative(x, inputs, i, H):
    """Derivative of read_state by the state, H (N_Y, N_ERR)."""
    H[:] = 0.0
    H[Y_DEPTH, X_DEPTH] = 1.0
    H[Y_ROLL, X_ROLL] = 1.0
    H[Y_SPEED, X_SPEED] = 1.0
    H[Y_NORTH, X_SPEED] = math.cos(x[X_GLIDE]) * math.cos(inputs[i, U_YAW])
    H[Y_EAST, X_SPEED] = math.cos(x[X_GLIDE]) * math.sin(inputs[i, U_YAW])


@allocating_kernel
def filter_run(P, F, spectral, R, t, inputs, z, begin, end, start, spread, X, path, E, W, K):
    """The Kalman filter over rows begin .. end - 1; arguments and results as in core/filter.filter_run.

    path (rows, 2): 1 sigma of the speed and of the vertical water behind each row, m/s.
    """
    x = start.copy()
    cov, Phi, turned = np.zeros((N_ERR, N_ERR)), np.empty((N_ERR, N_ERR)), np.empty((N_ERR, N_ERR))
    carried, error = np.empty((N_ERR, N_ERR)), np.empty(N_ERR)
    H, L, y, d = np.zeros((N_Y, N_ERR)), np.empty((N_Y, N_Y)), np.empty(N_Y), np.empty(N_Y)
    HC, HT, S = np.empty((N_Y, N_ERR)), np.empty((N_ERR, N_Y)), np.empty((N_Y, N_Y))
    for j in range(N_ERR):
        cov[j, j] = spread[j] * spread[j]
    misfit = 0.0
    for i in range(begin, end):
        if i > begin:
            propagate(P, F, x, t, inputs, i, begin, Phi)
            product(Phi, cov, carried)
            transpose(Phi, turned)
            product(carried, turned, cov)
            add_noise(P, spectral, t[i] - t[i - 1], inputs[i, U_UNSTEADY], cov)
        read_state(P, F, x, inputs, i, y)
        for m in range(N_Y):
            d[m] = z[i, m] - y[m]
        reading_derivative(x, inputs, i, H)
        misfit += take_measurement(H, cov, R, d, HC, HT, S, L, W[i], K[i])
        misfit += take_gain(W[i], K[i], d, error, E[i])
        for n in range(N_ERR):
            x[n] += error[n]
        x[X_SPEED] = max(x[X_SPEED], 0.0)
        for n in range(N_X):
            X[i, n] = x[n]
        path[i, 0], path[i, 1] = math.sqrt(max(cov[X_SPEED, X_SPEED], 0.0)), math.sqrt(max(cov[X_WATER, X_WATER], 0.0))
    return misfit


@parallel_kernel
def filter_runs(
    P, F, spectral, R, sigma, drift, modes, bounds, early, t, stamps, inputs, z, starts, speeds, spreads,
    X, path, E, W, K, misfit,
):  # fmt: skip
    """filter_run for every run. The first speed is uncertain in `spreads`: none is searched among `speeds`."""
    for run in prange(len(bounds) - 1):
        misfit[run] = filter_run(
            P, F, spectral, R[run], t, inputs, z, bounds[run], bounds[run + 1], starts[run], spreads[run], X, path, E,
            W, K,
        )  # fmt: skip


@allocating_kernel
def follow_run(P, F, t, inputs, z, begin, end, start, W, K, X, E):
    """A model flown along rows begin .. end - 1 with the gains of filter_run: X and E as there."""
    x, Phi, error = start.copy(), np.empty((N_ERR, N_ERR)), np.empty(N_ERR)
    y, d = np.empty(N_Y), np.empty(N_Y)
    for i in range(begin, end):
        if i > begin:
            propagate(P, F, x, t, inputs, i, begin, Phi)
        read_state(P, F, x, inputs, i, y)
        for m in range(N_Y):
            d[m] = z[i, m] - y[m]
        take_gain(W[i], K[i], d, error, E[i])
        for n in range(N_ERR):
            x[n] += error[n]
        x[X_SPEED] = max(x[X_SPEED], 0.0)
        for n in range(N_X):
            X[i, n] = x[n]


@parallel_kernel
def follow_runs(Ps, Fs, drift, modes, bounds, t, stamps, inputs, z, starts, W, K, valid, places, lost_at, E):
    """Whitened innovations of models Ps (models, N_P), Fs (models, N_F) with kept gains: as core/filter.follow_runs."""
    models = Ps.shape[0]
    for n in prange(models * (len(bounds) - 1)):
        m, run = n % models, n // models
        begin, end = bounds[run], bounds[run + 1]
        X, rows = np.empty((end - begin, N_X)), np.empty((end - begin, N_Y))
        follow_run(
            Ps[m], Fs[m], t[begin:end], inputs[begin:end], z[begin:end], 0, end - begin, starts[run], W[begin:end],
            K[begin:end], X, rows,
        )  # fmt: skip
        take_valid(rows, valid[begin:end], lost_at, E[m, places[run] : places[run + 1]])


@allocating_kernel
def fly_window(P, F, t, inputs, bound, X, begin, first, last, Y):
    """Fly a run whose first row is `bound` on from X[begin - 1], rows first .. last - 1 into Y (rows, N_Y)."""
    x, Phi = X[begin - 1].copy(), np.empty((N_ERR, N_ERR))
    for i in range(begin, last):
        propagate(P, F, x, t, inputs, i, bound, Phi)
        if i >= first:
            read_state(P, F, x, inputs, i, Y[i])


@parallel_kernel
def fly_windows(P, F, modes, bounds, t, inputs, X, paths, begin, first, last, run_of, Y):
    """Fly every window on from where a filter stands, as core/flight.fly_windows."""
    for w in prange(len(first)):
        fly_window(P, F, t, inputs, bounds[run_of[w]], X, begin[w], first[w], last[w], Y)


@parallel_kernel
def fly_followed(
    Ps, Fs, drift, modes, bounds, t, stamps, inputs, z, starts, W, K, begin_at, first, last, run_of, cut_of, Y
):  # fmt: skip
    """Every model followed along the runs with kept gains, and its windows flown on: as core/flight.fly_followed."""
    runs = len(bounds) - 1
    for n in prange(Ps.shape[0] * runs):
        m, run = n // runs, n % runs
        begin, end = bounds[run], bounds[run + 1]
        X, E = np.empty((end, N_X)), np.empty((end, N_Y))
        follow_run(Ps[m], Fs[m], t, inputs, z, begin, end, starts[run], W, K, X, E)
        for w in range(len(first)):
            if run_of[w] == run:
                fly_window(Ps[m], Fs[m], t, inputs, begin, X, begin_at[w], first[w], last[w], Y[m, cut_of[w]])


@parallel_kernel
def simulate_runs(P, F, spectral, R, modes, bounds, t, inputs, starts, disturbance_draws, noise, Z):
    """What would be measured, were (P, F) the truth: Z (rows, N_Y); disturbance_draws (rows, N_SPECTRAL), noise
    (rows, N_Y).
    """
    for run in prange(len(bounds) - 1):
        begin = bounds[run]
        x, Phi, cov = starts[run].copy(), np.empty((N_ERR, N_ERR)), np.zeros((N_ERR, N_ERR))
        for i in range(begin, bounds[run + 1]):
            if i > begin:
                propagate(P, F, x, t, inputs, i, begin, Phi)
                cov[:] = 0.0
                add_noise(P, spectral, t[i] - t[i - 1], 0.0, cov)
                for n in range(N_ERR):
                    x[n] += math.sqrt(cov[n, n]) * disturbance_draws[i, n]
                x[X_SPEED] = max(x[X_SPEED], 0.0)
            read_state(P, F, x, inputs, i, Z[i])
            for m in range(N_Y):
                Z[i, m] += math.sqrt(R[run, m]) * noise[i, m]


@parallel_kernel
def read_rows(F, X, path, t, bounds, Y):
    """What would be read at every row's state of depth, roll and speed, into Y (rows, N_Y); NaN of velocities."""
    for i in prange(len(t)):
        Y[i, :] = math.nan
        Y[i, Y_DEPTH], Y[i, Y_SPEED] = X[i, X_DEPTH], X[i, X_SPEED] + F[F_SPEED_BIAS]
        Y[i, Y_ROLL] = math.nan


@kernel
def steady_glide(P, F, z, since, inputs, rows, out):
    """Speed (m/s) and angle of the path (rad) of steady glides at rows, out (n, 2); depth z (rows), since (rows) s."""
    for k in range(len(rows)):
        i = rows[k]
        u = inputs[i]
        force = net_buoyancy(P, F, z[i], u[U_DENSITY], u[U_TEMPERATURE], u[U_OIL], since[i])
        pitch = true_pitch(P, F, u[U_PITCH], u[U_PITCH_RATE])
        out[k, 0], out[k, 1] = steady_speed(P, F, pitch, u[U_DENSITY], force)
