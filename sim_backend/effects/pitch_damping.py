"""pitch_damping: pitching is damped more or less than its coefficient says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="pitch_damping",
    subsystem="hydrodynamics",
    element="pitch",
    summary="K_q times 1 + scale",
    parameters=(Parameter("scale", "1", -0.98, 8.0, spread=0.6, entry=ef.PITCH_DAMPING),),
)
