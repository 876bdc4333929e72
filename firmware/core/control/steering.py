"""From references and estimate to wanted slider and ballast: by PID, and by the law.

Both share the estimate, the references and the limits; they differ in nothing else.
"""

import math

from glider.firmware.core.control.control import pid, pitch_feedforward
from glider.firmware.core.control.input_forms import exact_form, paper_form
from glider.firmware.core.control.law import pitch_depth_law
from glider.firmware.core.control.law_plus import JERK_RATE_SHARE, on_outputs, reach
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rates, actuator_table, clip
from glider.firmware.core.vehicle.mass import roll_pendulum_moment


@kernel
def depth_is_held(legs, ap):
    """True where the leg leaves the ballast to the depth loop."""
    return math.isnan(legs[int(ap[ctl.LEG]), ctl.LEG_BALLAST])


@kernel
def angle_rates(est):
    """phi_dot and theta_dot, rad/s, by (5); phi_dot's tan(theta) is held at 84 deg."""
    roll, pitch = est[ctl.EST_ROLL], est[ctl.EST_PITCH]
    cf, sf = math.cos(roll), math.sin(roll)
    ct = max(math.cos(pitch), 0.1)
    turn = sf * est[ctl.EST_Q] + cf * est[ctl.EST_R]
    return est[ctl.EST_P] + turn * math.sin(pitch) / ct, cf * est[ctl.EST_Q] - sf * est[ctl.EST_R]


@kernel
def pid_inputs(P, C, legs, est, ap, pitch_rate):
    """Slider (m) and ballast (kg) by PID; pitch with gravity's own moment fed forward."""
    dt = C[ctl.DT]
    if depth_is_held(legs, ap):
        ballast, ap[ctl.INT_DEPTH] = pid(
            ap[ctl.REF_DEPTH] - est[ctl.EST_DEPTH], ap[ctl.REF_DEPTH_RATE] - est[ctl.EST_DEPTH_RATE],
            ap[ctl.INT_DEPTH], 0.0,
            C[ctl.DEPTH_KP], C[ctl.DEPTH_KI], C[ctl.DEPTH_KD], P[layout.BALLAST_MIN], P[layout.BALLAST_MAX], dt,
        )  # fmt: skip
    else:
        ballast = legs[int(ap[ctl.LEG]), ctl.LEG_BALLAST]
    # a mass moved forward lowers the nose: the loop's sign is turned here, not in the gains
    slider, ap[ctl.INT_PITCH] = pid(
        est[ctl.EST_PITCH] - ap[ctl.REF_PITCH], pitch_rate - ap[ctl.REF_PITCH_RATE], ap[ctl.INT_PITCH],
        slider_feedforward(P, est, ap), C[ctl.PITCH_KP], C[ctl.PITCH_KI], C[ctl.PITCH_KD],
        P[layout.SLIDER_MIN], P[layout.SLIDER_MAX], dt,
    )  # fmt: skip
    return slider, ballast


@kernel
def slider_feedforward(P, est, ap):
    """Where gravity alone holds the reference pitch, ballast as it is, m."""
    sr = roll_pendulum_moment(P)
    low, high = P[layout.SLIDER_MIN], P[layout.SLIDER_MAX]
    return pitch_feedforward(sr, P[layout.M_S], P[layout.X_B], ap[ctl.REF_PITCH], est[ctl.EST_BALLAST], low, high)


@kernel
def start_pid(P, C, legs, est, ap, pitch_rate):
    """Set the integrators so that the PID begins with the commands sent last."""
    slider = slider_feedforward(P, est, ap)
    slider += C[ctl.PITCH_KP] * (est[ctl.EST_PITCH] - ap[ctl.REF_PITCH])
    slider += C[ctl.PITCH_KD] * (pitch_rate - ap[ctl.REF_PITCH_RATE])
    ap[ctl.INT_PITCH] = clip(ap[ctl.SENT_SLIDER] - slider, P[layout.SLIDER_MIN], P[layout.SLIDER_MAX])
    ballast = C[ctl.DEPTH_KP] * (ap[ctl.REF_DEPTH] - est[ctl.EST_DEPTH])
    ballast += C[ctl.DEPTH_KD] * (ap[ctl.REF_DEPTH_RATE] - est[ctl.EST_DEPTH_RATE])
    ap[ctl.INT_DEPTH] = clip(ap[ctl.SENT_BALLAST] - ballast, P[layout.BALLAST_MIN], P[layout.BALLAST_MAX])


