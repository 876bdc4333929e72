"""Effects on what is read: lags, scales, levers, the compass; each against its closed form."""

import math

import numpy as np
import pytest

from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effect_plant import update_effect_states
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import apply_effects
from glider.sim_backend.core.effects.sensing import read
from glider.sim_backend.core.world import sample_sensors
from tests.support.effect_flights import flown, world


class Plain:
    def __init__(self, effects):
        self.F = np.zeros(ef.N_F)
        apply_effects(self, effects)


def readings(x, **effects):
    y = np.zeros(ef.N_Y)
    read(Plain(effects).F, x, y)
    return y


def a_state(roll=0.2, pitch=-0.4, yaw=1.1):
    x = np.zeros(ef.N_XF)
    x[:3] = 3.0, -2.0, 7.0
    x[3:7] = quaternion_from_euler(roll, pitch, yaw)
    x[7:16] = 0.31, 0.02, -0.03, 0.05, -0.04, 0.03, 0.3, -0.015, 0.12
    return x


def test_without_effects_everything_is_read_as_it_is():
    y = readings(a_state())
    assert y[:9] == pytest.approx([0.2, -0.4, 1.1, 0.05, -0.04, 0.03, 7.0, -0.015, 0.12], abs=1e-15)
    assert y[9:] == pytest.approx([3.0, -2.0, 7.0, 0.2, -0.4, 1.1], abs=1e-15)


@pytest.mark.parametrize(
    ("effects", "place", "wanted"),
    [
        ({"imu_roll_bias": {"angle": 0.05}}, ef.Y_ROLL, 0.25),
        ({"imu_pitch_bias": {"angle": 0.05}}, ef.Y_PITCH, -0.35),
        ({"attitude_scale": {"scale": 0.1}}, ef.Y_PITCH, -0.44),
        ({"gyro_scale": {"scale": 0.4}}, ef.Y_Q, -0.056),
        ({"gyro_bias": {"r": 0.01}}, ef.Y_R, 0.04),
        ({"gyro_bias": {"p": 0.01}, "gyro_scale": {"scale": 1.0}}, ef.Y_P, 0.11),
        ({"depth_offset": {"offset": -0.3}}, ef.Y_DEPTH, 6.7),
        ({"depth_scale": {"scale": 0.1}}, ef.Y_DEPTH, 7.7),
        ({"pressure_lever": {"ahead": 0.5}}, ef.Y_DEPTH, 7.0 + 0.5 * math.sin(0.4)),  # nose down: the port is deeper
        ({"compass": {"s1": 0.1}}, ef.Y_YAW, 1.1 + 0.1 * math.sin(1.1)),
        ({"compass": {"c1": 0.1}}, ef.Y_YAW, 1.1 + 0.1 * math.cos(1.1)),
        ({"compass": {"s2": 0.1}}, ef.Y_YAW, 1.1 + 0.1 * math.sin(2.2)),
        ({"compass": {"c2": 0.1}}, ef.Y_YAW, 1.1 + 0.1 * math.cos(2.2)),
    ],
)
def test_an_error_is_in_its_own_reading(effects, place, wanted):
    y, plain = readings(a_state(), **effects), readings(a_state())
    assert y[place] == pytest.approx(wanted)
    others = [i for i in range(ef.N_Y) if i != place and not ("gyro_scale" in effects and i in range(3, 6))]
    assert np.array_equal(y[others], plain[others])


def test_the_lever_turns_with_the_hull_and_not_with_its_roll():
    for roll in (0.0, 1.0, -2.0):
        y = readings(a_state(roll=roll), pressure_lever={"ahead": 0.5})
        assert y[ef.Y_DEPTH] == pytest.approx(7.0 + 0.5 * math.sin(0.4))


def test_a_depth_lag_follows_a_ramp_one_time_constant_behind():
    F, x, dt, speed, lag = Plain({"depth_lag": {"time": 0.7}}).F, a_state(), 0.01, 0.2, 0.7
    before, behind = np.zeros(6), []
    for _ in range(500):
        before[3] = x[2]
        x[2] += speed * dt
        update_effect_states(F, x, before, dt)
        y = np.zeros(ef.N_Y)
        read(F, x, y)
        behind.append(x[2] - y[ef.Y_DEPTH])
    t = dt * np.arange(1, 501)
    assert np.array(behind) == pytest.approx(speed * lag * (1.0 - np.exp(-t / lag)), rel=1e-10)
    for _ in range(700):
        before[3] = x[2]
        update_effect_states(F, x, before, dt)
    assert abs(x[ef.X_LAG_DEPTH]) < 1e-4 * behind[-1]  # at rest, it settles


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_attitude_lag_follows_a_turn_one_time_constant_behind_across_the_seam(axis):
    F, x, dt, rate, lag = Plain({"attitude_lag": {"time": 0.3}}).F, np.zeros(ef.N_XF), 0.01, 0.8, 0.3
    angles, before = np.array([0.0, 0.0, math.pi - 1.0]), np.zeros(6)
    x[3:7] = quaternion_from_euler(*angles)
    for _ in range(180):
        before[:3] = euler_from_quaternion(*x[3:7])
        angles[axis] += rate * dt
        x[3:7] = quaternion_from_euler(*angles)
        update_effect_states(F, x, before, dt)
    assert x[ef.X_LAG + axis] == pytest.approx(rate * lag * (1.0 - math.exp(-1.8 / lag)), rel=1e-9)
    assert np.delete(x[ef.X_LAG : ef.X_LAG_DEPTH], axis) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_lag_ends_where_the_vehicle_comes_to_rest():
    resting = {"attitude_lag": {"time": 1.0}, "depth_lag": {"time": 1.0}}
    lagging, frames = flown(world(resting), 20.0, lambda t: (0.0, 0.0, 0.0))
    _, plain = flown(world({"gyro_bias": {"p": 1e-9}}), 20.0, lambda t: (0.0, 0.0, 0.0))
    assert np.abs(frames[20:60, 3] - plain[20:60, 3]).max() > 1e-4
    moving = np.abs(lagging[-1, 7:13]).max()
    assert np.abs(frames[-1, 2:5] - plain[-1, 2:5]).max() <= moving
    assert abs(frames[-1, 10] - plain[-1, 10]) <= 9.8e3 * moving


def test_samples_with_no_effect_are_the_plain_samples_bit_for_bit():
    """The way that sensors take where an effect is set, with none: `read` is today's readings."""
    made = world(disturbance_linear=0.01, disturbance_angular=0.02)
    made.errors[1] = 0.01
    rings = [np.zeros_like(made.ring) for _ in range(2)]
    counters = [made.counters.copy() for _ in range(2)]
    for k in range(200):
        made.cmd[:] = 0.5, -0.02, 0.1
        made.advance(0.01 * k)
        for effects in (False, True):
            kept = counters[int(effects)], rings[int(effects)], made.work[wl.W_READ]
            sample_sensors(made.F, effects, made.sensors, made.x, made.time, *kept)
    assert rings[0][:, 40].all(axis=0).any()
    assert np.array_equal(*rings)
    assert np.array_equal(*counters)
