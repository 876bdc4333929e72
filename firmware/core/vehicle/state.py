"""The parts of a state x, as `layout` has them."""

import math

from glider.firmware.core.jit import inlined_kernel, kernel
from glider.firmware.core.maths.rotations import euler_from_quaternion, rotation_nb
from glider.firmware.core.vehicle.layout import X_BALLAST, X_NU, X_QUAT, X_SERVO, X_SLIDER


@inlined_kernel
def quaternion(x):
    """Attitude q0, q1, q2, q3, body to NED."""
    return x[X_QUAT], x[X_QUAT + 1], x[X_QUAT + 2], x[X_QUAT + 3]


@inlined_kernel
def velocities(x):
    """u, v, w relative to the water (m/s) and p, q, r (rad/s)."""
    return x[X_NU], x[X_NU + 1], x[X_NU + 2], x[X_NU + 3], x[X_NU + 4], x[X_NU + 5]


@inlined_kernel
def actuators(x):
    """Servo (rad), slider (m), ballast (kg)."""
    return x[X_SERVO], x[X_SLIDER], x[X_BALLAST]


@inlined_kernel
def rotation(x):
    """R_nb, nine numbers row by row."""
    q0, q1, q2, q3 = quaternion(x)
    return rotation_nb(q0, q1, q2, q3)


@kernel
def euler_angles(x):
    """Roll, pitch, yaw, rad."""
    q0, q1, q2, q3 = quaternion(x)
    return euler_from_quaternion(q0, q1, q2, q3)


@kernel
def normalise_attitude(x):
    """Scale the quaternion in x back to unit length: rounding and the integrator let it drift."""
    q0, q1, q2, q3 = quaternion(x)
    scale = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    for i in range(X_QUAT, X_NU):
        x[i] *= scale
