"""Where things stand in the vectors of the simulated world.

E is the environment, SENSOR a table of the sensors, and C what a flight counts.
The effects' vector F and the extended state have a layout of their own, effect_layout.
"""

# --- E: the environment, SI, NED ------------------------------------------------------------------------------------
ENV_CURRENT_N, ENV_CURRENT_E = 0, 1  # m/s at the surface
ENV_SHEAR_N, ENV_SHEAR_E = 2, 3  # 1/s, change of the current with depth
ENV_SURFACE_HEIGHT = 4  # m, over which buoyancy is lost above the surface: HULL_HEIGHT; 0: no surface
ENV_FLOOR_DEPTH = 5  # m; 0: no floor
ENV_ACC_LINEAR, ENV_ACC_ANGULAR = 6, 7  # m/s2, rad/s2, 1 sigma of the held disturbance
ENV_TEMPERATURE_C, ENV_SALINITY = 8, 9
ENV_SURFACE_PRESSURE = 10  # Pa
ENV_WATER_DENSITY = 11  # kg/m3, the plant's own
N_ENV = 12

HULL_HEIGHT = 0.16  # m
FLOOR_STIFFNESS = 2000.0  # N/m
FLOOR_DAMPING = 300.0  # N s/m

# --- waves: one row a component -------------------------------------------------------------------------------------
WAVE_AMPLITUDE, WAVE_OMEGA, WAVE_K_N, WAVE_K_E, WAVE_PHASE = 0, 1, 2, 3, 4
N_WAVE = 5

# --- SENSOR: one row a sensor ---------------------------------------------------------------------------------------
# IMU, beacon and draw-wires are numbered as on the vehicle, supervisor_layout
N_SAMPLED = 4
SENSOR_PERIOD, SENSOR_DELAY = 0, 1  # s
N_SENSOR_FIELDS = 2

# --- ERROR: bias (row 0) and white noise (row 1) of each measured value, SI ------------------------------------------
E_ROLL, E_PITCH, E_YAW, E_P, E_Q, E_R, E_DEPTH, E_SLIDER, E_BALLAST = 0, 1, 2, 3, 4, 5, 6, 7, 8
N_ERRORS = 9

# --- streams of random numbers --------------------------------------------------------------------------------------
STREAM_DISTURBANCE = 0  # 0..5
STREAM_SENSORS = 16  # + index of the value
STREAM_WAVES = 32  # phase, frequency

# --- delay line: each sensor has RING slots of [delivery time, measurement time, values ...] ------------------------
DELAY_SLOTS = 64
DELAY_WIDTH = 8

# --- memory of effects and scratch -----------------------------------------------------------------------------------
LONGEST_DELAY = 6.0  # s, of commands; a world keeps those of the steps so far back
W_READ, W_WATER = 4, 5  # rows of scratch behind the step's: what is read; water (3), late commands (3)
N_WORK, WORK_WIDTH = 6, 24  # rows, columns: N_XF and what makes rows whole cache lines

# --- C: counters of a world (int64) ---------------------------------------------------------------------------------
C_STEP = 0  # plant steps done
C_HOLD = 1  # index of the disturbance's hold, -1 before the first
C_SAMPLES = 2  # 2..5 samples taken, by sensor
C_TAKEN = 6  # 6..9 samples delivered, by sensor
N_COUNTERS = 10
