"""servo_backlash: play between the servo and the rail: the rail stays where it is until the play is taken up."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="servo_backlash",
    subsystem="actuation",
    element="servo",
    summary="whole width of the play",
    parameters=(Parameter("width", "rad", 0.0, 1.0, spread=0.2, entry=ef.SERVO_PLAY),),
)
