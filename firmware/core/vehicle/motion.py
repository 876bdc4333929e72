"""Equation (1): the accelerations of the body, solved with the block structure of M instead of a general inverse.

M = [[diag(m1, m2, m3), -S^], [S^, Jt]] with a diagonal upper left block, so eliminating the translations leaves a
symmetric 3 x 3 system for the rotations (Schur complement).
"""

from glider.firmware.core.jit import inlined_kernel, kernel
from glider.firmware.core.vehicle.layout import GRAVITY, NET_MASS
from glider.firmware.core.vehicle.mass import first_moment, first_moment_rate, inertia, translational_mass
from glider.firmware.core.vehicle.water import water_wrench


@inlined_kernel
def momentum(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, u, v, w, p, q, r):
    """[P; Q] = M nu, kg m/s and kg m2/s (of any other six numbers, M times those).

    -S^ Omega = Omega x S and S^ V = S x V.
    """
    return (
        m1 * u + q * S3 - r * S2, m2 * v + r * S1 - p * S3, m3 * w + p * S2 - q * S1,
        I1 * p + I12 * q + I13 * r + S2 * w - S3 * v, I12 * p + I2 * q + I23 * r + S3 * u - S1 * w,
        I13 * p + I23 * q + I3 * r + S1 * v - S2 * u,
    )  # fmt: skip


@inlined_kernel
def momentum_rate(
    P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate, net=0.0
):
    """Right-hand side of equation (1) without the water's forces: six generalised forces, N and N m.

    -M_dot nu + [P x Omega ; Q x Omega + P x V] + [W k ; S x g k], k = [kx, ky, kz] the unit vector down in body axes.
    net: mass at the origin beside P's own, kg.
    """
    m1, m2, m3 = translational_mass(P, ballast, net)
    S1, S2, S3 = first_moment(P, servo, slider, ballast)
    I1, I2, I3, I12, I13, I23 = inertia(P, servo, slider, ballast)
    dS1, dS2, dS3 = first_moment_rate(P, servo, servo_rate, slider_rate, ballast_rate)
    P1, P2, P3, Q1, Q2, Q3 = momentum(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, u, v, w, p, q, r)
    weight = (ballast + P[NET_MASS] + net) * GRAVITY
    return (
        P2 * r - P3 * q + weight * kx - (ballast_rate * u + q * dS3 - r * dS2),
        P3 * p - P1 * r + weight * ky - (ballast_rate * v + r * dS1 - p * dS3),
        P1 * q - P2 * p + weight * kz - (ballast_rate * w + p * dS2 - q * dS1),
        Q2 * r - Q3 * q + P2 * w - P3 * v + GRAVITY * (S2 * kz - S3 * ky) - (dS2 * w - dS3 * v),
        Q3 * p - Q1 * r + P3 * u - P1 * w + GRAVITY * (S3 * kx - S1 * kz) - (dS3 * u - dS1 * w),
        Q1 * q - Q2 * p + P1 * v - P2 * u + GRAVITY * (S1 * ky - S2 * kx) - (dS1 * v - dS2 * u),
    )


@kernel
def solve_mass_matrix(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, f1, f2, f3, t1, t2, t3):
    """M^-1 [f; t]: six accelerations. M is symmetric and positive definite for any physical vehicle."""
    i1, i2, i3 = 1.0 / m1, 1.0 / m2, 1.0 / m3
    # Jt - S^ diag(1/m) (-S^): S^ = [[0, -S3, S2], [S3, 0, -S1], [-S2, S1, 0]]
    a11 = I1 - (S3 * S3 * i2 + S2 * S2 * i3)
    a22 = I2 - (S3 * S3 * i1 + S1 * S1 * i3)
    a33 = I3 - (S2 * S2 * i1 + S1 * S1 * i2)
    a12 = I12 + S1 * S2 * i3
    a13 = I13 + S1 * S3 * i2
    a23 = I23 + S2 * S3 * i1
    x1, x2, x3 = f1 * i1, f2 * i2, f3 * i3
    b1 = t1 - (S2 * x3 - S3 * x2)
    b2 = t2 - (S3 * x1 - S1 * x3)
    b3 = t3 - (S1 * x2 - S2 * x1)
    # symmetric 3 x 3 by cofactors
    c11 = a22 * a33 - a23 * a23
    c12 = a13 * a23 - a12 * a33
    c13 = a12 * a23 - a13 * a22
    inverse = 1.0 / (a11 * c11 + a12 * c12 + a13 * c13)
    c22 = a11 * a33 - a13 * a13
    c23 = a12 * a13 - a11 * a23
    c33 = a11 * a22 - a12 * a12
    pd = (c11 * b1 + c12 * b2 + c13 * b3) * inverse
    qd = (c12 * b1 + c22 * b2 + c23 * b3) * inverse
    rd = (c13 * b1 + c23 * b2 + c33 * b3) * inverse
    # upper rows: diag(m) V_dot + Omega_dot x S = f
    return (
        x1 - (qd * S3 - rd * S2) * i1,
        x2 - (rd * S1 - pd * S3) * i2,
        x3 - (pd * S2 - qd * S1) * i3,
        pd, qd, rd,
    )  # fmt: skip


@kernel
def accelerations(
    P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate,
    X, Y, Z, K, M, N, net=0.0,
):  # fmt: skip
    """nu_dot of equation (1), m/s2 and rad/s2, with any further wrench X..N (N, N m, body axes) beside the water's.

    u, v, w are relative to the water. The actuators' speeds enter through M_dot. net: mass at the origin beside P's
    own, kg.
    """
    b1, b2, b3, b4, b5, b6 = momentum_rate(
        P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate, net
    )
    F1, F2, F3, T1, T2, T3 = water_wrench(P, u, v, w, p, q, r)
    m1, m2, m3 = translational_mass(P, ballast, net)
    S1, S2, S3 = first_moment(P, servo, slider, ballast)
    I1, I2, I3, I12, I13, I23 = inertia(P, servo, slider, ballast)
    return solve_mass_matrix(
        m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23,
        b1 + F1 + X, b2 + F2 + Y, b3 + F3 + Z, b4 + T1 + K, b5 + T2 + M, b6 + T3 + N,
    )  # fmt: skip
