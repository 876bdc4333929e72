"""Effects of mass: more or less of it, elsewhere, and behind readings that do not show it."""

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import everywhere, where
from glider.firmware.core.vehicle import layout
from glider.sim_backend.core.effects import effect_layout as ef


@kernel
def effective_masses(F, out):
    """Net mass, centre of gravity and inertia with effects F, in place in out (N_P)."""
    out[layout.NET_MASS] += F[ef.NET_MASS_OFFSET]
    out[layout.CG_X] += F[ef.CG_OFFSET_X]
    out[layout.CG_Y] += F[ef.CG_OFFSET_Y]
    out[layout.CG_Z] += F[ef.CG_OFFSET_Z]
    out[layout.J_YY] *= 1.0 + F[ef.INERTIA_Y]
    out[layout.J_ZZ] *= 1.0 + F[ef.INERTIA_Z]


@kernel
def net_mass_of_depth(F, depth):
    """Net mass (kg) at the origin that the depth (m) makes: a hull squeezed, denser water below a mixed layer."""
    if everywhere(F[ef.MIXED_LAYER] <= 0.0):
        return F[ef.MASS_PER_DEPTH] * depth
    below = depth - F[ef.MIXED_LAYER]
    return F[ef.MASS_PER_DEPTH] * where(below < 0.0, 0.0, below)


@kernel
def slider_mass(F, slider, speed):
    """Where the sliding mass is (m) and how fast it moves (m/s), the draw-wire saying `slider` and `speed`."""
    scale = 1.0 + F[ef.SLIDER_SCALE]
    return slider * scale, speed * scale


@kernel
def tank_mass(F, ballast, rate, since):
    """Mass in the tank (kg) and its rate (kg/s), the draw-wire saying `ballast` and `rate`, `since` s into the run."""
    scale = 1.0 + F[ef.BALLAST_SCALE]
    return ballast * scale + F[ef.BALLAST_LEAK] * since, rate * scale + F[ef.BALLAST_LEAK]
