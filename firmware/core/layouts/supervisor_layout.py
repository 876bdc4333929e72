"""Where things stand in the supervisor's vector G: settings, what the runtime tells it, and its memory. SI."""

from glider.firmware.core.layouts.cursor import Cursor
from glider.hal.ports import BALLAST, BATTERY, BEACON, IMU, LEAK, PLUNGER_WIRE, SERVO, SLIDER, SLIDER_WIRE

# --- rows of the fault table: firmware/faults.py says of each who sees it, how soon, and what is done ----------------
_row = Cursor()
_row()  # row 0 is nobody's
(
    FAULT_IMU_LOST, FAULT_PRESSURE_LOST, FAULT_BUS_LOST, FAULT_WIRE_LOST, FAULT_SERVO_LOST,
    FAULT_SAMPLE_TIME, FAULT_CHECKSUM, FAULT_REPLY, FAULT_EXCEPTION, FAULT_IMPLAUSIBLE, FAULT_STUCK_SENSOR,
    FAULT_NOT_ARMED, FAULT_DISAGREE, FAULT_STALL, FAULT_SOFT_LIMIT, FAULT_DRIVE_ALARM, FAULT_TOO_DEEP,
    FAULT_NO_ASCENT, FAULT_OVERTIME, FAULT_LEAK, FAULT_STEEP, FAULT_NO_ANSWER, FAULT_VOLTAGE, FAULT_OVERRUN,
    FAULT_LOOP_HUNG, FAULT_WALL_CLOCK, FAULT_DISK, FAULT_POWER_CUT, FAULT_STATE_FILE, FAULT_FILE, FAULT_SERIAL,
    FAULT_CONSOLE, FAULT_GROWTH, FAULT_PORT, FAULT_ESTIMATE, FAULT_ACKNOWLEDGED,
) = _row.each(36)  # fmt: skip
N_ROWS = _row.size

# --- reactions, mildest first, and the levels of a row: the reactions that it asks for, mildest first -----------------
NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
_level = Cursor()
LEVEL_1, LEVEL_2, LEVEL_3 = _level.each(3)
N_LEVELS = _level.size

# --- sensors and their values, in the frame's order -----------------------------------------------------------------
_sensor = Cursor()
SENSOR_IMU, SENSOR_BEACON, SENSOR_SLIDER, SENSOR_PLUNGER, SENSOR_LEAK, SENSOR_BATTERY = _sensor.each(6)
N_SENSORS = _sensor.size
STARTS = (IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE, LEAK, BATTERY)  # of their slots in the frame
WIDTHS = (6, 2, 1, 1, 1, 1)
_value = Cursor()
PLACES = tuple(_value(width) for width in WIDTHS)  # of their values in the tables below
N_VALUES = _value.size
STATES = (SERVO, SLIDER, BALLAST)  # slots in which actuators say how they do
FIT, MISTIMED, IMPLAUSIBLE, STUCK = 0.0, 1.0, 2.0, 3.0  # the verdict on a sample
# glider.hal.ports.Validity and glider.hal.ports.Condition as the frame holds them
VALID, FAULT = 1.0, 3.0
WELL, ALARM, ALARM_KEPT, RETRYING, GIVEN_UP, WRONG_WAY, MISCONFIGURED = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0

# --- settings -------------------------------------------------------------------------------------------------------
_g = Cursor()
ENABLED = _g(N_ROWS)  # 1: the row's detector counts
REACTION = _g(N_ROWS * N_LEVELS)  # of each row's levels
CLEAR_AFTER = _g(N_ROWS * N_LEVELS)  # s for which such a request stands after its condition has ended; inf: never
PERIOD = _g(N_SENSORS)  # s
LOST_AFTER = _g(N_SENSORS)  # s without a sample
LOW = _g(N_VALUES)  # the physical range
HIGH = _g(N_VALUES)
JUMP = _g(N_VALUES)  # farther than this, and the rate times the time gone by, is no motion
JUMP_RATE = _g(N_VALUES)
TICK = _g()  # s
STATE_AGE = _g()  # s without a word from an actuator
HOLD_TIME = _g()  # s of HOLD before ABORT
FROZEN_TIME = _g()  # s in which the IMU repeats itself
STUCK_TIME = _g()  # s, the others while the vehicle moves
UNFIT_RUN = _g()  # unfit samples running before a device is in error
DISAGREE_TIME, DISAGREE_PITCH, DISAGREE_RATE = _g.each(3)  # s, rad, m/s
WORKING_DEPTH, DEEP_TIME = _g.each(2)  # m, s
RISK_DEPTH, RISK_TIME = _g.each(2)
ASCENT_TIME, ASCENT_STEP, BLIND_TIME = _g.each(3)  # s, m, s
SAME_TIME, SAME_BAND = _g.each(2)  # s, m
LEAK_COUNT = _g()  # wet samples before ABORT
STEEP_PITCH, STEEP_MARGIN, STEEP_ROLL, STEEP_TIME = _g.each(4)  # rad, s
LAW_RUN = _g()  # times running without an answer before ABORT
LOW_VOLTAGE, LEAST_VOLTAGE, VOLTAGE_TIME = _g.each(3)  # V, s
OVERRUN_RUN, OVERRUN_SHARE = _g.each(2)  # ticks running; of a minute's
MISSION_TIME = _g()  # s
STALL_FACTOR, STALL_COUNT, STALL_REST = _g.each(3)  # travel times, 1, s
WRONG_TICKS = _g()  # ticks over which a wrong way is judged, fewer than N_RING
SURFACE_DEPTH = _g()  # m
RESTARTED = _g()  # 1: an earlier flight did not end in order
DELAY_TICKS = _g()  # ticks for which a command may not show yet, fewer than N_RING
SURFACED_TIME = _g()  # s at the surface before a flight ends
RESTART_COUNT = _g()  # restarts of the filter in a flight before ABORT

