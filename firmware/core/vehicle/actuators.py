"""The nominal actuators (docs/explanation/model.md, Actuators): a lag limited in rate, towards a command limited in
range."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import where
from glider.firmware.core.vehicle import layout


@kernel
def clip(value, low, high):
    """Value held in [low, high]; NaN comes out as low, so that nothing unlimited passes."""
    return where(value > high, high, where(value >= low, value, low))


@kernel
def actuator_table(P, start):
    """Range (low, high), rate per second and time constant (s) of the actuator whose entries of P begin at start."""
    return P[start], P[start + 1], P[start + 2], P[start + 3]


@kernel
def actuator_rate(position, command, low, high, rate, time_constant):
    """x_dot = clip((clip(cmd, range) - x) / time_constant, -rate, +rate)."""
    return clip((clip(command, low, high) - position) / time_constant, -rate, rate)


@kernel
def actuator_rates(P, servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast):
    """Speeds of servo (rad/s), slider (m/s) and ballast (kg/s) under their commands."""
    return (
        actuator_rate(servo, cmd_servo, *actuator_table(P, layout.SERVO_MIN)),
        actuator_rate(slider, cmd_slider, *actuator_table(P, layout.SLIDER_MIN)),
        actuator_rate(ballast, cmd_ballast, *actuator_table(P, layout.BALLAST_MIN)),
    )


@kernel
def limited(wanted, last, low, high, rate, dt):
    """The last word on a command: finite, within its range, and no further from the last than its rate allows.

    A wanted value that is not finite keeps the last command; rounding never carries the result past the range.
    """
    if not math.isfinite(wanted):
        return last
    return clip(clip(wanted, last - rate * dt, last + rate * dt), low, high)
