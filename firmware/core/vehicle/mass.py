"""Mass properties of a vehicle with moving masses (docs/MODEL.md, Mass): the first moment S and the inertia Jt."""

import math

from firmware.core.jit import inlined_kernel, kernel
from firmware.core.vehicle.layout import (
    A_X,
    A_Y,
    A_Z,
    B_X,
    B_Y,
    B_Z,
    CG_X,
    CG_Y,
    CG_Z,
    J_XX,
    J_YY,
    J_ZZ,
    M_R,
    M_S,
    M_T,
    NET_MASS,
    R_R,
    R_S,
    R_SX0,
    X_B,
    X_R,
)  # fmt: skip


@inlined_kernel
def swung_moment(P):
    """m_r R_r + m_s R_s, kg m: what the servo swings, times the distance from its axis."""
    return P[M_R] * P[R_R] + P[M_S] * P[R_S]


@kernel
def first_moment(P, servo, slider, ballast):
    """S = [m_s dr_s + m_b x_b, sr sin(gamma), sr cos(gamma)] + m_t cg, kg m, with sr = m_r R_r + m_s R_s.

    What the fixed hull trims out (ledger L1) is not in S: at gamma = 0, dr_s = 0, m_b = 0 only the pendulum is left.
    """
    gamma, dr_s, m_b = servo, slider, ballast
    sr = swung_moment(P)
    return (
        P[M_S] * dr_s + m_b * P[X_B] + P[M_T] * P[CG_X],
        sr * math.sin(gamma) + P[M_T] * P[CG_Y],
        sr * math.cos(gamma) + P[M_T] * P[CG_Z],
    )


@kernel
def first_moment_rate(P, servo, servo_rate, slider_rate, ballast_rate):
    """dS/dt from the actuators' speeds, kg m/s: what enters M_dot (the change of Jt is left out)."""
    sr = swung_moment(P)
    return (
        P[M_S] * slider_rate + ballast_rate * P[X_B],
        sr * math.cos(servo) * servo_rate,
        -sr * math.sin(servo) * servo_rate,
    )


@kernel
def translational_mass(P, ballast, net=0.0):
    """Diagonal of the upper left block of M: m_t + m_b + net mass + added mass, kg, on x, y, z.

    net: mass at the origin beside P's own, kg.
    """
    m = P[M_T] + ballast + P[NET_MASS] + net
    return m + P[A_X], m + P[A_Y], m + P[A_Z]


@kernel
def inertia(P, servo, slider, ballast):
    """Jt about the origin, kg m2: J_xx, J_yy, J_zz, J_xy, J_xz, J_yz (off-diagonal as in the matrix).

    Jt = diag(J) + diag(added_inertia) + sum over rail and slider of m (|r|^2 I - r r^T) + m_b x_b^2 diag(0, 1, 1).
    """
    m_r, m_s, x_r = P[M_R], P[M_S], P[X_R]
    sg, cg = math.sin(servo), math.cos(servo)
    y_r, z_r = P[R_R] * sg, P[R_R] * cg
    x_s, y_s, z_s = P[R_SX0] + slider, P[R_S] * sg, P[R_S] * cg
    tank = ballast * P[X_B] * P[X_B]
    return (
        P[J_XX] + P[B_X] + m_r * (y_r * y_r + z_r * z_r) + m_s * (y_s * y_s + z_s * z_s),
        P[J_YY] + P[B_Y] + m_r * (x_r * x_r + z_r * z_r) + m_s * (x_s * x_s + z_s * z_s) + tank,
        P[J_ZZ] + P[B_Z] + m_r * (x_r * x_r + y_r * y_r) + m_s * (x_s * x_s + y_s * y_s) + tank,
        -(m_r * x_r * y_r + m_s * x_s * y_s),
        -(m_r * x_r * z_r + m_s * x_s * z_s),
        -(m_r * y_r * z_r + m_s * y_s * z_s),
    )
