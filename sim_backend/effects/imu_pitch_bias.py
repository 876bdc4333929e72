"""imu_pitch_bias: the IMU is mounted nose up or down; its pitch reads a constant too much."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="imu_pitch_bias",
    subsystem="sensing",
    element="attitude",
    summary="constant error of the measured pitch, nose up positive",
    parameters=(Parameter("angle", "rad", -0.4, 0.4, spread=0.05, entry=ef.PITCH_BIAS),),
)
