"""Random-walk Metropolis-Hastings, equations (7) and (8), on a posterior whose misfits are quadratic forms.

The log posterior of y (D,), the parameters in whitened coordinates, and l (G,), logarithms of noise scales:

    log p = - y' A0 y / 2 - b0' y
            - sum_g [ n_g l_g + exp(-2 l_g) (c_g + 2 b_g' y + y' A_g y) / 2 + (l_g / width)^2 / 2 ]

where G y + g0 >= 0 holds, and nothing elsewhere. A_g, b_g, c_g, n_g are the normal matrix, slope, sum of squares and
number of the samples of noise group g: sufficient statistics, so that a step costs no more than its algebra, whatever
the length of the recordings. One component moves at a time. The gradients A_g y + b_g are kept up to date, so that a
proposal costs O(G) and only an accepted one O(G D). Steps adapt to an acceptance of 0.44 during the warm-up and stay as
they are after it. Random numbers are counted, not drawn (sim_backend/core/noise): a seed gives one chain everywhere.
"""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel, parallel_kernel, prange
from glider.sim_backend.core.noise import gaussian, uniform

WANTED = 0.44  # acceptance of single components that a random walk does best with
WALK, DECIDE = 0, 1  # streams of random numbers
LEAST_STEP, LARGEST_STEP = 1e-6, 1e3


@kernel
def log_density(y, levels, A0, b0, A, b, c, n, width, bounds, base):
    """The log posterior at y (D,), levels (G,); -inf outside of the bounds (M, D), base (M,)."""
    D = len(y)
    for m in range(len(base)):
        value = base[m]
        for i in range(D):
            value += bounds[m, i] * y[i]
        if value < 0.0:
            return -math.inf
    total = 0.0
    for i in range(D):
        row = 0.0
        for j in range(D):
            row += A0[i, j] * y[j]
        total -= y[i] * (0.5 * row + b0[i])
    for g in range(len(levels)):
        square = c[g]
        for i in range(D):
            row = 0.0
            for j in range(D):
                row += A[g, i, j] * y[j]
            square += y[i] * (row + 2.0 * b[g, i])
        total -= n[g] * levels[g] + 0.5 * math.exp(-2.0 * levels[g]) * square + 0.5 * (levels[g] / width) ** 2
    return total


@parallel_kernel
def log_densities(points, A0, b0, A, b, c, n, width, bounds, base, out):
    """log_density of many points (N, D + G), into out (N,)."""
    D = len(b0)
    for k in prange(len(points)):
        out[k] = log_density(points[k, :D], points[k, D:], A0, b0, A, b, c, n, width, bounds, base)


@kernel
def accept(gain, seed, number):
    """Equation (8): whether step `number`, which gains so much log posterior, is taken; the walk is symmetric (L8)."""
    return gain >= 0.0 or math.log(uniform(seed, DECIDE, number)) < gain


@kernel
def adapted(step, taken, sweep):
    """A step's size after one proposal of the warm-up (Robbins and Monro): larger if taken, else smaller."""
    rate = min(0.5, 5.0 / (sweep + 1.0) ** 0.6)
    change = rate * ((1.0 if taken else 0.0) - WANTED)
    return min(max(step * math.exp(change), LEAST_STEP), LARGEST_STEP)


@kernel
def begin(y, levels, A0, b0, A, b, c, slope0, slope, square):
    """Gradients and sums of squares at y, in place."""
    D = len(y)
    for i in range(D):
        slope0[i] = b0[i]
        for j in range(D):
            slope0[i] += A0[i, j] * y[j]
    for g in range(len(levels)):
        square[g] = c[g]
        for i in range(D):
            row = 0.0
            for j in range(D):
                row += A[g, i, j] * y[j]
            slope[g, i] = row + b[g, i]
            square[g] += y[i] * (row + 2.0 * b[g, i])


