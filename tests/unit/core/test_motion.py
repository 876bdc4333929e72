"""Mass properties, water forces and equation (1) against the same in matrices."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.mass import first_moment, first_moment_rate, inertia, translational_mass
from glider.firmware.core.vehicle.motion import solve_mass_matrix
from glider.firmware.core.vehicle.water import flow_angles, flow_to_body, water_wrench
from tests.independent.make_reference import VEHICLE
from tests.independent.nominal import Glider, about, body_to_ned
from tests.support.examples import examples
from tests.support.model_states import (
    RATE,
    P,
    actuators,
    angles,
    derivative,
    full_mass_matrix,
    pitches,
    rates,
    state,
    vehicles,
    velocities,
)

GLIDER = Glider.from_file(VEHICLE)
forces = st.tuples(*[st.floats(-10.0, 10.0)] * 6)
# Below the stillness threshold the flow has no direction; components either matter against it or are nothing.
component = st.one_of(st.just(0.0), st.floats(1e-3, 1.0), st.floats(-1.0, -1e-3))
flows = st.tuples(component, component, component)


@examples()
@given(vehicles(), actuators, forces)
def test_block_solve_is_the_full_solve(vehicle, act, force):
    M = full_mass_matrix(act, vehicle)
    ours = solve_mass_matrix(
        *translational_mass(vehicle, act[2]), *first_moment(vehicle, *act), *inertia(vehicle, *act), *force
    )
    np.testing.assert_allclose(ours, np.linalg.solve(M, force), rtol=1e-10, atol=1e-12)


@examples()
@given(actuators)
def test_mass_matrix_is_the_independent_one(act):
    M = full_mass_matrix(act)
    np.testing.assert_allclose(M, GLIDER.mass_matrix(np.array(act)), atol=1e-14)
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0.0


@examples()
@given(actuators, st.tuples(*(st.floats(-rate, rate) for rate in RATE)))
def test_rate_of_the_first_moment_is_its_derivative(act, act_rate):
    h = 1e-5
    ahead = np.array(first_moment(P, *(np.array(act) + h * np.array(act_rate))))
    behind = np.array(first_moment(P, *(np.array(act) - h * np.array(act_rate))))
    np.testing.assert_allclose(first_moment_rate(P, act[0], *act_rate), (ahead - behind) / (2 * h), atol=1e-9)


@examples()
@given(flows, forces)
def test_flow_to_body_is_matrix_3(V, wrench):
    alpha, beta, _ = flow_angles(*V)
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    printed = np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]])
    np.testing.assert_allclose(flow_to_body(*V, *wrench[:3]), printed @ wrench[:3], atol=1e-12)
    np.testing.assert_allclose(printed, about(1, -alpha) @ about(2, beta), atol=1e-15)


@examples()
@given(flows)
def test_first_flow_axis_is_the_velocity(V):
    speed = float(np.linalg.norm(V))
    if speed > 1e-3:
        np.testing.assert_allclose(flow_to_body(*V, speed, 0.0, 0.0), V, atol=1e-15)


@examples()
@given(velocities, rates)
def test_water_wrench_is_the_independent_one(V, omega):
    nu = np.array([*V, *omega])
    np.testing.assert_allclose(water_wrench(P, *nu), GLIDER.water_forces(nu), atol=1e-11)


def test_still_water_does_nothing():
    assert water_wrench(P, 0.0, 0.0, 0.0, 0.3, -0.2, 0.1) == (0.0,) * 6
    assert flow_angles(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)


@examples()
@given(flows, rates)
def test_a_zero_has_no_sign(V, omega):
    negative = [-0.0 if speed == 0.0 else speed for speed in V]
    if negative[0] >= 0.0:  # astern, alpha jumps from pi to -pi at w = 0
        assert water_wrench(P, *negative, *omega) == water_wrench(P, *V, *omega)


@examples()
@given(angles, pitches, angles, velocities, rates, actuators, actuators)
def test_derivative_is_the_independent_one(phi, theta, psi, V, omega, act, command):
    V = tuple(speed + 0.0 for speed in V)  # a zero has no sign here (test_a_zero_has_no_sign), to atan2 it has one
    nu = np.array([*V, *omega])
    dx = derivative(state((phi, theta, psi), nu, act), command)
    R, act_rate = body_to_ned(phi, theta, psi), GLIDER.actuator_speed(np.array(act), np.array(command))
    np.testing.assert_allclose(dx[:3], R @ V, atol=1e-14)
    np.testing.assert_allclose(dx[layout.X_ACT :], act_rate, atol=1e-15)
    # the independent M_dot is a difference: 1e-9 of it
    np.testing.assert_allclose(dx[7:13], GLIDER.acceleration(R, nu, np.array(act), act_rate), rtol=1e-8, atol=1e-8)


def test_net_mass_and_centre_of_gravity_off_nominal():
    vehicle = P.copy()
    vehicle[layout.NET_MASS], vehicle[layout.CG_X] = 0.05, 0.001
    act = (0.2, 0.01, 0.1)
    np.testing.assert_allclose(
        np.subtract(translational_mass(vehicle, 0.1), translational_mass(P, 0.1)), 0.05, atol=1e-14
    )
    moved = np.array(first_moment(vehicle, *act)) - first_moment(P, *act)
    np.testing.assert_allclose(moved, [P[layout.M_T] * 0.001, 0.0, 0.0], atol=1e-15)
    # at rest, level, neutral otherwise: the net mass sinks the hull, and its weight acts at the origin
    vehicle[layout.CG_X] = 0.0
    force = full_mass_matrix((0.0, 0.0, 0.0), vehicle) @ derivative(state(), (0.0, 0.0, 0.0), vehicle=vehicle)[7:13]
    np.testing.assert_allclose(force, [0, 0, 0.05 * layout.GRAVITY, 0, 0, 0], atol=1e-12)
