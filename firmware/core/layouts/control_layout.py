"""Where things stand in the autopilot's vectors: C its configuration, est the estimate, ap its memory.

Missions come as a matrix, one row a leg; nav is the estimator's own memory. SI and radians.
"""

from firmware.core.layouts.estimator_layout import N_E, N_S, N_W, N_WORK_ROWS, N_XE, N_Z
from firmware.core.vehicle.layout import N_P, N_X

# --- C: configuration -----------------------------------------------------------------------------------------------
DT = 0  # s, the loop's step
PITCH_KP, PITCH_KI, PITCH_KD = 1, 2, 3  # m/rad, m/(rad s), m s/rad
DEPTH_KP, DEPTH_KI, DEPTH_KD = 4, 5, 6  # kg/m, kg/(m s), kg s/m
ROLL_KP, ROLL_KD = 7, 8  # rad/rad, s
PITCH_WN, PITCH_ZETA = 9, 10  # rad/s, 1: reference filters
DEPTH_WN, DEPTH_ZETA = 11, 12
ROLL_WN, ROLL_ZETA = 13, 14
DEPTH_FILTER_WN = 15  # rad/s, bandwidth of the depth rate observer
MAX_AGE_IMU, MAX_AGE_BEACON, MAX_AGE_WIRE = 16, 17, 18  # s, older samples are not used
ABORT_AGE = 19  # s without IMU or beacon before the dive is given up
SALINITY = 20  # PSU
SURFACE_PRESSURE = 21  # Pa
SITE_DEPTH = 22  # m; 0: unknown
MISSION_TIME_LIMIT = 23  # s
HEADING_KP, HEADING_KD = 24, 25  # rad of roll per rad of heading error, and per rad/s
ESTIMATOR = 26  # MEASURED, FILTERED or GIVEN
CONTROLLER, FORM = 27, 28  # PID, LAW, HYBRID, LAW_PLUS; EXACT or PAPER
PITCH_K1, PITCH_K2, PITCH_K3, PITCH_EPS = 29, 30, 31, 32  # 1/s, m, 1/s, rad/s
DEPTH_K1, DEPTH_K2, DEPTH_K3, DEPTH_EPS = 33, 34, 35, 36  # 1/s, kg, 1/s, m/s
HYBRID_ROUGHNESS_ON, HYBRID_ROUGHNESS_OFF = 37, 38  # roughness past which the law takes over, and back
HYBRID_PITCH_ON, HYBRID_PITCH_OFF = 39, 40  # rad still to go to the pitch target
HYBRID_DEPTH_ON, HYBRID_DEPTH_OFF = 41, 42  # m off the depth reference
HYBRID_DWELL = 43  # s for which a choice stands at least
OBSERVER_SHARE = 44  # of the filter's model error that the law counts on, 0..1
N_C = 45
PID, LAW, HYBRID, LAW_PLUS = 0.0, 1.0, 2.0, 3.0
EXACT, PAPER = 0.0, 1.0
MEASURED, FILTERED, GIVEN = 0.0, 1.0, 2.0  # samples as they come; the Kalman filter; a state from outside

# --- est: the estimate ----------------------------------------------------------------------------------------------
EST_DEPTH, EST_DEPTH_RATE = 0, 1
EST_ROLL, EST_PITCH, EST_YAW = 2, 3, 4
EST_P, EST_Q, EST_R = 5, 6, 7
EST_SLIDER, EST_BALLAST = 8, 9
EST_DENSITY = 10
EST_IMU_TIME, EST_BEACON_TIME = 11, 12  # time of the newest sample used
EST_SLIDER_TIME, EST_PLUNGER_TIME = 13, 14
EST_STARTED = 15  # 1 once IMU and beacon have both been seen
NEW_DEPTH = 16  # the newest samples as measured, before any filter
NEW_ROLL, NEW_PITCH, NEW_YAW = 17, 18, 19
NEW_P, NEW_Q, NEW_R = 20, 21, 22
NEW_SLIDER, NEW_BALLAST = 23, 24
EST_U, EST_V, EST_W = 25, 26, 27  # m/s through the water; 0 unless FILTERED
EST_SERVO = 28  # rad
EST_X, EST_Y = 29, 30  # m north and east of the start, by dead reckoning
EST_WATER_N, EST_WATER_E = 31, 32  # m/s
SD_DEPTH_RATE, SD_PITCH, SD_U = 33, 34, 35  # 1 sigma: m/s, rad, m/s
ROUGHNESS = 36  # disturbance seen over the one in the vehicle file, 1 or more
MODEL_ERROR = 37  # 37..42 accelerations beside the model's, body axes, m/s2, rad/s2
N_EST = 43

