"""Many open-loop flights at once, over all cores from one compiled call."""

import numpy as np

from firmware.core.jit import kernel, parallel_kernel, prange
from firmware.core.layout import N_X
from sim_backend.core import layout as at
from sim_backend.core.plant import hold_disturbance, rk4_step


@kernel
def fly_open_loop(P, E, waves, seed, x, commands, dt, steps_per_row, out):
    """Fly from x (in place) under commands (rows, 3), each held for steps_per_row steps of dt; out (rows, N_X).

    out[i] is the state when row i's commands come into force.
    """
    acc, work = np.zeros(6), np.zeros((5, N_X))
    counters = np.zeros(at.N_C, dtype=np.int64)
    counters[at.C_HOLD] = -1
    step = 0
    for row in range(commands.shape[0]):
        out[row] = x
        for _ in range(steps_per_row):
            t = step * dt
            hold_disturbance(E, seed, counters, t, acc)
            rk4_step(P, E, waves, x, commands[row], t, dt, acc, work)
            step += 1


@parallel_kernel
def fly_open_loop_many(Ps, Es, waves, seeds, xs, commands, dt, steps_per_row, out):
    """`fly_open_loop` for every row of Ps (n, N_P), Es (n, N_E), seeds (n,), xs (n, N_X), commands (n, rows, 3)."""
    for i in prange(Ps.shape[0]):
        fly_open_loop(Ps[i], Es[i], waves, seeds[i], xs[i], commands[i], dt, steps_per_row, out[i])
