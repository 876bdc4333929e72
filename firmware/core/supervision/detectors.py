"""The supervisor's detectors: each asks, every tick, for a reaction of its row of the fault table.

They read what was screened (frame, G), what is believed (est) and what the autopilot is at (ap), and write G alone.
"""

import math

from firmware.core.control import control_layout as ctl
from firmware.core.jit import kernel
from firmware.core.supervision import supervisor_layout as at
from firmware.core.vehicle.layout import BALLAST_MAX, BALLAST_MIN, SERVO_MAX, SERVO_MIN, SLIDER_MAX, SLIDER_MIN

LAG = 1.0  # s of the depth that lags, from which its rate is made
SPANS = ((SERVO_MIN, SERVO_MAX), (SLIDER_MIN, SLIDER_MAX), (BALLAST_MIN, BALLAST_MAX))
ABSURD = 100.0  # ranges; what a controller wants beyond that is no answer


@kernel
def lasting(G, timer, holds, t):
    """For how long a condition has held, s; -1 where it does not."""
    if not holds:
        G[at.SINCE + timer] = math.nan
        return -1.0
    if math.isnan(G[at.SINCE + timer]):
        G[at.SINCE + timer] = t
    return t - G[at.SINCE + timer]


@kernel
def ask(G, row, reaction):
    """A row asks for a reaction, beside what it asked for in this tick already."""
    G[at.ASKED + row] = max(G[at.ASKED + row], reaction)


@kernel
def age(G, sensor, t):
    """How long ago the sensor's newest fit sample was taken, s; since the first tick before there was one."""
    return t - max(G[at.TAKEN + sensor], G[at.BEGAN])


@kernel
def lost(G, sensor, t):
    """True where nothing fit has come from a sensor for too long."""
    return age(G, sensor, t) > max(G[at.LOST_AFTER + sensor], 3.5 * G[at.PERIOD + sensor])


@kernel
def watch_sensors(G, frame, t):
    """Rows 1, 2, 4, 6, 10, 11, 20 and 23."""
    gone = lasting(G, at.T_IMU, lost(G, at.S_IMU, t) or G[at.WORTH + at.S_IMU] == at.STUCK, t)
    if gone >= 0.0:
        ask(G, 1, at.ABORT if gone >= G[at.HOLD_TIME] else at.HOLD)
    if lost(G, at.S_BEACON, t):
        ask(G, 2, at.ABORT)
    if lost(G, at.S_SLIDER, t):
        ask(G, 4, at.WARN)
    if lost(G, at.S_PLUNGER, t):
        ask(G, 4, at.ABORT)
    for sensor in range(at.N_SENSORS):
        worth = G[at.WORTH + sensor]
        fitted = sensor <= at.S_PLUNGER or math.isfinite(G[at.TAKEN + sensor])
        old = fitted and age(G, sensor, t) > 3.0 * G[at.PERIOD + sensor] + G[at.TICK]
        if worth == at.MISTIMED or old:
            ask(G, 6, at.LOG)
        if worth == at.ABSURD:
            ask(G, 10, at.WARN if G[at.UNFIT + sensor] >= G[at.UNFIT_RUN] else at.LOG)
        if worth == at.STUCK:
            ask(G, 11, at.WARN)
    watch_leak(G, frame)
    watch_battery(G, frame, t)


@kernel
def watch_leak(G, frame):
    """Row 20: wet samples are counted, and never forgotten."""
    start = at.STARTS[at.S_LEAK]
    if frame[start + 1] == at.VALID and frame[start] != G[at.LEAK_SEEN]:
        G[at.LEAK_SEEN] = frame[start]
        if frame[start + 2] > 0.5:
            G[at.WET] += 1.0
    if G[at.WET] >= G[at.LEAK_COUNT]:
        ask(G, 20, at.ABORT)
    elif G[at.WET] > 0.0:
        ask(G, 20, at.WARN)


@kernel
def watch_battery(G, frame, t):
    """Row 23."""
    start = at.STARTS[at.S_BATTERY]
    if frame[start + 1] != at.VALID:
        return
    volts = frame[start + 2]
    if lasting(G, at.T_LOW, volts < G[at.LOW_VOLTAGE], t) >= G[at.VOLTAGE_TIME]:
        ask(G, 23, at.WARN)
    if lasting(G, at.T_LEAST, volts < G[at.LEAST_VOLTAGE], t) >= G[at.VOLTAGE_TIME]:
        ask(G, 23, at.ABORT)


@kernel
def silent(G, frame, actuator, t):
    """True where an actuator that says how it does (validity not MISSING) has not said so for too long."""
    start = at.STATES[actuator]
    return frame[start + 1] != 0.0 and t - max(frame[start], G[at.BEGAN]) > G[at.STATE_AGE]


