"""Effects of the water on the hull: coefficients that are others, and terms that equation (4) has not."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.state import velocities
from glider.firmware.core.vehicle.time_constants import attack_bound, least_inertia
from glider.firmware.core.vehicle.water import flow_angles, flow_to_body
from glider.sim_backend.core.effects import effect_layout as ef


@kernel
def effective_coefficients(F, out):
    """Coefficients and added mass with effects F, in place in out (N_P)."""
    out[layout.K_D0] *= 1.0 + F[ef.DRAG_0]
    out[layout.K_D] *= 1.0 + F[ef.DRAG_ALPHA]
    out[layout.K_L] *= 1.0 + F[ef.LIFT]
    out[layout.K_L0] *= 1.0 + F[ef.LIFT]
    out[layout.A_Y] *= 1.0 + F[ef.ADDED_Y]
    out[layout.A_Z] *= 1.0 + F[ef.ADDED_Z]
    out[layout.K_BETA] *= 1.0 + F[ef.SIDE]
    out[layout.K_M0] += F[ef.PITCH_TRIM]
    out[layout.K_Q] *= 1.0 + F[ef.PITCH_DAMPING]
    out[layout.K_MY] *= 1.0 + F[ef.WEATHERCOCK]
    out[layout.K_R] *= 1.0 + F[ef.YAW_DAMPING]


@kernel
def tether_wrench(F, depth, u, v, w, q, r):
    """Forces (N) and moments (N m) in body axes of a line at the tail: X, Y, Z, M, N.

    Drag with the square of the tail's own speed, of a line as long as the dive is deep; across the hull it may be less.
    """
    vt, wt = v + ef.TAIL * r, w - ef.TAIL * q
    pull = (F[ef.TETHER] + F[ef.TETHER_GROWTH] * max(depth, 0.0)) * math.sqrt(u * u + vt * vt + wt * wt)
    X, Y, Z = -pull * u, -pull * F[ef.TETHER_ACROSS] * vt, -pull * F[ef.TETHER_ACROSS] * wt
    return X, Y, Z, -ef.TAIL * Z - ef.TAIL_TOP * X, ef.TAIL * Y


@kernel
def extra_wrench(P, F, kx, depth, u, v, w, p, q, r):
    """Forces (N) and moments (N m) in body axes that equation (4) has not: X, Y, Z, K, M, N.

    kx is the forward component of the unit vector down, -sin(theta): positive in a dive. depth in m.
    """
    X, Y, Z, K, M, N = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    alpha, _, v_squared = flow_angles(u, v, w)
    drag, lift = 0.0, 0.0
    if anywhere(F[ef.CLIMB_DIVE] != 0.0):
        profile = P[layout.K_D0] + P[layout.K_D] * alpha * alpha
        drag += F[ef.CLIMB_DIVE] * math.tanh(-kx / ef.REST_PITCH) * profile * v_squared
    if anywhere(F[ef.STALL] > 0.0):
        held = clip(alpha, -1.0 / F[ef.STALL], 1.0 / F[ef.STALL])
        lost = where(P[layout.LIFT_PRINTED] != 0.0, held * held - alpha * alpha, held - alpha)
        lift += P[layout.K_L] * lost * v_squared
    if anywhere(drag != 0.0) or anywhere(lift != 0.0):
        X, Y, Z = flow_to_body(u, v, w, -drag, 0.0, -lift)
    if anywhere(F[ef.LINEAR_DRAG] != 0.0):
        X -= F[ef.LINEAR_DRAG] * u
        Y -= F[ef.LINEAR_DRAG] * v
        Z -= F[ef.LINEAR_DRAG] * w
    if anywhere(F[ef.ROLL_TRIM] != 0.0) or anywhere(F[ef.YAW_TRIM] != 0.0):
        K1, M1, N1 = flow_to_body(u, v, w, F[ef.ROLL_TRIM] * v_squared, 0.0, F[ef.YAW_TRIM] * v_squared)
        K += K1
        M += M1
        N += N1
    if anywhere(F[ef.PITCH_DAMPING_ACROSS] != 0.0) or anywhere(F[ef.YAW_DAMPING_ACROSS] != 0.0):
        damped_q = F[ef.PITCH_DAMPING_ACROSS] * P[layout.K_Q] * abs(q) * q
        damped_r = F[ef.YAW_DAMPING_ACROSS] * P[layout.K_R] * abs(r) * r
        K2, M2, N2 = flow_to_body(u, v, w, 0.0, damped_q, damped_r)
        K += K2
        M += M2
        N += N2
    if anywhere(F[ef.TETHER] != 0.0) or anywhere(F[ef.TETHER_GROWTH] != 0.0):
        X1, Y1, Z1, M1, N1 = tether_wrench(F, depth, u, v, w, q, r)
        X += X1
        Y += Y1
        Z += Z1
        M += M1
        N += N1
    return X, Y, Z, K, M, N


@kernel
def extra_rate(P, F, x):
    """An upper bound of the rates of decay that `extra_wrench` adds at x, 1/s (firmware/core/vehicle/time_constants).

    Stall and trims add none: one takes lift away, the others hang on no speed but that of the flow.
    """
    u, v, w, _, q, r = velocities(x)
    mass, _, I2, I3 = least_inertia(P, x)
    inertia, rate = min(I2, I3), 0.0
    if anywhere(F[ef.LINEAR_DRAG] != 0.0):
        rate += abs(F[ef.LINEAR_DRAG]) / mass
    if anywhere(F[ef.CLIMB_DIVE] != 0.0):
        alpha = attack_bound(u, w)
        slope = 2.0 * P[layout.K_D0] + 2.0 * P[layout.K_D] * alpha * (alpha + 1.0)
        rate += abs(F[ef.CLIMB_DIVE]) * slope * math.sqrt(u * u + v * v + w * w) / mass
    if anywhere(F[ef.PITCH_DAMPING_ACROSS] != 0.0) or anywhere(F[ef.YAW_DAMPING_ACROSS] != 0.0):
        rate += 2.0 * abs(F[ef.PITCH_DAMPING_ACROSS] * P[layout.K_Q] * q) / I2
        rate += 2.0 * abs(F[ef.YAW_DAMPING_ACROSS] * P[layout.K_R] * r) / I3
    if anywhere(F[ef.TETHER] != 0.0) or anywhere(F[ef.TETHER_GROWTH] != 0.0):
        vt, wt = v + ef.TAIL * r, w - ef.TAIL * q
        pull = (F[ef.TETHER] + F[ef.TETHER_GROWTH] * max(x[layout.X_DOWN], 0.0)) * max(1.0, F[ef.TETHER_ACROSS])
        arm = abs(ef.TAIL) + abs(ef.TAIL_TOP)
        rate += 2.0 * pull * math.sqrt(u * u + vt * vt + wt * wt) * (1.0 / mass + arm * arm / inertia)
    return rate


@kernel
def current(F, depth):
    """Velocity of the water (m/s, north and east) that effects F add at a depth (m)."""
    return F[ef.CURRENT_N] + F[ef.SHEAR_N] * depth, F[ef.CURRENT_E] + F[ef.SHEAR_E] * depth
