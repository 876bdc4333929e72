"""Attitude: unit quaternion inside, ZYX Euler angles at the interfaces.

The quaternion q = [q0, q1, q2, q3], scalar first, takes body vectors to NED; it passes through theta = +-90 deg, where
the Euler rates of equation (5) break.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import everywhere, where


@kernel
def wrap_angle(angle):
    """Angle in (-pi, pi]; one that is there already comes back as it is."""
    within = (angle > -math.pi) & (angle <= math.pi)
    if everywhere(within):
        return angle
    return where(within, angle, math.pi - (math.pi - angle) % (2.0 * math.pi))


def wrap(angles):
    """An array of angles (any shape, rad), each in [-pi, pi)."""
    return (angles + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def quaternion_from_euler(phi, theta, psi):
    """Unit quaternion (body to NED) of ZYX Euler angles in rad."""
    cf, sf = math.cos(0.5 * phi), math.sin(0.5 * phi)
    ct, st = math.cos(0.5 * theta), math.sin(0.5 * theta)
    cp, sp = math.cos(0.5 * psi), math.sin(0.5 * psi)
    return (
        cf * ct * cp + sf * st * sp,
        sf * ct * cp - cf * st * sp,
        cf * st * cp + sf * ct * sp,
        cf * ct * sp - sf * st * cp,
    )


@kernel
def euler_from_quaternion(q0, q1, q2, q3):
    """ZYX Euler angles phi, theta, psi in rad, phi and psi in (-pi, pi], of a unit quaternion.

    By half sums and differences: (phi - psi)/2 has the tangent (q1 - q3)/(q0 + q2), (phi + psi)/2 the tangent
    (q1 + q3)/(q0 - q2). At theta = +90 (-90) deg only phi - psi (phi + psi) means anything, and stays exact, so that
    the three angles always give the attitude back.
    """
    a, b, c, d = q0 + q2, q1 - q3, q0 - q2, q1 + q3
    difference, total = math.atan2(b, a), math.atan2(d, c)
    theta = 2.0 * math.atan2(math.sqrt(a * a + b * b), math.sqrt(c * c + d * d)) - 0.5 * math.pi
    return wrap_angle(total + difference), theta, wrap_angle(total - difference)


@kernel
def rotation_nb(q0, q1, q2, q3):
    """R_nb, body to NED: equation (2) (ledger L2), as nine numbers row by row. The third row is k in body axes."""
    return (
        1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2),
        2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q1 * q1 + q3 * q3), 2.0 * (q2 * q3 - q0 * q1),
        2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2),
    )  # fmt: skip


@kernel
def rotation_nb_euler(phi, theta, psi):
    """R_nb of equation (2) as printed, from Euler angles, nine numbers row by row (ledger L2)."""
    cf, sf = math.cos(phi), math.sin(phi)
    ct, st = math.cos(theta), math.sin(theta)
    cp, sp = math.cos(psi), math.sin(psi)
    return (
        ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp,
        ct * sp, cf * cp + sf * st * sp, -sf * cp + cf * st * sp,
        -st, sf * ct, cf * ct,
    )  # fmt: skip


@kernel
def quaternion_rate(q0, q1, q2, q3, p, q, r):
    """Time derivative of the quaternion for body rates p, q, r in rad/s: q_dot = q * [0, Omega] / 2."""
    return (
        0.5 * (-q1 * p - q2 * q - q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q),
        0.5 * (q0 * q - q1 * r + q3 * p),
        0.5 * (q0 * r + q1 * q - q2 * p),
    )


@kernel
def euler_rates(phi, theta, p, q, r):
    """phi_dot, theta_dot, psi_dot by equation (5); breaks at theta = +-90 deg."""
    cf, sf = math.cos(phi), math.sin(phi)
    ct, tt = math.cos(theta), math.tan(theta)
    return p + sf * tt * q + cf * tt * r, cf * q - sf * r, (sf * q + cf * r) / ct
