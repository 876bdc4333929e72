"""Attitude kernels against scipy's Rotation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glider.firmware.core.maths.rotations import (
    euler_from_quaternion,
    euler_rates,
    quaternion_from_euler,
    quaternion_rate,
    rotation_nb,
    rotation_nb_euler,
    wrap_angle,
)
from tests.support.examples import examples
from tests.support.model_states import angles, pitches, quaternions, rates


def scipy_rotation(q) -> Rotation:
    return Rotation.from_quat([q[1], q[2], q[3], q[0]])


@examples()
@given(angles, st.floats(-math.pi, math.pi), angles)
def test_quaternion_of_euler_angles_is_scipys(phi, theta, psi):
    ours = scipy_rotation(quaternion_from_euler(phi, theta, psi))
    assert (ours.inv() * Rotation.from_euler("ZYX", [psi, theta, phi])).magnitude() < 1e-14


@examples()
@given(angles, pitches, angles)
def test_euler_angles_come_back(phi, theta, psi):
    back = euler_from_quaternion(*quaternion_from_euler(phi, theta, psi))
    assert abs(wrap_angle(back[0] - phi)) < 1e-12
    assert abs(back[1] - theta) < 1e-12
    assert abs(wrap_angle(back[2] - psi)) < 1e-12


@examples()
@given(quaternions())
def test_euler_angles_are_scipys(q):
    psi, theta, phi = scipy_rotation(q).as_euler("ZYX")
    off = np.array(euler_from_quaternion(*q)) - [phi, theta, psi]
    off[[0, 2]] = [wrap_angle(angle) for angle in off[[0, 2]]]  # half a turn either way is the same
    np.testing.assert_allclose(off, 0.0, atol=1e-12)


@pytest.mark.parametrize("theta", [math.pi / 2, -math.pi / 2])
def test_attitude_survives_euler_angles_at_the_pole(theta):
    for off in (0.0, 1e-16, 1e-12, 1e-8, 1e-4):
        q = quaternion_from_euler(0.4, theta - off, -1.1)
        back = quaternion_from_euler(*euler_from_quaternion(*q))
        assert (scipy_rotation(q).inv() * scipy_rotation(back)).magnitude() < 1e-14


@examples()
@given(quaternions())
def test_rotation_matrix_is_scipys(q):
    ours = np.reshape(rotation_nb(*q), (3, 3))
    np.testing.assert_allclose(ours, scipy_rotation(q).as_matrix(), atol=1e-15)


@examples()
@given(angles, st.floats(-math.pi, math.pi), angles)
def test_printed_rotation_matrix_is_the_quaternions(phi, theta, psi):
    printed = rotation_nb_euler(phi, theta, psi)
    np.testing.assert_allclose(printed, rotation_nb(*quaternion_from_euler(phi, theta, psi)), atol=1e-15)


@examples()
@given(quaternions(), rates)
def test_quaternion_rate_is_a_small_turn_in_body_axes(q, omega):
    h = 1e-6
    turned = scipy_rotation(q) * Rotation.from_rotvec(h * np.array(omega))
    before = scipy_rotation(q) * Rotation.from_rotvec(-h * np.array(omega))
    x, y, z, w = turned.as_quat() - before.as_quat()
    sign = math.copysign(1.0, turned.as_quat() @ [q[1], q[2], q[3], q[0]])
    np.testing.assert_allclose(quaternion_rate(*q, *omega), sign * np.array([w, x, y, z]) / (2 * h), atol=1e-9)


@examples()
@given(angles, st.floats(-1.3, 1.3), angles, rates)
def test_euler_rates_are_those_of_the_quaternion(phi, theta, psi, omega):
    h = 1e-6
    q = np.array(quaternion_from_euler(phi, theta, psi))
    qd = np.array(quaternion_rate(*q, *omega))
    ahead, behind = np.array(euler_from_quaternion(*(q + h * qd))), np.array(euler_from_quaternion(*(q - h * qd)))
    moved = np.array([wrap_angle(angle) for angle in ahead - behind]) / (2 * h)
    np.testing.assert_allclose([*euler_rates(phi, theta, omega[0], omega[1], omega[2])], moved, atol=1e-8)


@examples()
@given(st.floats(-1e4, 1e4))
def test_wrapped_angle_is_the_same_direction(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped <= math.pi
    assert abs(math.remainder(wrapped - angle, 2.0 * math.pi)) < 1e-11


@examples()
@given(st.floats(-math.pi, math.pi, exclude_min=True))
def test_angle_in_range_is_left_as_it_is(angle):
    assert wrap_angle(angle) == angle


def test_wrapping_keeps_pi_and_turns_minus_pi():
    assert wrap_angle(math.pi) == math.pi
    assert wrap_angle(-math.pi) == math.pi
