"""Effects of the actuators: slower, shorter of range, behind a backlash, beside their zero."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import anywhere, everywhere, where
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rate, actuator_table, clip
from glider.firmware.core.vehicle.state import actuators
from glider.sim_backend.core.effects import effect_layout as ef

SERVO_DRIVEN, SLIDER_DRIVEN, BALLAST_DRIVEN = 1, 2, 4  # mode: this actuator's input is a speed, not a command


@kernel
def effective_actuators(P, F, out):
    """Rates, time constants and ranges of P with effects F, into out (N_P)."""
    out[layout.SERVO_RATE] *= math.exp(-F[ef.SERVO_RATE_LOG])
    out[layout.SERVO_TAU] *= math.exp(F[ef.SERVO_LAG_LOG])
    middle = 0.5 * (P[layout.SERVO_MIN] + P[layout.SERVO_MAX])
    lost = F[ef.SERVO_LIMIT] * (1.0 - F[ef.SERVO_GIVE])
    out[layout.SERVO_MIN] = min(P[layout.SERVO_MIN] + lost, middle)  # at most all is lost
    out[layout.SERVO_MAX] = max(P[layout.SERVO_MAX] - lost, middle)
    out[layout.SLIDER_RATE] *= math.exp(-F[ef.SLIDER_RATE_LOG])
    out[layout.SLIDER_TAU] *= math.exp(F[ef.SLIDER_LAG_LOG])
    out[layout.BALLAST_RATE] *= math.exp(-F[ef.PUMP_RATE_LOG])
    out[layout.BALLAST_TAU] *= math.exp(F[ef.PUMP_LAG_LOG])


@kernel
def against_stops(P, F, command):
    """Angle (rad) that a servo reaches of one commanded, by effective P: into a soft stop it goes by a share of it."""
    give = F[ef.SERVO_GIVE]
    if everywhere((give <= 0.0) | (F[ef.SERVO_LIMIT] <= 0.0)):
        return command
    soft = give * F[ef.SERVO_LIMIT]
    low, high = P[layout.SERVO_MIN] + soft, P[layout.SERVO_MAX] - soft
    return command + (give - 1.0) * (command - clip(command, low, high))


@kernel
def motor_speeds(P, F, x, mode, c_servo, c_slider, c_ballast):
    """Speeds of the actuators' motors (rad/s, m/s, kg/s) under commands, or as given where `mode` drives them."""
    servo, slider, ballast = actuators(x)
    ds, dl, db = c_servo, c_slider, c_ballast
    if not mode & SERVO_DRIVEN:
        ds = actuator_rate(servo, against_stops(P, F, c_servo), *actuator_table(P, layout.SERVO_MIN))
    if not mode & SLIDER_DRIVEN:
        dl = actuator_rate(slider, c_slider, *actuator_table(P, layout.SLIDER_MIN))
    if not mode & BALLAST_DRIVEN:
        low, high, rate, tau = actuator_table(P, layout.BALLAST_MIN)
        if anywhere((F[ef.PUMP_DROOP] > 0.0) & (c_ballast < ballast)):
            droop = math.exp(-F[ef.PUMP_DROOP] * max(x[layout.X_DOWN], 0.0))
            rate *= where(c_ballast < ballast, droop, 1.0)
        db = actuator_rate(ballast, c_ballast, low, high, rate, tau)
    return ds, dl, db


@kernel
def backlash(follower, leader, width):
    """Where a follower stands behind a backlash of this width (whole, SI); at 0 it stands with its leader."""
    if everywhere(width <= 0.0):
        return leader
    return where(width <= 0.0, leader, clip(follower, leader - 0.5 * width, leader + 0.5 * width))


@kernel
def geared(F, x, servo_speed, slider_speed):
    """Rail (rad) and sliding mass (m) behind their motors' backlash and offset, and the speeds of both."""
    servo, slider = x[layout.X_SERVO], x[layout.X_SLIDER]
    if anywhere(F[ef.SERVO_PLAY] > 0.0):
        servo = backlash(x[ef.X_GEAR_SERVO], x[layout.X_SERVO], F[ef.SERVO_PLAY])
        servo_speed = where((F[ef.SERVO_PLAY] > 0.0) & (servo == x[ef.X_GEAR_SERVO]), 0.0, servo_speed)
    if anywhere(F[ef.SLIDER_PLAY] > 0.0):
        slider = backlash(x[ef.X_GEAR_SLIDER], x[layout.X_SLIDER], F[ef.SLIDER_PLAY])
        slider_speed = where((F[ef.SLIDER_PLAY] > 0.0) & (slider == x[ef.X_GEAR_SLIDER]), 0.0, slider_speed)
    return servo + F[ef.SERVO_OFFSET], slider, servo_speed, slider_speed


@kernel
def update_gears(F, x):
    """What the gears remember after a step: where they stand behind their motors."""
    x[ef.X_GEAR_SERVO] = backlash(x[ef.X_GEAR_SERVO], x[layout.X_SERVO], F[ef.SERVO_PLAY])
    x[ef.X_GEAR_SLIDER] = backlash(x[ef.X_GEAR_SLIDER], x[layout.X_SLIDER], F[ef.SLIDER_PLAY])
