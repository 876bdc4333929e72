"""ROUGHIE as a model of the kind that users bring: the nominal flight of firmware/core, and what the sensors read.

Numbers, uncertainties and noises are those of the shipped vehicle file (docs/explanation/model.md). Effects of the
catalogue are not here: what may be wrong is derived from the declaration (docs/how-to/own-vehicle.md).
"""

import math

import numpy as np

from glider.firmware.core.layouts.estimator_layout import DISTURBANCE_HOLD
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.flight import nominal_derivative
from glider.firmware.core.vehicle.layout import N_X, X_BALLAST, X_DOWN, X_NU, X_SLIDER
from glider.firmware.core.vehicle.state import euler_angles
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import PLACES, decode_vehicle

VEHICLE = decode_vehicle(shipped("model/vehicles")["roughie"], "roughie")
P0 = VEHICLE.vector()
_SIGMA = parameter_sigma(P0, VEHICLE.uncertainty)
_OPEN = [name for name, place in PLACES.items() if _SIGMA[place] > 0.0]
OPEN = np.array([PLACES[name] for name in _OPEN])
UNITS = {"m_t": "kg", "m_r": "kg", "m_s": "kg", "net_mass": "kg", "R_r": "m", "R_s": "m", "x_b": "m"}
UNITS |= {f"cg_{axis}": "m" for axis in "xyz"} | {f"added_mass_{axis}": "kg" for axis in "xyz"}
UNITS |= {f"added_inertia_{axis}": "kg m2" for axis in "xyz"}
BEGINNINGS = 0.03, 0.2, 0.4  # m/s: nothing reads the speed, and no linearisation reaches from rest to a glide
_SENSORS, _FLOW = VEHICLE.sensors, DISTURBANCE_HOLD**0.5

inputs = [("servo", "rad", "cmd_servo_rad"), ("slider", "m", "cmd_slider_m"), ("ballast", "kg", "cmd_ballast_kg")]
states = [
    ("north", "m"), ("east", "m"), ("down", "m"), *((f"q{n}", "1", "quaternion") for n in range(4)),
    ("u", "m/s"), ("v", "m/s"), ("w", "m/s"), ("p", "rad/s"), ("q", "rad/s"), ("r", "rad/s"),
    ("servo_position", "rad"), ("slider_position", "m"), ("tank", "kg"),
]  # fmt: skip
outputs = [
    *({"name": name, "unit": "rad", "noise": _SENSORS.attitude.noise, "bias": _SENSORS.attitude.bias, "angle": True,
       "tolerance": math.radians(4.0 if name == "yaw" else 1.5)} for name in ("roll", "pitch", "yaw")),
    *({"name": f"{name}_rate", "column": f"{name}_rad_s", "unit": "rad/s", "noise": _SENSORS.gyro.noise,
       "bias": _SENSORS.gyro.bias, "tolerance": math.radians(2.0)} for name in "pqr"),
    {"name": "depth", "unit": "m", "noise": _SENSORS.depth.noise, "bias": _SENSORS.depth.bias, "tolerance": 0.05},
    {"name": "slider_wire", "column": "slider_m", "unit": "m", "noise": _SENSORS.slider.noise, "tolerance": 0.002},
    {"name": "ballast_wire", "column": "ballast_kg", "unit": "kg", "noise": _SENSORS.ballast.noise,
     "tolerance": 0.005},
]  # fmt: skip
parameters = [(name, UNITS.get(name, "1"), P0[PLACES[name]], _SIGMA[PLACES[name]]) for name in _OPEN]
noises = [
    *((name, "m/s2", VEHICLE.disturbance.linear * _FLOW) for name in ("surge", "sway", "heave")),
    *((f"{name}_moment", "rad/s2", VEHICLE.disturbance.angular * _FLOW) for name in ("roll", "pitch", "yaw")),
]
horizon = 20.0


def derivative(x, u, w, theta):
    """dx/dt (16,) of the nominal vehicle with accelerations w (6,) beside it."""
    P, out = P0.copy(), np.empty(N_X)
    for k in range(len(OPEN)):
        P[OPEN[k]] = theta[k]
    nominal_derivative(P, x, u[0], u[1], u[2], 0.0, 0.0, 0.0, out)
    for k in range(6):
        out[X_NU + k] += w[k]
    return out


def measure(x, u, theta):
    """What the onboard sensors read, (9,)."""
    y = np.empty(9)
    y[0], y[1], y[2] = euler_angles(x)
    y[3:6] = x[X_NU + 3 : X_NU + 6]
    y[6], y[7], y[8] = x[X_DOWN], x[X_SLIDER], x[X_BALLAST]
    return y


def initial(y):
    """States at the first readings, one for each speed that a run may begin with, and their 1 sigma."""
    found = []
    for speed in BEGINNINGS:
        x = np.zeros(N_X)
        x[X_DOWN], x[X_NU] = y["depth"], speed
        x[3:7] = quaternion_from_euler(y["roll"], y["pitch"], y["yaw"])
        known = [y[name] for name in ("p_rate", "q_rate", "r_rate")]
        x[X_NU + 3 : X_NU + 6] = np.nan_to_num(known)
        x[X_SLIDER], x[X_BALLAST] = np.nan_to_num([y["slider_wire"], y["ballast_wire"]])
        found.append((x, np.array([*6 * [0.05], 0.1, 0.03, 0.03, *3 * [0.05], 1e-4, 3e-4, 5e-4])))
    return found
