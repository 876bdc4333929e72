"""Guidance: the mission's legs one after the other, and each leg's targets through the reference filters."""

import math

from glider.firmware.core.control.control import reference_step
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.maths.rotations import wrap_angle
from glider.firmware.core.vehicle.actuators import clip

LEVEL = 0.17  # rad; flatter than this a glider has no grip to turn by


@kernel
def begin_leg(est, ap, leg, t):
    """Enter a leg: its clock starts, its references go on from where they are."""
    ap[ctl.LEG] = leg
    ap[ctl.LEG_START] = t
    ap[ctl.REACHED] = -1.0
    ap[ctl.LEG_DEPTH_START] = est[ctl.EST_DEPTH]
    ap[ctl.TURNED] = 0.0


@kernel
def begin_mission(est, ap, t):
    """From waiting to flying: references start at the vehicle's own attitude and depth."""
    ap[ctl.MODE] = ctl.FLYING
    ap[ctl.MISSION_START] = t
    ap[ctl.REF_DEPTH], ap[ctl.REF_DEPTH_RATE] = est[ctl.EST_DEPTH], 0.0
    ap[ctl.REF_PITCH], ap[ctl.REF_PITCH_RATE] = est[ctl.EST_PITCH], 0.0
    ap[ctl.REF_ROLL], ap[ctl.REF_ROLL_RATE] = est[ctl.EST_ROLL], 0.0
    ap[ctl.INT_PITCH], ap[ctl.INT_DEPTH] = 0.0, 0.0
    ap[ctl.YAW_BEFORE] = est[ctl.EST_YAW]
    begin_leg(est, ap, 0, t)


@kernel
def leg_reached(legs, est, ap):
    """True where the leg has turned far enough, or its depth is within tolerance or passed in the leg's direction."""
    row = int(ap[ctl.LEG])
    if not math.isnan(legs[row, ctl.LEG_TURNED]):
        return abs(ap[ctl.TURNED]) >= legs[row, ctl.LEG_TURNED]
    target, tolerance = legs[row, ctl.LEG_DEPTH], legs[row, ctl.LEG_TOLERANCE]
    depth = est[ctl.EST_DEPTH]
    if abs(depth - target) <= tolerance:
        return True
    return (depth - target) * (ap[ctl.LEG_DEPTH_START] - target) < 0.0


@kernel
def abort(ap, reason):
    """Give the dive up: latched, with the first reason kept."""
    if ap[ctl.MODE] != ctl.ABORTED:
        ap[ctl.MODE] = ctl.ABORTED
        ap[ctl.REASON] = reason


@kernel
def guard_alone(C, est, ap, t):
    """Where no supervisor guards: a dead sensor, too great a depth, or a mission over its time aborts."""
    if t - est[ctl.EST_IMU_TIME] > C[ctl.ABORT_AGE]:
        abort(ap, ctl.REASON_IMU)
    elif t - est[ctl.EST_BEACON_TIME] > C[ctl.ABORT_AGE]:
        abort(ap, ctl.REASON_BEACON)
    elif C[ctl.SITE_DEPTH] > 0.0 and est[ctl.EST_DEPTH] > C[ctl.SITE_DEPTH]:
        abort(ap, ctl.REASON_TOO_DEEP)
    elif t - ap[ctl.MISSION_START] > C[ctl.MISSION_TIME_LIMIT]:
        abort(ap, ctl.REASON_MISSION_TIME)


