"""Kernels of the diagnosis: what a model with effects fails to predict of a recording, row by row.

A Kalman filter follows each run with a given model; what its one-step predictions miss, divided by how much they may
miss, are the whitened innovations: for the true model white, of unit variance, whatever the disturbance did to the
course. Its gains are kept, and any other model is then flown along the same data with those gains: its innovations
differ smoothly with its parameters however long the run, because the data hold every flight to the course flown.

Runs stand one behind the other in tables of all rows; `bounds` (runs + 1) says where each begins. Errors of the state
(N_ERR) and densities of process noise (N_SPECTRAL) are those of core/error_layout.
"""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel, parallel_kernel, prange
from glider.firmware.core.maths.matrices import copy, product, transpose
from glider.firmware.core.maths.rotations import wrap_angle
from glider.firmware.core.maths.steps import MIDPOINT, RK4
from glider.firmware.core.maths.wide import LANES, as_wide, room
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.batch import gather
from glider.firmware.core.vehicle.layout import N_P, SERVO_MAX, SERVO_MIN, X_ACT, X_NU, X_SERVO
from glider.firmware.core.vehicle.state import rotation
from glider.sim_backend.core.effect_plant import effect_parts, effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.correction import link_of
from glider.tools.inference.core.error_layout import (
    E_ACT,
    E_ATT,
    E_DOWN,
    E_LATE,
    E_NU,
    E_POS,
    N_ERR,
    N_PATH,
    Q_ACC,
    Q_ACT,
    Q_LATE,
    Q_POS,
)
from glider.tools.inference.core.gain import take_gain, take_measurement, take_valid
from glider.tools.inference.core.model_error import (
    L_GYRO,
    N_MODEL_ERROR,
    add_drift,
    add_model_error,
    model_error_columns,
    step_model_error,
    take_gyro_bias,
)
from glider.tools.inference.core.step import (
    N_Y,
    difference,
    inject_error,
    innovation,
    log_path,
    pose_of,
    propagate,
    read_now,
    read_row,
    step_count,
)

LOST_SPEED = 3.0  # m/s; a glider of this class flies at 0.2 to 0.7: an observer that thinks it faster has lost it
DIFFERENCE_STEP = 1e-5  # of the state's unit, for derivatives


@kernel
def perturbed(x, j, error, moved):
    """x with its error j at DIFFERENCE_STEP, into moved; error (N_ERR or more) is scratch."""
    error[:] = 0.0
    error[j] = DIFFERENCE_STEP
    copy(x, moved)
    inject_error(moved, error)


@kernel
def noise_gain(x, dt, Gam):
    """What accelerations held over a step of dt to x leave, Gam (N_ERR, 6): speeds, and half as much way and turn."""
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation(x)
    half = 0.5 * dt * dt
    Gam[:] = 0.0
    Gam[E_POS, 0], Gam[E_POS, 1], Gam[E_POS, 2] = half * r11, half * r12, half * r13
    Gam[E_POS + 1, 0], Gam[E_POS + 1, 1], Gam[E_POS + 1, 2] = half * r21, half * r22, half * r23
    Gam[E_POS + 2, 0], Gam[E_POS + 2, 1], Gam[E_POS + 2, 2] = half * r31, half * r32, half * r33
    for j in range(3):
        Gam[E_ATT + j, 3 + j] = half
    for j in range(6):
        Gam[E_NU + j, j] = dt


@allocating_kernel
def filled(values):
    """An array (n, LANES) of one vector, in every lane."""
    many = np.empty((len(values), LANES))
    for n in range(len(values)):
        many[n, :] = values[n]
    return many


