"""imu_roll_bias: the IMU is mounted tilted to one side; its roll reads a constant too much."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="imu_roll_bias",
    subsystem="sensing",
    element="attitude",
    summary="constant error of the measured roll, starboard down positive",
    parameters=(Parameter("angle", "rad", -0.4, 0.4, spread=0.05, entry=ef.ROLL_BIAS),),
)
