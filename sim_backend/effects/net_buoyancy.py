"""net_buoyancy: the vehicle was ballasted heavy or light; the missing mass acts at the origin."""

from firmware.core.layout import NET_MASS
from sim_backend.effects.base import Effect, Parameter


def apply(world, mass):
    world.P[NET_MASS] += mass


EFFECT = Effect(
    label="net_buoyancy",
    subsystem="mass",
    element="net",
    summary="a constant net mass at the origin, heavy positive",
    parameters=(Parameter("mass", "kg", -0.3, 0.3, spread=0.02),),
    apply=apply,
)
