"""Pitch, depth and roll as the controller sees them: accelerations affine in the inputs, section 3.1 of the paper.

    theta_dd = f_theta + g_ts dr_s + g_tb m_b
    Z_dd     = f_Z     + g_zs dr_s + g_zb m_b

Two forms with the same arguments. `exact_form` is equation (1) with all of M, M and the momenta held at the present
state: at the present positions of the actuators it is what the plant does, to rounding. `paper_form` is (14) and (18)
with the ledger's corrections (L1, L14, L17): no added mass, no coupling through S, Jt diagonal, no P x V moment.

In both the inputs act through weight alone. With c1 = [0; 0, cphi, -sphi] and c2 = [k; 0], the directions in which
nu_dot becomes theta_dd and Z_dd, weight puts -m_s g ctheta c1 on dr_s and g c2 - x_b g ctheta c1 on m_b, so that

    [[g_ts, g_tb], [g_zs, g_zb]] = N [[-m_s g ctheta, -x_b g ctheta], [0, g]],  N = [c1 c2]' M^-1 [c1 c2],

and its determinant is -m_s g^2 ctheta det N. N is positive definite, as M is: the inputs lose their grip at
theta = +-90 deg alone, whatever the roll. Nothing here needs an angle: k, down in body axes, has all of them.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.vehicle.layout import GRAVITY, M_S, M_T, X_B
from glider.firmware.core.vehicle.mass import first_moment, inertia, roll_pendulum_moment, translational_mass
from glider.firmware.core.vehicle.motion import momentum_rate, solve_mass_matrix
from glider.firmware.core.vehicle.water import water_wrench


@kernel
def level(kx, ky, kz):
    """sin(phi), cos(phi), sin(theta), cos(theta) from k = [-stheta, sphi ctheta, cphi ctheta]; phi = 0 at the poles."""
    ct = math.sqrt(ky * ky + kz * kz)
    if ct > 0.0:
        return ky / ct, kz / ct, -kx, ct
    return 0.0, 1.0, -kx, 0.0


@kernel
def output_rates(kx, ky, kz, u, v, w, p, q, r):
    """phi_dot (11), theta_dot (9) in rad/s and Z_dot (16) in m/s through the water; phi_dot breaks at the poles."""
    sf, cf, st, ct = level(kx, ky, kz)
    return p + (sf * q + cf * r) * st / ct, cf * q - sf * r, kx * u + ky * v + kz * w


@kernel
def output_accelerations(kx, ky, kz, u, v, w, p, q, r, ud, vd, wd, pd, qd, rd):
    """theta_dd (rad/s2) by (10) and Z_dd (m/s2, still water) by (17), which is k . (V_dot + Omega x V), from nu_dot."""
    sf, cf, st, ct = level(kx, ky, kz)
    turn = sf * q + cf * r
    pitch_acc = cf * qd - sf * rd - turn * (p + turn * st / ct)
    depth_acc = kx * (ud + q * w - r * v) + ky * (vd + r * u - p * w) + kz * (wd + p * v - q * u)
    return pitch_acc, depth_acc


@kernel
def input_gains(P, cos_pitch, n11, n12, n22):
    """g_ts (rad/s2/m), g_tb (rad/s2/kg), g_zs (1/s2), g_zb (m/s2/kg) from N of the module's docstring."""
    slider, tank = -P[M_S] * GRAVITY * cos_pitch, -P[X_B] * GRAVITY * cos_pitch
    return slider * n11, GRAVITY * n12 + tank * n11, slider * n12, GRAVITY * n22 + tank * n12


