"""Where things stand in the vectors of an ocean glider's model: vehicle P, effects F, state x, inputs, readings y.

Attitude is an input, measured with errors of its own, not a state (docs/explanation/ocean.md, Model).
"""

# --- vehicle, P ---
MASS = 0  # kg
VOLUME = 1  # m3, of the hull at the surface at the reference temperature, the buoyancy engine at its zero
COMPRESSIBILITY = 2  # 1/Pa, of the hull
THERMAL_EXPANSION = 3  # 1/K, of the hull
TEMPERATURE = 4  # degC, reference
AREA = 5  # m2, reference of the coefficients
DRAG_0 = 6  # parasitic drag, at a dynamic pressure of DRAG_PRESSURE
DRAG_ALPHA = 7  # 1/rad2, induced drag
DRAG_EXPONENT = 8  # parasitic drag goes with (q / DRAG_PRESSURE)^s; 0: a square law
LIFT_SLOPE = 9  # 1/rad
OIL_SCALE = 10  # volume of the engine over what it reports
PITCH_OFFSET = 11  # rad, read too much
PITCH_SCALE = 12  # pitch reads so many times the truth
ROLL_TRIM = 13  # rad, mean roll
GRAVITY = 14  # m/s2
ADDED_MASS = 15  # kg, along the path
WATER_TIME = 16  # s, in which vertical water decorrelates
ROLL_TIME = 17  # s, the same of the roll
N_P = 18

# --- effects, F (0 is no effect) ---
F_DRAG, F_INDUCED, F_LIFT, F_CLIMB_DIVE = 0, 1, 2, 3
F_NET_MASS, F_LEAK, F_OIL_SCALE, F_COMPRESSIBILITY, F_EXPANSION = 4, 5, 6, 7, 8
F_DENSITY, F_PITCH_BIAS, F_PITCH_SCALE, F_ATTITUDE_LAG, F_ROLL_TRIM = 9, 10, 11, 12, 13
F_SPEED_BIAS = 14  # m/s, of the speed that was measured
N_F = 15

# --- state, x: its errors are its differences ---
X_DEPTH = 0  # m
X_SPEED = 1  # m/s, along the path through the water
X_WATER = 2  # m/s, of the water, down positive
X_ROLL = 3  # rad, beside the trim
X_GLIDE = 4  # rad, angle of the path through the water, up positive: for the readings, no error of its own
N_X, N_ERR = 5, 4

# --- inputs of a row ---
U_PITCH, U_PITCH_RATE, U_YAW, U_OIL, U_DENSITY, U_TEMPERATURE, U_UNSTEADY = 0, 1, 2, 3, 4, 5, 6
N_U = 7

# --- readings, y ---
Y_DEPTH, Y_ROLL, Y_SPEED, Y_NORTH, Y_EAST = 0, 1, 2, 3, 4
N_Y = 5

# --- densities of process noise ---
Q_DEPTH = 0  # m2/s, walk of the depth: noise of the pitch, fast vertical water
Q_WATER = 1  # (m/s)2/s, of the vertical water
Q_ROLL = 2  # rad2/s
Q_SPEED = 3  # (m/s)2/s
N_SPECTRAL = 4

DRAG_PRESSURE = 32.0  # Pa, q at 0.25 m/s
PASCALS_A_METRE = 1.0e4  # of seawater, for the hull's compression
LEAST_FLOW_SPEED = 0.005  # m/s; a vehicle that stands still has no angle of attack
UNSTEADY_WALK = 0.05**2 * 10.0  # m2/s added to the walk of the depth where the vehicle does not fly steadily
UNSTEADY_SPEED = 0.05**2 / 10.0  # (m/s)2/s, the same of the speed
STEEPEST_ANGLE = 0.25  # rad, largest angle of attack looked for