# --- what the runtime tells ------------------------------------------------------------------------------------------
LATENESS = _g()  # s, of this tick
RECORDER = _g()  # 0 well, 1 dropping, 2 failed
GROWTH = _g()  # 0 none, 1 memory or handles have grown, 2 past their limit

# --- memory ---------------------------------------------------------------------------------------------------------
_timer = Cursor()
T_IMU, T_DISAGREE, T_DEEP, T_RISK, T_STEEP, T_LOW, T_LEAST, T_HEAVY = _timer.each(8)
T_STALL = _timer(2)
T_SURFACE = _timer()
N_TIMERS = _timer.size
N_RING = 64
BEGAN = _g()  # s, the first tick
SEEN = _g(N_SENSORS)  # time of the sample looked at last
TAKEN = _g(N_SENSORS)  # time of the newest fit sample
SAMPLE_VERDICT = _g(N_SENSORS)  # on the sample in the frame: FIT ...
UNFIT = _g(N_SENSORS)  # unfit samples running
SAME_SINCE = _g(N_SENSORS)  # s, since when the sensor says the same
LAST = _g(N_VALUES)  # newest fit values
RAW = _g(N_VALUES)  # as looked at last
SENT_THEN = _g(2)  # slider and ballast sent when their wires last changed
ASKED = _g(N_ROWS)  # reaction asked for in this tick, or still standing
CLEARS = _g(N_ROWS)  # s for which it stands after its condition has ended
KEPT = _g(N_ROWS)  # reaction that stands
KEPT_UNTIL = _g(N_ROWS)  # s
FIRST = _g(N_ROWS)  # s, when a row asked for the first time; -1: never
WORST = _g(N_ROWS)  # the highest it ever asked for
SINCE = _g(N_TIMERS)  # s, since when a condition holds; NaN: it does not
SENT = _g(3)  # servo rad, slider m, ballast kg
PLACED = _g(2)  # slider and ballast start from where their wires say
STALLS = _g(2)
REST_UNTIL = _g(2)  # s
STOPPED = _g(2)  # 1: ran the wrong way, stays where it is
MARK = _g(2)  # place from which progress counts
HIGHEST, HIGHEST_ROW = _g.each(2)  # the highest asked for, and who asked
SLOW_DEPTH, SLOW_TIME = _g.each(2)  # m, s: depth that lags 1 s, for its rate
ASCENT_MARK, ASCENT_SINCE = _g.each(2)  # m, s: the last progress upwards
BAND_MARK, BAND_SINCE = _g.each(2)  # m, s
WET = _g()  # wet samples counted
LAW_FAILED = _g()  # ticks running without an answer
LATE_RUN, LATE_COUNT, MINUTE = _g.each(3)  # ticks running, in this minute; s
LEAK_SEEN = _g()  # s, the sample counted last
CHANGED = _g()  # 1: a row asks for more than it ever did
OOB_SINCE = _g()  # s
RING_AT = _g()
RING = _g(2 * N_RING)  # where slider and ballast were measured in the ticks before
SENT_RING = _g(2 * N_RING)  # where they were sent
ENDING = _g()  # UNDER_WAY ...: has the flight ended?
PUMP_MARK, PUMP_SINCE = _g.each(2)  # kg, s: the last progress of the ballast to its light end
CLOCK = _g()  # s, of the last tick
RESTARTS_SEEN = _g()  # of the filter, up to the tick before
N_G = _g.size
UNDER_WAY, AT_SURFACE, PUMP_GIVEN_UP, NO_WAY_LEFT = 0.0, 1.0, 2.0, 3.0
