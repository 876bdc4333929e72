"""Integration by the vehicle's time constants, over all that identification can return: stable, and no rate beyond the
vehicle's own."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.steps import MIDPOINT, RK4, end_stage, stable_product
from glider.firmware.core.maths.wide import LANES, as_wide
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.batch import nominal_batch
from glider.firmware.core.vehicle.flight import nominal_run
from glider.firmware.core.vehicle.motion import accelerations
from glider.firmware.core.vehicle.time_constants import MOST_PARTS, STABLE_SHARE, damping_rate, lag_rate, nominal_parts
from glider.firmware.core.vehicle.water import water_wrench
from glider.firmware.model.vehicle import COEFFICIENTS
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effect_plant import effect_parts, effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.hydrodynamics import extra_rate, extra_wrench
from glider.sim_backend.core.plant import plant_step
from glider.tools.inference.core.step import LARGEST_SPEED, MAX_STEP, propagate
from glider.tools.inference.prediction_error import LIMIT
from glider.tools.inference.vehicle_parameters import K_SHARE, LINEAR_DAMPING, coefficient_sizes
from tests.support.estimating import Filter
from tests.support.examples import examples
from tests.support.model_states import LOW, P, pitches, quaternions, state

K_P_OF_REAL_WINGS = -22.0  # kg s/rad, eleven times the shipped vehicle's
SIGNED = (layout.K_L, layout.K_BETA, layout.K_P, layout.K_M, layout.K_Q, layout.K_MY, layout.K_R)
SPEED = 1.0  # m/s
FINE = 0.001  # s


@st.composite
def identified(draw, damped: bool = False) -> np.ndarray:
    """Vehicles (N_P,) within LIMIT sigma of the priors, of the shipped file or of one with real wings.

    damped: those whose forces and moments damp the motion and whose trim is stable, as the shipped file's; any other
    diverges, and a coarse flight from a fine one with it.
    """
    vector = P.copy()
    vector[layout.K_P] = draw(st.sampled_from((P[layout.K_P], K_P_OF_REAL_WINGS)))
    spreads = K_SHARE * coefficient_sizes(vector)
    for name, spread in zip(COEFFICIENTS, spreads, strict=True):
        place = getattr(layout, name.upper())
        vector[place] += spread * draw(st.floats(-LIMIT, LIMIT))
        if name in ("K_D0", "K_D"):
            vector[place] = max(vector[place], 0.0)
        if damped and place in SIGNED:
            vector[place] = math.copysign(max(vector[place] * np.sign(P[place]), 0.0), P[place])
    for name, spread in LINEAR_DAMPING.items():
        vector[getattr(layout, name.upper())] = -spread * draw(st.floats(0.0, LIMIT))
    return vector


@st.composite
def flights(draw) -> np.ndarray:
    """States (N_X,) of a glide at up to SPEED: any attitude, at most 30 deg of attack and sideslip, rates to 0.5."""
    speed, alpha, beta = draw(st.floats(0.02, SPEED)), draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5))
    flow = np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])
    rates = draw(st.tuples(*[st.floats(-0.5, 0.5)] * 3))
    x = state((0.0, 0.0, 0.0), (*(speed * flow), *rates), draw(acts))
    x[3:7] = draw(quaternions())
    return x


acts = st.tuples(*(st.floats(0.9 * low, -0.9 * low) for low in LOW))


def has_a_direction(v) -> bool:
    """Whether the flow is neither abeam nor straight from astern, where alpha jumps."""
    speed = math.hypot(*v)
    return speed > 0.05 and math.hypot(v[0], v[2]) > 0.5 * speed and (v[0] > 0.0 or abs(v[2]) > 0.01)


speeds_anywhere = st.tuples(*[st.floats(-SPEED, SPEED)] * 3).filter(has_a_direction)


def decay(vehicle: np.ndarray, x: np.ndarray, wrench) -> float:
    """The fastest decay (1/s) by a wrench of nu: the eigenvalues of M^-1 d(wrench)/d(nu), by differences."""

    def rate(forces):
        still = accelerations(vehicle, *[0.0] * 9, *x[13:16], *[0.0] * 3, *[0.0] * 6)
        return np.array(accelerations(vehicle, *[0.0] * 9, *x[13:16], *[0.0] * 3, *forces)) - still

    J, h = np.empty((6, 6)), 1e-6
    for j in range(6):
        nu, back = x[7:13].copy(), x[7:13].copy()
        nu[j] += h
        back[j] -= h
        J[:, j] = (rate(wrench(*nu)) - rate(wrench(*back))) / (2.0 * h)
    return float(-np.linalg.eigvals(J).real.min())


@examples(300)
@given(identified(), speeds_anywhere, st.tuples(*[st.floats(-1.0, 1.0)] * 3), acts)
def test_no_motion_decays_faster_than_the_bound(vehicle, v, rates, act):
    x = state((0.0, 0.0, 0.0), (*v, *rates), act)
    found = decay(vehicle, x, lambda *nu: water_wrench(vehicle, *nu))
    assert found <= 1.15 * damping_rate(vehicle, x) + 0.05


@examples(200)
@given(
    speeds_anywhere, st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.floats(0.0, 20.0), st.floats(0.0, 20.0),
    st.floats(0.0, 2.0), st.floats(-0.9, 0.9), st.floats(0.0, 8.0), st.floats(0.0, 8.0),
)  # fmt: skip
def test_effects_add_no_more_than_their_bound(v, rates, drag, tether, across, asymmetry, pitch, yaw):
    F, effective, x = np.zeros(ef.N_F), np.zeros(layout.N_P), state((0.0, -0.3, 0.0), (*v, *rates), (0.0, 0.0, 0.0))
    F[ef.LINEAR_DRAG], F[ef.TETHER], F[ef.TETHER_ACROSS], F[ef.CLIMB_DIVE] = drag, tether, across, asymmetry
    F[ef.PITCH_DAMPING_ACROSS], F[ef.YAW_DAMPING_ACROSS] = pitch, yaw
    effective_parameters(P, F, effective)

    def wrench(*nu):
        return np.array(water_wrench(effective, *nu)) + extra_wrench(effective, F, 0.3, 0.0, *nu)

    found = decay(effective, x, wrench)
    assert found <= 1.15 * (damping_rate(effective, x) + extra_rate(effective, F, x)) + 0.05


@pytest.mark.parametrize("method", [RK4, MIDPOINT], ids=["RK4", "midpoint"])
def test_limits_of_stability_are_the_methods_own(method):
    """x' = -x in steps of z: |R(z)| is below 1 before the limit, and above it behind."""

    def shrunk(z):
        x, k, total, y = np.array([1.0]), np.zeros(1), np.zeros(1), np.array([1.0])
        for stage in range(len(method)):
            k[:] = -y
            end_stage(method, stage, z, x, k, total, y, 1)
        return abs(x[0])

    assert shrunk(0.999 * stable_product(method)) < 1.0 < shrunk(1.001 * stable_product(method))
    assert shrunk(STABLE_SHARE * stable_product(method)) < 0.85