@kernel
def sweep_parameters(y, weights, A0, A, bounds, room, slope0, slope, square, steps, seed, number, sweep, adapt, taken):
    """One proposal for each component of y, in place; weights (G,) are exp(-2 l), room (M,) is G y + g0.

    `number` counts the proposals of the chain before this one.
    """
    D, groups = len(y), len(weights)
    for i in range(D):
        d = steps[i] * gaussian(seed, WALK, number + i)
        allowed = True
        for m in range(len(room)):
            if room[m] + bounds[m, i] * d < 0.0:
                allowed = False
        took = False
        if allowed:
            gain = -d * (slope0[i] + 0.5 * d * A0[i, i])
            for g in range(groups):
                gain -= weights[g] * d * (slope[g, i] + 0.5 * d * A[g, i, i])
            took = accept(gain, seed, number + i)
        if took:
            y[i] += d
            for g in range(groups):
                square[g] += d * (2.0 * slope[g, i] + d * A[g, i, i])
                for j in range(D):
                    slope[g, j] += d * A[g, i, j]
            for j in range(D):
                slope0[j] += d * A0[i, j]
            for m in range(len(room)):
                room[m] += bounds[m, i] * d
            taken[0] += 1.0
        if adapt:
            steps[i] = adapted(steps[i], took, sweep)


@kernel
def sweep_levels(levels, weights, square, n, width, steps, seed, number, sweep, adapt, taken):
    """One proposal for each noise level, in place; weights follow."""
    for g in range(len(levels)):
        at = levels[g] + steps[g] * gaussian(seed, WALK, number + g)
        gain = -n[g] * (at - levels[g]) - 0.5 * (math.exp(-2.0 * at) - weights[g]) * square[g]
        gain -= 0.5 * (at * at - levels[g] * levels[g]) / (width * width)
        took = accept(gain, seed, number + g)
        if took:
            levels[g], weights[g] = at, math.exp(-2.0 * at)
            taken[0] += 1.0
        if adapt:
            steps[g] = adapted(steps[g], took, sweep)


@allocating_kernel
def walk(seed, start, A0, b0, A, b, c, n, width, bounds, base, warm, thin, out):
    """One chain from start (D + G,): out (draws, D + G) after `warm` sweeps, each `thin` on; returns its acceptance."""
    D, groups = len(b0), len(n)
    y, levels = start[:D].copy(), start[D:].copy()
    slope0, slope, square = np.empty(D), np.empty((groups, D)), np.empty(groups)
    begin(y, levels, A0, b0, A, b, c, slope0, slope, square)
    room = base.copy()
    for m in range(len(base)):
        for i in range(D):
            room[m] += bounds[m, i] * y[i]
    weights = np.exp(-2.0 * levels)
    steps, level_steps = np.full(D, 2.4), 1.7 / np.sqrt(np.maximum(n, 1.0))
    taken, total, number = np.zeros(1), 0, 0
    for sweep in range(warm + thin * len(out)):
        adapt = sweep < warm
        if sweep == warm:
            taken[0] = 0.0
        sweep_parameters(
            y, weights, A0, A, bounds, room, slope0, slope, square, steps, seed, number, sweep, adapt, taken
        )
        sweep_levels(levels, weights, square, n, width, level_steps, seed, number + D, sweep, adapt, taken)
        number += D + groups
        if not adapt:
            total += D + groups
            done = sweep - warm + 1
            if done % thin == 0:
                for i in range(D):
                    out[done // thin - 1, i] = y[i]
                for g in range(groups):
                    out[done // thin - 1, D + g] = levels[g]
    return taken[0] / max(total, 1)


@parallel_kernel
def walk_chains(seeds, starts, A0, b0, A, b, c, n, width, bounds, base, warm, thin, out, accepted):
    """Chains beside each other on all cores: out (chains, draws, D + G), accepted (chains,).

    Each chain has its own seed, set where the chain begins, so that the draws do not depend on the cores.
    """
    for chain in prange(len(seeds)):
        accepted[chain] = walk(
            seeds[chain], starts[chain], A0, b0, A, b, c, n, width, bounds, base, warm, thin, out[chain]
        )
