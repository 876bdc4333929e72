"""A data-driven correction: an error at one link of the chain, as a sum of shapes that are about 1 in a glide."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import lane, spread
from glider.firmware.core.vehicle.layout import X_DOWN
from glider.firmware.core.vehicle.state import rotation, velocities
from glider.sim_backend.core.effects import effect_layout as ef

SPEED, DEPTH, ANGLE, RATE, PUMP, TIME = 0.3, 5.0, 0.1, 0.1, 0.03, 60.0  # of a glide: m/s, m, rad, rad/s, kg/s, s
LEAST_FLOW_SPEED = 0.05  # m/s, below which angles of flow grow no more


@kernel
def shapes(x, since, pump):
    """The eleven of effect_layout.SHAPES, in their order.

    x (N_XF); since (s) from the run's start; pump (kg/s), positive when taking in water.
    """
    u, v, w, p, q, r = velocities(x)
    squared = u * u + v * v + w * w
    speed = max(math.sqrt(squared), LEAST_FLOW_SPEED)
    _, _, _, _, _, _, kx, _, _ = rotation(x)
    return (
        spread(1.0, squared), squared / (SPEED * SPEED), x[X_DOWN] / DEPTH, w / speed / ANGLE, v / speed / ANGLE,
        p / RATE, q / RATE, r / RATE, spread(pump / PUMP, squared), spread(since / TIME, squared),
        math.tanh(-kx / ef.REST_PITCH),
    )  # fmt: skip


@kernel
def link_of(F):
    """The link at which the correction of F enters, 0 for none: one and the same in all lanes."""
    return int(lane(F[ef.LINK], 0))


@kernel
def correction(F, x, since, pump):
    """What the correction adds at its link, in the link's unit; arguments as of `shapes`."""
    value, values = 0.0, shapes(x, since, pump)
    for n in range(ef.N_SHAPES):
        value += F[ef.SHAPE + n] * values[n]
    return value
