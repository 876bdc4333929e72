"""imu_pitch_bias: the IMU is mounted nose up or down; its pitch reads a constant too much."""

from sim_backend.core.layout import E_PITCH
from sim_backend.effects.base import Effect, Parameter


def apply(world, angle):
    world.errors[0, E_PITCH] += angle


EFFECT = Effect(
    label="imu_pitch_bias",
    subsystem="sensing",
    element="attitude",
    summary="constant error of the measured pitch, nose up positive",
    parameters=(Parameter("angle", "rad", -0.3, 0.3, spread=0.03),),
    apply=apply,
)
