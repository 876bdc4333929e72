"""Many open-loop flights at once, over all cores from one compiled call."""

import numpy as np

from glider.firmware.core.jit import allocating_kernel, parallel_kernel, prange
from glider.firmware.core.vehicle.layout import N_P, N_X
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effect_plant import effect_world_step, set_effects
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.plant import hold_disturbance, plant_step


@allocating_kernel
def fly_open_loop(P, E, F, waves, seed, x, commands, dt, steps_per_row, out):
    """Fly from x (N_XF, in place) under commands (rows, 3), each held for steps_per_row steps of dt; out (rows, N_X).

    out[i] is the state when row i's commands come into force.
    """
    acc, work, effective = np.zeros(6), np.zeros((wl.N_WORK, wl.WORK_WIDTH)), np.zeros(N_P)
    queue = np.zeros((int(F[ef.COMMAND_DELAY] / dt) + 3, 3))
    counters = np.zeros(wl.N_COUNTERS, dtype=np.int64)
    counters[wl.C_HOLD] = -1
    effects, step = set_effects(P, F, effective), 0
    for row in range(commands.shape[0]):
        out[row] = x[:N_X]
        for _ in range(steps_per_row):
            hold_disturbance(E, seed, counters, step * dt, acc)
            if effects:
                effect_world_step(effective, F, E, waves, x, commands[row], step, dt, acc, queue, work)
            else:
                plant_step(P, E, waves, x, commands[row], step * dt, dt, acc, work)
            step += 1


@parallel_kernel
def fly_open_loop_many(Ps, Es, Fs, waves, seeds, xs, commands, dt, steps_per_row, out):
    """`fly_open_loop` for every row of Ps (n, N_P), Es (n, N_E), Fs (n, N_F), seeds (n,), xs (n, N_XF) and commands
    (n, rows, 3)."""
    for i in prange(Ps.shape[0]):
        fly_open_loop(Ps[i], Es[i], Fs[i], waves, seeds[i], xs[i], commands[i], dt, steps_per_row, out[i])
