"""States, vehicles, gains and references for the tests of the law."""

import math

import numpy as np
from hypothesis import strategies as st

from glider.firmware.core.vehicle import layout
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import decode_vehicle
from tests.support.law_flights import Gains, Reference, output_accelerations, outputs, plant_rates, without_stops
from tests.support.model_states import RATE, VEHICLE_TEXT, P, actuators, angles, rates, state, vehicles, velocities

SPREAD = 3.0 * parameter_sigma(P, decode_vehicle(VEHICLE_TEXT, "roughie").uncertainty)
actuator_speeds = st.tuples(*(st.floats(-rate, rate) for rate in RATE))
# 75 deg: nearer the poles a pitch error asks for inputs of which no iteration knows the fixed point
law_pitches = st.floats(-1.3, 1.3)
unit = st.floats(-1.0, 1.0)


# Astern and broadside (4) gives forces of hundreds of newtons; the inputs that would answer them leave no mass matrix.
forward = st.tuples(st.floats(0.0, 0.8), unit, unit).map(lambda a: (a[0], *(0.5 * a[0] + 0.02) * np.array(a[1:])))


@st.composite
def flying(draw, pitches=law_pitches, flows=velocities, turning=rates) -> np.ndarray:
    """States away from the poles, shape (N_X,)."""
    euler = draw(st.tuples(angles, pitches, angles))
    return state(euler, (*draw(flows), *draw(turning)), draw(actuators), (0.0, 0.0, draw(st.floats(0.0, 10.0))))


@st.composite
def trimmed_vehicles(draw) -> np.ndarray:
    """Perturbed vehicles with what stands beside the nominal model, too: net mass and an offset centre of gravity."""
    vehicle = without_stops(draw(vehicles()))
    vehicle[layout.NET_MASS] = draw(st.floats(-0.02, 0.02))
    vehicle[layout.CG_X : layout.CG_Z + 1] = draw(st.tuples(*[st.floats(-0.001, 0.001)] * 3))
    return vehicle


@st.composite
def gains(draw, reach_of_k2) -> Gains:
    # eps above |g| now and then, so that sat(g/eps) is not always a sign
    eps = draw(st.one_of(st.floats(0.005, 0.3), st.floats(0.3, 20.0)))
    return Gains(draw(st.floats(0.05, 1.5)), draw(st.floats(0.001, reach_of_k2)), draw(st.floats(0.05, 1.5)), eps)


@st.composite
def closed_loops(draw, vehicle, states, spare=0.3):
    """A state, speeds of the actuators, references and gains: all of what the law looks at.

    References accelerate like the vehicle would with some actuators or other, give or take; errors shrink with ctheta,
    as the slider's grip does: the inputs stay of a size at which M is a mass matrix.
    """
    x, speeds = draw(states), np.array(draw(actuator_speeds))
    theta, theta_rate, Z, Z_rate = outputs(x)
    natural = output_accelerations(x, plant_rates(vehicle, x, x[layout.X_ACT :])[7:13])
    grip = spare * math.cos(theta)
    pitch = Reference(theta + grip * draw(unit), theta_rate + grip * draw(unit), natural[0] + grip * draw(unit))
    depth = Reference(Z + draw(unit), Z_rate + spare * draw(unit), natural[1] + spare * draw(unit))
    return x, speeds, (pitch, depth), draw(gains(0.05)), draw(gains(0.3))
