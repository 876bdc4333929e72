"""Where things stand in the foreign plant's vectors: F its effects' strengths and shapes, x its state, L a pilot's leg.

The foreign plant flies blind tests: the nominal equations, but every effect in another form than the catalogue's.
An entry of F that is 0 is no effect; entries below N_STRENGTH are strengths, the others only shape them. SI.
"""

from firmware.core.vehicle.layout import N_X

# --- F: strengths ---------------------------------------------------------------------------------------------------
(
    SERVO_SLOW, SERVO_BACKLASH, SERVO_OFFSET, SERVO_LIMIT,  # 1, rad, rad, 1
    SLIDER_SLOW, SLIDER_BACKLASH,  # 1, m
    PUMP_SLOW, PUMP_DROOP, BALLAST_LEAK,  # 1, 1/m, kg in the end
    DRAG, LINEAR_DRAG, ASYMMETRY, TETHER,  # 1, kg/s, 1, kg/m a metre of line
    LIFT, STALL, ADDED_MASS, SIDE_FORCE,  # 1, 1/rad, 1, 1
    ROLL_TRIM, PITCH_TRIM, PITCH_DAMPING,  # kg, kg, 1
    YAW_TRIM, WEATHERCOCK, YAW_DAMPING,  # kg, 1, 1
    NET_BUOYANCY, BALLAST_SCALE, COMPRESSIBILITY, STRATIFICATION,  # kg, 1, kg in the end, kg from layer to layer
    CG_LONGITUDINAL, SLIDER_SCALE, CG_LATERAL, CG_VERTICAL, INERTIA,  # m, 1, m, m, kg m2
    CURRENT_N, CURRENT_E, SHEAR_N, SHEAR_E,  # m/s, m/s for each e-fold of depth
    WAVES, TURBULENCE,  # 1 (scale of the waves' table), 1 (in nominal disturbances)
    IMU_PITCH, IMU_ROLL, COMPASS_1, COMPASS_2, ATTITUDE_LAG,  # rad, rad, rad, rad, s
    GYRO_SCALE, GYRO_P, GYRO_Q, GYRO_R,  # 1, rad/s
    DEPTH_OFFSET, DEPTH_SCALE, DEPTH_LAG, LEVER,  # m, 1, s, m
    COMMAND_DELAY, MOCAP_DELAY, CLOCK_SKEW,  # s, s, 1
    # outside the catalogue
    FLAP, PUMP_JET, FOULING, ROLL_PITCH, TANGLE, LIFT_LAG,  # N m s, N, 1, kg, kg/m, 1
    GYRO_DEPTH, WIRE_DRIFT, ROLL_PULL,  # rad/s a metre, m, rad
) = range(63)  # fmt: skip
N_STRENGTH = 64  # one to spare

# --- F: shapes ------------------------------------------------------------------------------------------------------
EXPONENT = 64  # of the speed in what nominally grows with V^2
LEAK_START, LEAK_TIME = 65, 66  # s
TRAPPED_AIR = 67  # 1: compressibility by Boyle's law, 0: saturating exponentially
DEPTH_SCALE_M = 68  # m over which mass saturates with depth
LAYER_DEPTH, LAYER_WIDTH = 69, 70  # m, middle and half width of the pycnocline
COMPASS_PHASE_1, COMPASS_PHASE_2 = 71, 72  # rad
GUST_TIME = 73  # s, correlation time of turbulence
JITTER = 74  # share by which a delay wanders
SKEW_STEP, SKEW_TIME = 75, 76  # s, the mocap clock's step and when
DRIFT_TIME, DRIFT_PHASE = 77, 78  # s, rad: slow change of what is called constant
FLAP_OMEGA, FLAP_ZETA = 79, 80  # rad/s, 1
FOUL_TIME = 81  # s
LIFT_TIME = 82  # s
N_F = 83

# --- x: the plant's state as in core/vehicle/layout, then what the effects remember ---------------------------------
X_SERVO_V, X_SERVO_Z, X_SLIDER_Z, X_PUMP_V = 16, 17, 18, 19  # speed, play taken up, play taken up, speed
X_ATT_1, X_ATT_2 = 20, 23  # rad, two stages of the attitude's lag
X_DEPTH_1, X_DEPTH_2 = 26, 27  # m, two stages of the depth's lag
X_GUST = 28  # 28..33 m/s2, rad/s2
X_FLAP, X_FLAP_V = 34, 35  # rad, rad/s
X_ALPHA = 36  # rad, angle of attack that the lift has followed
N_FX = 37
assert N_X == X_SERVO_V

# --- readings: as the first nine readings of the observer (sim_backend/core/effect_layout) ----------------------------
(R_ROLL, R_PITCH, R_YAW, R_P, R_Q, R_R, R_DEPTH, R_SLIDER, R_BALLAST) = range(9)
N_R = 9

# --- L: one leg of the pilot's plan ---------------------------------------------------------------------------------
L_PITCH, L_BALLAST, L_SERVO = 0, 1, 2  # rad, kg, rad
L_FIXED, L_SLIDER = 3, 4  # 1: slider held at L_SLIDER (m), 0: slider follows the measured pitch
L_DEPTH, L_TIME = 5, 6  # m at which the leg ends, s after which it ends anyway
L_STEP_TIME, L_STEP_SERVO, L_STEP_PITCH, L_STEP_SLIDER = 7, 8, 9, 10  # s into the leg; rad, rad, m added from then on
N_L = 11

# --- waves: one row a component -------------------------------------------------------------------------------------
W_AMPLITUDE, W_OMEGA, W_NORTH, W_EAST, W_PHASE = 0, 1, 2, 3, 4  # m, rad/s, wave number north and east 1/m, rad
N_W = 5

ROW = 0.1  # s between samples
STEPS = 10  # of the integrator in a row
TAIL = -0.6  # m, body x
STREAM_JITTER, STREAM_TANGLE, STREAM_GUST, STREAM_PUSH, STREAM_NOISE = 40, 41, 42, 50, 60