@kernel
def linear_step(
    Pw, F, x, acc, mode, t, inputs, i, begin, zero, work, kept, Pws, Fs, many, states, works, keeps, moved, base, error,
    Phi, Gam,
):  # fmt: skip
    """Fly x to row i; Phi (N_ERR, N_ERR) is the step's derivative by the state, Gam (N_ERR, 6) by accelerations.

    acc (6) is added to nu_dot. Nothing of a step depends on the place north and east that it starts from, nor on
    motion capture's clock. States that are off by one error each fly beside each other: Pws (N_P), Fs (N_F) are Pw, F
    as wide numbers; many (6, LANES), states (N_XF, LANES), works and keeps (wide) are scratch.
    """
    for j in range(E_DOWN):
        Phi[:, j] = 0.0
        Phi[j, j] = 1.0
    Phi[:, E_LATE] = 0.0
    Phi[E_LATE, E_LATE] = 1.0
    for n in range(6):
        many[n, :] = acc[n]
    # one and the same number for all of them: where one had more than the other, that would be their difference
    dt = t[i] - t[i - 1]
    parts = effect_parts(MIDPOINT, Pw, F, x, mode, dt / step_count(dt))
    for first in range(E_DOWN - 1, E_LATE, LANES):  # the first of all is x as it stands, which the others are off from
        for n in range(LANES):
            copy(x, moved)
            if E_DOWN <= first + n < E_LATE:
                perturbed(x, first + n, error, moved)
            copy(moved, states[:, n])
        propagate(
            Pws, Fs, as_wide(states), mode, t, inputs, i, begin, as_wide(many), zero, works, keeps, MIDPOINT, parts
        )  # fmt: skip
        if first < E_DOWN:
            copy(states[:, 0], base)
        for n in range(LANES):
            if E_DOWN <= first + n < E_LATE:
                copy(states[:, n], moved)
                difference(moved, base, error)
                for m in range(N_ERR):
                    Phi[m, first + n] = error[m] / DIFFERENCE_STEP
    propagate(Pw, F, x, mode, t, inputs, i, begin, acc, zero, work, kept, RK4)
    noise_gain(x, dt, Gam)


@kernel
def linear_reading(F, x, t, stamps, path, i, begin, moved, error, y, y2, H):
    """H (N_Y, N_ERR), the derivative of what is read at row i, y (N_Y), by the state.

    Where no correction of a reading is fitted, none depends on the speeds u, v, w.
    """
    still = link_of(F) <= ef.ACTUATOR_LINKS
    for j in range(N_ERR):
        if still and E_NU <= j < E_NU + 3:
            for m in range(N_Y):
                H[m, j] = 0.0
            continue
        perturbed(x, j, error, moved)
        read_row(F, moved, t, stamps, path, i, begin, y2)
        for m in range(N_Y):
            change = y2[m] - y[m]
            if m <= ef.Y_YAW or m >= ef.Y_MOCAP_ROLL:
                change = wrap_angle(change)
            H[m, j] = change / DIFFERENCE_STEP


