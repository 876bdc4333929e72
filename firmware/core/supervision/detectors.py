"""The supervisor's detectors: each requests, every tick, a level of its row of the fault table.

Which reaction a level is, and how long it stands, is data (firmware/faults.py), copied into G. The detectors read what
was screened (frame, G), what is believed (est) and what the autopilot is at (ap), and write G alone.
"""

import math

from glider.firmware.core.estimation.sensing import longest_age
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle.layout import BALLAST_MAX, BALLAST_MIN, SERVO_MAX, SERVO_MIN, SLIDER_MAX, SLIDER_MIN

LAG = 1.0  # s of the depth that lags, from which its rate is made
SPANS = ((SERVO_MIN, SERVO_MAX), (SLIDER_MIN, SLIDER_MAX), (BALLAST_MIN, BALLAST_MAX))
IMPOSSIBLE = 100.0  # ranges; what a controller wants beyond that is no answer


@kernel
def held_for(G, timer, holds, t):
    """For how long a condition has held, s; -1 where it does not."""
    if not holds:
        G[sup.SINCE + timer] = math.nan
        return -1.0
    if math.isnan(G[sup.SINCE + timer]):
        G[sup.SINCE + timer] = t
    return t - G[sup.SINCE + timer]


@kernel
def request(G, row, level):
    """Request a level of a row, LEVEL_1 the mildest, unless the row has requested a higher one in this tick."""
    place = row * sup.N_LEVELS + level
    if G[sup.REACTION + place] > G[sup.ASKED + row]:
        G[sup.ASKED + row], G[sup.CLEARS + row] = G[sup.REACTION + place], G[sup.CLEAR_AFTER + place]


@kernel
def age(G, sensor, t):
    """How long ago the sensor's newest fit sample was taken, s; since the first tick before there was one."""
    return t - max(G[sup.TAKEN + sensor], G[sup.BEGAN])


@kernel
def outdated(G, sensor, t):
    """Return whether the sensor's newest fit sample is older than MAX_AGE_PERIODS of its periods."""
    return age(G, sensor, t) > longest_age(G[sup.PERIOD + sensor], G[sup.TICK])


@kernel
def lost(G, sensor, t):
    """True where nothing fit has come from a sensor for too long."""
    return outdated(G, sensor, t) and age(G, sensor, t) > G[sup.LOST_AFTER + sensor]


@kernel
def watch_sensors(G, frame, t):
    """Rows 1, 2, 4, 6, 10, 11, 20 and 23."""
    gone = held_for(G, sup.T_IMU, lost(G, sup.SENSOR_IMU, t) or G[sup.SAMPLE_VERDICT + sup.SENSOR_IMU] == sup.STUCK, t)
    if gone >= 0.0:
        request(G, sup.FAULT_IMU_LOST, sup.LEVEL_2 if gone >= G[sup.HOLD_TIME] else sup.LEVEL_1)
    if lost(G, sup.SENSOR_BEACON, t):
        request(G, sup.FAULT_PRESSURE_LOST, sup.LEVEL_1)
    if lost(G, sup.SENSOR_SLIDER, t):
        request(G, sup.FAULT_WIRE_LOST, sup.LEVEL_1)
    if lost(G, sup.SENSOR_PLUNGER, t):
        request(G, sup.FAULT_WIRE_LOST, sup.LEVEL_2)
    for sensor in range(sup.N_SENSORS):
        verdict = G[sup.SAMPLE_VERDICT + sensor]
        fitted = sensor <= sup.SENSOR_PLUNGER or math.isfinite(G[sup.TAKEN + sensor])
        if verdict == sup.MISTIMED or (fitted and outdated(G, sensor, t)):
            request(G, sup.FAULT_SAMPLE_TIME, sup.LEVEL_1)
        if verdict == sup.IMPLAUSIBLE:
            many = G[sup.UNFIT + sensor] >= G[sup.UNFIT_RUN]
            request(G, sup.FAULT_IMPLAUSIBLE, sup.LEVEL_2 if many else sup.LEVEL_1)
        if verdict == sup.STUCK:
            request(G, sup.FAULT_STUCK_SENSOR, sup.LEVEL_1)
    watch_leak(G, frame)
    watch_battery(G, t)


@kernel
def watch_leak(G, frame):
    """Row 20: wet samples are counted, and never forgotten."""
    start = sup.STARTS[sup.SENSOR_LEAK]
    if frame[start + 1] == sup.VALID and frame[start] != G[sup.LEAK_SEEN]:
        G[sup.LEAK_SEEN] = frame[start]
        if frame[start + 2] > 0.5:
            G[sup.WET] += 1.0
            request(G, sup.FAULT_LEAK, sup.LEVEL_2 if G[sup.WET] >= G[sup.LEAK_COUNT] else sup.LEVEL_1)


