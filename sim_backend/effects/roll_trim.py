"""roll_trim: a bent fin: a roll moment that grows with the square of the speed."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="roll_trim",
    subsystem="hydrodynamics",
    element="roll",
    summary="roll moment over V^2",
    parameters=(Parameter("k", "kg", -2.0, 2.0, spread=0.1, entry=ef.ROLL_TRIM),),
)
