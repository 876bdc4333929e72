"""pitch_trim: a pitch moment that grows with the square of the speed."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="pitch_trim",
    subsystem="hydrodynamics",
    element="pitch",
    summary="added to K_M0",
    parameters=(Parameter("k", "kg", -5.0, 5.0, spread=0.3, entry=ef.PITCH_TRIM),),
)
