"""One tick of the autopilot: samples to estimate, mission to targets, targets to commands, limits last.

`tick` is what the runtime calls 50 times a second and what a campaign calls from compiled code: the same function.
"""

import math

from firmware.core import control_layout as at
from firmware.core.control import limited, pid, pitch_feedforward, reference_step, roll_law
from firmware.core.jit import kernel
from firmware.core.layout import (
    BALLAST_MAX,
    BALLAST_MIN,
    BALLAST_RATE,
    M_R,
    M_S,
    R_R,
    R_S,
    SERVO_MAX,
    SERVO_MIN,
    SERVO_RATE,
    SLIDER_MAX,
    SLIDER_MIN,
    SLIDER_RATE,
    X_B,
)  # fmt: skip
from firmware.core.sensing import sense


@kernel
def begin_leg(est, ap, leg, t):
    """Enter a leg: its clock starts, its references go on from where they are."""
    ap[at.LEG] = leg
    ap[at.LEG_START] = t
    ap[at.REACHED] = -1.0
    ap[at.LEG_DEPTH_START] = est[at.EST_DEPTH]


@kernel
def begin_mission(est, ap, t):
    """From waiting to flying: references start at the vehicle's own attitude and depth."""
    ap[at.MODE] = at.FLYING
    ap[at.MISSION_START] = t
    ap[at.REF_DEPTH], ap[at.REF_DEPTH_RATE] = est[at.EST_DEPTH], 0.0
    ap[at.REF_PITCH], ap[at.REF_PITCH_RATE] = est[at.EST_PITCH], 0.0
    ap[at.REF_ROLL], ap[at.REF_ROLL_RATE] = est[at.EST_ROLL], 0.0
    ap[at.INT_PITCH], ap[at.INT_DEPTH] = 0.0, 0.0
    begin_leg(est, ap, 0, t)


@kernel
def leg_reached(legs, est, ap):
    """True where the leg's depth is reached: within its tolerance, or passed in the direction the leg began in."""
    row = int(ap[at.LEG])
    target, tolerance = legs[row, at.LEG_DEPTH], legs[row, at.LEG_TOLERANCE]
    depth = est[at.EST_DEPTH]
    if abs(depth - target) <= tolerance:
        return True
    return (depth - target) * (ap[at.LEG_DEPTH_START] - target) < 0.0


@kernel
def abort(ap, reason):
    """Give the dive up: latched, with the first reason kept."""
    if ap[at.MODE] != at.ABORTED:
        ap[at.MODE] = at.ABORTED
        ap[at.REASON] = reason


@kernel
def sequence(C, legs, est, ap, t):
    """Move through the legs; a leg or mission over its time, a dead sensor or too great a depth aborts."""
    if ap[at.MODE] == at.WAITING:
        if est[at.EST_STARTED] == 1.0:
            begin_mission(est, ap, t)
        return
    if ap[at.MODE] != at.FLYING:
        return
    if t - est[at.EST_IMU_TIME] > C[at.ABORT_AGE]:
        abort(ap, at.REASON_IMU)
    elif t - est[at.EST_BEACON_TIME] > C[at.ABORT_AGE]:
        abort(ap, at.REASON_BEACON)
    elif C[at.SITE_DEPTH] > 0.0 and est[at.EST_DEPTH] > C[at.SITE_DEPTH]:
        abort(ap, at.REASON_TOO_DEEP)
    elif t - ap[at.MISSION_START] > C[at.MISSION_TIME_LIMIT]:
        abort(ap, at.REASON_MISSION_TIME)
    if ap[at.MODE] != at.FLYING:
        return
    row = int(ap[at.LEG])
    elapsed = t - ap[at.LEG_START]
    if math.isnan(legs[row, at.LEG_DEPTH]):
        done = elapsed >= legs[row, at.LEG_DURATION]
    else:
        if ap[at.REACHED] < 0.0 and leg_reached(legs, est, ap):
            ap[at.REACHED] = t
        done = ap[at.REACHED] >= 0.0 and t - ap[at.REACHED] >= legs[row, at.LEG_HOLD]
        if not done and elapsed > legs[row, at.LEG_TIME_LIMIT]:
            abort(ap, at.REASON_LEG_TIME)
            return
    if done:
        if row + 1 < legs.shape[0]:
            begin_leg(est, ap, row + 1, t)
        else:
            ap[at.MODE] = at.COMPLETED


@kernel
def follow(C, legs, ap):
    """Step the reference filters towards the leg's targets."""
    dt = C[at.DT]
    row = int(ap[at.LEG])
    if not math.isnan(legs[row, at.LEG_DEPTH]):
        ap[at.REF_DEPTH], ap[at.REF_DEPTH_RATE], ap[at.REF_DEPTH_ACC] = reference_step(
            ap[at.REF_DEPTH], ap[at.REF_DEPTH_RATE], legs[row, at.LEG_DEPTH], C[at.DEPTH_WN], C[at.DEPTH_ZETA], dt
        )
    ap[at.REF_PITCH], ap[at.REF_PITCH_RATE], ap[at.REF_PITCH_ACC] = reference_step(
        ap[at.REF_PITCH], ap[at.REF_PITCH_RATE], legs[row, at.LEG_PITCH], C[at.PITCH_WN], C[at.PITCH_ZETA], dt
    )
    ap[at.REF_ROLL], ap[at.REF_ROLL_RATE], ap[at.REF_ROLL_ACC] = reference_step(
        ap[at.REF_ROLL], ap[at.REF_ROLL_RATE], legs[row, at.LEG_ROLL], C[at.ROLL_WN], C[at.ROLL_ZETA], dt
    )


