"""Where things stand in the foreign plant's vectors: F its effects' strengths and shapes, x its state, L a pilot's leg.

The foreign plant flies blind tests: the nominal equations, but every effect in another form than the catalogue's.
An entry of F that is 0 is no effect; entries below N_STRENGTH are strengths, the others only shape them. SI.
"""

from glider.firmware.core.vehicle.layout import N_X

# --- F: strengths ---------------------------------------------------------------------------------------------------
(
    FS_SERVO_SLOW, FS_SERVO_BACKLASH, FS_SERVO_OFFSET, FS_SERVO_LIMIT,  # 1, rad, rad, 1
    FS_SLIDER_SLOW, FS_SLIDER_BACKLASH,  # 1, m
    FS_PUMP_SLOW, FS_PUMP_DROOP, FS_BALLAST_LEAK,  # 1, 1/m, kg in the end
    FS_DRAG, FS_LINEAR_DRAG, FS_ASYMMETRY, FS_TETHER,  # 1, kg/s, 1, kg/m a metre of line
    FS_LIFT, FS_STALL, FS_ADDED_MASS, FS_SIDE_FORCE,  # 1, 1/rad, 1, 1
    FS_ROLL_TRIM, FS_PITCH_TRIM, FS_PITCH_DAMPING,  # kg, kg, 1
    FS_YAW_TRIM, FS_WEATHERCOCK, FS_YAW_DAMPING,  # kg, 1, 1
    FS_NET_BUOYANCY, FS_BALLAST_SCALE, FS_COMPRESSIBILITY, FS_STRATIFICATION,  # kg, 1, kg in the end, kg a layer
    FS_CG_LONGITUDINAL, FS_SLIDER_SCALE, FS_CG_LATERAL, FS_CG_VERTICAL, FS_INERTIA,  # m, 1, m, m, kg m2
    FS_CURRENT_N, FS_CURRENT_E, FS_SHEAR_N, FS_SHEAR_E,  # m/s, m/s for each e-fold of depth
    FS_WAVES, FS_TURBULENCE,  # 1 (scale of the waves' table), 1 (in nominal disturbances)
    FS_IMU_PITCH, FS_IMU_ROLL, FS_COMPASS_1, FS_COMPASS_2, FS_ATTITUDE_LAG,  # rad, rad, rad, rad, s
    FS_GYRO_SCALE, FS_GYRO_P, FS_GYRO_Q, FS_GYRO_R,  # 1, rad/s
    FS_DEPTH_OFFSET, FS_DEPTH_SCALE, FS_DEPTH_LAG, FS_LEVER,  # m, 1, s, m
    FS_COMMAND_DELAY, FS_MOCAP_DELAY, FS_CLOCK_SKEW,  # s, s, 1
    # outside the catalogue
    FS_FLAP, FS_PUMP_JET, FS_FOULING, FS_ROLL_PITCH, FS_TANGLE, FS_LIFT_LAG,  # N m s, N, 1, kg, kg/m, 1
    FS_GYRO_DEPTH, FS_WIRE_DRIFT, FS_ROLL_PULL,  # rad/s a metre, m, rad
    FS_PITCH_SCALE,  # 1; a label of the catalogue that came later
    # outside the catalogue, of a vehicle of another form
    FS_SHELL, FS_SIDED_FOULING, FS_LOOSE,  # kg, 1, kg m
) = range(67)  # fmt: skip
N_STRENGTH = 67

# --- F: shapes ------------------------------------------------------------------------------------------------------
FS_EXPONENT = 67  # of the speed in what nominally grows with V^2
FS_LEAK_START, FS_LEAK_TIME = 68, 69  # s
FS_TRAPPED_AIR = 70  # 1: compressibility by Boyle's law, 0: saturating exponentially
FS_DEPTH_SCALE_M = 71  # m over which mass saturates with depth
FS_LAYER_DEPTH, FS_LAYER_WIDTH = 72, 73  # m, middle and half width of the pycnocline
FS_COMPASS_PHASE_1, FS_COMPASS_PHASE_2 = 74, 75  # rad
FS_GUST_TIME = 76  # s, correlation time of turbulence
FS_JITTER = 77  # share by which a delay wanders
FS_SKEW_STEP, FS_SKEW_TIME = 78, 79  # s, the mocap clock's step and when
FS_DRIFT_TIME, FS_DRIFT_PHASE = 80, 81  # s, rad: slow change of what is called constant
FS_FLAP_OMEGA, FS_FLAP_ZETA = 82, 83  # rad/s, 1
FS_FOUL_TIME = 84  # s
FS_LIFT_TIME = 85  # s
FS_SHELL_TIME, FS_LOOSE_TIME = 86, 87  # s, over which a flooded shell drains, a loose mass slides

