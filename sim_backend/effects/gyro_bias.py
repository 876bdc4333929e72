"""gyro_bias: the gyro reads a constant too much."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="gyro_bias",
    subsystem="sensing",
    element="gyro",
    summary="constant error of each measured rate",
    parameters=(
        Parameter("p", "rad/s", -0.2, 0.2, spread=0.01, entry=ef.GYRO_P),
        Parameter("q", "rad/s", -0.2, 0.2, spread=0.01, entry=ef.GYRO_Q),
        Parameter("r", "rad/s", -0.2, 0.2, spread=0.01, entry=ef.GYRO_R),
    ),
)
