"""How far a vehicle whose parameters are known within bounds can be from what the exact form says of it.

With a = nu_dot of the believed vehicle, M a = b, and the true one M' a' = b', both at the same state:

    M' (a' - a) = b' - M' a =: rho,    rho = sum over parameters n of rho_n

since b and M are linear in every uncertain parameter (the product m_t cg is seen to). An output c' a (c1: pitch, c2:
depth; input_forms) is then wrong by c' M'^-1 rho. With |x' (M' - M) x| <= kappa x' M x for all x,

    |c' (a' - a)| <= sum_n |c' M^-1 rho_n| + kappa/(1 - kappa) sqrt(c' M^-1 c) sum_n sqrt(rho_n' M^-1 rho_n),

so all of it is found from the believed vehicle, one parameter after the other. kappa by rows of M scaled to a unit
diagonal (Gershgorin). A bound and no estimate: all parameters at their worst together. docs/explanation/control.md has
the proof.
"""

import math

from glider.firmware.core.control.input_forms import level
from glider.firmware.core.jit import kernel
from glider.firmware.core.vehicle.layout import CG_X, CG_Z, M_T, N_P
from glider.firmware.core.vehicle.mass import first_moment, inertia, translational_mass
from glider.firmware.core.vehicle.motion import momentum, momentum_rate, solve_mass_matrix
from glider.firmware.core.vehicle.water import water_wrench


@kernel
def row_sums(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, d1, d2, d3, d4, d5, d6):
    """Largest row sum of |entries| of a matrix of M's shape, row and column i divided by d_i; d1..d6 > 0."""
    S1, S2, S3 = abs(S1), abs(S2), abs(S3)
    I12, I13, I23 = abs(I12), abs(I13), abs(I23)
    return max(
        (abs(m1) / d1 + S3 / d5 + S2 / d6) / d1,
        (abs(m2) / d2 + S3 / d4 + S1 / d6) / d2,
        (abs(m3) / d3 + S2 / d4 + S1 / d5) / d3,
        (S3 / d2 + S2 / d3 + abs(I1) / d4 + I12 / d5 + I13 / d6) / d4,
        (S3 / d1 + S1 / d3 + I12 / d4 + abs(I2) / d5 + I23 / d6) / d5,
        (S2 / d1 + S1 / d2 + I13 / d4 + I23 / d5 + abs(I3) / d6) / d6,
    )


@kernel
def model_error_bound(
    P, spread, Pt, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
):
    """Bounds on |true - believed| of theta_dd (rad/s2) and of Z_dd (m/s2), actuators where they are given.

    spread (N_P,): how far each parameter may be off, absolute (three times parameter_sigma, say); nonzero only for
    masses, added mass and inertia, hydrodynamic coefficients, net mass and centre of gravity. Pt (N_P,) is scratch.
    Infinite where the parameters may leave no mass matrix (kappa >= 1).
    """
    sf, cf, _, _ = level(kx, ky, kz)
    m1, m2, m3 = translational_mass(P, ballast)
    S1, S2, S3 = first_moment(P, servo, slider, ballast)
    I1, I2, I3, I12, I13, I23 = inertia(P, servo, slider, ballast)
    b1, b2, b3, b4, b5, b6 = momentum_rate(
        P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
    )
    F1, F2, F3, T1, T2, T3 = water_wrench(P, u, v, w, p, q, r)
    a1, a2, a3, a4, a5, a6 = solve_mass_matrix(
        m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, b1 + F1, b2 + F2, b3 + F3, b4 + T1, b5 + T2, b6 + T3
    )
    y = solve_mass_matrix(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, 0.0, 0.0, 0.0, 0.0, cf, -sf)
    z = solve_mass_matrix(m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, kx, ky, kz, 0.0, 0.0, 0.0)
    d1, d2, d3 = math.sqrt(m1), math.sqrt(m2), math.sqrt(m3)
    d4, d5, d6 = math.sqrt(I1), math.sqrt(I2), math.sqrt(I3)
    # the least eigenvalue of M scaled to a unit diagonal is at least this
    firm = 1.0 - row_sums(0.0, 0.0, 0.0, S1, S2, S3, 0.0, 0.0, 0.0, I12, I13, I23, d1, d2, d3, d4, d5, d6)
    em1 = em2 = em3 = eS1 = eS2 = eS3 = eI1 = eI2 = eI3 = eI12 = eI13 = eI23 = 0.0
    pitch = depth = size = 0.0
    for n in range(N_P):
        Pt[n] = P[n]
    for n in range(N_P):
        if spread[n] == 0.0:
            continue
        # m_t cg is the one product of two uncertain parameters: the second is taken with the first at its largest
        scale = 1.0 + spread[M_T] / P[M_T] if CG_X <= n <= CG_Z else 1.0
        Pt[n] = P[n] + scale * spread[n]
        n1, n2, n3 = translational_mass(Pt, ballast)
        s1, s2, s3 = first_moment(Pt, servo, slider, ballast)
        j1, j2, j3, j12, j13, j23 = inertia(Pt, servo, slider, ballast)
        b1, b2, b3, b4, b5, b6 = momentum_rate(
            Pt, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
        )
        F1, F2, F3, T1, T2, T3 = water_wrench(Pt, u, v, w, p, q, r)
        Pt[n] = P[n]
        f1, f2, f3, f4, f5, f6 = momentum(
            n1, n2, n3, s1, s2, s3, j1, j2, j3, j12, j13, j23, a1, a2, a3, a4, a5, a6
        )  # fmt: skip
        f1, f2, f3 = b1 + F1 - f1, b2 + F2 - f2, b3 + F3 - f3
        f4, f5, f6 = b4 + T1 - f4, b5 + T2 - f5, b6 + T3 - f6
        h1, h2, h3, h4, h5, h6 = solve_mass_matrix(
            m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, f1, f2, f3, f4, f5, f6
        )
        pitch += abs(cf * h5 - sf * h6)
        depth += abs(kx * h1 + ky * h2 + kz * h3)
        size += math.sqrt(max(0.0, f1 * h1 + f2 * h2 + f3 * h3 + f4 * h4 + f5 * h5 + f6 * h6))
        em1, em2, em3 = em1 + abs(n1 - m1), em2 + abs(n2 - m2), em3 + abs(n3 - m3)
        eS1, eS2, eS3 = eS1 + abs(s1 - S1), eS2 + abs(s2 - S2), eS3 + abs(s3 - S3)
        eI1, eI2, eI3 = eI1 + abs(j1 - I1), eI2 + abs(j2 - I2), eI3 + abs(j3 - I3)
        eI12, eI13, eI23 = eI12 + abs(j12 - I12), eI13 + abs(j13 - I13), eI23 + abs(j23 - I23)
    kappa = row_sums(
        em1, em2, em3, eS1, eS2, eS3, eI1, eI2, eI3, eI12, eI13, eI23, d1, d2, d3, d4, d5, d6
    )  # fmt: skip
    if not (firm > 0.0 and kappa < firm):
        return math.inf, math.inf
    rest = size * kappa / (firm - kappa)
    return (
        pitch + rest * math.sqrt(max(0.0, cf * y[4] - sf * y[5])),
        depth + rest * math.sqrt(max(0.0, kx * z[0] + ky * z[1] + kz * z[2])),
    )
