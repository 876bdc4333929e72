"""Effects of the water's motion; waves and turbulence change the world instead (water_motion)."""

from firmware.core.jit import kernel
from sim_backend.core.effects import effect_layout as ef


@kernel
def current(F, depth):
    """Velocity of the water (m/s, north and east) that effects F add at a depth (m)."""
    return F[ef.CURRENT_N] + F[ef.SHEAR_N] * depth, F[ef.CURRENT_E] + F[ef.SHEAR_E] * depth