@kernel
def form_point(P, est, ap):
    """Where a form (input_forms) is wanted: kx, ky, kz, u, v, w, p, q, r, servo, slider, ballast and their rates."""
    cf, sf = math.cos(est[ctl.EST_ROLL]), math.sin(est[ctl.EST_ROLL])
    ct, st = math.cos(est[ctl.EST_PITCH]), math.sin(est[ctl.EST_PITCH])
    a, b, c = est[ctl.EST_SERVO], est[ctl.EST_SLIDER], est[ctl.EST_BALLAST]
    da, db, dc = actuator_rates(P, a, b, c, ap[ctl.SENT_SERVO], ap[ctl.SENT_SLIDER], ap[ctl.SENT_BALLAST])
    u, v, w = est[ctl.EST_U], est[ctl.EST_V], est[ctl.EST_W]
    return -st, sf * ct, cf * ct, u, v, w, est[ctl.EST_P], est[ctl.EST_Q], est[ctl.EST_R], a, b, c, da, db, dc


@kernel
def form_at(P, C, est, ap):
    """The I/O form chosen in C at the estimate: f_theta, f_Z, g_ts, g_tb, g_zs, g_zb, and cos(theta)."""
    point = form_point(P, est, ap)
    if C[ctl.FORM] == ctl.PAPER:
        f_t, f_z, g_ts, g_tb, g_zs, g_zb = paper_form(P, *point)
    else:
        f_t, f_z, g_ts, g_tb, g_zs, g_zb = exact_form(P, *point)
    share = C[ctl.OBSERVER_SHARE]
    if share > 0.0:
        e = ctl.MODEL_ERROR
        d_t, d_z = on_outputs(*point[:3], est[e], est[e + 1], est[e + 2], est[e + 3], est[e + 4], est[e + 5])
        f_t += share * d_t
        f_z += share * d_z
    return f_t, f_z, g_ts, g_tb, g_zs, g_zb, math.cos(est[ctl.EST_PITCH])


@kernel
def within_reach(P, C, est):
    """Bounds that the law holds the other axis' input in: slider (m) and ballast (kg), low and high each.

    The law takes the other actuator where it is, as (34) and (35) do; law+ takes it where it can be in a moment.
    """
    slider, ballast = est[ctl.EST_SLIDER], est[ctl.EST_BALLAST]
    if C[ctl.CONTROLLER] != ctl.LAW_PLUS:
        return slider, slider, ballast, ballast
    horizon = P[layout.SLIDER_TAU] + C[ctl.DT]
    s_low, s_high = reach(slider, *actuator_table(P, layout.SLIDER_MIN), horizon)
    b_low, b_high = reach(ballast, *actuator_table(P, layout.BALLAST_MIN), horizon)
    return s_low, s_high, b_low, b_high


@kernel
def law_inputs(P, C, legs, est, ap, pitch_rate):
    """Slider (m), ballast (kg) and status by the law, (34) and (35); where the leg holds the ballast, pitch alone."""
    f_t, f_z, g_ts, g_tb, g_zs, g_zb, ct = form_at(P, C, est, ap)
    jerk_t = jerk_z = math.inf
    if C[ctl.CONTROLLER] == ctl.LAW_PLUS:
        jerk_t, jerk_z = (
            JERK_RATE_SHARE * abs(g_ts) * P[layout.SLIDER_RATE],
            JERK_RATE_SHARE * abs(g_zb) * P[layout.BALLAST_RATE],
        )
    slider, ballast, ap[ctl.S_PITCH], ap[ctl.S_DEPTH], status = pitch_depth_law(
        f_t, f_z, g_ts, g_tb, g_zs, g_zb, ct,
        est[ctl.EST_PITCH] - ap[ctl.REF_PITCH], pitch_rate - ap[ctl.REF_PITCH_RATE], ap[ctl.REF_PITCH_ACC],
        C[ctl.PITCH_K1], C[ctl.PITCH_K2], C[ctl.PITCH_K3], C[ctl.PITCH_EPS], jerk_t,
        est[ctl.EST_DEPTH] - ap[ctl.REF_DEPTH], est[ctl.EST_DEPTH_RATE] - ap[ctl.REF_DEPTH_RATE], ap[ctl.REF_DEPTH_ACC],
        C[ctl.DEPTH_K1], C[ctl.DEPTH_K2], C[ctl.DEPTH_K3], C[ctl.DEPTH_EPS], jerk_z,
        *within_reach(P, C, est),
    )  # fmt: skip
    if not depth_is_held(legs, ap):
        ballast = legs[int(ap[ctl.LEG]), ctl.LEG_BALLAST]
    return slider, ballast, status
