"""A gliding blimp with a moving mass and two propellers, in air: six degrees of freedom, aerodynamics in wind axes.

The numbers are those of Zhu, Cheng, Zhang, "Data-Driven Dynamics Modeling of Miniature Robotic Blimps Using Neural ODEs
With Parameter Auto-Tuning", IEEE Robotics and Automation Letters 9(12), 2024, doi 10.1109/LRA.2024.3484182. Left out
are their terms alpha^2 of side force, beta^2 of lift, alpha of roll and yaw, beta^4 of pitch; added are added masses.
"""

import math

import numpy as np

AIR_DENSITY, GRAVITY, AREA = 1.2187, 9.80, 0.25  # kg/m3, m/s2, m2
HULL, GONDOLA = 0.10482, 0.05407  # kg
GONDOLA_X, GONDOLA_Y, GONDOLA_Z, ARM = 0.0747, 0.0006, 0.2380, 0.15  # m, from the centre of buoyancy; thrusters

states = [
    ("x", "m"), ("y", "m"), ("z", "m"), ("roll", "rad", "angle"), ("pitch", "rad", "angle"), ("yaw", "rad", "angle"),
    ("u", "m/s"), ("v", "m/s"), ("w", "m/s"), ("p", "rad/s"), ("q", "rad/s"), ("r", "rad/s"),
]  # fmt: skip
inputs = {"mass_x": "m", "thrust_left": "N", "thrust_right": "N"}
outputs = [
    *({"name": name, "unit": "m", "noise": 0.003} for name in ("x", "y", "z")),
    *({"name": name, "unit": "rad", "noise": 0.003, "angle": True} for name in ("roll", "pitch", "yaw")),
    *({"name": name, "unit": "rad/s", "noise": 0.005} for name in ("p", "q", "r")),
]
parameters = [
    ("net_mass", "kg", 0.00685, 0.002), ("cg_x", "m", -0.0432, 0.01), ("cg_y", "m", -0.0003, 0.003),
    ("cg_z", "m", 0.0079, 0.01),
    ("cd0", "1", 0.2425, 0.1), ("cd_alpha2", "1", 4.4195, 1.5), ("cd_beta2", "1", 7.508, 2.5),
    ("cs0", "1", 0.0083, 0.05), ("cs_beta", "1", -2.114, 1.0),
    ("cl0", "1", 0.1594, 0.1), ("cl_alpha", "1", 2.9375, 1.0),
    ("cr0", "1", 0.0131, 0.02), ("cr_beta", "1", -0.5256, 0.2),
    ("cm0", "1", 0.0568, 0.03), ("cm_alpha", "1", 0.0933, 0.1),
    ("cn0", "1", 0.0006, 0.005), ("cn_beta", "1", -0.0936, 0.05),
    ("k_p", "N m s", -0.0503, 0.02), ("k_q", "N m s", -0.0264, 0.01), ("k_r", "N m s", -0.0137, 0.005),
    ("i_x", "kg m2", 0.030, 0.01), ("i_y", "kg m2", 0.015, 0.006), ("i_z", "kg m2", 0.010, 0.004),
    ("a_x", "kg", 0.02, 0.03), ("a_z", "kg", 0.05, 0.05),
]  # fmt: skip
noises = [
    *((name, "m/s2", 0.02) for name in ("surge", "sway", "heave")),
    *((f"{name}_moment", "rad/s2", 0.05) for name in ("roll", "pitch", "yaw")),
]


def aerodynamics(speed, u, v, w, p, q, r, theta):
    """Forces and moments of the air in body axes, (6,)."""
    alpha, beta = math.atan2(w, u), math.asin(min(max(v / speed, -1.0), 1.0))
    load = 0.5 * AIR_DENSITY * speed * speed * AREA
    drag = load * (theta[4] + theta[5] * alpha * alpha + theta[6] * beta * beta)
    side = load * (theta[7] + theta[8] * beta)
    lift = load * (theta[9] + theta[10] * alpha)
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    out = np.empty(6)
    out[0] = -ca * cb * drag - ca * sb * side + sa * lift
    out[1] = -sb * drag + cb * side
    out[2] = -sa * cb * drag - sa * sb * side - ca * lift
    out[3] = load * (theta[11] + theta[12] * beta) + theta[17] * p
    out[4] = load * (theta[13] + theta[14] * alpha) + theta[18] * q
    out[5] = load * (theta[15] + theta[16] * beta) + theta[19] * r
    return out


