"""The nominal actuators (docs/MODEL.md, Actuators): a lag limited in rate, towards a command limited in range."""

from firmware.core.jit import kernel
from firmware.core.vehicle.layout import (
    BALLAST_MAX,
    BALLAST_MIN,
    BALLAST_RATE,
    BALLAST_TAU,
    SERVO_MAX,
    SERVO_MIN,
    SERVO_RATE,
    SERVO_TAU,
    SLIDER_MAX,
    SLIDER_MIN,
    SLIDER_RATE,
    SLIDER_TAU,
)  # fmt: skip


@kernel
def clip(value, low, high):
    """Value held in [low, high]; NaN comes out as low, so that nothing unlimited passes."""
    if value > high:
        return high
    if value >= low:
        return value
    return low


@kernel
def actuator_rate(position, command, low, high, rate, time_constant):
    """x_dot = clip((clip(cmd, range) - x) / time_constant, -rate, +rate)."""
    return clip((clip(command, low, high) - position) / time_constant, -rate, rate)


@kernel
def actuator_rates(P, servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast):
    """Speeds of servo (rad/s), slider (m/s) and ballast (kg/s) under their commands."""
    return (
        actuator_rate(servo, cmd_servo, P[SERVO_MIN], P[SERVO_MAX], P[SERVO_RATE], P[SERVO_TAU]),
        actuator_rate(slider, cmd_slider, P[SLIDER_MIN], P[SLIDER_MAX], P[SLIDER_RATE], P[SLIDER_TAU]),
        actuator_rate(ballast, cmd_ballast, P[BALLAST_MIN], P[BALLAST_MAX], P[BALLAST_RATE], P[BALLAST_TAU]),
    )