@kernel
def watch_battery(G, t):
    """Row 23: the newest fit voltage, as long as it is fresh; a silence ends an under-voltage, which has to last."""
    volts = math.nan if outdated(G, sup.SENSOR_BATTERY, t) else G[sup.LAST + sup.PLACES[sup.SENSOR_BATTERY]]
    if held_for(G, sup.T_LOW, volts < G[sup.LOW_VOLTAGE], t) >= G[sup.VOLTAGE_TIME]:
        request(G, sup.FAULT_VOLTAGE, sup.LEVEL_1)
    if held_for(G, sup.T_LEAST, volts < G[sup.LEAST_VOLTAGE], t) >= G[sup.VOLTAGE_TIME]:
        request(G, sup.FAULT_VOLTAGE, sup.LEVEL_2)


@kernel
def silent(G, frame, actuator, t):
    """True where an actuator that says how it does (validity not MISSING) has not said so for too long."""
    start = sup.STATES[actuator]
    return frame[start + 1] != 0.0 and t - max(frame[start], G[sup.BEGAN]) > G[sup.STATE_AGE]


@kernel
def watch_states(G, frame, t):
    """What actuators say of themselves: rows 3, 5, 9, 14 and 16."""
    if silent(G, frame, 0, t):
        request(G, sup.FAULT_SERVO_LOST, sup.LEVEL_1)
    for actuator in range(3):
        if actuator > 0 and silent(G, frame, actuator, t):
            request(G, sup.FAULT_BUS_LOST, sup.LEVEL_1)
        if frame[sup.STATES[actuator] + 1] != sup.VALID:
            continue
        condition = frame[sup.STATES[actuator] + 2]
        if condition == sup.ALARM:
            request(G, sup.FAULT_DRIVE_ALARM, sup.LEVEL_1)
        elif condition == sup.ALARM_KEPT:
            request(G, sup.FAULT_DRIVE_ALARM, sup.LEVEL_2)
        elif condition == sup.RETRYING:
            request(G, sup.FAULT_STALL, sup.LEVEL_1)
        elif condition == sup.GIVEN_UP or condition == sup.WRONG_WAY:
            request(G, sup.FAULT_STALL, sup.LEVEL_2)
        elif condition == sup.MISCONFIGURED:
            request(G, sup.FAULT_EXCEPTION, sup.LEVEL_1)


@kernel
def runs_away(G, i, measured, least):
    """True where slider (i = 0) or ballast (1) went by more than `least` away from every place it was sent to of late.

    Places sent to younger than DELAY_TICKS may not show yet, so all of them have to lie on the other side.
    """
    now, size = int(G[sup.RING_AT]), sup.N_RING
    ring, sent = sup.RING + i * size, sup.SENT_RING + i * size
    before = G[ring + (now - int(G[sup.WRONG_TICKS])) % size]
    moved = measured - before
    if not abs(moved) > least:  # NaN at first
        return False
    for back in range(int(G[sup.DELAY_TICKS])):
        ahead = (G[sent + (now - back) % size] - before) * math.copysign(1.0, moved)
        if ahead > (-least if back == 0 else least) / 3.0:  # never for NaN, before the flight
            return False
    return True


@kernel
def watch_move(G, i, measured, rate, tau, span, t):
    """Row 14 for slider (i = 0) or ballast (1): does it go where it was sent? rate 1/s, tau s, span the whole range."""
    if runs_away(G, i, measured, 0.3 * rate * G[sup.WRONG_TICKS] * G[sup.TICK]):
        G[sup.STOPPED + i] = G[sup.ENABLED + sup.FAULT_STALL]
        G[sup.SENT + 1 + i] = measured
    if G[sup.STOPPED + i] == 1.0:
        request(G, sup.FAULT_STALL, sup.LEVEL_2)
    else:
        watch_stall(G, i, measured, rate, tau, span, t)


