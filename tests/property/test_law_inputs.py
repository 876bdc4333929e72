"""What the law makes of whatever comes in: inputs within reach, flags in place of commands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.control.input_forms import exact_form, paper_form
from glider.firmware.core.control.law import (
    NOT_FINITE,
    OK,
    STEEP,
    axis_demand,
    k2_to_cover,
    pitch_depth_law,
    solve_inputs,
)
from glider.firmware.core.control.law_plus import reach
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rate, limited
from tests.support.equations import k2_by_29
from tests.support.examples import examples
from tests.support.law_flights import SLIDER, down, form_at
from tests.support.law_states import flying, gains, unit
from tests.support.model_states import HIGH, LOW, RATE, TAU, P, state


@examples()
@given(flying(), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2))
def test_each_axis_counts_on_the_other_only_within_bounds(x, demand_t, demand_z):
    _, _, g_ts, g_tb, g_zs, g_zb = form_at(P, x)
    horizon, cos_pitch = 0.17, math.hypot(*down(x)[1:])
    tables = [P[layout.SLIDER_MIN :][:4], P[layout.BALLAST_MIN :][:4]]
    bounds = [bound for i in (0, 1) for bound in reach(x[SLIDER + i], *tables[i], horizon)]
    everywhere = (-np.inf, np.inf, -np.inf, np.inf)
    joint_s, joint_b, _ = solve_inputs(g_ts, g_tb, g_zs, g_zb, demand_t, demand_z, cos_pitch, *everywhere)
    u_s, u_b, status = solve_inputs(g_ts, g_tb, g_zs, g_zb, demand_t, demand_z, cos_pitch, *bounds)
    assert status == OK
    assert g_ts * joint_s + g_tb * joint_b == pytest.approx(demand_t, abs=1e-12)
    assert g_zs * joint_s + g_zb * joint_b == pytest.approx(demand_z, abs=1e-12)
    near_s, near_b = np.clip(joint_s, *bounds[:2]), np.clip(joint_b, *bounds[2:])
    assert g_ts * u_s + g_tb * near_b == pytest.approx(demand_t, abs=1e-12)
    assert g_zs * near_s + g_zb * u_b == pytest.approx(demand_z, abs=1e-12)
    if (near_s, near_b) == (joint_s, joint_b):
        assert (u_s, u_b) == (joint_s, joint_b)


@examples()
@given(unit, unit, st.floats(0.0, 3.0), st.sampled_from([0, 1, 2]))
def test_no_command_takes_an_actuator_out_of_reach(where, command, horizon, which):
    low, high, rate, tau = LOW[which], HIGH[which], RATE[which], TAU[which]
    begin = position = 0.5 * (low + high) + 0.5 * (high - low) * where
    least, most = reach(begin, low, high, rate, tau, horizon)
    steps = 2000
    for _ in range(steps):
        position += horizon / steps * actuator_rate(position, 2.0 * high * command, low, high, rate, tau)
    slack = 1e-3 * (high - low)  # of Euler's method
    assert least - slack <= position <= most + slack
    assert low <= least <= begin <= most <= high
    # and the command that asks for most gets most of the way there
    if command == 1.0:
        assert position - begin >= 0.6 * (most - begin) - slack


# --- whatever comes in ----------------------------------------------------------------------------------------------

anything = st.floats(allow_nan=True, allow_infinity=True, width=64)
plausible = st.floats(-2.0, 2.0)
number = st.one_of(plausible, plausible, plausible, plausible, anything)


@examples(500)
@given(
    st.lists(number, min_size=15, max_size=15), st.lists(number, min_size=6, max_size=6),
    st.lists(number, min_size=10, max_size=10), st.tuples(*[number] * 4), st.floats(LOW[1], HIGH[1]),
    st.floats(LOW[2], HIGH[2]), st.booleans(),
)  # fmt: skip
def test_no_input_whatever_makes_a_command_that_is_not_one(seen, errors, gain, bounds, slider, ballast, paper):
    """k, nu, actuators, their speeds, errors, gains, bounds: all NaN, infinite or absurd if it comes to that."""
    form = (paper_form if paper else exact_form)(P, *seen)
    pitch, depth = (*errors[:3], *gain[:5]), (*errors[3:], *gain[5:])
    u_s, u_b, _, _, status = pitch_depth_law(*form, 0.8, *pitch, *depth, *bounds)
    assert status in (OK, STEEP, NOT_FINITE)
    assert math.isfinite(u_s)
    assert math.isfinite(u_b)
    if status != OK:
        assert (u_s, u_b) == (0.0, 0.0)
    for u, last, index in ((u_s, slider, 1), (u_b, ballast, 2)):
        sent = limited(u, last, LOW[index], HIGH[index], RATE[index], 0.02)
        assert LOW[index] <= sent <= HIGH[index]
        assert abs(sent - last) <= RATE[index] * 0.02 * (1.0 + 1e-9)


GLIDE = state((0.1, -0.4, 0.0), (0.4, 0.0, 0.03, 0.0, 0.02, 0.0), (0.1, 0.01, 0.1))
SOUND = [*form_at(P, GLIDE), math.cos(0.4), 0.1, 0.02, 0.0, 0.8, 0.01, 0.8, 0.1, math.inf,
         0.2, 0.03, 0.0, 0.3, 0.05, 0.4, 0.05, math.inf, -math.inf, math.inf, -math.inf, math.inf]  # fmt: skip


def test_sound_numbers_give_inputs():
    u_s, u_b, s_t, s_z, status = pitch_depth_law(*SOUND)
    assert (status, s_t, s_z) == (OK, pytest.approx(0.1), pytest.approx(0.09))
    assert u_s > 0.01  # nose above its reference: mass forward
    assert u_b < 0.1  # below its depth: lighter


@pytest.mark.parametrize("place", range(len(SOUND)))
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_one_bad_number_is_noticed(place, bad):
    """What is infinite may be harmless (a bound, eps); what is NaN never is."""
    numbers = list(SOUND)
    numbers[place] = bad
    u_s, u_b, _, _, status = pitch_depth_law(*numbers)
    if math.isnan(bad):
        assert status == NOT_FINITE
    if status != OK:
        assert (u_s, u_b) == (0.0, 0.0)
    assert math.isfinite(u_s)
    assert math.isfinite(u_b)


@pytest.mark.parametrize(("pitch_deg", "status"), [(80.0, OK), (84.0, OK), (84.5, STEEP), (90.0, STEEP), (-86, STEEP)])
@pytest.mark.parametrize("roll_deg", [0.0, 90.0, -90.0, 180.0])
def test_steep_is_said(pitch_deg, status, roll_deg):
    theta = math.radians(pitch_deg)
    x = state((math.radians(roll_deg), theta, 0.3), (0.3, 0.02, 0.03, 0.02, 0.02, 0.0), (0.1, 0.01, 0.1))
    numbers = [*form_at(P, x), math.cos(theta), *SOUND[7:]]
    u_s, _, _, _, found = pitch_depth_law(*numbers)
    assert found in ((status,) if status == OK else (STEEP, NOT_FINITE))
    assert (u_s == 0.0) == (status != OK)


def test_no_grip_at_all_is_no_division_by_zero():
    assert k2_by_29(0.1, 0.0, 0.1, 0.0, 1.0) == math.inf
    assert k2_to_cover(0.1, 0.1, 0.0, 0.05) == math.inf
    assert solve_inputs(0.0, 0.0, 0.0, 0.4, 0.1, 0.1, 0.9, *SOUND[-4:]) == (0.0, 0.0, STEEP)


@examples()
@given(unit, unit, st.floats(-0.3, 0.3), unit, gains(0.1))
def test_demand_is_30_and_32(error, error_rate, acc, f, gain):
    """As printed, sat written out: u = (1/g)(-k1 e_d + x_dd_ref - f - k3 s) - k2 sat(s/eps) sat(g/eps)."""
    for g in (-7.5, 0.39):
        demand, s = axis_demand(error, error_rate, acc, f, g, *vars(gain).values(), math.inf)
        assert s == pytest.approx(gain.k1 * error + error_rate, abs=1e-15)
        saturated = np.clip(s / gain.eps, -1.0, 1.0) * np.clip(g / gain.eps, -1.0, 1.0)
        u = (-gain.k1 * error_rate + acc - f - gain.k3 * s) / g - gain.k2 * saturated
        assert demand == pytest.approx(g * u, rel=1e-12, abs=1e-12)
        braked, _ = axis_demand(error, error_rate, acc, f, g, *vars(gain).values(), 0.05)
        free = -gain.k1 * error_rate + acc - f
        held = math.copysign(min(abs(free - demand), math.sqrt(0.1 * abs(s))), free - demand)
        assert braked == pytest.approx(free - held, rel=1e-12, abs=1e-12)
