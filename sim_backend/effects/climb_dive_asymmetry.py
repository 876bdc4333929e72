"""climb_dive_asymmetry: climbing drags more, or less, than diving."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="climb_dive_asymmetry",
    subsystem="hydrodynamics",
    element="surge",
    summary="drag times 1 + share nose up, times 1 - share nose down",
    parameters=(Parameter("share", "1", -0.9, 0.9, spread=0.3, entry=ef.CLIMB_DIVE),),
)
