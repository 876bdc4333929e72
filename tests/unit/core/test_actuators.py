"""The nominal actuators: never past range or rate, whatever the commands."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rate, actuator_rates, clip
from glider.firmware.core.vehicle.flight import nominal_step
from tests.support.examples import examples
from tests.support.model_states import HIGH, LOW, RATE, TAU, P, actuators, derivative, state

anything = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.floats(-2.0, 2.0))
commands = st.tuples(anything, anything, anything)
ROUNDING = 1e-15


@examples()
@given(anything, anything, anything, anything, anything, anything)
def test_speed_is_never_above_the_rate(servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast):
    speeds = np.array(actuator_rates(P, servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast))
    assert (np.abs(speeds) <= RATE).all()  # NaN would not be


@examples()
@given(actuators, st.lists(commands, min_size=1, max_size=20), st.sampled_from([0.001, 0.01, 0.05, 0.1]))
def test_position_is_never_outside_the_range(act, sequence, dt):
    x, work = state(act=act), np.zeros((5, layout.N_X))
    for command in sequence:
        for _ in range(5):
            before = x[layout.X_ACT :].copy()
            nominal_step(P, x, *command, 0.0, 0.0, 0.0, dt, work)
            now = x[layout.X_ACT :]
            assert (now >= LOW - ROUNDING).all()
            assert (now <= HIGH + ROUNDING).all()
            assert (np.abs(now - before) <= RATE * dt * (1.0 + 1e-9) + ROUNDING).all()


@examples()
@given(actuators, commands)
def test_accelerations_stay_finite_whatever_the_commands(act, command):
    assert np.isfinite(derivative(state(nu=(0.3, 0.0, 0.02, 0.0, 0.0, 0.0), act=act), command)).all()


@examples()
@given(anything, st.floats(-1.0, 0.0), st.floats(0.0, 1.0))
def test_clip(value, low, high):
    held = clip(value, low, high)
    assert low <= held <= high
    if low <= value <= high:
        assert held == value


def test_lag_and_limit_of_one_actuator():
    low, high, rate, tau = -0.06, 0.06, 0.02, 0.15
    assert actuator_rate(0.0, 0.001, low, high, rate, tau) == 0.001 / tau  # lag
    assert actuator_rate(0.0, 0.05, low, high, rate, tau) == rate  # rate limit
    assert actuator_rate(0.0599, 1.0, low, high, rate, tau) == (high - 0.0599) / tau  # range, then lag


def test_step_response_is_the_lags():
    x, work = state(), np.zeros((5, layout.N_X))
    wanted = 0.5 * RATE * TAU  # small enough to stay off the rate limit
    for _ in range(100):
        nominal_step(P, x, *wanted, 0.0, 0.0, 0.0, 0.01, work)
    expected = wanted * (1.0 - np.array([math.exp(-1.0 / tau) for tau in TAU]))
    np.testing.assert_allclose(x[layout.X_ACT :], expected, rtol=1e-5)
