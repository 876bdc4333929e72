"""Plausibility checks of samples: their times, their ranges, their jumps, and whether they are stuck.

What is not fit is marked as FAULT in the frame, so that the estimator does without it.
"""

import math

from glider.firmware.core.estimation.sensing import longest_age
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle.layout import BALLAST_MAX, BALLAST_MIN, SLIDER_MAX, SLIDER_MIN
from glider.hal.ports import IMU

LOWS, HIGHS = (SLIDER_MIN, BALLAST_MIN), (SLIDER_MAX, BALLAST_MAX)

NODDING = 0.1  # rad; steeper than this, or
HEAVY = 0.25  # of the ballast's range away from neutral, a glider changes its depth
UPRIGHT = 1.2  # rad of pitch
DRAWN = 0.05  # of a range; an actuator sent so far moves its draw-wire


@kernel
def differs(G, frame, sensor, table):
    """True where the sensor's values are not those at `table`; NaN differs from everything."""
    start, place = sup.STARTS[sensor] + 2, sup.PLACES[sensor]
    other = False
    for i in range(sup.WIDTHS[sensor]):
        other = other or frame[start + i] != G[table + place + i]
    return other


@kernel
def keep(G, frame, sensor, table):
    """The sensor's values into the table."""
    start, place = sup.STARTS[sensor] + 2, sup.PLACES[sensor]
    for i in range(sup.WIDTHS[sensor]):
        G[table + place + i] = frame[start + i]


@kernel
def implausible(G, frame, sensor, elapsed):
    """True where a value is not finite, out of its physical range, or farther from the last than anything moves."""
    start, place = sup.STARTS[sensor] + 2, sup.PLACES[sensor]
    for i in range(sup.WIDTHS[sensor]):
        value = frame[start + i]
        if not (math.isfinite(value) and G[sup.LOW + place + i] <= value <= G[sup.HIGH + place + i]):
            return True
        jump = abs(value - G[sup.LAST + place + i])
        if sensor == sup.SENSOR_IMU and (i == 0 or i == 2):  # roll and yaw go round, and mean nothing upright
            jump = min(jump, 2.0 * math.pi - jump) if abs(frame[start + 1]) < UPRIGHT else 0.0
        if jump > G[sup.JUMP + place + i] + G[sup.JUMP_RATE + place + i] * elapsed:  # never for NaN, the first
            return True
    return False


@kernel
def excited(P, G, frame, sensor):
    """True where the vehicle does what should show in this sensor (persistent excitation)."""
    if sensor == sup.SENSOR_IMU:
        return True
    if sensor == sup.SENSOR_BEACON:
        return abs(frame[IMU + 3]) > NODDING or abs(G[sup.SENT + 2]) > HEAVY * (P[BALLAST_MAX] - P[BALLAST_MIN])
    if sensor == sup.SENSOR_SLIDER or sensor == sup.SENSOR_PLUNGER:
        i = sensor - sup.SENSOR_SLIDER
        return abs(G[sup.SENT + 1 + i] - G[sup.SENT_THEN + i]) > DRAWN * (P[HIGHS[i]] - P[LOWS[i]])
    return False


@kernel
def stuck(P, G, frame, sensor, t):
    """True where the sensor has said the same for too long while it should not; notes when that began."""
    if differs(G, frame, sensor, sup.RAW) or math.isnan(G[sup.SAME_SINCE + sensor]):
        G[sup.SAME_SINCE + sensor] = t
        if sensor == sup.SENSOR_SLIDER or sensor == sup.SENSOR_PLUNGER:
            G[sup.SENT_THEN + sensor - sup.SENSOR_SLIDER] = G[sup.SENT + 1 + sensor - sup.SENSOR_SLIDER]
    patience = G[sup.FROZEN_TIME] if sensor == sup.SENSOR_IMU else G[sup.STUCK_TIME]
    row = sup.FAULT_IMU_LOST if sensor == sup.SENSOR_IMU else sup.FAULT_STUCK_SENSOR
    same = t - G[sup.SAME_SINCE + sensor] >= max(patience, 4.0 * G[sup.PERIOD + sensor])
    return G[sup.ENABLED + row] == 1.0 and same and excited(P, G, frame, sensor)


@kernel
def judge(P, G, frame, sensor, t):
    """The verdict on a sample not seen before: FIT, MISTIMED, IMPLAUSIBLE or STUCK."""
    time, last = frame[sup.STARTS[sensor]], G[sup.TAKEN + sensor]
    still = stuck(P, G, frame, sensor, t)
    if G[sup.ENABLED + sup.FAULT_SAMPLE_TIME] == 1.0:
        oldest = t - longest_age(G[sup.PERIOD + sensor], G[sup.TICK])
        if not oldest <= time <= t + 1e-6 or time <= last:
            return sup.MISTIMED
    if G[sup.ENABLED + sup.FAULT_IMPLAUSIBLE] == 1.0 and implausible(G, frame, sensor, max(time - last, 0.0)):
        return sup.IMPLAUSIBLE
    return sup.STUCK if still else sup.FIT


@kernel
def take(P, G, frame, sensor, t):
    """Look at one sensor's slot; what is unfit is marked in the frame."""
    start = sup.STARTS[sensor]
    if frame[start + 1] != sup.VALID:
        return
    if frame[start] != G[sup.SEEN + sensor]:
        verdict = judge(P, G, frame, sensor, t)
        G[sup.SEEN + sensor] = frame[start]
        keep(G, frame, sensor, sup.RAW)
        if verdict == sup.FIT:
            G[sup.TAKEN + sensor], G[sup.UNFIT + sensor] = frame[start], 0.0
            keep(G, frame, sensor, sup.LAST)
        else:
            G[sup.UNFIT + sensor] += 1.0
        G[sup.SAMPLE_VERDICT + sensor] = verdict
    elif G[sup.ENABLED + sup.FAULT_SAMPLE_TIME] == 1.0 and differs(G, frame, sensor, sup.RAW):
        G[sup.SAMPLE_VERDICT + sensor] = sup.MISTIMED  # another sample under the same time
    if G[sup.SAMPLE_VERDICT + sensor] != sup.FIT:
        frame[start + 1] = sup.FAULT


@kernel
def start_place(G, frame, wire, scale, dead):
    """Before anything is sent: slider (wire 0) and ballast (1) begin where their wires say they stand.

    scale: the actuator's unit per metre of wire; nearer to neutral than `dead` counts as neutral.
    """
    if G[sup.PLACED + wire] == 0.0 and frame[sup.STARTS[sup.SENSOR_SLIDER + wire] + 1] == sup.VALID:
        place = scale * frame[sup.STARTS[sup.SENSOR_SLIDER + wire] + 2]
        if abs(place) > dead:
            G[sup.SENT + 1 + wire] = place
        G[sup.PLACED + wire] = 1.0


@kernel
def screen(P, G, frame, t):
    """Every sensor of the frame (FRAME_SIZE,) at time t (s), in place; P (N_P,), G (N_G,)."""
    if math.isnan(G[sup.BEGAN]):
        G[sup.BEGAN] = t
    for sensor in range(sup.N_SENSORS):
        take(P, G, frame, sensor, t)