@kernel
def steer(P, C, legs, est, ap):
    """Wanted servo, slider and ballast from references and estimate, before the limits."""
    dt = C[at.DT]
    row = int(ap[at.LEG])
    roll, pitch = est[at.EST_ROLL], est[at.EST_PITCH]
    cf, sf = math.cos(roll), math.sin(roll)
    ct = max(math.cos(pitch), 0.1)
    turn = sf * est[at.EST_Q] + cf * est[at.EST_R]
    roll_rate = est[at.EST_P] + turn * math.sin(pitch) / ct
    pitch_rate = cf * est[at.EST_Q] - sf * est[at.EST_R]

    servo = roll_law(ap[at.REF_ROLL], ap[at.REF_ROLL_RATE], roll, roll_rate, C[at.ROLL_KP], C[at.ROLL_KD])

    if math.isnan(legs[row, at.LEG_BALLAST]):
        ballast, ap[at.INT_DEPTH] = pid(
            ap[at.REF_DEPTH] - est[at.EST_DEPTH], ap[at.REF_DEPTH_RATE] - est[at.EST_DEPTH_RATE], ap[at.INT_DEPTH], 0.0,
            C[at.DEPTH_KP], C[at.DEPTH_KI], C[at.DEPTH_KD], P[BALLAST_MIN], P[BALLAST_MAX], dt,
        )  # fmt: skip
    else:
        ballast = legs[row, at.LEG_BALLAST]

    # a mass moved forward lowers the nose: the loop's sign is turned here, not in the gains
    sr = P[M_R] * P[R_R] + P[M_S] * P[R_S]
    forward = pitch_feedforward(sr, P[M_S], P[X_B], ap[at.REF_PITCH], est[at.EST_BALLAST], P[SLIDER_MIN], P[SLIDER_MAX])
    slider, ap[at.INT_PITCH] = pid(
        pitch - ap[at.REF_PITCH], pitch_rate - ap[at.REF_PITCH_RATE], ap[at.INT_PITCH], forward,
        C[at.PITCH_KP], C[at.PITCH_KI], C[at.PITCH_KD], P[SLIDER_MIN], P[SLIDER_MAX], dt,
    )  # fmt: skip
    return servo, slider, ballast


@kernel
def score(legs, est, ap):
    """Add this tick's tracking errors up; depth only where the depth loop commands the ballast."""
    if math.isnan(legs[int(ap[at.LEG]), at.LEG_BALLAST]):
        ap[at.SUM_DEPTH] += (est[at.EST_DEPTH] - ap[at.REF_DEPTH]) ** 2
        ap[at.COUNT_DEPTH] += 1.0
    ap[at.SUM_PITCH] += (est[at.EST_PITCH] - ap[at.REF_PITCH]) ** 2
    ap[at.SUM_ROLL] += (est[at.EST_ROLL] - ap[at.REF_ROLL]) ** 2
    ap[at.COUNT_ATTITUDE] += 1.0


@kernel
def limit_commands(P, ap, servo, slider, ballast, dt, cmd):
    """Limits last: into cmd (3,) what may be sent, and into the memory what was."""
    cmd[0] = limited(servo, ap[at.SENT_SERVO], P[SERVO_MIN], P[SERVO_MAX], P[SERVO_RATE], dt)
    cmd[1] = limited(slider, ap[at.SENT_SLIDER], P[SLIDER_MIN], P[SLIDER_MAX], P[SLIDER_RATE], dt)
    cmd[2] = limited(ballast, ap[at.SENT_BALLAST], P[BALLAST_MIN], P[BALLAST_MAX], P[BALLAST_RATE], dt)
    ap[at.SENT_SERVO], ap[at.SENT_SLIDER], ap[at.SENT_BALLAST] = cmd[0], cmd[1], cmd[2]


@kernel
def tick(P, C, legs, frame, est, ap, cmd, t):
    """One tick at time t (s): frame (FRAME_SIZE,) in, cmd (3,) servo rad, slider m, ballast kg out.

    est (N_EST,) and ap (N_AP,) are the autopilot's memory. Waiting: actuators stay where they are. Completed or
    aborted: ballast to its light end, mass aft for nose up, servo centred, so that the vehicle surfaces.
    """
    sense(P, C, frame, est, t)
    sequence(C, legs, est, ap, t)
    if ap[at.MODE] == at.FLYING:
        follow(C, legs, ap)
        servo, slider, ballast = steer(P, C, legs, est, ap)
        score(legs, est, ap)
    elif ap[at.MODE] == at.WAITING:
        servo, slider, ballast = ap[at.SENT_SERVO], ap[at.SENT_SLIDER], ap[at.SENT_BALLAST]
    else:
        servo, slider, ballast = 0.0, P[SLIDER_MIN], P[BALLAST_MIN]
    limit_commands(P, ap, servo, slider, ballast, C[at.DT], cmd)


@kernel
def reset(est, ap):
    """Forget everything: no sample seen, nothing commanded, waiting for the first samples."""
    est[:] = 0.0
    est[at.EST_IMU_TIME : at.EST_BEACON_TIME + 3] = -1.0
    ap[:] = 0.0
    ap[at.MODE] = at.WAITING
    ap[at.REACHED] = -1.0