@kernel
def watch_states(G, frame, t):
    """What actuators say of themselves: rows 3, 5, 9, 14 and 16."""
    if silent(G, frame, 0, t):
        ask(G, 5, at.WARN)
    for actuator in range(3):
        if actuator > 0 and silent(G, frame, actuator, t):
            ask(G, 3, at.ABORT)
        if frame[at.STATES[actuator] + 1] != at.VALID:
            continue
        condition = frame[at.STATES[actuator] + 2]
        if condition == at.ALARM:
            ask(G, 16, at.WARN)
        elif condition == at.ALARM_KEPT:
            ask(G, 16, at.ABORT)
        elif condition == at.RETRYING:
            ask(G, 14, at.WARN)
        elif condition == at.GIVEN_UP or condition == at.WRONG_WAY:
            ask(G, 14, at.ABORT)
        elif condition == at.MISCONFIGURED:
            ask(G, 9, at.ABORT)


@kernel
def runs_away(G, i, measured, least):
    """True where slider (i = 0) or ballast (1) went by more than `least` away from every place it was sent to of late.

    Places sent to younger than DELAY_TICKS may not show yet, so all of them have to lie on the other side.
    """
    now, size = int(G[at.RING_AT]), at.N_RING
    ring, sent = at.RING + i * size, at.SENT_RING + i * size
    before = G[ring + (now - int(G[at.WRONG_TICKS])) % size]
    moved = measured - before
    if not abs(moved) > least:  # NaN at first
        return False
    for back in range(int(G[at.DELAY_TICKS])):
        ahead = (G[sent + (now - back) % size] - before) * math.copysign(1.0, moved)
        if ahead > (-least if back == 0 else least) / 3.0:  # never for NaN, before the flight
            return False
    return True


@kernel
def watch_move(G, i, measured, rate, tau, span, t):
    """Row 14 for slider (i = 0) or ballast (1): does it go where it was sent? rate 1/s, tau s, span the whole range."""
    if runs_away(G, i, measured, 0.3 * rate * G[at.WRONG_TICKS] * G[at.TICK]):
        G[at.STOPPED + i] = G[at.ENABLED + 14]
        G[at.SENT + 1 + i] = measured
    if G[at.STOPPED + i] == 1.0:
        ask(G, 14, at.ABORT)
    else:
        watch_stall(G, i, measured, rate, tau, span, t)


@kernel
def watch_stall(G, i, measured, rate, tau, span, t):
    """Row 14: away from where it was sent, without progress, for longer than the way takes; rests, tries again."""
    off = abs(G[at.SENT + 1 + i] - measured)
    tolerance = rate * (tau + 0.2) + 0.02 * span
    if t < G[at.REST_UNTIL + i]:
        ask(G, 14, at.WARN)
        return
    moved = abs(measured - G[at.MARK + i]) > 0.25 * tolerance
    stands = lasting(G, at.T_STALL + i, off > tolerance and not moved, t)
    if stands <= 0.0:
        G[at.MARK + i] = measured
    if moved:
        G[at.STALLS + i] = 0.0
    if stands > G[at.STALL_FACTOR] * (off / rate + tau) and G[at.ENABLED + 14] == 1.0:
        G[at.STALLS + i] += 1.0
        G[at.REST_UNTIL + i] = t + G[at.STALL_REST]
        G[at.SINCE + at.T_STALL + i] = math.nan
    if G[at.STALLS + i] > G[at.STALL_TRIES]:
        ask(G, 14, at.ABORT)


@kernel
def depth_rate(G, depth, t):
    """Depth rate (m/s) by depth alone, of the last second or so."""
    if math.isnan(G[at.SLOW_TIME]):
        G[at.SLOW_DEPTH] = depth
    else:
        G[at.SLOW_DEPTH] += (depth - G[at.SLOW_DEPTH]) * (1.0 - math.exp(-(t - G[at.SLOW_TIME]) / LAG))
    G[at.SLOW_TIME] = t
    return (depth - G[at.SLOW_DEPTH]) / LAG


@kernel
def watch_depth(G, est, ap, t):
    """Rows 13, 17 and 19: what depth, pitch and time say of each other."""
    depth, pitch = est[ctl.NEW_DEPTH], est[ctl.NEW_PITCH]
    flying = ap[ctl.MODE] == ctl.FLYING
    rate = depth_rate(G, depth, t)
    against = rate * pitch > 0.0 and abs(pitch) > G[at.DISAGREE_PITCH] and abs(rate) > G[at.DISAGREE_RATE]
    if lasting(G, at.T_DISAGREE, flying and against, t) >= G[at.DISAGREE_TIME]:
        ask(G, 13, at.WARN)
    if lasting(G, at.T_DEEP, depth > G[at.WORKING_DEPTH], t) >= G[at.DEEP_TIME]:
        ask(G, 17, at.ABORT)
    if lasting(G, at.T_RISK, depth > G[at.RISK_DEPTH], t) >= G[at.RISK_TIME]:
        ask(G, 17, at.OOB)
    held = not flying or ap[ctl.REACHED] >= 0.0
    if held or not abs(depth - G[at.BAND_MARK]) <= G[at.SAME_BAND]:
        G[at.BAND_MARK], G[at.BAND_SINCE] = depth, t
    if t - G[at.BAND_SINCE] > G[at.SAME_TIME]:
        ask(G, 19, at.ABORT)
    begun = ap[ctl.MODE] == ctl.FLYING or ap[ctl.MODE] == ctl.ABORTED
    if begun and t - ap[ctl.MISSION_START] > G[at.MISSION_TIME]:
        ask(G, 19, at.ABORT)


