"""Effects of the actuators: slower, shorter of range, behind a backlash, beside their zero."""

import math

from firmware.core.jit import kernel
from firmware.core.vehicle.actuators import actuator_rate, clip
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
    X_DOWN,
    X_SERVO,
    X_SLIDER,
)
from firmware.core.vehicle.state import actuators
from sim_backend.core.effects import effect_layout as ef

SERVO_DRIVEN, SLIDER_DRIVEN, BALLAST_DRIVEN = 1, 2, 4  # mode: this actuator's input is a speed, not a command


@kernel
def effective_actuators(P, F, out):
    """Rates, time constants and ranges of P with effects F, into out (N_P)."""
    out[SERVO_RATE] *= math.exp(-F[ef.SERVO_RATE_LOG])
    out[SERVO_TAU] *= math.exp(F[ef.SERVO_LAG_LOG])
    middle = 0.5 * (P[SERVO_MIN] + P[SERVO_MAX])
    out[SERVO_MIN] = min(P[SERVO_MIN] + F[ef.SERVO_LIMIT], middle)  # a loss of more than there is leaves one place
    out[SERVO_MAX] = max(P[SERVO_MAX] - F[ef.SERVO_LIMIT], middle)
    out[SLIDER_RATE] *= math.exp(-F[ef.SLIDER_RATE_LOG])
    out[SLIDER_TAU] *= math.exp(F[ef.SLIDER_LAG_LOG])
    out[BALLAST_RATE] *= math.exp(-F[ef.PUMP_RATE_LOG])
    out[BALLAST_TAU] *= math.exp(F[ef.PUMP_LAG_LOG])


@kernel
def motor_speeds(P, F, x, mode, c_servo, c_slider, c_ballast):
    """Speeds of the actuators' motors (rad/s, m/s, kg/s) under commands, or as given where `mode` drives them."""
    servo, slider, ballast = actuators(x)
    ds, dl, db = c_servo, c_slider, c_ballast
    if not mode & SERVO_DRIVEN:
        ds = actuator_rate(servo, c_servo, P[SERVO_MIN], P[SERVO_MAX], P[SERVO_RATE], P[SERVO_TAU])
    if not mode & SLIDER_DRIVEN:
        dl = actuator_rate(slider, c_slider, P[SLIDER_MIN], P[SLIDER_MAX], P[SLIDER_RATE], P[SLIDER_TAU])
    if not mode & BALLAST_DRIVEN:
        rate = P[BALLAST_RATE]
        if F[ef.PUMP_DROOP] > 0.0 and c_ballast < ballast:
            rate *= math.exp(-F[ef.PUMP_DROOP] * max(x[X_DOWN], 0.0))
        db = actuator_rate(ballast, c_ballast, P[BALLAST_MIN], P[BALLAST_MAX], rate, P[BALLAST_TAU])
    return ds, dl, db


@kernel
def backlash(follower, leader, width):
    """Where a follower stands behind a backlash of this width (whole, SI); at 0 it stands with its leader."""
    if width <= 0.0:
        return leader
    return clip(follower, leader - 0.5 * width, leader + 0.5 * width)


@kernel
def geared(F, x, servo_speed, slider_speed):
    """Rail (rad) and sliding mass (m) behind their motors' backlash and offset, and the speeds of both."""
    servo, slider = x[X_SERVO], x[X_SLIDER]
    if F[ef.SERVO_PLAY] > 0.0:
        servo = backlash(x[ef.X_GEAR_SERVO], x[X_SERVO], F[ef.SERVO_PLAY])
        if servo == x[ef.X_GEAR_SERVO]:
            servo_speed = 0.0
    if F[ef.SLIDER_PLAY] > 0.0:
        slider = backlash(x[ef.X_GEAR_SLIDER], x[X_SLIDER], F[ef.SLIDER_PLAY])
        if slider == x[ef.X_GEAR_SLIDER]:
            slider_speed = 0.0
    return servo + F[ef.SERVO_OFFSET], slider, servo_speed, slider_speed


@kernel
def update_gears(F, x):
    """What the gears remember after a step: where they stand behind their motors."""
    x[ef.X_GEAR_SERVO] = backlash(x[ef.X_GEAR_SERVO], x[X_SERVO], F[ef.SERVO_PLAY])
    x[ef.X_GEAR_SLIDER] = backlash(x[ef.X_GEAR_SLIDER], x[X_SLIDER], F[ef.SLIDER_PLAY])