@kernel
def watch_stall(G, i, measured, rate, tau, span, t):
    """Row 14: away from where it was sent, without progress, for longer than the way takes; rests, tries again."""
    off = abs(G[sup.SENT + 1 + i] - measured)
    tolerance = rate * (tau + 0.2) + 0.02 * span
    if t < G[sup.REST_UNTIL + i]:
        request(G, sup.FAULT_STALL, sup.LEVEL_1)
        return
    moved = abs(measured - G[sup.MARK + i]) > 0.25 * tolerance
    stands = held_for(G, sup.T_STALL + i, off > tolerance and not moved, t)
    if stands <= 0.0:
        G[sup.MARK + i] = measured
    if moved:
        G[sup.STALLS + i] = 0.0
    if stands > G[sup.STALL_FACTOR] * (off / rate + tau) and G[sup.ENABLED + sup.FAULT_STALL] == 1.0:
        G[sup.STALLS + i] += 1.0
        G[sup.REST_UNTIL + i] = t + G[sup.STALL_REST]
        G[sup.SINCE + sup.T_STALL + i] = math.nan
    if G[sup.STALLS + i] > G[sup.STALL_COUNT]:
        request(G, sup.FAULT_STALL, sup.LEVEL_2)


@kernel
def depth_rate(G, depth, t):
    """Depth rate (m/s) by depth alone, of the last second or so."""
    if math.isnan(G[sup.SLOW_TIME]):
        G[sup.SLOW_DEPTH] = depth
    else:
        G[sup.SLOW_DEPTH] += (depth - G[sup.SLOW_DEPTH]) * (1.0 - math.exp(-(t - G[sup.SLOW_TIME]) / LAG))
    G[sup.SLOW_TIME] = t
    return (depth - G[sup.SLOW_DEPTH]) / LAG


@kernel
def watch_depth(G, est, ap, t):
    """Rows 13, 17 and 19: what depth, pitch and time say of each other."""
    depth, pitch = est[ctl.NEW_DEPTH], est[ctl.NEW_PITCH]
    flying = ap[ctl.MODE] == ctl.FLYING
    rate = depth_rate(G, depth, t)
    against = rate * pitch > 0.0 and abs(pitch) > G[sup.DISAGREE_PITCH] and abs(rate) > G[sup.DISAGREE_RATE]
    if held_for(G, sup.T_DISAGREE, flying and against, t) >= G[sup.DISAGREE_TIME]:
        request(G, sup.FAULT_DISAGREE, sup.LEVEL_1)
    if held_for(G, sup.T_DEEP, depth > G[sup.WORKING_DEPTH], t) >= G[sup.DEEP_TIME]:
        request(G, sup.FAULT_TOO_DEEP, sup.LEVEL_1)
    if held_for(G, sup.T_RISK, depth > G[sup.RISK_DEPTH], t) >= G[sup.RISK_TIME]:
        request(G, sup.FAULT_TOO_DEEP, sup.LEVEL_2)
    held = not flying or ap[ctl.REACHED] >= 0.0
    if held or not abs(depth - G[sup.BAND_MARK]) <= G[sup.SAME_BAND]:
        G[sup.BAND_MARK], G[sup.BAND_SINCE] = depth, t
    if t - G[sup.BAND_SINCE] > G[sup.SAME_TIME]:
        request(G, sup.FAULT_OVERTIME, sup.LEVEL_1)
    begun = ap[ctl.MODE] == ctl.FLYING or ap[ctl.MODE] == ctl.ABORTED
    if begun and t - ap[ctl.MISSION_START] > G[sup.MISSION_TIME]:
        request(G, sup.FAULT_OVERTIME, sup.LEVEL_1)


@kernel
def watch_ascent(G, est, ap, t):
    """Row 18: after ABORT, or the mission's end, the vehicle has to rise; judged blind where there is no depth."""
    if G[sup.HIGHEST] < sup.ABORT and ap[ctl.MODE] < ctl.COMPLETED:
        G[sup.ASCENT_MARK], G[sup.ASCENT_SINCE] = est[ctl.NEW_DEPTH], t
        return
    blind = lost(G, sup.SENSOR_BEACON, t)
    depth = est[ctl.NEW_DEPTH]
    if not blind and (depth < G[sup.SURFACE_DEPTH] or depth < G[sup.ASCENT_MARK] - G[sup.ASCENT_STEP]):
        G[sup.ASCENT_MARK], G[sup.ASCENT_SINCE] = depth, t
        return
    G[sup.ASCENT_MARK] = max(G[sup.ASCENT_MARK], depth)  # it may sink on until the ballast is out
    if t - G[sup.ASCENT_SINCE] <= G[sup.ASCENT_TIME]:
        return
    if math.isnan(G[sup.OOB_SINCE]):
        G[sup.OOB_SINCE] = G[sup.ASCENT_SINCE] = t
    patience = G[sup.BLIND_TIME] if blind else G[sup.ASCENT_TIME]
    in_vain = t - max(G[sup.ASCENT_SINCE], G[sup.OOB_SINCE]) > patience
    request(G, sup.FAULT_NO_ASCENT, sup.LEVEL_2 if in_vain else sup.LEVEL_1)


