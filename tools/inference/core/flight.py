"""Kernels of the diagnosis: a model's flights from given states, without looking at what was measured."""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, parallel_kernel, prange
from glider.firmware.core.maths.matrices import copy
from glider.firmware.core.maths.steps import RK4
from glider.firmware.core.maths.wide import LANES, as_wide, room
from glider.firmware.core.vehicle.batch import gather
from glider.firmware.core.vehicle.layout import N_P
from glider.sim_backend.core.effect_plant import effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.core.error_layout import N_PATH, Q_ACC
from glider.tools.inference.core.filter import follow_run, groups_of
from glider.tools.inference.core.step import N_Y, log_path, pose_of, propagate, read_row


@allocating_kernel
def fly_window(P, F, mode, t, inputs, X, path, begin, first, last, Y):
    """Fly a run on from X[begin - 1], rows first .. last - 1 into Y (rows, N_Y); path (rows, N_PATH) up to begin.

    P, F, X, path and Y of wide numbers fly as many models as have lanes.
    """
    Pw, x, flown = room(P, (N_P,)), room(P, (ef.N_XF,)), room(P, (last, N_PATH))
    effective_parameters(P, F, Pw)
    copy(X[begin - 1], x)
    flown[:begin] = path[:begin]
    work, kept = room(P, (4, ef.N_XF)), room(P, (ef.N_XF,))
    zero, before, acc = np.zeros(3), room(P, (N_PATH,)), np.zeros(6)
    for i in range(begin, last):
        pose_of(x, before)
        propagate(Pw, F, x, mode, t, inputs, i, 0, acc, zero, work, kept, RK4)
        log_path(x, before, flown, i, 0)
        if i >= first:
            read_row(F, x, t, t, flown, i, 0, Y[i])


@parallel_kernel
def fly_windows(P, F, modes, bounds, t, inputs, X, paths, begin, first, last, run_of, Y):
    """Fly every window on from where a filter stands in row begin - 1: Y (rows, N_Y), rows first .. last - 1.

    X (rows, N_XF) and paths (rows, N_PATH) as filter_runs leaves them. Nothing measured is looked at.
    """
    for w in prange(len(first)):
        a, b = bounds[run_of[w]], bounds[run_of[w] + 1]
        fly_window(
            P, F, modes[run_of[w]], t[a:b], inputs[a:b], X[a:b], paths[a:b], begin[w] - a, first[w] - a, last[w] - a,
            Y[a:b],
        )  # fmt: skip


@parallel_kernel
def fly_followed(
    Ps, Fs, drift, modes, bounds, t, stamps, inputs, z, starts, W, K, begin_at, first, last, run_of, cut_of, Y
):  # fmt: skip
    """Every model followed along the runs with kept gains, and its windows flown on from there.

    begin_at (windows,): the row that each is flown from, its first or one before. Y (models, cuts, rows, N_Y): windows
    of one cut_of do not overlap; rows outside of them are left as they are.
    """
    groups = groups_of(Fs[:, ef.LINK])
    number = len(groups) - 1
    posed = len(first) > 0  # a variable: with a constant, follow_run would be compiled once more
    for n in prange(number * (len(bounds) - 1)):
        begins, ends, run = groups[n % number], groups[n % number + 1], n // number
        begin, end = bounds[run], bounds[run + 1]
        rows = end - begin
        P, F = np.empty((N_P, LANES)), np.empty((ef.N_F, LANES))
        gather(Ps[begins:ends], 0, P)
        gather(Fs[begins:ends], 0, F)
        X, path, E = np.empty((rows, ef.N_XF, LANES)), np.empty((rows, N_PATH, LANES)), np.empty((rows, N_Y, LANES))
        follow_run(
            as_wide(P), as_wide(F), drift, modes[run], t[begin:end], stamps[begin:end], inputs[begin:end],
            z[begin:end], 0, rows, starts[run], W[begin:end], K[begin:end], posed, as_wide(X), as_wide(path),
            as_wide(E),
        )  # fmt: skip
        for w in range(len(first)):
            if run_of[w] == run:
                at, a, b = begin_at[w] - begin, first[w] - begin, last[w] - begin
                fly_window(
                    as_wide(P), as_wide(F), modes[run], t[begin:end], inputs[begin:end], as_wide(X), as_wide(path),
                    at, a, b, as_wide(E),
                )  # fmt: skip
                for m in range(begins, ends):
                    Y[m, cut_of[w], first[w] : last[w]] = E[a:b, :, m - begins]


@parallel_kernel
def simulate_runs(P, F, spectral, R, modes, bounds, t, inputs, starts, disturbance_draws, noise, Z):
    """What would be measured, were (P, F) the truth: Z (rows, N_Y).

    disturbance_draws (rows, 6) and noise (rows, N_Y): standard normal deviates of the disturbance and of the sensors.
    """
    for run in prange(len(bounds) - 1):
        begin = bounds[run]
        Pw, x = np.empty(N_P), starts[run].copy()
        effective_parameters(P, F, Pw)
        work, kept = np.zeros((4, ef.N_XF)), np.empty(ef.N_XF)
        zero, before, acc = np.zeros(3), np.empty(N_PATH), np.zeros(6)
        path = np.zeros((bounds[run + 1] - begin, N_PATH))
        for i in range(begin, bounds[run + 1]):
            if i > begin:
                for j in range(6):
                    acc[j] = math.sqrt(spectral[Q_ACC + j] / (t[i] - t[i - 1])) * disturbance_draws[i, j]
                pose_of(x, before)
                propagate(Pw, F, x, modes[run], t, inputs, i, begin, acc, zero, work, kept, RK4)
                log_path(x, before, path, i - begin, 0)
            read_row(F, x, t[begin:], t[begin:], path, i - begin, 0, Z[i])
            for m in range(N_Y):
                Z[i, m] += math.sqrt(R[run, m]) * noise[i, m]


@parallel_kernel
def read_rows(F, X, path, t, bounds, Y):
    """What would be read at every row's state, into Y (rows, N_Y)."""
    for run in prange(len(bounds) - 1):
        begin, end = bounds[run], bounds[run + 1]
        for i in range(begin, end):
            read_row(F, X[i], t[begin:end], t[begin:end], path[begin:end], i - begin, 0, Y[i])
