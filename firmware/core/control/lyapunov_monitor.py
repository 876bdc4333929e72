"""Is V sure to fall? k2 against what is left of (29), and the decrease margin, looked at in flight.

Every WATCH_EVERY s while the law flies, for pitch and, where the law commands the ballast, for depth:

- need: the smallest k2 that covers a vehicle within one sigma of [uncertainty], all parameters at their worst together,
  and the disturbance that the filter sees (law.k2_to_cover, error_bound).
- margin: what is left with the actuators where they are (law.decrease_margin): positive, V is sure to fall by
  |s| margin; not positive, nothing is guaranteed. Estimates are taken for the truth. docs/explanation/control.md.

Both are worked out with the exact form, whichever the law flies with, and without the observer's share of f: what
either makes of the commands is in the mismatch.
"""

import math

from glider.firmware.core.control.error_bound import model_error_bound
from glider.firmware.core.control.input_forms import exact_form
from glider.firmware.core.control.law import decrease_margin, feedback, k2_to_cover
from glider.firmware.core.control.law_plus import JERK_RATE_SHARE
from glider.firmware.core.control.steering import angle_rates, depth_is_held, form_point
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts.estimator_layout import DISTURBANCE_HOLD, N_W, S_ANGULAR, S_LINEAR, W_SCRATCH
from glider.firmware.core.vehicle.layout import BALLAST_RATE, N_P, SLIDER_RATE

WATCH_EVERY = 0.2  # s; the bound takes longer than the law itself


@kernel
def forget_lyapunov(ap):
    """Nothing is said of V."""
    for i in range(ctl.K2_NEED_PITCH, ctl.MARGIN_DEPTH + 1):
        ap[i] = math.nan
    ap[ctl.MONITORED] = -math.inf


@kernel
def axis_margin(error, error_rate, reference_acc, acc, g, k1, k2, k3, eps, jerk, model_error, disturbance):
    """decrease_margin of one axis from the acceleration acc that the exact form gives, actuators where they are."""
    s = k1 * error + error_rate
    # s_dot = -feedback + mismatch; what the law wanted would leave no mismatch
    mismatch = k1 * error_rate + acc - reference_acc + feedback(s, g, k2, k3, eps, jerk)
    return decrease_margin(s, g, k2, k3, eps, jerk, mismatch, model_error, disturbance)


@kernel
def monitor(P, C, legs, nav, est, ap, t):
    """Need and margin of this tick into ap, every WATCH_EVERY s; NaN where the law does not fly or the leg holds it."""
    if ap[ctl.MODE] != ctl.FLYING or ap[ctl.ACTIVE] != ctl.LAW or ap[ctl.LAW_RAN] != 1.0:
        if ap[ctl.MONITORED] > -math.inf:
            forget_lyapunov(ap)
        return
    if t < ap[ctl.MONITORED] + WATCH_EVERY - 0.5 * C[ctl.DT]:
        return
    ap[ctl.MONITORED] = t
    b, c = est[ctl.EST_SLIDER], est[ctl.EST_BALLAST]
    sigma = nav[ctl.NAV_SIGMA : ctl.NAV_SIGMA + N_P]
    scratch = ctl.NAV_WORK + (W_SCRATCH + 4) * N_W  # the estimator's, free between its steps
    off_t, off_z = model_error_bound(P, sigma, nav[scratch : scratch + N_P], *form_point(P, est, ap))
    d_t = math.sqrt(nav[ctl.NAV_SETTINGS + S_ANGULAR] / DISTURBANCE_HOLD)
    d_z = math.sqrt(nav[ctl.NAV_SETTINGS + S_LINEAR] / DISTURBANCE_HOLD)
    f_t, f_z, g_ts, g_tb, g_zs, g_zb = exact_form(P, *form_point(P, est, ap))
    jerk_t = jerk_z = math.inf
    if C[ctl.CONTROLLER] == ctl.LAW_PLUS:
        jerk_t, jerk_z = (
            JERK_RATE_SHARE * abs(g_ts) * P[SLIDER_RATE],
            JERK_RATE_SHARE * abs(g_zb) * P[BALLAST_RATE],
        )
    _, pitch_rate = angle_rates(est)
    ap[ctl.K2_NEED_PITCH] = k2_to_cover(off_t, d_t, g_ts, C[ctl.PITCH_EPS])
    ap[ctl.MARGIN_PITCH] = axis_margin(
        est[ctl.EST_PITCH] - ap[ctl.REF_PITCH], pitch_rate - ap[ctl.REF_PITCH_RATE], ap[ctl.REF_PITCH_ACC],
        f_t + g_ts * b + g_tb * c, g_ts,
        C[ctl.PITCH_K1], C[ctl.PITCH_K2], C[ctl.PITCH_K3], C[ctl.PITCH_EPS], jerk_t, off_t, d_t,
    )  # fmt: skip
    if not depth_is_held(legs, ap):
        ap[ctl.K2_NEED_DEPTH] = ap[ctl.MARGIN_DEPTH] = math.nan
        return
    ap[ctl.K2_NEED_DEPTH] = k2_to_cover(off_z, d_z, g_zb, C[ctl.DEPTH_EPS])
    ap[ctl.MARGIN_DEPTH] = axis_margin(
        est[ctl.EST_DEPTH] - ap[ctl.REF_DEPTH], est[ctl.EST_DEPTH_RATE] - ap[ctl.REF_DEPTH_RATE], ap[ctl.REF_DEPTH_ACC],
        f_z + g_zs * b + g_zb * c, g_zb,
        C[ctl.DEPTH_K1], C[ctl.DEPTH_K2], C[ctl.DEPTH_K3], C[ctl.DEPTH_EPS], jerk_z, off_z, d_z,
    )  # fmt: skip