@kernel
def watch_ascent(G, est, ap, t):
    """Row 18: after ABORT, or the mission's end, the vehicle has to rise; judged blind where there is no depth."""
    if G[at.REACTION] < at.ABORT and ap[ctl.MODE] < ctl.COMPLETED:
        G[at.ASCENT_MARK], G[at.ASCENT_SINCE] = est[ctl.NEW_DEPTH], t
        return
    blind = lost(G, at.S_BEACON, t)
    depth = est[ctl.NEW_DEPTH]
    if not blind and (depth < G[at.SURFACE_DEPTH] or depth < G[at.ASCENT_MARK] - G[at.ASCENT_STEP]):
        G[at.ASCENT_MARK], G[at.ASCENT_SINCE] = depth, t
        return
    G[at.ASCENT_MARK] = max(G[at.ASCENT_MARK], depth)  # it may sink on until the ballast is out
    if t - G[at.ASCENT_SINCE] <= G[at.ASCENT_TIME]:
        return
    if math.isnan(G[at.OOB_SINCE]):
        G[at.OOB_SINCE] = G[at.ASCENT_SINCE] = t
    patience = G[at.BLIND_TIME] if blind else G[at.ASCENT_TIME]
    ask(G, 18, at.HW if t - max(G[at.ASCENT_SINCE], G[at.OOB_SINCE]) > patience else at.OOB)


@kernel
def watch_attitude(G, est, ap, t):
    """Row 21: steeper than a glider flies, or rolling over."""
    pitch, roll = abs(est[ctl.NEW_PITCH]), abs(est[ctl.NEW_ROLL])
    steep = pitch > max(G[at.STEEP_PITCH], abs(ap[ctl.REF_PITCH]) + G[at.STEEP_MARGIN])
    over = roll > max(G[at.STEEP_ROLL], abs(ap[ctl.REF_ROLL]) + G[at.STEEP_MARGIN])
    bad = lasting(G, at.T_STEEP, ap[ctl.MODE] == ctl.FLYING and (steep or over), t)
    if bad >= 0.0:
        ask(G, 21, at.ABORT if bad >= G[at.STEEP_TIME] else at.WARN)


@kernel
def answerless(P, C, ap):
    """True where the control law had no answer in this tick, or one beyond all measure."""
    for i in range(3):
        if not abs(ap[ctl.WANTED_SERVO + i]) <= ABSURD * (P[SPANS[i][1]] - P[SPANS[i][0]]):  # NaN too
            return True
    return C[ctl.CONTROLLER] != ctl.PID and ap[ctl.ACTIVE] == ctl.LAW and ap[ctl.LAW_STATUS] != 0.0


@kernel
def watch_law(P, C, G, ap, t):
    """Row 22: the PID flies for a while; a law that has no answer again and again is given up."""
    if ap[ctl.MODE] != ctl.FLYING:
        return
    if answerless(P, C, ap):
        G[at.LAW_FAILED] += 1.0
        G[at.PID_UNTIL] = t + G[at.LAW_REST]
        ask(G, 22, at.ABORT if G[at.LAW_FAILED] >= G[at.LAW_RUN] else at.WARN)
    elif C[ctl.CONTROLLER] == ctl.PID or ap[ctl.ACTIVE] == ctl.LAW:
        G[at.LAW_FAILED] = 0.0


@kernel
def watch_loop(G, t):
    """Rows 24, 25, 27 and 33: the loop's own time, and what the runtime says of recorder and memory."""
    if not t - G[at.MINUTE] < 60.0:
        G[at.MINUTE], G[at.LATE_COUNT] = t, 0.0
    if G[at.LATENESS] > G[at.TICK]:
        G[at.LATE_RUN] += 1.0
        G[at.LATE_COUNT] += 1.0
        ask(G, 24, at.LOG)
    else:
        G[at.LATE_RUN] = 0.0
    many = G[at.LATE_COUNT] * G[at.TICK] > 60.0 * G[at.OVERRUN_SHARE]
    heavy = lasting(G, at.T_HEAVY, G[at.LATE_RUN] >= G[at.OVERRUN_RUN] or many, t)
    if heavy >= 0.0:
        ask(G, 24, at.ABORT if heavy >= G[at.HOLD_TIME] else at.HOLD)
    if G[at.RESTARTED] == 1.0:
        ask(G, 25, at.ABORT)
    if G[at.RECORDER] > 0.0:
        ask(G, 27, at.WARN if G[at.RECORDER] > 1.0 else at.LOG)
    if G[at.GROWTH] > 0.0:
        ask(G, 33, at.ABORT if G[at.GROWTH] > 1.0 else at.WARN)
