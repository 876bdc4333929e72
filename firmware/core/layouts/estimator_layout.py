"""Where everything stands in the estimator's vectors, and the numbers that do not depend on the vehicle.

State x (N_XE = 27): the flight's state (layout, N_X) and, behind it, six accelerations by which the nominal model errs
(m/s2, rad/s2, body axes), the gyro's bias (rad/s) and the water's velocity north and east (m/s).

Error state (N_E = 26): position (NED, m), attitude (rotation vector in body axes, rad), nu, servo, slider, ballast;
then what nothing turns: the model's error, the gyro's bias, the water.
"""

from glider.firmware.core.vehicle.layout import N_X

E_POS, E_ATT, E_NU, E_ACT, E_ERR, E_GYRO, E_WATER = 0, 3, 6, 12, 15, 21, 24
N_MOVING = E_ACT  # rows of the linearised flight's matrix A: position, attitude, nu
N_COUPLED = E_ERR  # its columns: what they hang on

# --- z: what is measured --------------------------------------------------------------------------------------------
Z_ROLL, Z_PITCH, Z_YAW = 0, 1, 2  # rad
Z_P, Z_Q, Z_R = 3, 4, 5  # rad/s
Z_DEPTH, Z_SLIDER, Z_BALLAST = 6, 7, 8  # m, m, kg
Z_MOCAP_X, Z_MOCAP_Y, Z_MOCAP_Z = 9, 10, 11  # m, NED
Z_MOCAP_ROLL, Z_MOCAP_PITCH, Z_MOCAP_YAW = 12, 13, 14
N_Z = 15

# --- states that wander: the last of E, in its order ----------------------------------------------------------------
# place in E, components, 1 sigma before the first measurement, walk (1 sigma after a second), and the measurement that
# the first component adds to, the second to the next, and so on; -1: none
WANDERING = (
    (E_GYRO, 3, 0.003, 0.0005, Z_P),  # rad/s; it wanders, so that the filter follows a bias worse than its file says
    (E_WATER, 2, 0.05, 0.005, -1),  # m/s
)  # fmt: skip
N_E = E_GYRO + sum(row[1] for row in WANDERING)
X_ERR, X_GYRO, X_WATER = N_X, N_X + E_GYRO - E_ERR, N_X + E_WATER - E_ERR
N_XE = N_X + N_E - E_ERR
# the place in E of what adds to each measurement, 0: nothing
BIAS_OF = tuple(max([row[0] + m - row[4] for row in WANDERING if 0 <= m - row[4] < row[1] and row[4] >= 0], default=0)
                for m in range(N_Z))  # fmt: skip

# --- settings: spectral densities (variance per second), times, biases, and the measurements' variances -------------
S_LINEAR, S_ANGULAR = 0, 1  # (m/s2)2 s, (rad/s2)2 s
S_SERVO, S_SLIDER, S_BALLAST = 2, 3, 4  # rad2/s, m2/s, kg2/s
S_SPEED_ERROR = 5  # (share of an actuator's speed that may be wrong)2 s
S_ERROR_TIME = 6  # s
S_SLIDER_BIAS, S_BALLAST_BIAS = 7, 8  # variances: m2, kg2
S_WALK = 9  # N_E - E_GYRO, of the states that wander
S_R = S_WALK + N_E - E_GYRO  # N_Z variances
N_S = S_R + N_Z

# mode, a sum: actuators that are not known to follow a command but move at a given speed (0 where nothing is known)
COMMANDED, SERVO_DRIVEN, SLIDER_DRIVEN, BALLAST_DRIVEN = 0, 1, 2, 4
FRESH = 8  # in that sum too: linearise at every sub-step and hold nothing, where time does not press

# --- constants ------------------------------------------------------------------------------------------------------
MAX_STEP = 0.02  # s
DISTURBANCE_HOLD = 0.1  # s; held that long, an acceleration a is white noise of spectral density a^2 DISTURBANCE_HOLD
HOLD_LINEARISED, HOLD_ERROR = 0.1, 0.2  # s, how long equation (1) linearised and the model error's covariance serve
MOVED_SHARE, MOVED_RATE = 0.015, 0.025  # of the speed, and rad/s: past such a change neither does
GATE = 5.0  # sigma
REJECTED_AT_MOST = 1.0  # s
INFLATION_GROWTH, INFLATION_TIME, INFLATION_MAX = 14.0, 5.0, 1e4  # 1/s (fourfold in 0.1 s), s, of the variance
ERROR_LINEAR, ERROR_ANGULAR = 0.1, 0.3  # m/s2, rad/s2
GYRO_WANDER = 0.2  # 1/s
SPEED_LIMIT, RATE_LIMIT = 1.5, 3.0  # m/s, rad/s
STOP_MARGIN = 0.25  # share of an actuator's range
COS_PITCH_MIN = 0.1
LARGEST_READING = 1e6  # a reading beyond it, or an infinite one, is none

# --- rows of `work` (N_WORK_ROWS, N_W) ------------------------------------------------------------------------------
# The first of them hold the linearised flight from step to step; the others are scratch.
N_W = 56  # holds a vehicle's parameters, in whole cache lines
W_HELD = 0  # [s for which A still serves, s for which C does]
W_POINT = 1  # what linearise leaves
W_A, W_TURNED = 2, 2 + N_MOVING  # A, and its columns from E_ATT on as rows
W_C = W_TURNED + N_COUPLED - E_ATT
W_DRIVE, W_T, W_K = W_C + 6, W_C + 12, W_C + 12 + N_MOVING
W_SCRATCH = W_K + N_Z
N_WORK_ROWS = W_SCRATCH + 5
