"""current_shear: the water moves faster the deeper."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="current_shear",
    subsystem="environment",
    element="water",
    summary="velocity of the water a metre of depth",
    parameters=(
        Parameter("north", "1/s", -0.3, 0.3, spread=0.02, entry=ef.SHEAR_N),
        Parameter("east", "1/s", -0.3, 0.3, spread=0.02, entry=ef.SHEAR_E),
    ),
)
