"""Guidance: the mission's legs one after the other, and each leg's targets through the reference filters."""

import math

from firmware.core.control import control_layout as at
from firmware.core.control.control import reference_step
from firmware.core.jit import kernel
from firmware.core.maths.rotations import wrap_angle
from firmware.core.vehicle.actuators import clip

LEVEL = 0.17  # rad; flatter than this a glider has no grip to turn by


@kernel
def begin_leg(est, ap, leg, t):
    """Enter a leg: its clock starts, its references go on from where they are."""
    ap[at.LEG] = leg
    ap[at.LEG_START] = t
    ap[at.REACHED] = -1.0
    ap[at.LEG_DEPTH_START] = est[at.EST_DEPTH]
    ap[at.TURNED] = 0.0


@kernel
def begin_mission(est, ap, t):
    """From waiting to flying: references start at the vehicle's own attitude and depth."""
    ap[at.MODE] = at.FLYING
    ap[at.MISSION_START] = t
    ap[at.REF_DEPTH], ap[at.REF_DEPTH_RATE] = est[at.EST_DEPTH], 0.0
    ap[at.REF_PITCH], ap[at.REF_PITCH_RATE] = est[at.EST_PITCH], 0.0
    ap[at.REF_ROLL], ap[at.REF_ROLL_RATE] = est[at.EST_ROLL], 0.0
    ap[at.INT_PITCH], ap[at.INT_DEPTH] = 0.0, 0.0
    ap[at.YAW_BEFORE] = est[at.EST_YAW]
    begin_leg(est, ap, 0, t)


@kernel
def leg_reached(legs, est, ap):
    """True where the leg has turned far enough, or its depth is within tolerance or passed in the leg's direction."""
    row = int(ap[at.LEG])
    if not math.isnan(legs[row, at.LEG_TURNED]):
        return abs(ap[at.TURNED]) >= legs[row, at.LEG_TURNED]
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
    ap[at.TURNED] += wrap_angle(est[at.EST_YAW] - ap[at.YAW_BEFORE])
    ap[at.YAW_BEFORE] = est[at.EST_YAW]
    if not math.isnan(legs[row, at.LEG_DURATION]):
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
def roll_target(C, legs, est, ap):
    """Roll (rad) that the leg asks for: as it stands, or turned so that the vehicle turns the way it should.

    Lift carries a rolled glider round: to the side it is rolled to in a dive, to the other side in a climb. So a turn
    to starboard is a roll to starboard going down and to port going up, fading out where the pitch is flat.
    """
    row = int(ap[at.LEG])
    roll = legs[row, at.LEG_ROLL]
    grip = clip(-ap[at.REF_PITCH] / LEVEL, -1.0, 1.0)
    if not math.isnan(legs[row, at.LEG_HEADING]):
        error = wrap_angle(legs[row, at.LEG_HEADING] - est[at.EST_YAW])
        most = abs(roll)
        return grip * clip(C[at.HEADING_KP] * error - C[at.HEADING_KD] * est[at.EST_R], -most, most)
    if not math.isnan(legs[row, at.LEG_TURN]):
        return grip * legs[row, at.LEG_TURN] * abs(roll)
    return roll


@kernel
def follow(C, legs, est, ap):
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
        ap[at.REF_ROLL], ap[at.REF_ROLL_RATE], roll_target(C, legs, est, ap), C[at.ROLL_WN], C[at.ROLL_ZETA], dt
    )
