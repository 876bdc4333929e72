"""weathercock: sideslip turns the bow more or less than its coefficient says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="weathercock",
    subsystem="hydrodynamics",
    element="yaw",
    summary="K_MY times 1 + scale",
    parameters=(Parameter("scale", "1", -0.95, 5.0, spread=0.3, entry=ef.WEATHERCOCK),),
)
