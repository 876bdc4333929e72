"""stall: lift stops growing past an angle of attack."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="stall",
    subsystem="hydrodynamics",
    element="heave",
    summary="lift of an angle of attack held within +-1/inverse",
    parameters=(Parameter("inverse", "1/rad", 0.0, 100.0, spread=15.0, entry=ef.STALL),),
)
