"""With the actuators standing still, kinetic and potential energy change by the work of the water's forces alone."""

import numpy as np
from hypothesis import Phase, given
from hypothesis import strategies as st
from scipy.integrate import simpson

from glider.firmware.core.maths.rotations import quaternion_from_euler, rotation_nb
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_step
from glider.firmware.core.vehicle.mass import first_moment
from glider.firmware.core.vehicle.water import water_wrench
from tests.support.examples import examples
from tests.support.model_states import (
    P,
    actuators,
    angles,
    derivative,
    full_mass_matrix,
    quaternions,
    rates,
    vehicles,
    velocities,
)


def energy(vehicle: np.ndarray, x: np.ndarray) -> float:
    """Kinetic energy 1/2 nu' M nu and potential energy -W Z - g S.k, k the direction of down in body axes; J."""
    nu, act = x[7:13], x[layout.X_ACT :]
    down = np.array(rotation_nb(*x[3:7]))[6:]
    weight = layout.GRAVITY * (act[2] + vehicle[layout.NET_MASS])
    swing = layout.GRAVITY * np.dot(first_moment(vehicle, *act), down)
    return 0.5 * nu @ full_mass_matrix(act, vehicle) @ nu - weight * x[2] - swing


def power(vehicle: np.ndarray, x: np.ndarray) -> float:
    """Of the water's forces, W."""
    return float(np.dot(water_wrench(vehicle, *x[7:13]), x[7:13]))


@examples()
@given(vehicles(), quaternions(), velocities, rates, actuators)
def test_power_balance_of_the_derivative(vehicle, q, V, omega, act):
    x = np.concatenate([np.zeros(3), q, V, omega, act])
    dx = derivative(x, act, vehicle=vehicle)
    assert (dx[layout.X_ACT :] == 0.0).all()
    h = 1e-5
    change = (energy(vehicle, x + h * dx) - energy(vehicle, x - h * dx)) / (2.0 * h)
    # central difference: its third derivative and rounding
    assert abs(change - power(vehicle, x)) < 1e-7 * (1.0 + np.abs(dx).max() ** 2)


# gliding: astern and straight sideways the angle of attack jumps, and the sum of the powers would miss the jump
gliding = st.tuples(st.floats(0.3, 0.6), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
gentle = st.tuples(*[st.floats(-0.2, 0.2)] * 3)


@examples(10, phases=[Phase.generate])
@given(vehicles(), angles, st.floats(-0.7, 0.7), gliding, gentle, actuators)
def test_power_balance_along_a_flight(vehicle, phi, theta, V, omega, act):
    q = quaternion_from_euler(0.3 * phi, theta, 1.0)
    x, work, dt, steps = np.concatenate([np.zeros(3), q, V, omega, act]), np.zeros((5, layout.N_X)), 0.002, 2000
    before, powers = energy(vehicle, x), [power(vehicle, x)]
    for _ in range(steps):
        nominal_step(vehicle, x, *act, 0.0, 0.0, 0.0, dt, work)
        powers.append(power(vehicle, x))
    assert abs(energy(vehicle, x) - before - simpson(powers, dx=dt)) < 1e-6


@examples(20)
@given(quaternions(), rates, actuators)
def test_no_energy_is_lost_without_water_forces(q, omega, act):
    """All coefficients at zero: the hull swings for ever, about its moving masses, with added mass."""
    vehicle = P.copy()
    vehicle[layout.K_D0 : layout.K_R + 1] = 0.0
    x, work = np.concatenate([np.zeros(3), q, np.zeros(3), omega, act]), np.zeros((5, layout.N_X))
    before = energy(vehicle, x)
    for _ in range(2000):
        nominal_step(vehicle, x, *act, 0.0, 0.0, 0.0, 0.005, work)
    assert abs(energy(vehicle, x) - before) < 1e-6
