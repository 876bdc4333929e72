"""Where things stand in the supervisor's vector G: settings, what the runtime tells it, and its memory. SI.

Row 0 of the fault table is nobody's.
"""

from hal.ports import BALLAST, BATTERY, BEACON, IMU, LEAK, PLUNGER_WIRE, SERVO, SLIDER, SLIDER_WIRE

# --- rows of the fault table: docs/SUPERVISOR.md says of each who sees it, how soon, and what is done ----------------
(
    FAULT_IMU_LOST, FAULT_PRESSURE_LOST, FAULT_BUS_LOST, FAULT_WIRE_LOST, FAULT_SERVO_LOST,
    FAULT_SAMPLE_TIME, FAULT_CHECKSUM, FAULT_REPLY, FAULT_EXCEPTION, FAULT_IMPLAUSIBLE, FAULT_STUCK_SENSOR,
    FAULT_NOT_ARMED, FAULT_DISAGREE, FAULT_STALL, FAULT_SOFT_LIMIT, FAULT_DRIVE_ALARM, FAULT_TOO_DEEP,
    FAULT_NO_ASCENT, FAULT_OVERTIME, FAULT_LEAK, FAULT_STEEP, FAULT_NO_ANSWER, FAULT_VOLTAGE, FAULT_OVERRUN,
    FAULT_LOOP_HUNG, FAULT_WALL_CLOCK, FAULT_DISK, FAULT_POWER_CUT, FAULT_STATE_FILE, FAULT_FILE, FAULT_SERIAL,
    FAULT_CONSOLE, FAULT_GROWTH, FAULT_PORT, FAULT_ESTIMATE,
) = range(1, 36)  # fmt: skip
N_ROWS = 36

# --- reactions, mildest first ---------------------------------------------------------------------------------------
NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0

# --- sensors and their values, in the frame's order -----------------------------------------------------------------
SENSOR_IMU, SENSOR_BEACON, SENSOR_SLIDER, SENSOR_PLUNGER, SENSOR_LEAK, SENSOR_BATTERY = 0, 1, 2, 3, 4, 5
N_SENSORS = 6
STARTS = (IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE, LEAK, BATTERY)  # of their slots in the frame
WIDTHS = (6, 2, 1, 1, 1, 1)
PLACES = (0, 6, 8, 9, 10, 11)  # of their values in the tables below
N_VALUES = 12
STATES = (SERVO, SLIDER, BALLAST)  # slots in which actuators say how they do
FIT, MISTIMED, ABSURD, STUCK = 0.0, 1.0, 2.0, 3.0  # the verdict on a sample
# hal.ports.Validity and hal.ports.Condition as the frame holds them
VALID, FAULT = 1.0, 3.0
WELL, ALARM, ALARM_KEPT, RETRYING, GIVEN_UP, WRONG_WAY, MISCONFIGURED = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0

# --- settings -------------------------------------------------------------------------------------------------------
ENABLED = 0  # N_ROWS; 1: the row's detector counts
PERIOD = ENABLED + N_ROWS  # N_SENSORS, s
LOST_AFTER = PERIOD + N_SENSORS  # N_SENSORS, s without a sample
LOW = LOST_AFTER + N_SENSORS  # N_VALUES, the physical range
HIGH = LOW + N_VALUES
JUMP = HIGH + N_VALUES  # N_VALUES, farther than this, and the rate times the time gone by, is no motion
JUMP_RATE = JUMP + N_VALUES
_W = JUMP_RATE + N_VALUES
TICK = _W  # s
STATE_AGE = _W + 1  # s without a word from an actuator
HOLD_TIME = _W + 2  # s of HOLD before ABORT
FROZEN_TIME = _W + 3  # s in which the IMU repeats itself
STUCK_TIME = _W + 4  # s, the others while the vehicle moves
UNFIT_RUN = _W + 5  # unfit samples running before a device is in error
DISAGREE_TIME, DISAGREE_PITCH, DISAGREE_RATE = _W + 6, _W + 7, _W + 8  # s, rad, m/s
WORKING_DEPTH, DEEP_TIME = _W + 9, _W + 10  # m, s
RISK_DEPTH, RISK_TIME = _W + 11, _W + 12
ASCENT_TIME, ASCENT_STEP, BLIND_TIME = _W + 13, _W + 14, _W + 15  # s, m, s
SAME_TIME, SAME_BAND = _W + 16, _W + 17  # s, m
LEAK_COUNT = _W + 18  # wet samples before ABORT
STEEP_PITCH, STEEP_MARGIN, STEEP_ROLL, STEEP_TIME = _W + 19, _W + 20, _W + 21, _W + 22  # rad, s
LAW_RUN = _W + 23  # times running without an answer before ABORT
LOW_VOLTAGE, LEAST_VOLTAGE, VOLTAGE_TIME = _W + 24, _W + 25, _W + 26  # V, s
OVERRUN_RUN, OVERRUN_SHARE = _W + 27, _W + 28  # ticks running; of a minute's
MISSION_TIME = _W + 29  # s
STALL_FACTOR, STALL_COUNT, STALL_REST = _W + 30, _W + 31, _W + 32  # travel times, 1, s
WRONG_TICKS = _W + 33  # ticks over which a wrong way is judged, fewer than N_RING
SURFACE_DEPTH = _W + 34  # m
RESTARTED = _W + 35  # 1: an earlier flight did not end in order
LAW_REST = _W + 36  # s of PID after the law had no answer
DELAY_TICKS = _W + 37  # ticks for which a command may not show yet, fewer than N_RING
SURFACED_TIME = _W + 38  # s at the surface before a flight ends
RESTART_COUNT = _W + 39  # restarts of the filter in a flight before ABORT
_H = _W + 40

