"""Which of the controllers (controller_rows) flies this tick, and what it wants.

Roll is always (37); a controller wants slider and ballast, and says whether it had an answer (law.OK). Without one the
PID flies. Whatever is wanted goes through `limited` afterwards (core/autopilot). How to add one: docs/how-to/adding.md.
"""

import math

from glider.firmware.core.control.control import roll_law
from glider.firmware.core.control.law import OK
from glider.firmware.core.control.steering import angle_rates, depth_is_held, law_inputs, pid_inputs, start_pid
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.layout import BALLAST_MAX, BALLAST_MIN, SLIDER_MAX, SLIDER_MIN

BUMP_TIME = 2.0  # s in which what a switch left over fades


@kernel
def inputs_by(P, C, legs, est, ap, controller, pitch_rate):
    """Slider (m), ballast (kg) and status by a controller other than the PID."""
    return law_inputs(P, C, legs, est, ap, pitch_rate)


@kernel
def choose(C, legs, est, ap, t):
    """The hybrid's choice, PID or LAW, with hysteresis and a dwell time.

    The law's are transitions (the pitch reference is still on its way to the leg's target), a depth that has come off
    its reference, and rough water; steady flight is the PID's.
    """
    if t - ap[ctl.ACTIVE_SINCE] < C[ctl.HYBRID_DWELL]:
        return ap[ctl.ACTIVE]
    row = int(ap[ctl.LEG])
    pitch_left = abs(legs[row, ctl.LEG_PITCH] - ap[ctl.REF_PITCH])
    depth_off = abs(est[ctl.EST_DEPTH] - ap[ctl.REF_DEPTH]) if depth_is_held(legs, ap) else 0.0
    if ap[ctl.ACTIVE] == ctl.LAW:
        calm = (
            est[ctl.NOISE_SCALE] < C[ctl.HYBRID_ROUGHNESS_OFF]
            and pitch_left < C[ctl.HYBRID_PITCH_OFF]
            and depth_off < C[ctl.HYBRID_DEPTH_OFF]
        )
        return ctl.PID if calm else ctl.LAW
    noise_scale = (
        est[ctl.NOISE_SCALE] > C[ctl.HYBRID_ROUGHNESS_ON]
        or pitch_left > C[ctl.HYBRID_PITCH_ON]
        or depth_off > C[ctl.HYBRID_DEPTH_ON]
    )
    return ctl.LAW if noise_scale else ctl.PID


@kernel
def flying_controller(C, legs, est, ap, t):
    """The controller of this tick: PID, LAW (law+ is the law with foresight), or the one chosen as it is."""
    if ap[ctl.CAUTIOUS] == 1.0:
        return ctl.PID
    if C[ctl.CONTROLLER] == ctl.HYBRID:
        return choose(C, legs, est, ap, t)
    return ctl.LAW if C[ctl.CONTROLLER] == ctl.LAW_PLUS else C[ctl.CONTROLLER]


@kernel
def wanted_by(P, C, legs, est, ap, controller, pitch_rate):
    """Slider and ballast by a controller; where it has no answer (steep, not finite) the PID's."""
    if controller != ctl.PID:
        slider, ballast, status = inputs_by(P, C, legs, est, ap, controller, pitch_rate)
        ap[ctl.LAW_STATUS] = status
        if status == OK:
            ap[ctl.LAW_RAN] = 1.0
            return slider, ballast
    if ap[ctl.LAW_RAN] == 1.0:
        start_pid(P, C, legs, est, ap, pitch_rate)
        ap[ctl.LAW_RAN] = 0.0
    return pid_inputs(P, C, legs, est, ap, pitch_rate)


@kernel
def steer(P, C, legs, est, ap, t):
    """Wanted servo (rad), slider (m) and ballast (kg) at time t (s), before the limits.

    A switch of controllers makes no step: the PID begins at the commands sent last, and what another
    differs from them is taken off and fades in BUMP_TIME.
    """
    roll_rate, pitch_rate = angle_rates(est)
    servo = roll_law(
        ap[ctl.REF_ROLL], ap[ctl.REF_ROLL_RATE], est[ctl.EST_ROLL], roll_rate, C[ctl.ROLL_KP], C[ctl.ROLL_KD]
    )
    controller = flying_controller(C, legs, est, ap, t)
    switched = controller != ap[ctl.ACTIVE]
    if switched:
        ap[ctl.ACTIVE], ap[ctl.ACTIVE_SINCE] = controller, t
    slider, ballast = wanted_by(P, C, legs, est, ap, controller, pitch_rate)
    if switched and controller != ctl.PID:
        ap[ctl.BUMP_SLIDER] = clip(ap[ctl.SENT_SLIDER] - slider, P[SLIDER_MIN], P[SLIDER_MAX])
        ap[ctl.BUMP_BALLAST] = clip(ap[ctl.SENT_BALLAST] - ballast, P[BALLAST_MIN], P[BALLAST_MAX])
    elif switched:
        ap[ctl.BUMP_SLIDER], ap[ctl.BUMP_BALLAST] = 0.0, 0.0
    fade = math.exp(-C[ctl.DT] / BUMP_TIME)
    slider += ap[ctl.BUMP_SLIDER]
    if depth_is_held(legs, ap):
        ballast += ap[ctl.BUMP_BALLAST]
    ap[ctl.BUMP_SLIDER] *= fade
    ap[ctl.BUMP_BALLAST] *= fade
    return servo, slider, ballast
