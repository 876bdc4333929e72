"""Where each unmodelled effect stands in the effect vector F, and what the state has beside the plant's.

F of zeros is the nominal vehicle. A label of the catalogue (sim_backend/effects) sets one or more of its entries;
entries go together in any number. Signs and meanings are those of docs/EFFECTS.md.
"""

from firmware.core.vehicle.layout import N_X

# --- F: effects, SI -------------------------------------------------------------------------------------------------
# actuation: rates and time constants in powers of e (-1: rate 1/e of the nominal), widths of play, offsets
SERVO_RATE_LOG, SERVO_LAG_LOG, SERVO_PLAY, SERVO_OFFSET, SERVO_LIMIT = 0, 1, 2, 3, 4  # 1, 1, rad, rad, rad
SLIDER_RATE_LOG, SLIDER_LAG_LOG, SLIDER_PLAY = 5, 6, 7  # 1, 1, m
PUMP_RATE_LOG, PUMP_LAG_LOG, PUMP_DROOP, BALLAST_LEAK = 8, 9, 10, 11  # 1, 1, 1/m, kg/s
# hydrodynamics: shares of a coefficient, and terms that the model has not
DRAG_0, DRAG_ALPHA, LINEAR_DRAG, CLIMB_DIVE, TETHER = 12, 13, 14, 15, 16  # 1, 1, N s/m, 1, kg/m
LIFT, STALL, ADDED_Y, ADDED_Z, SIDE = 17, 18, 19, 20, 21  # 1, 1/rad, 1, 1, 1
ROLL_TRIM, PITCH_TRIM, PITCH_DAMPING = 22, 23, 24  # kg, kg, 1
YAW_TRIM, WEATHERCOCK, YAW_DAMPING = 25, 26, 27  # kg, 1, 1
# mass
NET_MASS_OFFSET, BALLAST_SCALE, MASS_PER_DEPTH = 28, 29, 30  # kg, 1, kg/m
CG_OFFSET_X, CG_OFFSET_Y, CG_OFFSET_Z, SLIDER_SCALE, INERTIA_Y, INERTIA_Z = 31, 32, 33, 34, 35, 36  # m, m, m, 1, 1, 1
# environment: water in motion (waves and turbulence have a course of their own and stand in the world)
CURRENT_N, CURRENT_E, SHEAR_N, SHEAR_E = 37, 38, 39, 40  # m/s, m/s, 1/s, 1/s
# sensing: errors of what is read, beside the biases that every sensor may have
ROLL_BIAS, PITCH_BIAS, COMPASS_S1, COMPASS_C1, COMPASS_S2, COMPASS_C2 = 41, 42, 43, 44, 45, 46  # rad
ATTITUDE_LAG, GYRO_SCALE, GYRO_P, GYRO_Q, GYRO_R = 47, 48, 49, 50, 51  # s, 1, rad/s
DEPTH_OFFSET, DEPTH_SCALE, DEPTH_LAG, DEPTH_LEVER = 52, 53, 54, 55  # m, 1, s, m
# timing: of commands, and of motion capture against the onboard clock
COMMAND_DELAY, MOCAP_DELAY, CLOCK_SKEW = 56, 57, 58  # s, s, 1
# allowed: a constant error of each onboard reading, in the order of y below
BIAS = 59  # 59..67
# a data-driven correction (tools/diagnose/correction): the link at which it enters, and its coefficients
LINK, SHAPE = 68, 69  # 69..79, in the link's unit
FORCE_LINKS, ACTUATOR_LINKS = 6, 9  # links 1-6: X Y Z K M N (N, N m); 7-9: servo, slider, ballast; then the readings
SHAPES = (
    "constant", "speed squared", "depth", "angle of attack", "sideslip", "roll rate", "pitch rate", "yaw rate",
    "pump running", "time", "climb or dive",
)  # fmt: skip
N_SHAPES = 11
TETHER_GROWTH, TETHER_ACROSS = SHAPE + N_SHAPES, SHAPE + N_SHAPES + 1  # kg/m2, 1: with depth, across the hull
N_F = SHAPE + N_SHAPES + 2

# --- x: behind the plant's state, what effects remember --------------------------------------------------------------
X_GEAR_SERVO, X_GEAR_SLIDER = N_X, N_X + 1  # behind the play: rad, m
X_LAG = N_X + 2  # roll, pitch, yaw, depth: how far the reading is behind, rad, m
X_LATE = N_X + 6  # s; motion capture behind its delay, by what the diagnosis believes: it stays as it is
N_XF = N_X + 7

# --- y: what is read ------------------------------------------------------------------------------------------------
Y_ROLL, Y_PITCH, Y_YAW, Y_P, Y_Q, Y_R, Y_DEPTH, Y_SLIDER, Y_BALLAST = 0, 1, 2, 3, 4, 5, 6, 7, 8
Y_ONBOARD = 9
Y_MOCAP_X, Y_MOCAP_Y, Y_MOCAP_Z, Y_MOCAP_ROLL, Y_MOCAP_PITCH, Y_MOCAP_YAW = 9, 10, 11, 12, 13, 14
N_Y = 15

TAIL, TAIL_TOP = -0.5, 0.06  # m, body x and above the axis: where a line is tied at the tail
REST_PITCH = 0.05  # rad, about level, over which a climb becomes a dive
