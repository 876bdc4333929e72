"""servo_limit: the servo stops short of the range that its file gives."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="servo_limit",
    subsystem="actuation",
    element="servo",
    summary="taken off the range at both ends",
    parameters=(Parameter("loss", "rad", 0.0, 1.0, spread=0.4, entry=ef.SERVO_LIMIT),),
)
