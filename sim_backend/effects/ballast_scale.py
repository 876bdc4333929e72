"""ballast_scale: the tank holds more or less than its draw-wire says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="ballast_scale",
    subsystem="mass",
    element="net",
    summary="ballast mass times 1 + scale, at the tank",
    parameters=(Parameter("scale", "1", -0.9, 3.0, spread=0.15, entry=ef.BALLAST_SCALE),),
)
