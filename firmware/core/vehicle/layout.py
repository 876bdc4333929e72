"""Where each parameter stands in the parameter vector `P` and each state in the state vector `x` of the kernels.

Kernels take plain float64 vectors, so that a batch of vehicles is a matrix and a derivative a difference of two
vectors. These names are the only way in: `glider.firmware.model` fills the vector from a vehicle file by the same
names. Units are SI and radians throughout.
"""

# --- P: the vehicle -------------------------------------------------------------------------------------------------
M_T, M_R, M_S = 0, 1, 2  # kg
X_R, R_R, R_SX0, R_S, X_B = 3, 4, 5, 6, 7  # m
J_XX, J_YY, J_ZZ = 8, 9, 10  # kg m2, hull
A_X, A_Y, A_Z = 11, 12, 13  # kg, added mass
B_X, B_Y, B_Z = 14, 15, 16  # kg m2, added inertia
K_D0, K_D, K_L0, K_L, K_BETA = 17, 18, 19, 20, 21
K_MR, K_P, K_M0, K_M, K_Q, K_MY, K_R = 22, 23, 24, 25, 26, 27, 28
LIFT_PRINTED = 29  # 1: lift as printed in (4), K_L alpha^2; 0: K_L alpha (ledger L4)
SERVO_MIN, SERVO_MAX, SERVO_RATE, SERVO_TAU = 30, 31, 32, 33  # rad, rad, rad/s, s
SLIDER_MIN, SLIDER_MAX, SLIDER_RATE, SLIDER_TAU = 34, 35, 36, 37  # m
BALLAST_MIN, BALLAST_MAX, BALLAST_RATE, BALLAST_TAU = 38, 39, 40, 41  # kg
ACTUATORS = (SERVO_MIN, SLIDER_MIN, BALLAST_MIN)  # where each begins
PLUNGER_AREA = 42  # m2
NET_MASS = 43  # kg, trim error at the origin; nominal 0
CG_X, CG_Y, CG_Z = 44, 45, 46  # m, offset of the whole vehicle's centre of gravity; nominal 0
D_P, D_Q, D_R = 47, 48, 49  # N m s/rad, moments linear in the rates beside (4); nominal 0
N_P = 50
N_DRAWN = 48  # random numbers that a drawn vehicle takes: what came later is not drawn, and seeds keep their vehicles

# --- x: the plant's state -------------------------------------------------------------------------------------------
X_POS = 0  # 0..2 north, east, down, m
X_NORTH, X_EAST, X_DOWN = 0, 1, 2
X_QUAT = 3  # 3..6 attitude quaternion, scalar first, body to NED
X_NU = 7  # 7..12 u v w (relative to the water), p q r
X_ACT = 13  # 13..15
X_SERVO, X_SLIDER, X_BALLAST = 13, 14, 15  # rad, m, kg
N_X = 16

GRAVITY = 9.80665  # m/s2
