"""The limits: what any command has to pass before it may be sent."""

import math

from firmware.core.jit import kernel
from firmware.core.vehicle.actuators import clip


@kernel
def limited(wanted, last, low, high, rate, dt):
    """The last word on a command: finite, within its range, and no further from the last than its rate allows.

    A wanted value that is not finite keeps the last command; rounding never carries the result past the range.
    """
    if not math.isfinite(wanted):
        return last
    return clip(clip(wanted, last - rate * dt, last + rate * dt), low, high)
