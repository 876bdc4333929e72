"""The controllers' parts: reference filter against its closed form, PID without wind-up, limits that always hold."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.control.control import pid, reference_step, roll_law
from glider.firmware.core.vehicle.actuators import limited
from tests.support.examples import examples

anything = st.floats(allow_nan=True, allow_infinity=True, width=64)
finite = st.floats(-1e6, 1e6)


@examples(200)
@given(st.floats(0.05, 2.0), st.floats(0.3, 3.0), st.floats(-5.0, 5.0))
def test_reference_filter_is_the_second_order_filter(wn, zeta, target):
    """L-ref: wn^2 / (s^2 + 2 zeta wn s + wn^2), against SciPy's step response."""
    from scipy import signal

    dt, steps = 0.02, 500
    t = dt * np.arange(steps + 1)
    _, expected = signal.step(([wn**2], [1.0, 2 * zeta * wn, wn**2]), T=t)
    x, v, got = 0.0, 0.0, [0.0]
    for _ in range(steps):
        x, v, _ = reference_step(x, v, target, wn, zeta, dt)
        got.append(x)
    assert np.array(got) == pytest.approx(target * expected, abs=2e-6 * max(1.0, abs(target)))


@examples(200)
@given(anything, st.floats(-1.0, 1.0), st.floats(0.001, 5.0))
def test_a_command_never_leaves_its_range_nor_outruns_its_rate(wanted, last, rate):
    sent = limited(wanted, last, -1.0, 1.0, rate, 0.02)
    assert -1.0 <= sent <= 1.0
    assert abs(sent - last) <= rate * 0.02 + 1e-15 * max(1.0, abs(last))  # rounding of where it stands, not of the step


@examples(200)
@given(st.lists(anything, min_size=1, max_size=50))
def test_no_sequence_of_wishes_gets_past_the_limits(wishes):
    last = 0.0
    for wanted in wishes:
        sent = limited(wanted, last, -0.06, 0.06, 0.02, 0.02)
        assert -0.06 <= sent <= 0.06
        assert abs(sent - last) <= 0.0004 * (1 + 1e-9)
        last = sent


@pytest.mark.parametrize("wanted", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_keeps_the_last_command(wanted):
    assert limited(wanted, 0.03, -0.06, 0.06, 0.02, 0.02) == 0.03


@examples(200)
@given(finite, finite, st.floats(-0.2, 0.2), finite)
def test_pid_stays_in_range_and_does_not_wind_up(error, error_rate, integral, feedforward):
    out, new_integral = pid(error, error_rate, integral, feedforward, 1.0, 0.5, 0.1, -0.2, 0.2, 0.02)
    assert -0.2 <= out <= 0.2
    unlimited = feedforward + error + integral + 0.1 * error_rate
    if (unlimited > 0.2 and error > 0) or (unlimited < -0.2 and error < 0):
        assert new_integral == integral


def test_pid_leaves_saturation_as_soon_as_the_error_turns():
    integral = 0.0
    for _ in range(5000):
        out, integral = pid(5.0, 0.0, integral, 0.0, 0.1, 0.5, 0.0, -0.2, 0.2, 0.02)
    assert out == 0.2
    out, integral = pid(-0.5, 0.0, integral, 0.0, 0.1, 0.5, 0.0, -0.2, 0.2, 0.02)
    assert out < 0.2


def test_pid_removes_a_constant_load():
    x, integral = 0.0, 0.0
    for _ in range(20_000):
        out, integral = pid(1.0 - x, 0.0, integral, 0.0, 1.0, 0.5, 0.0, -5.0, 5.0, 0.01)
        x += 0.01 * (out - x - 0.7)
    assert x == pytest.approx(1.0, abs=1e-6)


@examples(200)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_roll_law_is_equation_37(ref, ref_rate, roll, roll_rate):
    assert roll_law(ref, ref_rate, roll, roll_rate, 0.3, 0.2) == pytest.approx(
        ref + 0.3 * (ref - roll) + 0.2 * (ref_rate - roll_rate)
    )
    assert roll_law(ref, ref_rate, ref, ref_rate, 0.3, 0.2) == ref
