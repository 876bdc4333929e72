"""An ocean glider as a model of the kind that users bring: speed and depth by the attitude that it flew with.

The motion is that of sim_backend/ocean/core (docs/explanation/ocean.md, Model), its numbers a shipped vehicle file's.
"""

import math

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.core.glide import glide, net_buoyancy, next_speed, true_pitch
from glider.sim_backend.ocean.vehicle import PLACES, UNITS, decode_ocean_vehicle, shipped_vehicles

VEHICLE = decode_ocean_vehicle(shipped_vehicles()["slocum"], "slocum")
P0 = VEHICLE.vector()
_SIGMA = VEHICLE.sigma()
_OPEN = [name for name, place in PLACES.items() if _SIGMA[place] > 0.0]
OPEN = np.array([PLACES[name] for name in _OPEN])
NO_EFFECTS = np.zeros(at.N_F)
# of the attitude sensor, beside what an offset and a gain of the input do
NAMES = {"pitch_offset": "attitude_offset", "pitch_scale": "attitude_scale"}
_SENSORS, _WATER = VEHICLE.sensors, VEHICLE.disturbance

inputs = [
    {"name": name, "unit": unit, "column": column, "interpolated": True}
    for name, unit, column in (
        ("pitch", "rad", "pitch_rad"), ("yaw", "rad", "yaw_rad"), ("oil", "m3", "oil_m3"),
        ("density", "kg/m3", "density_kg_m3"), ("temperature", "degC", "temperature_c"),
    )
]  # fmt: skip
states = [("depth_state", "m"), ("speed_state", "m/s"), ("water", "m/s"), ("roll_state", "rad")]
outputs = [
    {"name": "depth", "unit": "m", "noise": _SENSORS.depth.noise, "tolerance": 6.0},
    {"name": "roll", "unit": "rad", "noise": _SENSORS.roll.noise, "tolerance": math.radians(3.0)},
    {"name": "speed", "unit": "m/s", "column": "speed_m_s", "noise": _SENSORS.speed.noise,
     "bias": _SENSORS.speed.bias, "tolerance": 0.03},
]  # fmt: skip
parameters = [(NAMES.get(name, name), UNITS[name], P0[PLACES[name]], _SIGMA[PLACES[name]]) for name in _OPEN]
noises = [
    ("depth_walk", "m/s", _WATER.walk), ("speed_walk", "m/s2", _WATER.speed),
    ("water_walk", "m/s2", _WATER.water_rate), ("roll_walk", "rad/s", _WATER.roll_rate),
]  # fmt: skip
horizon = 600.0


def step(x, u, w, theta, dt):
    """The state (4,) after dt s with the walks' rates w (4,)."""
    P, out = P0.copy(), np.empty(4)
    for k in range(len(OPEN)):
        P[OPEN[k]] = theta[k]
    force = net_buoyancy(P, NO_EFFECTS, x[0], u[3], u[4], u[2], 0.0)
    path, drag = glide(P, NO_EFFECTS, x[1], true_pitch(P, NO_EFFECTS, u[0], 0.0), u[3])
    speed, _ = next_speed(P, x[1], dt, force * math.sin(path), drag)
    memory = math.exp(-dt / P[at.WATER_TIME])
    out[0] = x[0] - 0.5 * (x[1] + speed) * math.sin(path) * dt + P[at.WATER_TIME] * (1.0 - memory) * x[2] + w[0] * dt
    out[1] = speed + w[1] * dt
    out[2] = memory * x[2] + w[2] * dt
    out[3] = math.exp(-dt / P[at.ROLL_TIME]) * x[3] + w[3] * dt
    return out


def measure(x, u, theta):
    """Depth, roll and speed through the water, (3,)."""
    trim = P0[at.ROLL_TRIM]
    for k in range(len(OPEN)):
        if OPEN[k] == at.ROLL_TRIM:
            trim = theta[k]
    return np.array([x[0], trim + x[3], x[1]])


def initial(y):
    """State at the first readings, in still water, and its 1 sigma."""
    speed = y["speed"] if y["speed"] == y["speed"] else 0.2
    return np.array([y["depth"], speed, 0.0, 0.0]), np.array([2.0, 0.1, 0.01, 0.3])
