"""Where things stand in the autopilot's vectors: C its configuration, est the estimate, ap its memory.

Missions come as a matrix, one row a leg; nav is the estimator's own memory. SI and radians.
"""

from glider.firmware.core.layouts.cursor import Cursor
from glider.firmware.core.layouts.estimator_layout import N_E, N_S, N_W, N_WORK_ROWS, N_XE, N_Z
from glider.firmware.core.vehicle.layout import N_P, N_X

# --- C: configuration -----------------------------------------------------------------------------------------------
_c = Cursor()
DT = _c()  # s, the loop's step
PITCH_KP, PITCH_KI, PITCH_KD = _c.each(3)  # m/rad, m/(rad s), m s/rad
DEPTH_KP, DEPTH_KI, DEPTH_KD = _c.each(3)  # kg/m, kg/(m s), kg s/m
ROLL_KP, ROLL_KD = _c.each(2)  # rad/rad, s
PITCH_WN, PITCH_ZETA = _c.each(2)  # rad/s, 1: reference filters
DEPTH_WN, DEPTH_ZETA = _c.each(2)
ROLL_WN, ROLL_ZETA = _c.each(2)
DEPTH_FILTER_WN = _c()  # rad/s, bandwidth of the depth rate observer
MAX_AGE_IMU, MAX_AGE_BEACON, MAX_AGE_WIRE = _c.each(3)  # s, older samples are not used
ABORT_AGE = _c()  # s without IMU or beacon before the dive is given up
SALINITY = _c()  # PSU
SURFACE_PRESSURE = _c()  # Pa
SITE_DEPTH = _c()  # m; 0: unknown
MISSION_TIME_LIMIT = _c()  # s
HEADING_KP, HEADING_KD = _c.each(2)  # rad of roll per rad of heading error, and per rad/s
ESTIMATOR = _c()  # MEASURED, FILTERED or GIVEN
CONTROLLER, FORM = _c.each(2)  # PID, LAW, HYBRID, LAW_PLUS; EXACT or PAPER
PITCH_K1, PITCH_K2, PITCH_K3, PITCH_EPS = _c.each(4)  # 1/s, m, 1/s, rad/s
DEPTH_K1, DEPTH_K2, DEPTH_K3, DEPTH_EPS = _c.each(4)  # 1/s, kg, 1/s, m/s
HYBRID_ROUGHNESS_ON, HYBRID_ROUGHNESS_OFF = _c.each(2)  # noise scale past which the law takes over, and back
HYBRID_PITCH_ON, HYBRID_PITCH_OFF = _c.each(2)  # rad still to go to the pitch target
HYBRID_DEPTH_ON, HYBRID_DEPTH_OFF = _c.each(2)  # m off the depth reference
HYBRID_DWELL = _c()  # s for which a choice stands at least
OBSERVER_SHARE = _c()  # of the filter's model error that the law counts on, 0..1
N_C = _c.size
PID, LAW, HYBRID, LAW_PLUS = 0.0, 1.0, 2.0, 3.0
EXACT, PAPER = 0.0, 1.0
MEASURED, FILTERED, GIVEN = 0.0, 1.0, 2.0  # samples as they come; the Kalman filter; a state from outside

# --- est: the estimate ----------------------------------------------------------------------------------------------
_est = Cursor()
EST_DEPTH, EST_DEPTH_RATE = _est.each(2)
EST_ROLL, EST_PITCH, EST_YAW = _est.each(3)
EST_P, EST_Q, EST_R = _est.each(3)
EST_SLIDER, EST_BALLAST = _est.each(2)
EST_DENSITY = _est()
EST_IMU_TIME, EST_BEACON_TIME = _est.each(2)  # time of the newest sample used
EST_SLIDER_TIME, EST_PLUNGER_TIME = _est.each(2)
EST_STARTED = _est()  # 1 once IMU and beacon have both been seen
NEW_DEPTH = _est()  # the newest samples as measured, before any filter
NEW_ROLL, NEW_PITCH, NEW_YAW = _est.each(3)
NEW_P, NEW_Q, NEW_R = _est.each(3)
NEW_SLIDER, NEW_BALLAST = _est.each(2)
EST_U, EST_V, EST_W = _est.each(3)  # m/s through the water; 0 unless FILTERED
EST_SERVO = _est()  # rad
EST_X, EST_Y = _est.each(2)  # m north and east of the start, by dead reckoning
EST_WATER_N, EST_WATER_E = _est.each(2)  # m/s
SD_DEPTH_RATE, SD_PITCH, SD_U = _est.each(3)  # 1 sigma: m/s, rad, m/s
NOISE_SCALE = _est()  # disturbance seen over the one in the vehicle file, 1 or more
MODEL_ERROR = _est(6)  # accelerations beside the model's, body axes, m/s2, rad/s2
N_EST = _est.size

