"""Surface waves in deep water, as rows of a world's table."""

import math

from firmware.core.vehicle.layout import GRAVITY


def wave_row(amplitude: float, omega: float, direction: float, phase: float) -> tuple[float, ...]:
    """One component: amplitude (m), omega (rad/s), the direction it runs to and its phase (rad); k = omega^2 / g."""
    k = omega * omega / GRAVITY
    return amplitude, omega, k * math.cos(direction), k * math.sin(direction), phase