@kernel
def exact_form(
    P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
):  # fmt: skip
    """f_theta (rad/s2), f_Z (m/s2), g_ts, g_tb, g_zs, g_zb from equation (1) with all of M, M_dot included.

    k = [kx, ky, kz] the unit vector down in body axes, nu relative to the water, actuators (rad, m, kg) and their
    speeds where they are now. Two solutions with M serve f and all four g.
    """
    sf, cf, _, ct = level(kx, ky, kz)
    b1, b2, b3, b4, b5, b6 = momentum_rate(
        P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
    )
    F1, F2, F3, T1, T2, T3 = water_wrench(P, u, v, w, p, q, r)
    b1, b2, b3, b4, b5, b6 = b1 + F1, b2 + F2, b3 + F3, b4 + T1, b5 + T2, b6 + T3
    m1, m2, m3 = translational_mass(P, ballast)
    S1, S2, S3 = first_moment(P, servo, slider, ballast)
    I1, I2, I3, I12, I13, I23 = inertia(P, servo, slider, ballast)
    # rows of [c1 c2]' M^-1; M is symmetric
    y1, y2, y3, y4, y5, y6 = solve_mass_matrix(
        m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, 0.0, 0.0, 0.0, 0.0, cf, -sf
    )
    z1, z2, z3, z4, z5, z6 = solve_mass_matrix(
        m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, kx, ky, kz, 0.0, 0.0, 0.0
    )
    g_ts, g_tb, g_zs, g_zb = input_gains(
        P, ct, cf * y5 - sf * y6, kx * y1 + ky * y2 + kz * y3, kx * z1 + ky * z2 + kz * z3
    )
    # the kinematic parts of (10) and (17): what is left where nu_dot is zero
    A, D = output_accelerations(kx, ky, kz, u, v, w, p, q, r, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pitch_acc = A + y1 * b1 + y2 * b2 + y3 * b3 + y4 * b4 + y5 * b5 + y6 * b6
    depth_acc = D + z1 * b1 + z2 * b2 + z3 * b3 + z4 * b4 + z5 * b5 + z6 * b6
    return (
        pitch_acc - g_ts * slider - g_tb * ballast, depth_acc - g_zs * slider - g_zb * ballast,
        g_ts, g_tb, g_zs, g_zb,
    )  # fmt: skip


@kernel
def paper_form(
    P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate
):  # fmt: skip
    """The same six numbers by (14) with ledger L14 and (18) as printed (L17). The actuators' speeds do not enter.

    Net mass and offset centre of gravity, which stand beside the nominal model, are not in it. D of (18) and the terms
    m_t (r v - q w), .. cancel, since momentum is m_t V here: what is left is the weight and the water's force along k.
    """
    sf, cf, st, ct = level(kx, ky, kz)
    F1, F2, F3, _, T2, T3 = water_wrench(P, u, v, w, p, q, r)
    I1, I2, I3, _, _, _ = inertia(P, servo, slider, ballast)
    sr = roll_pendulum_moment(P)
    turn = sf * q + cf * r
    pitch = ((I3 - I1) * p * r - GRAVITY * st * sr * math.cos(servo) + T2) / I2
    yaw = ((I1 - I2) * p * q + GRAVITY * st * sr * math.sin(servo) + T3) / I3
    f_theta = cf * pitch - sf * yaw - turn * (p + turn * st / ct)
    f_Z = (kx * F1 + ky * F2 + kz * F3) / P[M_T]
    g_ts, g_tb, g_zs, g_zb = input_gains(P, ct, cf * cf / I2 + sf * sf / I3, 0.0, 1.0 / P[M_T])
    return f_theta, f_Z, g_ts, g_tb, g_zs, g_zb


@kernel
def roll_form(P, kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast):
    """J, a, b of phi_dd = J + a sin(gamma) + b cos(gamma), rad/s2: (22) and (23) with ledger L22, Jt diagonal.

    Breaks at theta = +-90 deg. `servo` enters through Jt alone.
    """
    sf, cf, st, ct = level(kx, ky, kz)
    tt = st / ct
    _, _, _, T1, T2, T3 = water_wrench(P, u, v, w, p, q, r)
    I1, I2, I3, _, _, _ = inertia(P, servo, slider, ballast)
    S1 = P[M_S] * slider + ballast * P[X_B]
    sr = roll_pendulum_moment(P)
    phi_dot, theta_dot, _ = output_rates(kx, ky, kz, u, v, w, p, q, r)
    H = tt * (cf * q - sf * r) * phi_dot + (sf * q + cf * r) * theta_dot / (ct * ct)
    J = (
        H
        + ((I2 - I3) * q * r + T1) / I1
        + sf * tt / I2 * ((I3 - I1) * p * r - GRAVITY * cf * ct * S1 + T2)
        + cf * tt / I3 * ((I1 - I2) * p * q + GRAVITY * sf * ct * S1 + T3)
    )
    a = GRAVITY * sr * (ct * cf / I1 + cf * tt * st / I3)
    b = -GRAVITY * sr * (ct * sf / I1 + sf * tt * st / I2)
    return J, a, b