# --- nav: the Kalman filter's memory, one vector ---------------------------------------------------------------------
NAV_RUNNING, NAV_TIME, NAV_USED = 0, 1, 2  # started; s; 2..5 times of the samples used, by sensor
NAV_ROUGHNESS = 6  # disturbance seen over the one in the vehicle file, 1 or more
NAV_CALM = 7  # 7, 8 the spectral densities of the vehicle file's disturbance
NAV_SETTINGS = 9
NAV_SIGMA = NAV_SETTINGS + N_S
NAV_SPREAD = NAV_SIGMA + N_P
NAV_X = NAV_SPREAD + N_E
NAV_INFLATION = NAV_X + N_XE
NAV_Z = NAV_INFLATION + 2
NAV_REJECTED = NAV_Z + N_Z
NAV_SCORES = NAV_REJECTED + N_Z
NAV_GIVEN = NAV_SCORES + N_Z  # N_X, the state from outside (GIVEN)
NAV_COV = NAV_GIVEN + N_X
NAV_WORK = NAV_COV + N_E * N_E
N_NAV = NAV_WORK + N_WORK_ROWS * N_W

# --- legs: one row each ---------------------------------------------------------------------------------------------
LEG_DEPTH = 0  # m, target; NaN: the leg ends by time or turn
LEG_PITCH, LEG_ROLL = 1, 2  # rad
LEG_BALLAST = 3  # kg held; NaN: the depth loop commands it
LEG_TIME_LIMIT = 4  # s
LEG_HOLD = 5  # s at the depth before the leg is done
LEG_TOLERANCE = 6  # m
LEG_DURATION = 7  # s; NaN for a leg to a depth or through a turn
LEG_TURN = 8  # +1 to starboard, -1 to port; NaN: LEG_ROLL as it stands
LEG_HEADING = 9  # rad, held by roll up to LEG_ROLL; NaN: not held
LEG_TURNED = 10  # rad through which the leg turns before it is done; NaN
N_LEG = 11

# --- ap: the autopilot's memory -------------------------------------------------------------------------------------
MODE, LEG, LEG_START, REACHED = 0, 1, 2, 3
REF_DEPTH, REF_DEPTH_RATE, REF_DEPTH_ACC = 4, 5, 6
REF_PITCH, REF_PITCH_RATE, REF_PITCH_ACC = 7, 8, 9
REF_ROLL, REF_ROLL_RATE, REF_ROLL_ACC = 10, 11, 12
INT_PITCH, INT_DEPTH = 13, 14  # integrators, m and kg
SENT_SERVO, SENT_SLIDER, SENT_BALLAST = 15, 16, 17  # last commands sent
REASON = 18
LEG_DEPTH_START = 19  # m, depth at which the leg began
MISSION_START = 20  # s
SUM_DEPTH, SUM_PITCH, SUM_ROLL = 21, 22, 23  # squared tracking errors added up while flying, m2, rad2
COUNT_DEPTH, COUNT_ATTITUDE = 24, 25  # ticks in those sums
TURNED, YAW_BEFORE = 26, 27  # rad turned in this leg, starboard positive; yaw a tick ago
ACTIVE, ACTIVE_SINCE = 28, 29  # controller at work, PID or LAW; s
LAW_STATUS = 30  # of the last law evaluated: law.OK, STEEP, NOT_FINITE
BUMP_SLIDER, BUMP_BALLAST = 31, 32  # m, kg, what a switch left over, fading
S_PITCH, S_DEPTH = 33, 34  # rad/s, m/s, the sliding variables
LAW_RAN = 35  # 1 if a controller other than the PID ran in the tick before
MONITORED = 36  # s, when the Lyapunov monitor looked last
K2_NEED_PITCH, K2_NEED_DEPTH = 37, 38  # m, kg: the k2 that covers; NaN where the law does not fly
MARGIN_PITCH, MARGIN_DEPTH = 39, 40  # rad/s2, m/s2: positive, V is sure to fall
WANTED_SERVO, WANTED_SLIDER, WANTED_BALLAST = 41, 42, 43  # what the controller wants, before any limit
CAUTIOUS = 44  # 1: the PID flies, whatever controller is chosen
AP_REACTION, AP_FAULT_ROW = 45, 46  # the supervisor's, and the row of the fault table that asked for it
SUPERVISED = 47  # 1: a supervisor guards, and it alone gives the dive up for what it sees
STOP_REQUESTED = 48  # 1: the operator wants the dive given up; written between two ticks, from a signal handler
STOP_TAKEN = 49  # STOP_REQUESTED as this tick found it
N_AP = 50

# --- modes and reasons ----------------------------------------------------------------------------------------------
WAITING, FLYING, COMPLETED, ABORTED = 0.0, 1.0, 2.0, 3.0
REASON_NONE, REASON_LEG_TIME, REASON_MISSION_TIME = 0.0, 1.0, 2.0
REASON_IMU, REASON_BEACON, REASON_TOO_DEEP, REASON_OPERATOR = 3.0, 4.0, 5.0, 6.0
REASON_FAULT = 100.0  # and the row of the fault table added to it
