"""`glider vehicle new --own`: a commented model and vehicle file to begin from, which work as they stand."""

from pathlib import Path

from glider.tools.data.errors import InputError
from glider.tools.data.files import write_files

MODEL = '''"""A model of one's own: a vehicle that sinks and turns. Put yours here; vectors have the declared order.

Units are SI. Functions are pure: the same answer for the same arguments. Plain numpy and math compile with Numba;
dictionaries, unpacking of arrays and classes with state do not (it runs all the same, about ten times slower).
"""

import math

import numpy as np

# what drives the model: run files have the columns thrust_n and rudder_rad
inputs = {"thrust": "N", "rudder": "rad"}
# what it says that sensors read; `angle`: compared modulo 2 pi
outputs = [
    {"name": "depth", "unit": "m", "noise": 0.02},
    {"name": "yaw", "unit": "rad", "noise": 0.01, "angle": True},
    {"name": "r", "unit": "rad/s", "noise": 0.005},
]
# name, unit, value, uncertainty (1 sigma; 0: known)
parameters = [
    ("mass", "kg", 12.0, 0.0),
    ("weight_in_water", "N", 0.5, 0.2),
    ("heave_drag", "N s2/m2", 30.0, 10.0),
    ("turn_rate_per_rudder", "1/s", -0.5, 0.2),
    ("yaw_damping", "1/s", 0.6, 0.2),
]
# what changes by itself; kind "angle" is wrapped, four of kind "quaternion" are an attitude
states = [("depth_state", "m"), ("sink_rate", "m/s"), ("heading", "rad", "angle"), ("turn_rate", "rad/s")]
# what no equation says: accelerations that disturb it, 1 sigma over one second
noises = [("heave", "m/s2", 0.01), ("yawing", "rad/s2", 0.01)]


def derivative(x, u, w, theta):
    """dx/dt (states,); or write step(x, u, w, theta, dt), which returns the next x."""
    mass, weight, drag, turn, damping = theta[0], theta[1], theta[2], theta[3], theta[4]
    out = np.zeros(4)
    out[0] = x[1]
    out[1] = (weight + u[0] - drag * abs(x[1]) * x[1]) / mass + w[0]
    out[2] = x[3]
    out[3] = turn * math.sin(u[1]) - damping * x[3] + w[1]
    return out


def measure(x, u, theta):
    """Outputs (outputs,) at a state."""
    return np.array([x[0], x[2], x[3]])


def initial(y):
    """Initial state and its 1 sigma by the first readings: y["depth"], and y["depth_rate"], their slope (NaN: none)."""
    sink = y["depth_rate"] if y["depth_rate"] == y["depth_rate"] else 0.0
    return np.array([y["depth"], sink, y["yaw"], y["r"]]), np.array([0.05, 0.1, 0.05, 0.02])
'''
VEHICLE = """# what is known of the vehicle; the model's own values stand where nothing is said here
format = 1
model = "{module}"                  # {module}.py beside this file; module:object where the model is an object of it

[parameters.heave_drag]
value = 30.0
uncertainty = 10.0                  # 1 sigma: `glider identify` moves it within some of these
# assumed = true                    # where nobody measured it
# scope = "run"                     # a number of each run (ballast, weather, a battery)

[sensors.depth]
noise = 0.02
tolerance = 0.05                    # what the model may be off: gaps are counted in it
# column = "depth_m"                # of the run files, where it is called otherwise

[start]                             # what is known of how a run begins; else the first readings say it
# depth = {{ value = 0.0, uncertainty = 0.02 }}

[groups]                            # what a cause has in common
# imu = ["yaw", "r"]                # outputs of one device: imu_delay, imu_lag, imu_gain; inputs of one supply likewise
# drag = ["heave_drag", "yaw_damping"]  # parameters that change by the same share: drag

[odds]                              # of causes, by what you know of them; 1 is usual
# depth_gain = 0                    # never

[windows]
seconds = 10.0                      # that gaps are measured on, flown open loop
"""


def write_skeleton(out: Path) -> Path:
    """A vehicle file and its model beside it; the model's path."""
    model = out.with_name(f"{out.stem.replace('-', '_')}_model.py")
    if model.exists():
        raise InputError("is there already: name another file", source=model)
    write_files({out: VEHICLE.format(module=model.stem).encode(), model: MODEL.encode()})
    return model
