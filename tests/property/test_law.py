"""The law at single states: V_dot as it should be, k2 as (29) and the model error bound want it.

s_dot is always taken from the plant's nu_dot with both inputs applied, never from the law's own f and g.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from glider.firmware.core.control.law import k2_to_cover
from glider.firmware.core.vehicle import layout
from tests.support.equations import k2_by_29
from tests.support.examples import examples
from tests.support.law_flights import (
    SLIDER,
    STANDING,
    Gains,
    Law,
    NeverSettled,
    form_at,
    lyapunov_rate,
    output_accelerations,
    outputs,
    plant_rates,
    without_stops,
    worst,
)
from tests.support.law_states import SPREAD, actuator_speeds, closed_loops, flying, forward, trimmed_vehicles, unit
from tests.support.model_states import HIGH, LOW, TAU, P, state


def arbitrate(law: Law, x, references, speeds=STANDING) -> None:
    """Put the actuators where the law wants them; a state at which there is no such place is none of the examples.

    There are such states: a mass far out turns the nose, but is itself to be turned.
    """
    try:
        law.arbitrate(x, references, speeds)
    except NeverSettled:
        assume(False)


@examples(300)
@given(st.data(), trimmed_vehicles(), st.sampled_from(["joint", "present"]), st.sampled_from([None, 0.1, 0.5]))
def test_V_falls_as_the_law_says_with_both_inputs_applied(data, vehicle, counting_on, share):
    """V_dot = -k3 s^2 - k2 |g| |s| sat(|s|/eps) sat(|g|/eps) for each axis, V_t of (36) for both, to rounding.

    Actuators ideal: where the law wants them with them there, moving at any speed the law knows of. With a share of the
    actuators' jerk given, V_dot is -|s| times the smaller of that push and sqrt(2 jerk |s|).
    """
    x, speeds, references, pitch, depth = data.draw(closed_loops(vehicle, flying(flows=forward)))
    law = Law(vehicle, pitch, depth, counting_on, share)
    arbitrate(law, x, references, speeds)
    command = x[layout.X_ACT :] + speeds * TAU
    np.testing.assert_allclose(plant_rates(vehicle, x, command)[layout.X_ACT :], speeds, atol=1e-12)
    _, s, g = law(x, references, speeds)
    found = lyapunov_rate(law, vehicle, x, references, command)
    wanted = -np.abs(s) * law.push(s, g)
    # rounding: of the accelerations that cancel, and of the fixed point
    size = np.abs(s) * (1.0 + np.abs(plant_rates(vehicle, x, command)[7:13]).max() + np.abs(x[SLIDER:]).max())
    assert (np.abs(found - wanted) <= 1e-11 * size).all()
    assert abs(found.sum() - wanted.sum()) <= 1e-11 * size.sum()
    assert found.sum() <= 1e-11 * size.sum()


@examples()
@given(st.data(), trimmed_vehicles())
def test_jointly_or_by_present_positions_settled_actuators_are_the_same(data, vehicle):
    x, speeds, references, pitch, depth = data.draw(closed_loops(vehicle, flying(flows=forward)))
    arbitrate(Law(vehicle, pitch, depth, "joint"), x, references, speeds)
    wanted = Law(vehicle, pitch, depth, "present")(x, references, speeds)[0]
    np.testing.assert_allclose(wanted, x[SLIDER:], rtol=1e-11, atol=1e-11)


@examples(300)
@given(flying(), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3), st.floats(0.05, 2.0), st.floats(0.001, 0.1), unit)
def test_k2_of_29_is_where_the_sliding_term_alone_begins_to_win(x, error_rate, acc, k1, k2, error):
    """(28) with the plant's pitch: with k2 above (29) V falls; below, it rises where s has the wrong sign."""
    vehicle, theta_rate = without_stops(P), outputs(x)[1]
    s = k1 * error + error_rate
    assume(abs(s) > 1e-6)
    x[SLIDER] = k2 * math.copysign(1.0, s)  # u = -k2 sign(s) sign(g), g < 0
    f_t, _, g_ts, g_tb, _, _ = form_at(vehicle, x)
    f = f_t + g_tb * x[SLIDER + 1]
    needed = k2_by_29(error_rate, acc, f, g_ts, k1)
    pitch_acc = output_accelerations(x, plant_rates(vehicle, x, x[layout.X_ACT :])[7:13])[0]
    V_dot = s * (k1 * error_rate - acc + pitch_acc)
    assert theta_rate == pytest.approx(outputs(x)[1])
    if k2 >= needed:
        assert V_dot <= 1e-10 * abs(s)
    elif s * (k1 * error_rate - acc + f) > 0.0:
        assert V_dot >= -1e-10 * abs(s)
    assert needed == pytest.approx(abs(k1 * error_rate - acc + f) / abs(g_ts))