def derivative(x, u, w, theta):
    """dx/dt (12,): pose by the body's velocities, these by the balance about the centre of buoyancy."""
    c1, s1, c2, s2 = math.cos(x[3]), math.sin(x[3]), math.cos(x[4]), math.sin(x[4])
    c3, s3 = math.cos(x[5]), math.sin(x[5])
    U, V, W, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11]
    out = np.empty(12)
    out[0] = c2 * c3 * U + (s1 * s2 * c3 - c1 * s3) * V + (c1 * s2 * c3 + s1 * s3) * W
    out[1] = c2 * s3 * U + (s1 * s2 * s3 + c1 * c3) * V + (c1 * s2 * s3 - s1 * c3) * W
    out[2] = -s2 * U + s1 * c2 * V + c1 * c2 * W
    out[3] = p + (q * s1 + r * c1) * s2 / c2
    out[4] = q * c1 - r * s1
    out[5] = (q * s1 + r * c1) / c2
    air = aerodynamics(math.sqrt(U * U + V * V + W * W + 1e-6), U, V, W, p, q, r, theta)
    gondola_x, thrust, mass = GONDOLA_X + u[0], u[1] + u[2], HULL + GONDOLA
    # first moments of mass, kg m; down in body axes
    mx = HULL * theta[1] + GONDOLA * gondola_x
    my, mz = HULL * theta[2] + GONDOLA * GONDOLA_Y, HULL * theta[3] + GONDOLA * GONDOLA_Z
    dx, dy, dz = -s2, s1 * c2, c1 * c2
    net = theta[0] * GRAVITY
    cx, cy, cz = mx / mass, my / mass, mz / mass
    along, rates = p * cx + q * cy + r * cz, p * p + q * q + r * r
    ax, ay, az = q * W - r * V, r * U - p * W, p * V - q * U
    ix, iy = theta[20] + GONDOLA * GONDOLA_Z**2, theta[21] + GONDOLA * (gondola_x**2 + GONDOLA_Z**2)
    iz = theta[22] + GONDOLA * gondola_x**2
    balance = np.empty(6)
    balance[0] = air[0] + net * dx + thrust - mass * (ax + p * along - cx * rates)
    balance[1] = air[1] + net * dy - mass * (ay + q * along - cy * rates)
    balance[2] = air[2] + net * dz - mass * (az + r * along - cz * rates)
    balance[3] = air[3] + GRAVITY * (my * dz - mz * dy) - (iz - iy) * q * r - (my * az - mz * ay)
    balance[4] = air[4] + GRAVITY * (mz * dx - mx * dz) + GONDOLA_Z * thrust - (ix - iz) * r * p - (mz * ax - mx * az)
    balance[5] = air[5] + GRAVITY * (mx * dy - my * dx) + ARM * (u[1] - u[2]) - (iy - ix) * p * q - (mx * ay - my * ax)
    inertia = np.zeros((6, 6))
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = mass + theta[23], mass + theta[24], mass + theta[24]
    inertia[3, 3], inertia[4, 4], inertia[5, 5] = ix, iy, iz
    inertia[0, 4], inertia[4, 0], inertia[1, 3], inertia[3, 1] = mz, mz, -mz, -mz
    inertia[0, 5], inertia[5, 0], inertia[2, 3], inertia[3, 2] = -my, -my, my, my
    inertia[1, 5], inertia[5, 1], inertia[2, 4], inertia[4, 2] = mx, mx, -mx, -mx
    out[6:] = np.linalg.solve(inertia, balance) + w
    return out


def measure(x, u, theta):
    """Motion capture's pose, and body rates, (9,)."""
    y = np.empty(9)
    y[:6] = x[:6]
    y[6:] = x[9:]
    return y


def initial(y):
    """State at the first readings, body velocity by the slope of the positions; and its 1 sigma."""
    c1, s1, c2, s2 = math.cos(y["roll"]), math.sin(y["roll"]), math.cos(y["pitch"]), math.sin(y["pitch"])
    c3, s3 = math.cos(y["yaw"]), math.sin(y["yaw"])
    body = np.array(
        [
            [c2 * c3, c2 * s3, -s2],
            [s1 * s2 * c3 - c1 * s3, s1 * s2 * s3 + c1 * c3, s1 * c2],
            [c1 * s2 * c3 + s1 * s3, c1 * s2 * s3 - s1 * c3, c1 * c2],
        ]
    )
    velocity = body @ np.array([y["x_rate"], y["y_rate"], y["z_rate"]])
    pose = [y[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")]
    return np.array([*pose, *velocity, y["p"], y["q"], y["r"]]), np.array(6 * [0.02] + 6 * [0.05])
