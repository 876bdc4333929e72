"""The control law of section 3.2 for pitch and depth: backstepping with feedforward (32), saturated sliding mode (30).

One axis, x_dd = f + g u (24), with e = x - x_ref and s = k1 e + e_d (25):

    u = (1/g)(-k1 e_d + x_dd_ref - f - k3 s) - k2 sat(s/eps) sat(g/eps)        (ledger L30; k1, k2, k3, eps > 0)

Both axes at once, each moved by the other's input too: the two equations

    g_ii u_i + g_ij u_j = demand_i = -k1 e_d + x_dd_ref - f - k3 s - g_ii k2 sat(s/eps) sat(g_ii/eps)

are solved for both inputs together, so that with both applied, actuators ideal and the form exact, every axis has

    V_dot = -k3 s^2 - k2 |g_ii| |s| sat(|s|/eps) sat(|g_ii|/eps),        V = s^2 / 2, and V_t of (36) is their sum.

Real actuators need more than that, and two arguments say how much of them the law takes into account:

- Bounds of what each input can be in the time at hand: an axis meets its demand with the other's input held within
  them. +-inf: the joint solution above. Where the actuators are: (34) and (35) as printed, f with the other input as it
  is. `reach` (law_plus) of a short horizon: law+. The tank fills for seconds, and its weight forward turns the nose;
  solved jointly, the slider stands against ballast that is not there yet, and the vehicle is lost
  (docs/explanation/control.md).
- jerk: k3 s and the sliding term together are held within sqrt(2 jerk |s|), from which an actuator whose speed gives
  that much jerk can still brake s to zero. inf: not held. law+ takes a share of |g| times the actuator's rate.

Where it ends: the determinant of the pair is -m_s g^2 ctheta det N (input_forms), so the slider loses its grip on pitch
at theta = +-90 deg and nowhere else; phi = +-90 deg is harmless. With |ctheta| < COS_PITCH_MIN (84.3 deg), or a pair
without a solution, the status is STEEP, and where anything is NaN or infinite it is NOT_FINITE; both inputs are then
0.0 and not to be used: the autopilot falls back to its PID (FAULTS row 22).
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.vehicle.actuators import clip

OK, STEEP, NOT_FINITE = 0, 1, 2
COS_PITCH_MIN = 0.1  # as for the estimator's Euler angles
DEGENERATE = 1e-9  # of the terms of the determinant: below that rounding decides its sign


@kernel
def sat(x):
    """Equation (31): x within +-1, its sign beyond; NaN stays NaN."""
    if x > 1.0:
        return 1.0
    if x < -1.0:
        return -1.0
    return x


@kernel
def feedback(s, g, k2, k3, eps, jerk):
    """What is taken off the demand for s alone, in the unit of f: k3 s + g k2 sat(s/eps) sat(g/eps), of the sign of s.

    Held within sqrt(2 jerk |s|): s_dot = -sqrt(2 jerk |s|) changes by just `jerk` (unit of f per second) on its way in.
    """
    push = k3 * s + g * k2 * sat(s / eps) * sat(g / eps)
    if jerk == math.inf:
        return push
    braking = math.sqrt(2.0 * jerk * abs(s))
    return max(-braking, min(braking, push))


@kernel
def axis_demand(error, error_rate, reference_acc, f, g, k1, k2, k3, eps, jerk):
    """What all inputs together must add to f (rad/s2 or m/s2), and s (rad/s or m/s), by (25), (30) and (32).

    error = x - x_ref and its rate; f, g of this axis and its own input; k1, k3 in 1/s, k2 in the input's unit,
    eps in the unit of s, and a plain number in sat(g/eps).
    """
    s = k1 * error + error_rate
    return -k1 * error_rate + reference_acc - f - feedback(s, g, k2, k3, eps, jerk), s


@kernel
def solve_inputs(
    g_ts, g_tb, g_zs, g_zb, demand_t, demand_z, cos_pitch, slider_low, slider_high, ballast_low, ballast_high
):
    """Slider (m) and ballast (kg) that meet both demands (rad/s2, m/s2), and a status; 0.0 unless OK.

    The bounds hold the *other* axis' share of each input only; the inputs themselves are not clipped. A ballast that is
    held anyway: its bounds where it is, and the second input not used.
    """
    first, second = g_ts * g_zb, g_tb * g_zs
    determinant = first - second
    if not (math.isfinite(determinant) and math.isfinite(cos_pitch)):
        return 0.0, 0.0, NOT_FINITE
    if not (math.isfinite(demand_t) and math.isfinite(demand_z)):
        return 0.0, 0.0, NOT_FINITE
    if not (slider_low <= slider_high and ballast_low <= ballast_high):
        return 0.0, 0.0, NOT_FINITE
    if abs(cos_pitch) < COS_PITCH_MIN or abs(determinant) <= DEGENERATE * (abs(first) + abs(second)) or first == 0.0:
        return 0.0, 0.0, STEEP
    u_s = (g_zb * demand_t - g_tb * demand_z) / determinant
    u_b = (g_ts * demand_z - g_zs * demand_t) / determinant
    # what the other falls short by is added: nothing, to the last bit, where both are within their bounds
    short_s = u_s - clip(u_s, slider_low, slider_high)
    short_b = u_b - clip(u_b, ballast_low, ballast_high)
    u_s, u_b = u_s + g_tb * short_b / g_ts, u_b + g_zs * short_s / g_zb
    if not (math.isfinite(u_s) and math.isfinite(u_b)):
        return 0.0, 0.0, NOT_FINITE
    return u_s, u_b, OK


@kernel
def pitch_depth_law(
    f_t, f_z, g_ts, g_tb, g_zs, g_zb, cos_pitch,
    e_t, ed_t, acc_t, k1_t, k2_t, k3_t, eps_t, jerk_t,
    e_z, ed_z, acc_z, k1_z, k2_z, k3_z, eps_z, jerk_z,
    slider_low, slider_high, ballast_low, ballast_high,
):  # fmt: skip
    """Slider (m), ballast (kg), s of pitch (rad/s), s of depth (m/s), status: (34) and (35), both axes together.

    A form (input_forms) and the cosine of pitch; then for pitch (_t) and depth (_z) the error, its rate, the
    reference's acceleration, the gains and the jerk; then the bounds of solve_inputs.
    """
    demand_t, s_t = axis_demand(e_t, ed_t, acc_t, f_t, g_ts, k1_t, k2_t, k3_t, eps_t, jerk_t)
    demand_z, s_z = axis_demand(e_z, ed_z, acc_z, f_z, g_zb, k1_z, k2_z, k3_z, eps_z, jerk_z)
    u_s, u_b, status = solve_inputs(
        g_ts, g_tb, g_zs, g_zb, demand_t, demand_z, cos_pitch, slider_low, slider_high, ballast_low, ballast_high
    )
    return u_s, u_b, s_t, s_z, status


@kernel
def k2_to_cover(model_error, disturbance, g, eps):
    """Smallest k2 with which V_dot <= -k3 s^2 outside the layer, (32) at work: (d_f + d) / (|g| sat(|g|/eps)).

    model_error bounds what true and believed f + G u differ by (error_bound.model_error_bound), disturbance what else
    accelerates this axis; both rad/s2 or m/s2, >= 0. Infinite where g = 0. Derived in docs/explanation/control.md.
    """
    grip = abs(g) * sat(abs(g) / eps)
    if grip == 0.0:
        return math.inf
    return (model_error + disturbance) / grip


@kernel
def decrease_margin(s, g, k2, k3, eps, jerk, mismatch, model_error, disturbance):
    """By how much V = s^2/2 is sure to fall with real actuators, as an acceleration: V_dot <= -|s| margin.

    mismatch: what the form gives for x_dd with the actuators where they are and moving as they do, less what the law
    wanted, g_ii (u_i - wanted_i) + g_ij (u_j - wanted_j). Not positive: nothing is guaranteed.
    """
    return abs(feedback(s, g, k2, k3, eps, jerk)) - abs(mismatch) - model_error - disturbance