# --- nav: the Kalman filter's memory, one vector ---------------------------------------------------------------------
_nav = Cursor()
NAV_RUNNING, NAV_TIME = _nav.each(2)  # 1: started; s
NAV_USED = _nav(4)  # times of the samples used, by sensor
NAV_NOISE_SCALE = _nav()  # disturbance seen over the one in the vehicle file, 1 or more
NAV_CALM = _nav(2)  # the spectral densities of the vehicle file's disturbance
NAV_SETTINGS = _nav(N_S)
NAV_SIGMA = _nav(N_P)
NAV_SPREAD = _nav(N_E)
NAV_X = _nav(N_XE)
NAV_INFLATION = _nav(2)
NAV_Z = _nav(N_Z)
NAV_REJECTED = _nav(N_Z)
NAV_SCORES = _nav(N_Z)
NAV_GIVEN = _nav(N_X)  # the state from outside (GIVEN)
NAV_COV = _nav(N_E * N_E)
NAV_WORK = _nav(N_WORK_ROWS * N_W)
N_NAV = _nav.size

# --- legs: one row each ---------------------------------------------------------------------------------------------
_leg = Cursor()
LEG_DEPTH = _leg()  # m, target; NaN: the leg ends by time or turn
LEG_PITCH, LEG_ROLL = _leg.each(2)  # rad
LEG_BALLAST = _leg()  # kg held; NaN: the depth loop commands it
LEG_TIME_LIMIT = _leg()  # s
LEG_HOLD = _leg()  # s at the depth before the leg is done
LEG_TOLERANCE = _leg()  # m
LEG_DURATION = _leg()  # s; NaN for a leg to a depth or through a turn
LEG_TURN = _leg()  # +1 to starboard, -1 to port; NaN: LEG_ROLL as it stands
LEG_HEADING = _leg()  # rad, held by roll up to LEG_ROLL; NaN: not held
LEG_TURNED = _leg()  # rad through which the leg turns before it is done; NaN
N_LEG = _leg.size

# --- ap: the autopilot's memory -------------------------------------------------------------------------------------
_ap = Cursor()
MODE, LEG, LEG_START, REACHED = _ap.each(4)
REF_DEPTH, REF_DEPTH_RATE, REF_DEPTH_ACC = _ap.each(3)
REF_PITCH, REF_PITCH_RATE, REF_PITCH_ACC = _ap.each(3)
REF_ROLL, REF_ROLL_RATE, REF_ROLL_ACC = _ap.each(3)
INT_PITCH, INT_DEPTH = _ap.each(2)  # integrators, m and kg
SENT_SERVO, SENT_SLIDER, SENT_BALLAST = _ap.each(3)  # last commands sent
REASON = _ap()
LEG_DEPTH_START = _ap()  # m, depth at which the leg began
MISSION_START = _ap()  # s
SUM_DEPTH, SUM_PITCH, SUM_ROLL = _ap.each(3)  # squared tracking errors added up while flying, m2, rad2
COUNT_DEPTH, COUNT_ATTITUDE = _ap.each(2)  # ticks in those sums
TURNED, YAW_BEFORE = _ap.each(2)  # rad turned in this leg, starboard positive; yaw a tick ago
ACTIVE, ACTIVE_SINCE = _ap.each(2)  # controller at work, PID or LAW; s
LAW_STATUS = _ap()  # of the last law evaluated: law.OK, STEEP, NOT_FINITE
BUMP_SLIDER, BUMP_BALLAST = _ap.each(2)  # m, kg, what a switch left over, fading
S_PITCH, S_DEPTH = _ap.each(2)  # rad/s, m/s, the sliding variables
LAW_RAN = _ap()  # 1 if a controller other than the PID ran in the tick before
MONITORED = _ap()  # s, when the Lyapunov monitor looked last
K2_NEED_PITCH, K2_NEED_DEPTH = _ap.each(2)  # m, kg: the k2 that covers; NaN where the law does not fly
MARGIN_PITCH, MARGIN_DEPTH = _ap.each(2)  # rad/s2, m/s2: positive, V is sure to fall
WANTED_SERVO, WANTED_SLIDER, WANTED_BALLAST = _ap.each(3)  # what the controller wants, before any limit
CAUTIOUS = _ap()  # 1: the PID flies, whatever controller is chosen
AP_REACTION, AP_FAULT_ROW = _ap.each(2)  # the supervisor's, and the row of the fault table that asked for it
SUPERVISED = _ap()  # 1: a supervisor guards, and it alone gives the dive up for what it sees
FILTER_RESTARTS = _ap()  # how often the filter was not finite, and was started anew
STOP_REQUESTED = _ap()  # 1: the operator wants the dive given up; written between two ticks, from a signal handler
STOP_TAKEN = _ap()  # STOP_REQUESTED as this tick found it
N_AP = _ap.size

# --- modes and reasons ----------------------------------------------------------------------------------------------
WAITING, FLYING, COMPLETED, ABORTED = 0.0, 1.0, 2.0, 3.0
REASON_NONE, REASON_LEG_TIME, REASON_MISSION_TIME = 0.0, 1.0, 2.0
REASON_IMU, REASON_BEACON, REASON_TOO_DEEP, REASON_OPERATOR = 3.0, 4.0, 5.0, 6.0
REASON_FAULT = 100.0  # and the row of the fault table added to it
