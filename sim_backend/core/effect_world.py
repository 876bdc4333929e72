"""The world around the plant with effects: late commands, moving water, surface and floor.

Where no effect is set, nothing of this runs: a nominal vehicle flies the plain plant.
"""

import math

from firmware.core.jit import kernel
from sim_backend.core import effect_layout as ef
from sim_backend.core import layout as wl
from sim_backend.core.effect_plant import effect_step, fold
from sim_backend.core.plant import boundary_force, water_velocity


@kernel
def set_effects(P, F, folded):
    """Whether any entry of the effect vector is set; if so, `folded` (N_P) becomes what holds throughout the flight."""
    for i in range(ef.N_F):
        if F[i] != 0.0:
            fold(P, F, folded)
            return True
    return False


@kernel
def late_commands(queue, cmd, step, delay, dt, out):
    """Keep the commands (3) of this step in the queue (rows, 3), and write what held `delay` (s) ago into out (3).

    The mean over the step, so that a delay between two steps is a delay between two steps; neutral before the start.
    The queue needs delay / dt + 2 rows.
    """
    rows = queue.shape[0]
    whole = math.floor(delay / dt + 1e-9)
    share = max(0.0, delay / dt - whole)
    for i in range(3):
        queue[step % rows, i] = cmd[i]
        newer = queue[(step - whole) % rows, i] if step >= whole else 0.0
        older = queue[(step - whole - 1) % rows, i] if step > whole else 0.0
        out[i] = newer + share * (older - newer) if share > 0.0 else newer


@kernel
def effect_world_step(P, F, E, waves, x, cmd, step, dt, acc, queue, work):
    """One step (number `step`) of folded parameters P with effects F in this environment, in place.

    The environment's water is that of the middle of the step, the force of surface and floor that of its start; work
    is (N_WORK, WORK_WIDTH) of scratch.
    """
    t = step * dt
    water, wanted = work[wl.W_WATER, 0:3], work[wl.W_WATER, 3:6]
    water[0], water[1], water[2] = water_velocity(E, waves, x[0], x[1], x[2], t + 0.5 * dt)
    force = 0.0
    if E[wl.ENV_SURFACE_HEIGHT] > 0.0 or E[wl.ENV_FLOOR_DEPTH] > 0.0:
        force = boundary_force(P, E, x, water[2])
    if F[ef.COMMAND_DELAY] > 0.0:
        late_commands(queue, cmd, step, F[ef.COMMAND_DELAY], dt, wanted)
    else:
        wanted[0], wanted[1], wanted[2] = cmd[0], cmd[1], cmd[2]
    effect_step(P, F, x, 0, wanted[0], wanted[1], wanted[2], t, acc, force, water, dt, work)
