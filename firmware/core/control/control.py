"""The baseline controllers: PID for pitch and depth, feedforward/PD for roll (37), reference filters."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.vehicle.actuators import clip


@kernel
def reference_step(position, rate, target, wn, zeta, dt):
    """One step of the reference filter wn^2 / (s^2 + 2 zeta wn s + wn^2) (ledger L-ref): position, rate, acceleration.

    A linear filter under a held target, stepped by its Taylor series to fourth order (the loader keeps wn dt small).
    """
    a, b = wn * wn, 2.0 * zeta * wn
    e = position - target
    d1 = rate
    d2 = -a * e - b * rate
    d3 = -a * d1 - b * d2
    d4 = -a * d2 - b * d3
    d5 = -a * d3 - b * d4
    h2, h3, h4 = dt * dt / 2.0, dt * dt * dt / 6.0, dt * dt * dt * dt / 24.0
    new_position = position + dt * d1 + h2 * d2 + h3 * d3 + h4 * d4
    new_rate = rate + dt * d2 + h2 * d3 + h3 * d4 + h4 * d5
    return new_position, new_rate, -a * (new_position - target) - b * new_rate


@kernel
def pid(error, error_rate, integral, feedforward, kp, ki, kd, low, high, dt):
    """PID with feedforward, its integrator held where the output is at a limit and would be driven further past it.

    Returns output (within [low, high]) and the integral, already in the output's unit.
    """
    unlimited = feedforward + kp * error + integral + kd * error_rate
    step = ki * error * dt
    wound_up = (unlimited > high and step > 0.0) or (unlimited < low and step < 0.0)
    if not wound_up:
        integral = clip(integral + step, low, high)
    return clip(unlimited, low, high), integral


@kernel
def roll_law(roll_ref, roll_rate_ref, roll, roll_rate, kp, kd):
    """gamma = phi_ref + kp (phi_ref - phi) + kd (phi_ref_d - phi_d): equation (37), servo angle in rad."""
    return roll_ref + kp * (roll_ref - roll) + kd * (roll_rate_ref - roll_rate)


@kernel
def pitch_feedforward(sr, m_s, x_b, pitch, ballast, low, high):
    """Slider position (m) at which gravity alone holds a pitch (rad): m_s dr_s + m_b x_b = -sr tan(theta)."""
    return clip(-(sr * math.tan(clip(pitch, -1.3, 1.3)) + ballast * x_b) / m_s, low, high)
