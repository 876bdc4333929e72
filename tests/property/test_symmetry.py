"""Port and starboard are the same to this vehicle: a flight with everything mirrored is the mirrored flight."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run
from tests.support.examples import examples
from tests.support.model_states import P, actuators, currents, derivative, states, vehicles

# north, east, down, quaternion, nu, actuators: what changes its sign when east is swapped with west
MIRROR = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, -1, 1, 1])
COMMAND, WATER = np.array([-1, 1, 1]), np.array([1, -1, 1])


@examples()
@given(states(), actuators, currents, vehicles())
def test_derivative_is_mirrored(x, command, water, vehicle):
    straight = derivative(x, command, water, vehicle)
    mirrored = derivative(x * MIRROR, np.array(command) * COMMAND, np.array(water) * WATER, vehicle)
    np.testing.assert_allclose(mirrored, straight * MIRROR, rtol=1e-13, atol=1e-13)


@examples(20)
@given(states(), st.lists(actuators, min_size=1, max_size=5), currents)
def test_flight_is_mirrored(x, commands, water):
    straight, mirrored, work = x.copy(), x * MIRROR, np.zeros((5, layout.N_X))
    for command in commands:
        nominal_run(P, straight, *command, *water, 0.01, 500, work)
        nominal_run(P, mirrored, *(np.array(command) * COMMAND), *(np.array(water) * WATER), 0.01, 500, work)
    np.testing.assert_allclose(mirrored, straight * MIRROR, atol=1e-10)


def test_wings_level_stays_wings_level():
    x, work = np.zeros(layout.N_X), np.zeros((5, layout.N_X))
    x[3], x[7] = 1.0, 0.2
    nominal_run(P, x, 0.0, -0.03, 0.2, 0.0, 0.0, 0.0, 0.01, 6000, work)
    assert (x[MIRROR < 0] == 0.0).all()
    assert x[2] > 5.0  # it did fly
