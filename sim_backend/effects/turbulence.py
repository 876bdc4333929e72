"""turbulence: the water is rougher, or calmer, than its file says."""

from typing import Any

from sim_backend.core.layout import ENV_ACC_ANGULAR, ENV_ACC_LINEAR
from sim_backend.effects.base import Effect, Parameter


def apply(world: Any, scale: float) -> None:
    """Scale the strength of the world's disturbance; its numbers stay those of the seed."""
    world.E[ENV_ACC_LINEAR] *= 1.0 + scale
    world.E[ENV_ACC_ANGULAR] *= 1.0 + scale


EFFECT = Effect(
    label="turbulence",
    subsystem="environment",
    element="water",
    summary="strength of the disturbance times 1 + scale",
    parameters=(Parameter("scale", "1", -1.0, 50.0, spread=2.0),),
    apply=apply,
)
