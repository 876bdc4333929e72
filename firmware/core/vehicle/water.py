"""Forces and moments of the water on the hull: equations (3) and (4), lift by ledger L4."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import everywhere, where
from glider.firmware.core.vehicle import layout

STILL_SPEED = 1e-6  # m/s; below this the flow has no direction and alpha = beta = 0


@kernel
def flow_angles(u, v, w):
    """Angle of attack, sideslip angle (rad) and squared speed through the water (m2/s2)."""
    v_squared = u * u + v * v + w * w
    speed = math.sqrt(v_squared)
    still = speed < STILL_SPEED
    if everywhere(still):
        return 0.0, 0.0, v_squared
    # + 0.0 makes -0.0 a zero like any other: atan2(0, -0.0) is pi, and flow_to_body knows no such flow
    alpha, beta = math.atan2(w, u + 0.0), math.asin(min(1.0, max(-1.0, v / speed)))
    return where(still, 0.0, alpha), where(still, 0.0, beta), v_squared


@kernel
def flow_to_body(u, v, w, a, b, c):
    """R_bf [a, b, c], equation (3): from flow axes to body axes, with the sines and cosines taken from u, v, w."""
    plane = math.sqrt(u * u + w * w)
    speed = math.sqrt(u * u + v * v + w * w)
    still, across = speed < STILL_SPEED, plane > 0.0
    if everywhere(still):
        return a, b, c
    part = where(across, plane, 1.0)
    sb, cb = v / speed, plane / speed
    ca, sa = where(across, u / part, 1.0), where(across, w / part, 0.0)
    along = cb * a - sb * b
    return (
        where(still, a, ca * along - sa * c),
        where(still, b, sb * a + cb * b),
        where(still, c, sa * along + ca * c),
    )  # fmt: skip


@kernel
def water_wrench(P, u, v, w, p, q, r):
    """Force (N) and moment (N m) of the water in body axes, F1 F2 F3 T1 T2 T3, for velocities relative to the water.

    D = (K_D0 + K_D alpha^2) V^2, SF = K_beta beta V^2, L = (K_L0 + K_L alpha) V^2 (ledger L4; K_L alpha^2 with
    LIFT_PRINTED), T_DL1 = (K_MR beta + K_p p) V^2, T_DL2 = (K_M0 + K_M alpha + K_q q) V^2,
    T_DL3 = (K_MY beta + K_r r) V^2; beside the paper's terms D_p p, D_q q, D_r r on the body's axes, which damp at
    rest too.
    """
    alpha, beta, v_squared = flow_angles(u, v, w)
    drag = (P[layout.K_D0] + P[layout.K_D] * alpha * alpha) * v_squared
    lift_slope = where(P[layout.LIFT_PRINTED] != 0.0, alpha * alpha, alpha)
    lift = (P[layout.K_L0] + P[layout.K_L] * lift_slope) * v_squared
    side = P[layout.K_BETA] * beta * v_squared
    F1, F2, F3 = flow_to_body(u, v, w, -drag, side, -lift)
    T1, T2, T3 = flow_to_body(
        u, v, w,
        (P[layout.K_MR] * beta + P[layout.K_P] * p) * v_squared,
        (P[layout.K_M0] + P[layout.K_M] * alpha + P[layout.K_Q] * q) * v_squared,
        (P[layout.K_MY] * beta + P[layout.K_R] * r) * v_squared,
    )  # fmt: skip
    return F1, F2, F3, T1 + P[layout.D_P] * p, T2 + P[layout.D_Q] * q, T3 + P[layout.D_R] * r
