"""stratification: denser water below makes the vehicle lighter with depth."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="stratification",
    subsystem="mass",
    element="net",
    summary="net mass at the origin a metre of depth, negative",
    parameters=(Parameter("slope", "kg/m", -0.05, 0.0, spread=0.002, entry=ef.MASS_PER_DEPTH),),
)
