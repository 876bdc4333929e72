"""A sphere with four motors on a cross of arms that dives in a tank: no pose, no numbers published, all identified.

It floats with some freeboard until four propellers push it down. Thrust and the buoyancy kept in reserve nearly cancel,
so that depth tells small differences of both. The water in the tank is set in motion by the propellers in two stages
of their own: an inflow that develops in a second or two, and a wake that comes back from walls and bottom. What the
vehicle is turned and tilted by, and what is left of thrust, is one number of each stage: before the inflow, in it, and
in the wake. Tilt is that of a damped pendulum about its attitude at rest, which the centre of mass sets.

Forces have one scale that no record tells: the thrust of a motor at the reference speed is assumed.
"""

import math

import numpy as np

G = 9.81
THRUST, SPEED = 4.0, 198.0 * 11.85  # N of each motor at a command of (us above 1000) times V: assumed
ZERO, OFF, STARTS = 1000.0, 1140.0, 10.0  # us: no speed; the motors stand still below, +- half a width
METACENTRE = 0.01  # m: assumed
ARM, TORQUE, YAW_INERTIA = 0.15, 0.01, 0.05  # m, N m a N of thrust, kg m2: assumed
BOTTOM, STIFFNESS, SOFT = 0.85, 100.0, 0.02  # m, N/m, m

states = [
    ("depth", "m"), ("heave", "m/s"), ("spin1", "1"), ("spin2", "1"), ("spin3", "1"), ("spin4", "1"),
    ("inflow", "1"), ("wake", "1"),
    ("heel", "rad"), ("trim", "rad"), ("heading", "rad", "angle"), ("turn", "rad/s"),
]  # fmt: skip
inputs = [
    *({"name": f"pwm{n}", "unit": "us"} for n in (1, 2, 3, 4)),
    {"name": "battery", "unit": "V"},
]
outputs = [
    {"name": "depth", "unit": "m", "noise": 0.02, "tolerance": 0.1},
    {"name": "roll", "unit": "rad", "noise": 0.01, "angle": True, "tolerance": 0.0175},
    {"name": "pitch", "unit": "rad", "noise": 0.01, "angle": True, "tolerance": 0.0175},
    {"name": "yaw", "unit": "rad", "noise": 0.005, "angle": True, "tolerance": 0.26},
    {"name": "r", "unit": "rad/s", "noise": 0.03, "tolerance": 0.07},
]
parameters = {
    "net_buoyancy": {"unit": "kg", "value": 1.35, "uncertainty": 0.2, "low": 0.2},  # wholly under water
    "freeboard": {"unit": "m", "value": 0.06, "uncertainty": 0.02, "low": 0.01},  # scale of depth in which it is lost
    "heave_mass": {"unit": "kg", "value": 3.0, "uncertainty": 0.5, "low": 2.0},  # with the water that moves with it
    "drag_linear": {"unit": "N s/m", "value": 5.0, "uncertainty": 3.0, "low": 0.0},
    "drag_quadratic": {"unit": "N s2/m2", "value": 120.0, "uncertainty": 40.0, "low": 0.0},
    "thrust_scale": {"unit": "1", "value": 1.0, "low": 0.0},  # of all motors: what forces are counted in
    "thrust_inflow": {"unit": "1", "value": 0.97, "uncertainty": 0.05},
    "thrust_wake": {"unit": "1", "value": 0.87, "uncertainty": 0.05},
    "spin_time_1": {"unit": "s", "value": 0.2, "uncertainty": 0.1, "low": 0.03},
    "spin_time_2": {"unit": "s", "value": 0.2, "uncertainty": 0.1, "low": 0.03},
    "spin_time_3": {"unit": "s", "value": 0.2, "uncertainty": 0.1, "low": 0.03},
    "spin_time_4": {"unit": "s", "value": 0.2, "uncertainty": 0.1, "low": 0.03},
    "inflow_time": {"unit": "s", "value": 1.0, "uncertainty": 0.4, "low": 0.2},
    "wake_time": {"unit": "s", "value": 1.5, "uncertainty": 0.6, "low": 0.4},
    "tilt_time": {"unit": "s", "value": 0.3, "uncertainty": 0.1, "low": 0.06},
    "turn_time": {"unit": "s", "value": 0.6, "uncertainty": 0.2, "low": 0.1},
    "cg_x": {"unit": "m", "value": 0.0, "uncertainty": 0.0005},
    "cg_y": {"unit": "m", "value": 0.0008, "uncertainty": 0.0005},
    "roll_start": {"unit": "rad", "value": 0.0, "uncertainty": 0.5},
    "roll_inflow": {"unit": "rad", "value": 0.0, "uncertainty": 0.1},
    "roll_wake": {"unit": "rad", "value": 0.0, "uncertainty": 0.1},
    "pitch_start": {"unit": "rad", "value": -0.1, "uncertainty": 0.5},
    "pitch_inflow": {"unit": "rad", "value": 0.0, "uncertainty": 0.1},
    "pitch_wake": {"unit": "rad", "value": 0.0, "uncertainty": 0.1},
    "yaw_start": {"unit": "rad/s", "value": -0.1, "uncertainty": 0.4},
    "yaw_inflow": {"unit": "rad/s", "value": -0.6, "uncertainty": 0.4},
    "yaw_wake": {"unit": "rad/s", "value": -0.6, "uncertainty": 0.4},
    "righting": {"unit": "N m/rad", "value": 0.4, "uncertainty": 0.2, "low": 0.05},
    "load": {"unit": "kg", "value": 0.0},  # weight added since, less its buoyancy
}
noises = [
    ("heave_force", "m/s2", 0.02), ("roll_moment", "rad/s", 0.05), ("pitch_moment", "rad/s", 0.05),
    ("yaw_torque", "rad/s2", 0.1),
]  # fmt: skip


