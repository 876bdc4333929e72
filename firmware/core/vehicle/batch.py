"""Many vehicles at once: the nominal flight of LANES of them at a time (firmware/core/maths/wide)."""

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.maths.wide import LANES, as_wide
from glider.firmware.core.vehicle.flight import nominal_run


@kernel
def put_lane(row, lane, table):
    """A row (n,) into a lane of a table (n, LANES)."""
    for i in range(len(row)):
        table[i, lane] = row[i]


@kernel
def take_lane(table, lane, row):
    """A lane of a table (n, LANES) into a row (n,)."""
    for i in range(len(row)):
        row[i] = table[i, lane]


@kernel
def gather(rows, first, out):
    """Rows first, first + 1 .. of a table (rows, n) side by side in out (n, LANES); the last row fills what is left."""
    for lane in range(LANES):
        put_lane(rows[min(first + lane, len(rows) - 1)], lane, out)


@kernel
def scatter(out, first, rows):
    """The way back of `gather`."""
    for lane in range(min(LANES, len(rows) - first)):
        take_lane(out, lane, rows[first + lane])


@allocating_kernel
def nominal_batch(Ps, xs, commands, waters, dt, steps):
    """`steps` Runge-Kutta steps of every vehicle, in place, under held commands: Ps (vehicles, N_P),
    xs (vehicles, N_X).

    commands (vehicles, 3): servo rad, slider m, ballast kg; waters (vehicles, 3): m/s, NED.
    """
    P, x, work = np.empty((Ps.shape[1], LANES)), np.empty((xs.shape[1], LANES)), np.empty((3, xs.shape[1], LANES))
    command, water = np.empty((3, LANES)), np.empty((3, LANES))
    for first in range(0, len(xs), LANES):
        gather(Ps, first, P)
        gather(xs, first, x)
        gather(commands, first, command)
        gather(waters, first, water)
        c, w = as_wide(command), as_wide(water)
        nominal_run(as_wide(P), as_wide(x), c[0], c[1], c[2], w[0], w[1], w[2], dt, steps, as_wide(work))
        scatter(x, first, xs)
