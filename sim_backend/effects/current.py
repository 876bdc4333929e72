"""current: the water moves evenly and carries the vehicle along."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="current",
    subsystem="environment",
    element="water",
    summary="velocity of the water",
    parameters=(
        Parameter("north", "m/s", -1.0, 1.0, spread=0.1, entry=ef.CURRENT_N),
        Parameter("east", "m/s", -1.0, 1.0, spread=0.1, entry=ef.CURRENT_E),
    ),
)