def started(pulse):
    """1 where a motor turns, 0 where its pulse leaves it standing."""
    return 0.5 * (1.0 + math.tanh((pulse - OFF) / STARTS))


def motor(pulse, volts, spin, scale):
    """Thrust of a motor, N: the square of its speed."""
    speed = (pulse - ZERO) * volts / SPEED
    return scale * THRUST * spin * speed * abs(speed)


def staged(start, inflow, wake, v, g):
    """A number of the stages of the water: before the inflow, in it, in the wake."""
    return start * (1.0 - v) + inflow * (v - g) + wake * g


def derivative(x, u, w, theta):
    """Rates of the states."""
    depth, heave, v, g, heel, trim, r = x[0], x[1], x[6], x[7], x[8], x[9], x[11]
    out = np.zeros(12)
    running = 0.0
    for n in range(4):
        out[2 + n] = (started(u[n]) - x[2 + n]) / theta[8 + n]
        running += 0.25 * x[2 + n]
    f1, f2 = motor(u[0], u[4], x[2], theta[5]), motor(u[1], u[4], x[3], theta[5])
    f3, f4 = motor(u[2], u[4], x[4], theta[5]), motor(u[3], u[4], x[5], theta[5])
    force = f1 + f2 + f3 + f4
    share = force / (4.0 * THRUST)
    thrust = force * staged(1.0, theta[6], theta[7], v, g)
    buoyancy = theta[0] * G * math.tanh(depth / theta[1])
    bottom = STIFFNESS * SOFT * math.log1p(math.exp(min((depth - BOTTOM) / SOFT, 30.0)))
    out[0] = heave
    down = thrust + theta[28] * G - buoyancy - bottom
    out[1] = (down - theta[3] * heave - theta[4] * heave * abs(heave)) / (theta[2] + theta[28]) + w[0]
    out[6] = (running - v) / theta[12]
    out[7] = (v - g) / theta[13]
    level_heel = share * staged(theta[18], theta[19], theta[20], v, g) + ARM * (f2 - f4) / theta[27]
    level_trim = share * staged(theta[21], theta[22], theta[23], v, g) - ARM * (f1 - f3) / theta[27]
    out[8] = (level_heel - heel) / theta[14] + w[1]
    out[9] = (level_trim - trim) / theta[14] + w[2]
    out[10] = r
    level_turn = share * staged(theta[24], theta[25], theta[26], v, g)
    out[11] = (level_turn - r) / theta[15] + TORQUE * (f1 - f2 + f3 - f4) / YAW_INERTIA + w[3]
    return out


def measure(x, u, theta):
    """Depth, attitude and yaw rate."""
    y = np.empty(5)
    y[0], y[1], y[2], y[3], y[4] = x[0], theta[17] / METACENTRE + x[8], -theta[16] / METACENTRE + x[9], x[10], x[11]
    return y


def initial(y):
    """Afloat and at rest, motors off, the water still; a first row of r may be anything."""
    x = np.zeros(12)
    x[10] = y["yaw"]
    return x, np.array([0.02, 0.01, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 0.01, 0.003])