@kernel
def sequence(C, legs, est, ap, t):
    """Move through the legs; the operator's stop aborts, so does a leg over its time, and without a supervisor what
    `guard_alone` sees."""
    ap[ctl.STOP_TAKEN] = ap[ctl.STOP_REQUESTED]
    if ap[ctl.STOP_TAKEN] == 1.0:
        abort(ap, ctl.REASON_OPERATOR)
    if ap[ctl.MODE] == ctl.WAITING:
        if est[ctl.EST_STARTED] == 1.0:
            begin_mission(est, ap, t)
        return
    if ap[ctl.MODE] != ctl.FLYING:
        return
    if ap[ctl.SUPERVISED] == 0.0:
        guard_alone(C, est, ap, t)
        if ap[ctl.MODE] != ctl.FLYING:
            return
    row = int(ap[ctl.LEG])
    elapsed = t - ap[ctl.LEG_START]
    ap[ctl.TURNED] += wrap_angle(est[ctl.EST_YAW] - ap[ctl.YAW_BEFORE])
    ap[ctl.YAW_BEFORE] = est[ctl.EST_YAW]
    if not math.isnan(legs[row, ctl.LEG_DURATION]):
        done = elapsed >= legs[row, ctl.LEG_DURATION]
    else:
        if ap[ctl.REACHED] < 0.0 and leg_reached(legs, est, ap):
            ap[ctl.REACHED] = t
        done = ap[ctl.REACHED] >= 0.0 and t - ap[ctl.REACHED] >= legs[row, ctl.LEG_HOLD]
        if not done and elapsed > legs[row, ctl.LEG_TIME_LIMIT]:
            abort(ap, ctl.REASON_LEG_TIME)
            return
    if done:
        if row + 1 < legs.shape[0]:
            begin_leg(est, ap, row + 1, t)
        else:
            ap[ctl.MODE] = ctl.COMPLETED


@kernel
def roll_target(C, legs, est, ap):
    """Roll (rad) that the leg asks for: as it stands, or turned so that the vehicle turns the way it should.

    Lift carries a rolled glider round: to the side it is rolled to in a dive, to the other side in a climb. So a turn
    to starboard is a roll to starboard going down and to port going up, fading out where the pitch is flat.
    """
    row = int(ap[ctl.LEG])
    roll = legs[row, ctl.LEG_ROLL]
    grip = clip(-ap[ctl.REF_PITCH] / LEVEL, -1.0, 1.0)
    if not math.isnan(legs[row, ctl.LEG_HEADING]):
        error = wrap_angle(legs[row, ctl.LEG_HEADING] - est[ctl.EST_YAW])
        most = abs(roll)
        return grip * clip(C[ctl.HEADING_KP] * error - C[ctl.HEADING_KD] * est[ctl.EST_R], -most, most)
    if not math.isnan(legs[row, ctl.LEG_TURN]):
        return grip * legs[row, ctl.LEG_TURN] * abs(roll)
    return roll


@kernel
def follow(C, legs, est, ap):
    """Step the reference filters towards the leg's targets."""
    dt = C[ctl.DT]
    row = int(ap[ctl.LEG])
    if not math.isnan(legs[row, ctl.LEG_DEPTH]):
        ap[ctl.REF_DEPTH], ap[ctl.REF_DEPTH_RATE], ap[ctl.REF_DEPTH_ACC] = reference_step(
            ap[ctl.REF_DEPTH], ap[ctl.REF_DEPTH_RATE], legs[row, ctl.LEG_DEPTH], C[ctl.DEPTH_WN], C[ctl.DEPTH_ZETA], dt
        )
    ap[ctl.REF_PITCH], ap[ctl.REF_PITCH_RATE], ap[ctl.REF_PITCH_ACC] = reference_step(
        ap[ctl.REF_PITCH], ap[ctl.REF_PITCH_RATE], legs[row, ctl.LEG_PITCH], C[ctl.PITCH_WN], C[ctl.PITCH_ZETA], dt
    )
    ap[ctl.REF_ROLL], ap[ctl.REF_ROLL_RATE], ap[ctl.REF_ROLL_ACC] = reference_step(
        ap[ctl.REF_ROLL], ap[ctl.REF_ROLL_RATE], roll_target(C, legs, est, ap), C[ctl.ROLL_WN], C[ctl.ROLL_ZETA], dt
    )