@allocating_kernel
def filter_run(
    P, F, spectral, R, sigma, drift, mode, t, stamps, inputs, z, begin, end, start, spread, X, path, E, W, K
):
    """The Kalman filter over rows begin .. end - 1. Returns -2 log likelihood without its constant.

    With a spread of N_ERR the model is taken at its word but for `spectral`; with N_ERR + N_MODEL_ERROR the filter also
    finds what the model lacks (core/model_error): sigma (N_P) and drift (N_DRIFT) say how much that may be.

    P (N_P), F (N_F); spectral (N_SPECTRAL): spectral densities of the accelerations ((m/s2)2 s, (rad/s2)2 s), walks
    of servo, slider, ballast, of the position and of motion capture's clock (per s); R (N_Y) measurements' variances;
    start (N_XF), spread (N_ERR or N_ERR + N_MODEL_ERROR).
    Out: X (rows, N_XF) the state and path (rows, N_PATH) after each row, E (rows, N_Y) whitened innovations, NaN where
    nothing was measured, W (rows, N_Y, N_Y) what whitens a row's innovations and K (rows, spreads, N_Y) what corrects
    the state by the whitened ones.
    """
    Pw, x = np.empty(N_P), start.copy()
    effective_parameters(P, F, Pw)
    work, kept, moved, base = np.zeros((4, ef.N_XF)), np.empty(ef.N_XF), np.empty(ef.N_XF), np.empty(ef.N_XF)
    count = len(spread)
    Pws, Fs, many, states = filled(Pw), filled(F), np.empty((6, LANES)), np.empty((ef.N_XF, LANES))
    works, keeps = np.zeros((4, ef.N_XF, LANES)), np.empty((ef.N_XF, LANES))
    error, zero, before, model_error = np.empty(count), np.zeros(3), np.empty(N_PATH), np.zeros(N_MODEL_ERROR)
    Phi, Gam, cov = np.zeros((count, count)), np.empty((count, 6)), np.zeros((count, count))
    carried, turned = np.empty((count, count)), np.empty((count, count))
    H, L, y, y2, d = np.zeros((N_Y, count)), np.empty((N_Y, N_Y)), np.empty(N_Y), np.empty(N_Y), np.empty(N_Y)
    HC, HT, S = np.empty((N_Y, count)), np.empty((count, N_Y)), np.empty((N_Y, N_Y))
    for j in range(count):
        cov[j, j] = spread[j] * spread[j]
    if count > N_ERR:
        add_model_error(Pw, sigma, x, 1.0, work, cov)
    misfit = 0.0
    for n in range(N_PATH):
        path[begin, n] = 0.0
    for i in range(begin, end):
        if i > begin:
            dt = t[i] - t[i - 1]
            pose_of(x, before)
            linear_step(
                Pw, F, x, model_error[:6], mode, t, inputs, i, begin, zero, work, kept, as_wide(Pws), as_wide(Fs), many,
                states, as_wide(works), as_wide(keeps), moved, base, error, Phi, Gam,
            )  # fmt: skip
            if count > N_ERR:
                step_model_error(drift, x, model_error, dt)
                model_error_columns(drift, dt, Gam, Phi)
            log_path(x, before, path, i, begin)
            product(Phi, cov, carried)
            transpose(Phi, turned)
            product(carried, turned, cov)
            transpose(Gam, turned)
            for j in range(6):
                s = spectral[Q_ACC + j] / dt
                for a in range(count):
                    if Gam[a, j] != 0.0:
                        for b in range(count):
                            cov[a, b] += s * Gam[a, j] * turned[j, b]
            for j in range(3):
                cov[E_ACT + j, E_ACT + j] += spectral[Q_ACT + j] * dt
                cov[E_POS + j, E_POS + j] += spectral[Q_POS + j] * dt
            cov[E_LATE, E_LATE] += spectral[Q_LATE] * dt
            if count > N_ERR:
                add_drift(Pw, sigma, drift, x, dt, work, cov)
        read_row(F, x, t, stamps, path, i, begin, y)
        innovation(z[i], y, d)
        linear_reading(F, x, t, stamps, path, i, begin, moved, error, y, y2, H)
        if count > N_ERR:
            take_gyro_bias(model_error, d)
            for j in range(3):
                H[ef.Y_P + j, N_ERR + L_GYRO + j] = 1.0
        misfit += take_measurement(H, cov, R, d, HC, HT, S, L, W[i], K[i])
        copy(x, base)
        misfit += apply_gain(W[i], K[i], d, x, error, E[i])
        for n in range(count - N_ERR):
            model_error[n] += error[N_ERR + n]
        if count > N_ERR:  # a servo that nobody reads or commands turns no further than its stops
            x[X_SERVO] = clip(x[X_SERVO], P[SERVO_MIN], P[SERVO_MAX])
            x[ef.X_GEAR_SERVO] = x[X_SERVO] if F[ef.SERVO_PLAY] == 0.0 else x[ef.X_GEAR_SERVO]
        if count > N_ERR and lost(x, cov):  # by readings of no vehicle: it begins anew
            copy(base, x)
            copy(start[X_NU:X_ACT], x[X_NU:X_ACT])
            model_error[:] = 0.0
            K[i, :, :] = 0.0
            cov[:] = 0.0
            for j in range(count):
                cov[j, j] = spread[j] * spread[j]
        for n in range(ef.N_XF):
            X[i, n] = x[n]
    return misfit


@kernel
def lost(x, cov):
    """Whether a filter's state moves as no vehicle does, or is no number, or its covariance is none."""
    total, fastest = 0.0, 0.0
    for n in range(len(cov)):
        total += cov[n, n]
    for n in range(ef.N_XF):
        total += x[n]
    for n in range(X_NU, X_NU + 3):
        fastest = max(fastest, abs(x[n]))
    return not (math.isfinite(total) and fastest < LOST_SPEED)


@kernel
def apply_gain(W, K, d, x, error, e):
    """Whiten a row's innovations d into e, correct x by them, return their sum of squares; d is used up."""
    total = take_gain(W, K, d, error, e)
    inject_error(x, error)
    return total


@parallel_kernel
def filter_runs(
    P, F, spectral, R, sigma, drift, modes, bounds, early, t, stamps, inputs, z, starts, speeds, spreads,
    X, path, E, W, K, misfit,
):  # fmt: skip
    """filter_run for every run, from the one of the forward speeds (m/s) that explains the rows below early best.

    misfit (runs) gets -2 log likelihood; starts (runs, N_XF) the speed taken.
    """
    for run in prange(len(bounds) - 1):
        begin, end = bounds[run], bounds[run + 1]
        least, speed = math.inf, starts[run, X_NU]
        start = starts[run].copy()
        for n in range(len(speeds) + 1):
            start[X_NU] = speeds[n] if n < len(speeds) else speed
            found = filter_run(
                P, F, spectral, R[run], sigma, drift, modes[run], t, stamps, inputs, z, begin,
                early[run] if n < len(speeds) else end, start, spreads[run], X, path, E, W, K,
            )  # fmt: skip
            if n == len(speeds):
                misfit[run] = found
            elif found < least:
                least, speed = found, speeds[n]
        starts[run, X_NU] = speed