# --- what the runtime tells ------------------------------------------------------------------------------------------
LATENESS = _H  # s, of this tick
RECORDER = _H + 1  # 0 well, 1 dropping, 2 failed
GROWTH = _H + 2  # 0 none, 1 memory or handles have grown, 2 past their limit
_M = _H + 3

# --- memory ---------------------------------------------------------------------------------------------------------
BEGAN = _M  # s, the first tick
SEEN = BEGAN + 1  # N_SENSORS, time of the sample looked at last
TAKEN = SEEN + N_SENSORS  # time of the newest fit sample
SAMPLE_VERDICT = TAKEN + N_SENSORS  # on the sample in the frame: FIT ...
UNFIT = SAMPLE_VERDICT + N_SENSORS  # unfit samples running
SAME_SINCE = UNFIT + N_SENSORS  # s, since when the sensor says the same
LAST = SAME_SINCE + N_SENSORS  # N_VALUES, newest fit values
RAW = LAST + N_VALUES  # N_VALUES, as looked at last
SENT_THEN = RAW + N_VALUES  # 2: slider and ballast sent when their wires last changed
ASKED = SENT_THEN + 2  # N_ROWS, reaction asked for in this tick
FIRST = ASKED + N_ROWS  # N_ROWS, s, when a row asked for the first time; -1: never
WORST = FIRST + N_ROWS  # N_ROWS, the highest it ever asked for
SINCE = WORST + N_ROWS  # N_TIMERS, s, since when a condition holds; NaN: it does not
T_IMU, T_DISAGREE, T_DEEP, T_RISK, T_STEEP, T_LOW, T_LEAST, T_HEAVY, T_STATE = 0, 1, 2, 3, 4, 5, 6, 7, 8
T_STALL = 9  # 2
T_SURFACE = 11
N_TIMERS = 12
_N = SINCE + N_TIMERS
SENT = _N  # 3: servo rad, slider m, ballast kg
PLACED = _N + 3  # 2: slider and ballast start from where their wires say
STALLS = _N + 5  # 2
REST_UNTIL = _N + 7  # 2, s
STOPPED = _N + 9  # 2: 1: ran the wrong way, stays where it is
MARK = _N + 11  # 2: place from which progress counts
HIGHEST, HIGHEST_ROW = _N + 13, _N + 14  # the highest asked for, and who asked
SLOW_DEPTH, SLOW_TIME = _N + 15, _N + 16  # m, s: depth that lags 1 s, for its rate
ASCENT_MARK, ASCENT_SINCE = _N + 17, _N + 18  # m, s: the last progress upwards
BAND_MARK, BAND_SINCE = _N + 19, _N + 20  # m, s
WET = _N + 21  # wet samples counted
LAW_FAILED = _N + 22  # ticks running without an answer
LATE_RUN, LATE_COUNT, MINUTE = _N + 23, _N + 24, _N + 25  # ticks running, in this minute; s
LEAK_SEEN = _N + 26  # s, the sample counted last
CHANGED = _N + 27  # 1: a row asks for more than it ever did
OOB_SINCE = _N + 28  # s
PID_UNTIL = _N + 29  # s, after the law had no answer
RING_AT = _N + 30
RING = _N + 31  # 2 x N_RING: where slider and ballast were measured in the ticks before
N_RING = 64
SENT_RING = RING + 2 * N_RING  # 2 x N_RING: where they were sent
ENDING = SENT_RING + 2 * N_RING  # UNDER_WAY ...: has the flight ended?
PUMP_MARK, PUMP_SINCE = ENDING + 1, ENDING + 2  # kg, s: the last progress of the ballast to its light end
CLOCK = ENDING + 3  # s, of the last tick
RESTARTS_SEEN = ENDING + 4  # of the filter, up to the tick before
N_G = ENDING + 5
UNDER_WAY, AT_SURFACE, PUMP_GIVEN_UP, NO_WAY_LEFT = 0.0, 1.0, 2.0, 3.0
