"""lift: the hull lifts more or less than its coefficient says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="lift",
    subsystem="hydrodynamics",
    element="heave",
    summary="K_L0 and K_L times 1 + scale",
    parameters=(Parameter("scale", "1", -0.95, 4.0, spread=0.3, entry=ef.LIFT),),
)
