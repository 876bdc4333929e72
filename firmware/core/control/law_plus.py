"""What the law's actuator-aware version, `law+`, has beside the law: how far an actuator gets, and how it brakes.

law+ is pitch_depth_law with the bounds of `reach` over a short horizon (the slider's time constant and a tick) and with
jerk = JERK_RATE_SHARE |g| rate of the axis' actuator.

Both law and law+ have a disturbance observer: the estimator's own accelerations of model error (x[X_ERR:]), which
`on_outputs` turns into the two axes, are added to f. The filter is driven by where the actuators are, not by where they
should be: a saturated actuator is in the model, and since the law itself integrates nothing, nothing winds up.
"""

import math

from glider.firmware.core.control.input_forms import level
from glider.firmware.core.jit import kernel

# Of the jerk that an actuator's rate gives. One would be the fastest braking without lag; the rest is left for the lag
# and for what the reference asks for. Measured in docs/explanation/control.md.
JERK_RATE_SHARE = 0.3


@kernel
def reach(position, low, high, rate, time_constant, horizon):
    """Least and greatest position that an actuator may have `horizon` s from now.

    See docs/explanation/model.md, Actuators.

    Each the nearer of what its rate and what its lag towards the end of its range allow.
    """
    share, travel = 1.0 - math.exp(-horizon / time_constant), rate * horizon
    down, up = max(-travel, share * min(low - position, 0.0)), min(travel, share * max(high - position, 0.0))
    return position + down, position + up


@kernel
def on_outputs(kx, ky, kz, a1, a2, a3, a4, a5, a6):
    """Accelerations beside the model's (body axes, added to nu_dot) as they act on theta_dd and Z_dd."""
    sf, cf, _, _ = level(kx, ky, kz)
    return cf * a5 - sf * a6, kx * a1 + ky * a2 + kz * a3
