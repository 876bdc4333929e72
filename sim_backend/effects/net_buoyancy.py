"""net_buoyancy: the vehicle was ballasted heavy or light; the missing mass acts at the origin."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="net_buoyancy",
    subsystem="mass",
    element="net",
    summary="a constant net mass at the origin, heavy positive",
    parameters=(Parameter("mass", "kg", -0.3, 0.3, spread=0.02, entry=ef.NET_MASS_OFFSET),),
)
