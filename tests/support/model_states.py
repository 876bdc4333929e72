"""Vehicles and states for the tests of the model: the shipped one, and hypothesis strategies around it."""

import math

import numpy as np
from hypothesis import strategies as st

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_derivative
from glider.firmware.core.vehicle.mass import first_moment, inertia, translational_mass
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import decode_vehicle

VEHICLE_TEXT = shipped("model/vehicles")["roughie"]
P = decode_vehicle(VEHICLE_TEXT, "roughie").vector()  # nobody writes into it: conftest.py looks
ACTUATORS = ("servo", "slider", "ballast")
LOW, HIGH, RATE, TAU = (
    np.array([P[getattr(layout, f"{name.upper()}_{field}")] for name in ACTUATORS])
    for field in ("MIN", "MAX", "RATE", "TAU")
)
angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.5, 1.5)
# to the nanometre: below 1e-150 m/s squares underflow, and with them the flow's direction
velocities = st.tuples(*[st.floats(-0.8, 0.8).map(lambda speed: round(speed, 9) + 0.0)] * 3)
rates = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
positions = st.tuples(*[st.floats(-100.0, 100.0)] * 3)
actuators = st.tuples(*(st.floats(low, high) for low, high in zip(LOW, HIGH, strict=True)))
currents = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@st.composite
def quaternions(draw) -> np.ndarray:
    """Unit quaternions of any attitude, shape (4,)."""
    return np.array(quaternion_from_euler(draw(angles), draw(pitches), draw(angles)))


@st.composite
def states(draw) -> np.ndarray:
    """States of the kernels, shape (N_X,), actuators within their ranges."""
    return np.concatenate([draw(part) for part in (positions, quaternions(), velocities, rates, actuators)])


@st.composite
def vehicles(draw) -> np.ndarray:
    """Parameter vectors of vehicles like the shipped one, but with nothing left at zero, shape (N_P,)."""
    vector = P.copy()
    for place in range(layout.M_T, layout.K_R + 1):
        vector[place] *= draw(st.floats(0.8, 1.25))
    vector[layout.X_R], vector[layout.R_SX0] = draw(st.floats(-0.1, 0.1)), draw(st.floats(-0.1, 0.1))
    vector[layout.K_L0], vector[layout.K_M0] = draw(st.floats(-2.0, 2.0)), draw(st.floats(-0.5, 0.5))
    return vector


def derivative(x: np.ndarray, command, water=(0.0, 0.0, 0.0), vehicle: np.ndarray = P) -> np.ndarray:
    """dx/dt, shape (N_X,)."""
    out = np.empty(layout.N_X)
    nominal_derivative(vehicle, x, *command, *water, out)
    return out


def state(euler=(0.0, 0.0, 0.0), nu=(0.0,) * 6, act=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0)) -> np.ndarray:
    """A kernels' state from Euler angles, shape (N_X,)."""
    return np.array([*position, *quaternion_from_euler(*euler), *nu, *act], dtype=float)


def skew(a) -> np.ndarray:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def full_mass_matrix(act, vehicle: np.ndarray = P) -> np.ndarray:
    """M as a 6 x 6 matrix, from what the kernels say its blocks hold."""
    I1, I2, I3, I12, I13, I23 = inertia(vehicle, *act)
    S = skew(first_moment(vehicle, *act))
    J = np.array([[I1, I12, I13], [I12, I2, I23], [I13, I23, I3]])
    return np.block([[np.diag(translational_mass(vehicle, act[2])), -S], [S, J]])
