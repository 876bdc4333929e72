"""Mass properties of a vehicle with moving masses (docs/explanation/model.md, Mass): the first moment S and the
inertia Jt."""

import math

from glider.firmware.core.jit import inlined_kernel, kernel
from glider.firmware.core.vehicle import layout


@inlined_kernel
def roll_pendulum_moment(P):
    """m_r R_r + m_s R_s, kg m: what the servo swings, times the distance from its axis."""
    return P[layout.M_R] * P[layout.R_R] + P[layout.M_S] * P[layout.R_S]


@kernel
def first_moment(P, servo, slider, ballast):
    """S = [m_s dr_s + m_b x_b, sr sin(gamma), sr cos(gamma)] + m_t cg, kg m, with sr = m_r R_r + m_s R_s.

    What the fixed hull trims out (ledger L1) is not in S: at gamma = 0, dr_s = 0, m_b = 0 only the pendulum is left.
    """
    gamma, dr_s, m_b = servo, slider, ballast
    sr = roll_pendulum_moment(P)
    return (
        P[layout.M_S] * dr_s + m_b * P[layout.X_B] + P[layout.M_T] * P[layout.CG_X],
        sr * math.sin(gamma) + P[layout.M_T] * P[layout.CG_Y],
        sr * math.cos(gamma) + P[layout.M_T] * P[layout.CG_Z],
    )


@kernel
def first_moment_rate(P, servo, servo_rate, slider_rate, ballast_rate):
    """dS/dt from the actuators' speeds, kg m/s: what enters M_dot (the change of Jt is left out)."""
    sr = roll_pendulum_moment(P)
    return (
        P[layout.M_S] * slider_rate + ballast_rate * P[layout.X_B],
        sr * math.cos(servo) * servo_rate,
        -sr * math.sin(servo) * servo_rate,
    )


@kernel
def translational_mass(P, ballast, net=0.0):
    """Diagonal of the upper left block of M: m_t + m_b + net mass + added mass, kg, on x, y, z.

    net: mass at the origin beside P's own, kg.
    """
    m = P[layout.M_T] + ballast + P[layout.NET_MASS] + net
    return m + P[layout.A_X], m + P[layout.A_Y], m + P[layout.A_Z]


@kernel
def inertia(P, servo, slider, ballast):
    """Jt about the origin, kg m2: J_xx, J_yy, J_zz, J_xy, J_xz, J_yz (off-diagonal as in the matrix).

    Jt = diag(J) + diag(added_inertia) + sum over rail and slider of m (|r|^2 I - r r^T) + m_b x_b^2 diag(0, 1, 1).
    """
    m_r, m_s, x_r = P[layout.M_R], P[layout.M_S], P[layout.X_R]
    sg, cg = math.sin(servo), math.cos(servo)
    y_r, z_r = P[layout.R_R] * sg, P[layout.R_R] * cg
    x_s, y_s, z_s = P[layout.R_SX0] + slider, P[layout.R_S] * sg, P[layout.R_S] * cg
    tank = ballast * P[layout.X_B] * P[layout.X_B]
    return (
        P[layout.J_XX] + P[layout.B_X] + m_r * (y_r * y_r + z_r * z_r) + m_s * (y_s * y_s + z_s * z_s),
        P[layout.J_YY] + P[layout.B_Y] + m_r * (x_r * x_r + z_r * z_r) + m_s * (x_s * x_s + z_s * z_s) + tank,
        P[layout.J_ZZ] + P[layout.B_Z] + m_r * (x_r * x_r + y_r * y_r) + m_s * (x_s * x_s + y_s * y_s) + tank,
        -(m_r * x_r * y_r + m_s * x_s * y_s),
        -(m_r * x_r * z_r + m_s * x_s * z_s),
        -(m_r * y_r * z_r + m_s * y_s * z_s),
    )
