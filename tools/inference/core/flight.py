"""Kernels of the diagnosis: a model's flights from given states, without looking at what was measured."""

import math

import numpy as np

from firmware.core.jit import parallel_kernel, prange
from firmware.core.vehicle.layout import N_P
from sim_backend.core import effect_layout as ef
from sim_backend.core.effect_plant import effective_parameters
from tools.inference.core.step import N_Y, log_path, pose_of, propagate, read_row


@parallel_kernel
def fly_windows(Ps, Fs, modes, bounds, t, inputs, X, paths, first, last, run_of, Y):
    """Fly every window with every model from where its filter stands: Y (models, rows, N_Y), rows first .. last - 1.

    X (models, rows, N_XF) and paths (models, rows, 6) as filter_runs leaves them; nothing measured is looked at.
    """
    windows = len(first)
    for n in prange(Ps.shape[0] * windows):
        m, w = n // windows, n % windows
        P, F, run = Ps[m], Fs[m], run_of[w]
        begin = bounds[run]
        Pw, x = np.empty(N_P), X[m, first[w] - 1].copy()
        effective_parameters(P, F, Pw)
        work, kept = np.zeros((4, ef.N_XF)), np.empty(ef.N_XF)
        zero, before, acc = np.zeros(3), np.empty(6), np.zeros(6)
        path = paths[m, begin : last[w]].copy()
        for i in range(first[w], last[w]):
            pose_of(x, before)
            propagate(Pw, F, x, modes[run], t, inputs, i, begin, acc, zero, work, kept, False)
            log_path(x, before, path, i - begin, 0)
            read_row(F, x, t[begin:], t[begin:], path, i - begin, 0, Y[m, i])


@parallel_kernel
def simulate_runs(P, F, spectral, R, modes, bounds, t, inputs, starts, shaken, noise, Z):
    """What would be measured, were (P, F) the truth: Z (rows, N_Y).

    shaken (rows, 6) and noise (rows, N_Y): standard normal deviates of the disturbance and of the sensors.
    """
    for run in prange(len(bounds) - 1):
        begin = bounds[run]
        Pw, x = np.empty(N_P), starts[run].copy()
        effective_parameters(P, F, Pw)
        work, kept = np.zeros((4, ef.N_XF)), np.empty(ef.N_XF)
        zero, before, acc = np.zeros(3), np.empty(6), np.zeros(6)
        path = np.zeros((bounds[run + 1] - begin, 6))
        for i in range(begin, bounds[run + 1]):
            if i > begin:
                for j in range(6):
                    acc[j] = math.sqrt(spectral[j] / (t[i] - t[i - 1])) * shaken[i, j]
                pose_of(x, before)
                propagate(Pw, F, x, modes[run], t, inputs, i, begin, acc, zero, work, kept, False)
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