@kernel
def posed(z):
    """Whether motion capture saw anything of rows z (rows, N_Y)."""
    for i in range(len(z)):
        for m in range(ef.Y_ONBOARD, N_Y):
            if not math.isnan(z[i, m]):
                return True
    return False


@allocating_kernel
def follow_run(P, F, drift, mode, t, stamps, inputs, z, begin, end, start, W, K, posed, X, path, E):
    """A model flown along rows begin .. end - 1 with the gains of filter_run: X, path and E as there.

    Where the gains correct what the model lacks, too, it is followed with the state. posed: whether the path is asked
    for, without which poses of another time cannot be read. X without rows is not asked for. P, F, X, path and E of
    wide numbers fly as many models as have lanes.
    """
    Pw, x = room(P, (N_P,)), room(P, (ef.N_XF,))
    effective_parameters(P, F, Pw)
    copy(start, x)
    work, kept = room(P, (4, ef.N_XF)), room(P, (ef.N_XF,))
    count = K.shape[1]
    error, zero, before, model_error = room(P, (count,)), np.zeros(3), room(P, (N_PATH,)), room(P, (N_MODEL_ERROR,))
    y, d = room(P, (N_Y,)), room(P, (N_Y,))
    for n in range(N_PATH):
        path[begin, n] = 0.0
    for i in range(begin, end):
        if i > begin:
            if posed:
                pose_of(x, before)
            propagate(Pw, F, x, mode, t, inputs, i, begin, model_error[:6], zero, work, kept, RK4)
            if count > N_ERR:
                step_model_error(drift, x, model_error, t[i] - t[i - 1])
            if posed:
                log_path(x, before, path, i, begin)
        if posed:
            read_row(F, x, t, stamps, path, i, begin, y)
        else:
            read_now(F, x, t[i] - t[begin], y)
        innovation(z[i], y, d)
        if count > N_ERR:
            take_gyro_bias(model_error, d)
        apply_gain(W[i], K[i], d, x, error, E[i])
        for n in range(count - N_ERR):
            model_error[n] += error[N_ERR + n]
        if len(X) > 0:
            for n in range(ef.N_XF):
                X[i, n] = x[n]


@allocating_kernel
def groups_of(links):
    """Where groups of at most LANES models begin whose corrections, if any, enter at the same link; and their end."""
    begins, count = np.empty(len(links) + 1, np.int64), 0
    for m in range(len(links)):
        if count == 0 or m == begins[count - 1] + LANES or links[m] != links[begins[count - 1]]:
            begins[count] = m
            count += 1
    begins[count] = len(links)
    return begins[: count + 1]


@parallel_kernel
def follow_runs(Ps, Fs, drift, modes, bounds, t, stamps, inputs, z, starts, W, K, valid, places, lost_at, E):
    """Whitened innovations of models Ps (models, N_P), Fs (models, N_F) with kept gains: E (models, samples).

    Samples are what is `valid` (rows, N_Y), row by row; places (runs + 1): the first of each run. What is
    larger than lost_at, or no number, is lost_at.
    """
    groups = groups_of(Fs[:, ef.LINK])
    number = len(groups) - 1
    for n in prange(number * (len(bounds) - 1)):  # models of a run one after the other: its gains are then near
        first, last, run = groups[n % number], groups[n % number + 1], n // number
        begin, end = bounds[run], bounds[run + 1]
        P, F = np.empty((N_P, LANES)), np.empty((ef.N_F, LANES))
        gather(Ps[first:last], 0, P)
        gather(Fs[first:last], 0, F)
        # scratch of this run alone; indices count from its first row
        path, rows = np.empty((end - begin, N_PATH, LANES)), np.empty((end - begin, N_Y, LANES))
        follow_run(
            as_wide(P), as_wide(F), drift, modes[run], t[begin:end], stamps[begin:end], inputs[begin:end],
            z[begin:end], 0, end - begin, starts[run], W[begin:end], K[begin:end], posed(z[begin:end]),
            as_wide(np.empty((0, ef.N_XF, LANES))), as_wide(path), as_wide(rows),
        )  # fmt: skip
        for m in range(first, last):
            take_valid(rows[:, :, m - first], valid[begin:end], lost_at, E[m, places[run] : places[run + 1]])
