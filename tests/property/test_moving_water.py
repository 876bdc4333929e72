"""A flight in moving water is the flight in still water, carried along; a neutral hull goes with the water."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run, nominal_step
from tests.independent.flights import fly
from tests.independent.make_reference import VEHICLE
from tests.independent.nominal import Glider
from tests.support.examples import examples
from tests.support.model_states import P, actuators, angles, currents, derivative, state, states

STEP = 0.01


def gust(t: float, strength: np.ndarray) -> np.ndarray:
    """Water that speeds up, stops and turns, m/s."""
    return strength * np.array([math.sin(1.3 * t), 1.0 - math.cos(0.7 * t), math.sin(2.1 * t)])


def fly_in_gust(x: np.ndarray, command, strength: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """State and way of the water after a flight in which the water's speed is that of the middle of each step."""
    x, way, work = x.copy(), np.zeros(3), np.zeros((5, layout.N_X))
    for k in range(steps):
        water = gust((k + 0.5) * STEP, strength)
        nominal_step(P, x, *command, *water, STEP, work)
        way += STEP * water
    return x, way


@examples()
@given(states(), actuators, currents)
def test_derivative_differs_by_the_waters_velocity_alone(x, command, water):
    still, moving = derivative(x, command), derivative(x, command, water)
    np.testing.assert_allclose(moving[:3] - still[:3], water, atol=1e-15)
    np.testing.assert_array_equal(moving[3:], still[3:])


@examples(20)
@given(states(), st.lists(actuators, min_size=1, max_size=4), currents)
def test_flight_in_uniformly_moving_water_is_carried_along(x, commands, water):
    still, moving, work = x.copy(), x.copy(), np.zeros((5, layout.N_X))
    for command in commands:
        nominal_run(P, still, *command, 0.0, 0.0, 0.0, STEP, 500, work)
        nominal_run(P, moving, *command, *water, STEP, 500, work)
    np.testing.assert_allclose(moving[:3] - still[:3], 5.0 * len(commands) * np.array(water), atol=1e-9)
    np.testing.assert_array_equal(moving[3:], still[3:])


@examples(20)
@given(angles, currents)
def test_neutral_hull_follows_accelerating_water(psi, strength):
    x, way = fly_in_gust(state((0.0, 0.0, psi)), (0.0, 0.0, 0.0), np.array(strength), 500)
    np.testing.assert_allclose(x[:3], way, atol=1e-12)
    # level and at rest in the water all the way: not turned, not left behind
    np.testing.assert_allclose(x[layout.X_NU : layout.X_ACT], 0.0, atol=1e-14)


@examples(10)
@given(states(), actuators, currents)
def test_accelerating_water_carries_any_flight_along(x, command, strength):
    still, _ = fly_in_gust(x, command, np.zeros(3), 300)
    moving, way = fly_in_gust(x, command, np.array(strength), 300)
    np.testing.assert_array_equal(moving[3:], still[3:])
    np.testing.assert_allclose(moving[:3] - still[:3], way, atol=1e-10)


def test_flight_in_a_gust_is_the_independent_ones():
    strength, steps = np.array([0.2, -0.15, 0.05]), 1000
    start = np.array([0, 0, 5, 0.1, -0.2, 0.4, 0.3, 0.02, 0.01, 0, 0, 0, 0.5, -0.02, 0.1], dtype=float)
    command = (0.5, -0.02, 0.1)
    x, _ = fly_in_gust(state(start[3:6], start[6:12], start[12:], start[:3]), command, strength, steps)
    times = np.array([0.0, steps * STEP])
    reference = fly(Glider.from_file(VEHICLE), start, times, np.array([command, command]), lambda t: gust(t, strength))[
        -1
    ]
    np.testing.assert_allclose(x[:3], reference[:3], atol=1e-5)  # water held over each step
    np.testing.assert_allclose(x[7:], reference[6:], atol=1e-7)