@kernel
def watch_attitude(G, est, ap, t):
    """Row 21: steeper than a glider flies, or rolling over."""
    pitch, roll = abs(est[ctl.NEW_PITCH]), abs(est[ctl.NEW_ROLL])
    steep = pitch > max(G[sup.STEEP_PITCH], abs(ap[ctl.REF_PITCH]) + G[sup.STEEP_MARGIN])
    over = roll > max(G[sup.STEEP_ROLL], abs(ap[ctl.REF_ROLL]) + G[sup.STEEP_MARGIN])
    bad = held_for(G, sup.T_STEEP, ap[ctl.MODE] == ctl.FLYING and (steep or over), t)
    if bad >= 0.0:
        request(G, sup.FAULT_STEEP, sup.LEVEL_2 if bad >= G[sup.STEEP_TIME] else sup.LEVEL_1)


@kernel
def control_law_failed(P, C, ap):
    """True where the control law had no answer in this tick, or one beyond all measure."""
    for i in range(3):
        if not abs(ap[ctl.WANTED_SERVO + i]) <= IMPOSSIBLE * (P[SPANS[i][1]] - P[SPANS[i][0]]):  # NaN too
            return True
    return C[ctl.CONTROLLER] != ctl.PID and ap[ctl.ACTIVE] != ctl.PID and ap[ctl.LAW_STATUS] != 0.0


@kernel
def watch_law(P, C, G, ap):
    """Row 22: the PID flies as long as the request stands; a law without an answer again and again is given up."""
    if ap[ctl.MODE] != ctl.FLYING:
        return
    if control_law_failed(P, C, ap):
        G[sup.LAW_FAILED] += 1.0
        request(G, sup.FAULT_NO_ANSWER, sup.LEVEL_2 if G[sup.LAW_FAILED] >= G[sup.LAW_RUN] else sup.LEVEL_1)
    elif C[ctl.CONTROLLER] == ctl.PID or ap[ctl.ACTIVE] != ctl.PID:
        G[sup.LAW_FAILED] = 0.0


@kernel
def watch_estimate(G, ap):
    """Row 35: the filter was not finite and was restarted in this tick; after so many restarts the dive is given up."""
    restarts = ap[ctl.FILTER_RESTARTS]
    if restarts >= G[sup.RESTART_COUNT]:
        request(G, sup.FAULT_ESTIMATE, sup.LEVEL_2)
    elif restarts > G[sup.RESTARTS_SEEN]:
        request(G, sup.FAULT_ESTIMATE, sup.LEVEL_1)
    G[sup.RESTARTS_SEEN] = restarts


@kernel
def watch_loop(G, t):
    """Rows 24, 25, 27 and 33: the loop's own time, and what the runtime says of recorder and memory."""
    if not t - G[sup.MINUTE] < 60.0:
        G[sup.MINUTE], G[sup.LATE_COUNT] = t, 0.0
    if G[sup.LATENESS] > G[sup.TICK]:
        G[sup.LATE_RUN] += 1.0
        G[sup.LATE_COUNT] += 1.0
        request(G, sup.FAULT_OVERRUN, sup.LEVEL_1)
    else:
        G[sup.LATE_RUN] = 0.0
    many = G[sup.LATE_COUNT] * G[sup.TICK] > 60.0 * G[sup.OVERRUN_SHARE]
    heavy = held_for(G, sup.T_HEAVY, G[sup.LATE_RUN] >= G[sup.OVERRUN_RUN] or many, t)
    if heavy >= 0.0:
        request(G, sup.FAULT_OVERRUN, sup.LEVEL_3 if heavy >= G[sup.HOLD_TIME] else sup.LEVEL_2)
    if G[sup.RESTARTED] == 1.0:
        request(G, sup.FAULT_LOOP_HUNG, sup.LEVEL_1)
    if G[sup.RECORDER] > 0.0:
        request(G, sup.FAULT_DISK, sup.LEVEL_2 if G[sup.RECORDER] > 1.0 else sup.LEVEL_1)
    if G[sup.GROWTH] > 0.0:
        request(G, sup.FAULT_GROWTH, sup.LEVEL_2 if G[sup.GROWTH] > 1.0 else sup.LEVEL_1)
