"""gyro_scale: the gyro reads more or less than the rate."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="gyro_scale",
    subsystem="sensing",
    element="gyro",
    summary="measured rates times 1 + scale",
    parameters=(Parameter("scale", "1", -0.95, 5.0, spread=0.4, entry=ef.GYRO_SCALE),),
)
