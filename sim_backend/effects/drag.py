"""drag: the hull drags more or less than its coefficients say, at every angle of attack alike."""

from firmware.core.layout import K_D, K_D0
from sim_backend.effects.base import Effect, Parameter


def apply(world, scale):
    world.P[K_D0] *= 1.0 + scale
    world.P[K_D] *= 1.0 + scale


EFFECT = Effect(
    label="drag",
    subsystem="hydrodynamics",
    element="surge",
    summary="drag coefficients K_D0 and K_D scaled by 1 + scale",
    parameters=(Parameter("scale", "1", -0.8, 5.0, spread=0.4),),
    apply=apply,
)
