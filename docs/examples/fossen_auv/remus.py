"""A survey AUV with two stern propellers and an elevator, in Fossen's form, in a steady current.

M nu' + C(nu) nu + D(nu) nu + g(eta) = tau with nu through the water (forward, starboard, down); what a Doppler log
reads is over ground. Its numbers are invented: 2 m long, 60 kg, trimmed neutral.
"""

import numpy as np

WEIGHT, CG_Z = 588.0, 0.02  # N; m below the centre of buoyancy
MASS = np.array([64.0, 115.0, 115.0, 1.2, 27.0, 27.0])  # with added mass: kg, kg m2
LINEAR = np.array([2.0, 20.0, 20.0, 1.5, 8.0, 8.0])  # damping: N s/m, N m s
QUADRATIC = np.array([0.0, 150.0, 150.0, 0.5, 60.0, 60.0])  # surge: a parameter
BODY_LIFT, FIN_MOMENT, FIN_DAMPING = 60.0, 55.0, 12.0  # of hull and tail fins, each times speed: kg/m, kg, kg m
ELEVATOR = 25.0  # N a (m/s)2 and radian
ELEVATOR_X = -0.9  # m

states = [("depth", "m"), ("roll", "rad", "angle"), ("pitch", "rad", "angle"), ("yaw", "rad", "angle"),
          ("u", "m/s"), ("v", "m/s"), ("w", "m/s"), ("p", "rad/s"), ("q", "rad/s"), ("r", "rad/s")]  # fmt: skip
inputs = {"port": "1/s", "starboard": "1/s", "elevator": "rad"}
outputs = [
    {"name": "depth", "unit": "m", "noise": 0.02},
    *({"name": name, "unit": "rad", "noise": 0.003, "angle": True} for name in ("roll", "pitch", "yaw")),
    *({"name": name, "unit": "rad/s", "noise": 0.003} for name in ("gyro_x", "gyro_y", "gyro_z")),
    {"name": "log_forward", "unit": "m/s", "noise": 0.01}, {"name": "log_starboard", "unit": "m/s", "noise": 0.01},
]  # fmt: skip
parameters = [
    ("thrust", "N s2", 0.02, 0.0002),  # of a propeller, times revolutions a second squared
    ("thruster_y", "m", 0.25, 0.003),  # lever arm of each
    ("thruster_z", "m", 0.03, 0.003),
    ("drag", "kg/m", 8.0, 0.1),
    ("net_weight", "N", 0.0, 0.05),
    ("cg_x", "m", 0.0, 0.0003),
    ("pressure_x", "m", 0.6, 0.01),  # where the pressure sensor is: lever arms
    ("pressure_z", "m", -0.05, 0.01),
    ("current_north", "m/s", 0.0, 0.01),
    ("current_east", "m/s", 0.0, 0.01),
]
noises = [("surge", "m/s2", 0.005), ("sway", "m/s2", 0.005), ("heave", "m/s2", 0.005), ("roll_moment", "rad/s2", 0.01),
          ("pitch_moment", "rad/s2", 0.005), ("yaw_moment", "rad/s2", 0.005)]  # fmt: skip


def to_ground(angles):
    """Rotation matrix from body axes to north, east, down."""
    (c1, c2, c3), (s1, s2, s3) = np.cos(angles), np.sin(angles)
    return np.array([[c3 * c2, c3 * s2 * s1 - s3 * c1, c3 * s2 * c1 + s3 * s1],
                     [s3 * c2, s3 * s2 * s1 + c3 * c1, s3 * s2 * c1 - c3 * s1],
                     [-s2, c2 * s1, c2 * c1]])  # fmt: skip


def cross(a, b):
    """Vector product."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def derivative(x, u, w, theta):
    """Rates of the states."""
    R, velocity, turn, nu = to_ground(x[1:4]), x[4:7], x[7:10], x[4:10]
    p, q, r = turn
    port, starboard = theta[0] * u[0] * abs(u[0]), theta[0] * u[1] * abs(u[1])
    speed = max(nu[0], 0.0)
    fin = ELEVATOR * speed * speed * u[2]
    down = R[2]  # in body axes
    force = theta[4] * down
    force[0] += port + starboard - theta[3] * nu[0] * abs(nu[0])
    force[1] -= BODY_LIFT * speed * nu[1]
    force[2] -= BODY_LIFT * speed * nu[2] - fin
    moment = WEIGHT * cross(np.array([theta[5], 0.0, CG_Z]), down)
    moment[1] += theta[2] * (port + starboard) - ELEVATOR_X * fin - speed * (FIN_MOMENT * nu[2] + FIN_DAMPING * q)
    moment[2] += theta[1] * (port - starboard) + speed * (FIN_MOMENT * nu[1] - FIN_DAMPING * r)
    momentum = MASS * nu  # linear, then angular: M nu, whose turning is C(nu) nu
    force -= cross(turn, momentum[:3])
    moment -= cross(velocity, momentum[:3]) + cross(turn, momentum[3:])
    out = np.empty(10)
    out[0] = down @ velocity
    out[1] = p + (q * np.sin(x[1]) + r * np.cos(x[1])) * np.tan(x[2])
    out[2] = q * np.cos(x[1]) - r * np.sin(x[1])
    out[3] = (q * np.sin(x[1]) + r * np.cos(x[1])) / np.cos(x[2])
    out[4:7], out[7:10] = force, moment
    out[4:10] = (out[4:10] - LINEAR * nu - QUADRATIC * nu * np.abs(nu)) / MASS + w
    return out


def measure(x, u, theta):
    """Pressure sensor, attitude, gyro, and speed over ground by a Doppler log."""
    R = to_ground(x[1:4])
    y = np.empty(9)
    y[0] = x[0] + R[2, 0] * theta[6] + R[2, 2] * theta[7]
    y[1:4], y[4:7] = x[1:4], x[7:10]
    y[7:9] = x[4:6] + R[0, :2] * theta[8] + R[1, :2] * theta[9]
    return y


def initial(y):
    """As the sensors read; speed through the water as over ground."""
    x = np.array([y["depth"], y["roll"], y["pitch"], y["yaw"], y["log_forward"], y["log_starboard"], 0.0,
                  y["gyro_x"], y["gyro_y"], y["gyro_z"]])  # fmt: skip
    return x, np.array([0.1, 0.02, 0.02, 0.02, 0.1, 0.1, 0.1, 0.02, 0.02, 0.02])
