"""Effects of time: commands that take effect late, and motion capture by a clock of its own.

A delayed command is the mean, over the step flown, of the commands in force a delay earlier: so a delay between two
steps is a delay between two steps. A world keeps the commands of its even steps in a queue (`delayed_commands`), a
recording has them in rows (`mean_input`).
"""

import math

from glider.firmware.core.jit import kernel
from glider.sim_backend.core.effects import effect_layout as ef


@kernel
def delayed_commands(queue, cmd, step, delay, dt, out):
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
def mean_input(t, inputs, column, i, begin, since, until):
    """Mean over since..until (s) of an input held from each row on; before row `begin` its first value holds."""
    if until <= since:
        since = until - 1e-9
    j = i
    while j > begin and t[j] > since:
        j -= 1
    total, at = 0.0, since
    while True:
        end = until if j + 1 > i or t[j + 1] >= until else t[j + 1]
        if end > at:
            total += inputs[j, column] * (end - at)
            at = end
        if at >= until or j + 1 > i:
            break
        j += 1
    return total / (until - since)


@kernel
def mocap_lateness(F, late, since):
    """How much older than its stamp a pose is, s; late (s) beside the labels' part, since (s) from the run's start."""
    return F[ef.MOCAP_DELAY] + F[ef.CLOCK_SKEW] * since + late
