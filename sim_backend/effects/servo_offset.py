"""servo_offset: the rail does not hang straight where the servo says 0."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="servo_offset",
    subsystem="actuation",
    element="servo",
    summary="constant angle added to the servo",
    parameters=(Parameter("angle", "rad", -0.8, 0.8, spread=0.15, entry=ef.SERVO_OFFSET),),
)