corners = st.lists(st.sampled_from([-1.0, 1.0]), min_size=layout.N_P, max_size=layout.N_P)


@st.composite
def uncertain(draw) -> np.ndarray:
    """A true vehicle within three sigma of the believed one: at a corner of the box, or inside."""
    signs = np.array(draw(corners))
    return without_stops(P + draw(st.sampled_from([1.0, 1.0, 0.5])) * SPREAD * signs)


@examples(300)
@given(uncertain(), flying(), actuator_speeds)
def test_no_vehicle_in_the_box_is_further_off_than_the_bound(true, x, speeds):
    law = Law(without_stops(P), Gains(1, 0, 1, 1), Gains(1, 0, 1, 1))
    bound = law.error_bound(x, SPREAD, speeds)
    command = x[layout.X_ACT :] + np.array(speeds) * TAU
    believed, real = (
        output_accelerations(x, plant_rates(vehicle, x, command)[7:13]) for vehicle in (law.vehicle, true)
    )
    assert (np.abs(real - believed) <= bound + 1e-12).all()


def test_the_bound_is_no_wider_than_it_has_to_be():
    """The worst corner, by the sign of each parameter's own effect, takes up most of it in glides."""
    rng, law = np.random.default_rng(5), Law(without_stops(P), Gains(1, 0, 1, 1), Gains(1, 0, 1, 1))
    shares = []
    for _ in range(40):
        V = (rng.uniform(0.2, 0.6), *rng.uniform(-0.06, 0.06, 2))
        x = state((*rng.uniform(-0.8, 0.8, 2), 0.0), (*V, *rng.uniform(-0.2, 0.2, 3)), rng.uniform(LOW, HIGH))

        def off(change, x=x):
            vectors = (law.vehicle + change, law.vehicle)
            a, b = (output_accelerations(x, plant_rates(v, x, x[layout.X_ACT :])[7:13]) for v in vectors)
            return a - b

        effects = np.array([off(SPREAD * (np.arange(layout.N_P) == n)) for n in range(layout.N_P)])
        found = [abs(off(SPREAD * np.sign(effects[:, axis])))[axis] for axis in (0, 1)]
        shares.append(np.array(found) / law.error_bound(x, SPREAD))
    assert np.max(shares) <= 1.0
    assert (np.median(shares, axis=0) > 0.6).all()


def test_a_box_too_wide_for_a_mass_matrix_has_no_bound():
    spread = SPREAD.copy()
    spread[layout.A_Z] = 30.0  # kg, of a vehicle with 25 kg across
    law = Law(P, Gains(1, 0, 1, 1), Gains(1, 0, 1, 1))
    assert (law.error_bound(state((0.0, -0.4, 0.0), (0.4, 0.0, 0.02, 0.0, 0.0, 0.0)), spread) == math.inf).all()


gentle = flying(st.floats(-1.0, 1.0), forward, st.tuples(*[st.floats(-0.3, 0.3)] * 3))


@examples(300)
@given(st.data(), uncertain(), st.floats(0.0, 0.1), st.floats(0.0, 0.1))
def test_a_k2_that_covers_keeps_V_falling_in_every_vehicle_of_the_box(data, true, d_pitch, d_depth):
    """Outside the layer, V_dot <= -k3 s^2 with the worst disturbance within d and the law on the believed vehicle."""
    believed = without_stops(P)
    x, _, references, pitch, depth = data.draw(closed_loops(believed, gentle, 0.1))
    # mostly thin layers, so that most states are outside
    pitch, depth = (replace(a, eps=data.draw(st.sampled_from([a.eps, 0.01, 0.003]))) for a in (pitch, depth))
    strength, eps = np.array([d_pitch, d_depth]), np.array([pitch.eps, depth.eps])
    for _ in range(30):  # k2 moves the inputs, and they the bound
        law = Law(believed, pitch, depth)
        arbitrate(law, x, references)
        _, s, g = law(x, references)
        bound = law.error_bound(x, SPREAD)
        needed = [k2_to_cover(*numbers) for numbers in zip(bound, strength, g, eps, strict=True)]
        pitch, depth = (replace(a, k2=max(a.k2, k2)) for a, k2 in zip((pitch, depth), needed, strict=True))
        if (pitch.k2, depth.k2) == (law.pitch.k2, law.depth.k2):
            break
    else:
        assume(False)  # sat(g/eps) far below 1: a larger k2 asks for a larger one, without end
    V_dot = lyapunov_rate(law, true, x, references, x[layout.X_ACT :], worst(x, s, strength))
    outside = np.abs(s) >= eps
    k3 = law.coefficients()[2]
    assert (V_dot <= -k3 * s * s + 1e-9 * np.abs(s))[outside].all()