@examples(200)
@given(flights(), pitches)
def test_the_shipped_vehicle_is_flown_in_whole_steps(x, pitch):
    x[7:10] *= 0.7  # of SPEED: what it reaches
    assert nominal_parts(RK4, P, x, 0, MAX_STEP) == 1.0
    assert nominal_parts(MIDPOINT, P, x, 0, MAX_STEP) == 1.0
    x[7:10] *= kf.SPEED_LIMIT / 0.7
    assert nominal_parts(MIDPOINT, P, x, 0, kf.MAX_STEP) == 1.0


def test_only_actuators_under_command_have_a_lag():
    assert lag_rate(P, 0) == pytest.approx(1.0 / P[layout.SERVO_TAU])
    assert lag_rate(P, kf.SERVO_DRIVEN) == pytest.approx(1.0 / P[layout.SLIDER_TAU])
    assert lag_rate(P, kf.SERVO_DRIVEN + kf.SLIDER_DRIVEN + kf.BALLAST_DRIVEN) == 0.0


def test_a_state_of_no_vehicle_takes_bounded_time():
    x = state((0.0, 0.0, 0.0), (1e9, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert nominal_parts(RK4, P, x, 0, MAX_STEP) == MOST_PARTS
    x[7] = math.nan
    assert nominal_parts(RK4, P, x, 0, MAX_STEP) == 1.0


# --- flights: a coarse step against a fine one ----------------------------------------------------------------------


def extended(x: np.ndarray) -> np.ndarray:
    whole = np.zeros(ef.N_XF)
    whole[: layout.N_X] = x
    whole[ef.X_GEAR_SERVO], whole[ef.X_GEAR_SLIDER] = x[13], x[14]
    return whole


@kernel
def predict(vehicle, F, x, mode, t, inputs, acc, zero, work, kept, method, out):
    """Fly the rows of t as inference does, out (rows, N_XF) the states."""
    for i in range(1, len(t)):
        propagate(vehicle, F, x, mode, t, inputs, i, 0, acc, zero, work, kept, method)
        for n in range(ef.N_XF):
            out[i, n] = x[n]


def predicted(vehicle: np.ndarray, x: np.ndarray, command, dt: float, seconds: float, method=RK4) -> np.ndarray:
    """States (rows, N_XF) at every row of MAX_STEP, in rows of dt."""
    t, whole = np.arange(round(seconds / dt) + 1) * dt, extended(x)
    out, inputs = np.empty((len(t), ef.N_XF)), np.tile(np.asarray(command, float), (len(t), 1))
    out[0] = whole
    scratch = np.zeros((4, ef.N_XF)), np.zeros(ef.N_XF)
    predict(vehicle, np.zeros(ef.N_F), whole, 0, t, inputs, np.zeros(6), np.zeros(3), *scratch, method, out)
    return out[:: round(MAX_STEP / dt)]


@kernel
def predict_wide(Ps, F, xs, mode, t, inputs, acc, zero, works, kepts, method, outs):
    """As predict, for tables (.., LANES)."""
    predict(
        as_wide(Ps), as_wide(F), as_wide(xs), mode, t, inputs, as_wide(acc), zero, as_wide(works), as_wide(kepts),
        method, as_wide(outs),
    )  # fmt: skip


def side_by_side(vehicles, x, command, seconds: float) -> np.ndarray:
    """States (rows, N_XF, LANES) of so many vehicles from one state, in rows of MAX_STEP."""
    t = np.arange(round(seconds / MAX_STEP) + 1) * MAX_STEP
    Ps, xs = np.array(vehicles).T.copy(), np.tile(extended(x)[:, None], (1, LANES))
    outs, inputs = np.empty((len(t), ef.N_XF, LANES)), np.tile(np.asarray(command, float), (len(t), 1))
    outs[0] = xs
    scratch = np.zeros((4, ef.N_XF, LANES)), np.zeros((ef.N_XF, LANES))
    F, acc = np.zeros((ef.N_F, LANES)), np.zeros((6, LANES))
    predict_wide(Ps, F, xs, 0, t, inputs, acc, np.zeros(3), *scratch, RK4, outs)
    return outs


def assert_alike(coarse: np.ndarray, fine: np.ndarray, share: float = 0.05) -> None:
    """Places, attitudes and speeds to `share`, and no rate of the coarse flight beyond those of the fine one."""
    assert np.isfinite(coarse).all()
    for part in (slice(0, 3), slice(3, 7), slice(7, 10)):
        scale = max(float(np.abs(fine[:, part]).max()), 0.1)
        assert np.abs(coarse[:, part] - fine[:, part]).max() <= share * scale
    assert np.abs(coarse[:, 10:13]).max() <= 1.1 * np.abs(fine[:, 10:13]).max() + 0.02


@examples(60)
@given(identified(damped=True), flights(), acts)
@pytest.mark.parametrize("method", [RK4, MIDPOINT], ids=["RK4", "midpoint"])
def test_predictions_are_those_of_a_fine_step(method, vehicle, x, command):
    coarse, fine = (predicted(vehicle, x, command, dt, 2.0, method) for dt in (MAX_STEP, FINE))
    assert_alike(coarse, fine)


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("k_p", [-2.0, -13.0, -22.0])
def test_real_wings_are_predicted_over_a_whole_window(k_p, speed):
    vehicle = P.copy()
    vehicle[layout.K_P] = k_p
    x = state((0.5, -0.3, 0.2), (speed, 0.05, 0.05, 0.4, 0.1, -0.1), (0.0, 0.0, 0.0))
    coarse, fine = (predicted(vehicle, x, (0.6, 0.02, 0.2), dt, 20.0) for dt in (MAX_STEP, FINE))
    assert_alike(coarse, fine, 0.01)


def test_lanes_take_their_own_number_of_parts_whatever_flies_beside_them():
    fleet = [P.copy() for _ in range(4)]
    for vehicle, k_p in zip(fleet, (-2.0, -13.0, -22.0, -50.0), strict=True):
        vehicle[layout.K_P] = k_p
    x, command = state((0.5, -0.3, 0.2), (0.9, 0.05, 0.05, 0.4, 0.1, -0.1), (0.0, 0.0, 0.0)), (0.6, 0.02, 0.2)
    parts = [effect_parts(RK4, vehicle, np.zeros(ef.N_F), extended(x), 0, MAX_STEP) for vehicle in fleet]
    assert parts == sorted(set(parts))
    together = side_by_side([fleet[n % 4] for n in range(LANES)], x, command, 10.0)
    for lane in range(LANES):
        alone = side_by_side([fleet[lane % 4]] * LANES, x, command, 10.0)[:, :, 0]
        np.testing.assert_array_equal(together[:, :, lane], alone)
        np.testing.assert_allclose(alone, predicted(fleet[lane % 4], x, command, MAX_STEP, 10.0), rtol=0.0, atol=1e-9)


@examples(60)
@given(identified(damped=True), flights(), acts, st.sampled_from((0.01, 0.05)))
def test_the_plant_flies_as_with_a_fine_step(vehicle, x, command, dt):
    sea, waves, work = np.zeros(wl.N_ENV), np.zeros((0, wl.N_WAVE)), np.zeros((wl.N_WORK, wl.WORK_WIDTH))

    def flown(step):
        whole, rows = extended(x), []
        for k in range(round(1.0 / step)):
            plant_step(vehicle, sea, waves, whole, np.array(command), k * step, step, np.zeros(6), work)
            rows.append(whole[: layout.N_X].copy())
        return np.array(rows)

    coarse, fine = flown(dt), flown(FINE)
    every = round(dt / FINE)
    assert_alike(coarse, fine[every - 1 :: every])
    batch = np.array([x, x])  # the nominal plant by the same steps, plain and wide
    nominal_batch(np.array([vehicle, P]), batch, np.array([command, command]), np.zeros((2, 3)), dt, round(1.0 / dt))
    np.testing.assert_allclose(batch[0], coarse[-1], rtol=0.0, atol=1e-6)
    alone = x.copy()
    nominal_run(vehicle, alone, *command, 0.0, 0.0, 0.0, dt, round(1.0 / dt), np.zeros((3, layout.N_X)))
    np.testing.assert_allclose(alone, coarse[-1], rtol=0.0, atol=1e-12)


@examples(30)
@given(identified(damped=True), flights(), acts)
def test_the_filter_flies_as_with_a_fine_step(vehicle, x, command):
    def flown(dt, mode):
        one = Filter(mode=mode)
        one.P[:] = vehicle
        one.start()
        one.x[: layout.N_X] = x
        rows = []
        for _ in range(round(1.0 / dt)):
            one.predict(dt, command)
            rows.append(one.x[: layout.N_X].copy())
        return one, np.array(rows)

    coarse, rows = flown(kf.MAX_STEP, 0)
    assert np.linalg.eigvalsh(coarse.cov).min() > -1e-12
    fine, exact = flown(FINE, 0)
    every = round(kf.MAX_STEP / FINE)
    assert_alike(rows, exact[every - 1 :: every])
    rate = np.sqrt(np.diag(coarse.cov)[kf.E_NU + 3 : kf.E_ACT] / np.diag(fine.cov)[kf.E_NU + 3 : kf.E_ACT])
    assert (rate < 2.0).all()


@examples(40)
@given(identified(), st.tuples(*[st.floats(-19.0, 19.0)] * 6))
def test_a_model_that_has_left_every_vehicle_stays_a_number(vehicle, nu):
    """Beyond MOST_PARTS no step is stable: the model is held where it was, whatever overflowed."""
    x = state((0.0, 0.0, 0.0), nu, (0.0, 0.0, 0.0))
    flown = predicted(vehicle, x, (0.0, 0.0, 0.0), MAX_STEP, 2.0)
    assert np.isfinite(flown).all()
    assert np.abs(flown[:, 7:13]).max() < LARGEST_SPEED