# --- F: the body of a vehicle of another form (lifting_body) ---------------------------------------------------------
FB_ON = 88  # 1: the water's forces are lifting_body's; 0: those of P
FB_LENGTH, FB_DIAMETER, FB_WETTED = 89, 90, 91  # m, m, m2: the hull
FB_FORM_FACTOR = 92  # friction of the hull over that of a flat plate
FB_BASE_AREA, FB_BASE_X = 93, 94  # m2, m: where the flow leaves the tail
FB_APPARENT = 95  # k2 - k1 of the hull's apparent masses
FB_CROSS_ALONG, FB_CROSS_ACROSS = 96, 97  # cross-flow drag coefficient along the flow and across it
FB_ROLL_DRAG = 98  # N m s2, moment per |p| p
FB_MAST_AREA, FB_MAST_X, FB_MAST_Z = 99, 100, 101  # m2 (drag area), m, m: what stands out of the hull
FB_DOWNWASH = 102  # of the wings at the tail, in that of an elliptic wing far behind it
FB_SURFACES = 103
(
    FBS_AREA, FBS_ASPECT, FBS_CHORD,  # m2, 1, m
    FBS_X, FBS_Y, FBS_Z, FBS_TILT, FBS_INCIDENCE,  # m, m, m, rad of the normal from z to y, rad
    FBS_STALL, FBS_FRICTION, FBS_OSWALD,  # rad, profile drag over a flat plate's, span efficiency
) = range(11)  # fmt: skip
N_FBS = 11
SURFACE_STARBOARD, SURFACE_PORT, SURFACE_TAIL, SURFACE_FIN = range(4)
N_FS = FB_SURFACES + 4 * N_FBS

# --- x: the plant's state as in core/vehicle/layout, then what the effects remember ---------------------------------
X_SERVO_V, X_SERVO_Z, X_SLIDER_Z, X_PUMP_V = 16, 17, 18, 19  # speed, play taken up, play taken up, speed
X_ATT_1, X_ATT_2 = 20, 23  # rad, two stages of the attitude's lag
X_DEPTH_1, X_DEPTH_2 = 26, 27  # m, two stages of the depth's lag
X_GUST = 28  # 28..33 m/s2, rad/s2
X_FLAP, X_FLAP_V = 34, 35  # rad, rad/s
X_ALPHA = 36  # rad, angle of attack that the lift has followed
X_LOOSE = 37  # -1 (aft) to 1, where a loose mass lies
N_FX = 38
assert N_X == X_SERVO_V

# --- readings: as the first nine columns of a prediction (sim_backend/core/effects/effect_layout) ---
(FR_ROLL, FR_PITCH, FR_YAW, FR_P, FR_Q, FR_R, FR_DEPTH, FR_SLIDER, FR_BALLAST) = range(9)
N_FR = 9

# --- L: one leg of the pilot's plan ---------------------------------------------------------------------------------
L_PITCH, L_BALLAST, L_SERVO = 0, 1, 2  # rad, kg, rad
L_FIXED, L_SLIDER = 3, 4  # 1: slider held at L_SLIDER (m), 0: slider follows the measured pitch
L_DEPTH, L_TIME = 5, 6  # m at which the leg ends, s after which it ends anyway
L_STEP_TIME, L_STEP_SERVO, L_STEP_PITCH, L_STEP_SLIDER = 7, 8, 9, 10  # s into the leg; rad, rad, m added from then on
N_L = 11

# --- waves: one row a component -------------------------------------------------------------------------------------
FW_AMPLITUDE, FW_OMEGA, FW_NORTH, FW_EAST, FW_PHASE = 0, 1, 2, 3, 4  # m, rad/s, wave number north and east 1/m, rad
N_FW = 5

ROW_S = 0.1  # s between samples
ROW_STEPS = 10  # of the integrator in a row
FOREIGN_TAIL = -0.6  # m, body x
STREAM_JITTER, STREAM_TANGLE, STREAM_GUST, STREAM_PUSH, STREAM_NOISE = 40, 41, 42, 50, 60
