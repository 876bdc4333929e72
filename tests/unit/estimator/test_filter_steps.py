"""One prediction, one measurement: against the textbook's matrices, and what does not fit."""

import math

import numba
import numpy as np
import pytest

from glider.firmware.core.estimation.estimator import estimator_step
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.vehicle.flight import nominal_run
from glider.firmware.core.vehicle.layout import N_X
from glider.firmware.core.vehicle.linearise import linearise
from tests.support.estimating import Filter, state_error

HERE = dict(roll=0.0, pitch=-0.2, yaw=0.5, p=0.0, q=0.0, r=0.0, depth=2.0, slider=0.0, ballast=0.0)


def test_prediction_follows_the_nominal_flight():
    filtered = Filter().start()
    x, work = filtered.x[:N_X].copy(), np.zeros((5, N_X))
    for _ in range(50):
        filtered.predict(0.1, (0.3, 0.02, 0.15))
    nominal_run(filtered.P, x, 0.3, 0.02, 0.15, 0.0, 0.0, 0.0, 0.02, 250, work)
    np.testing.assert_allclose(filtered.x[:N_X], x, atol=2e-4)


def test_prediction_of_the_covariance_is_f_p_f_plus_q():
    filtered = Filter(uncertain=False).start()
    rng = np.random.default_rng(2)
    root = rng.standard_normal((kf.N_E, kf.N_E))
    filtered.cov[:] = root @ root.T
    before, x = filtered.cov.copy(), filtered.x.copy()
    A, y = np.zeros((kf.N_MOVING, kf.N_COUPLED)), np.zeros(kf.N_W)
    linearise(filtered.P, x, 0.0, 0.0, 0.0, A, y)
    dt, F = 0.02, np.eye(kf.N_E)
    F[: kf.N_MOVING, : kf.N_COUPLED] += dt * A
    F[0, kf.E_WATER] = F[1, kf.E_WATER + 1] = dt
    for i in range(6):
        F[kf.E_NU + i, kf.E_ERR + i] = dt
        F[kf.E_ERR + i, kf.E_ERR + i] = math.exp(-dt / filtered.settings[kf.S_ERROR_TIME])
    for i, tau in enumerate((0.10, 0.15, 0.30)):
        F[kf.E_ACT + i, kf.E_ACT + i] = math.exp(-dt / tau)
    filtered.predict(dt)
    Q = np.zeros(kf.N_E)
    disturbance = filtered.vehicle.disturbance
    Q[kf.E_NU : kf.E_ACT] = np.repeat([disturbance.linear**2, disturbance.angular**2], 3) * 0.1 * dt
    Q[kf.E_ACT : kf.E_ERR] = filtered.settings[kf.S_SERVO : kf.S_BALLAST + 1] * dt
    Q[kf.E_GYRO :] = filtered.settings[kf.S_WALK : kf.S_R] * dt
    np.testing.assert_allclose(filtered.cov, F @ before @ F.T + np.diag(Q), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["roll", "pitch", "yaw", "q", "depth", "slider", "mocap_y", "mocap_yaw"])
def test_an_update_is_the_textbooks(name):
    filtered = Filter().start(euler=(0.5, -0.4, 1.0))
    rng = np.random.default_rng(3)
    root = 0.01 * rng.standard_normal((kf.N_E, kf.N_E))
    filtered.cov[:] = root @ root.T
    before, x = filtered.cov.copy(), filtered.x.copy()
    f, th = 0.5, -0.4
    rows = {
        "roll": [1.0, math.sin(f) * math.tan(th), math.cos(f) * math.tan(th)],
        "pitch": [0.0, math.cos(f), -math.sin(f)],
        "yaw": [0.0, math.sin(f) / math.cos(th), math.cos(f) / math.cos(th)],
    }
    H = np.zeros(kf.N_E)
    places = {"q": [kf.E_NU + 4, kf.E_GYRO + 1], "depth": [2], "slider": [kf.E_ACT + 1], "mocap_y": [1]}
    now = {"roll": f, "pitch": th, "yaw": 1.0, "mocap_yaw": 1.0, "depth": 2.0}.get(name, 0.0)
    if name in places:
        H[places[name]] = 1.0
    else:
        H[kf.E_ATT : kf.E_NU] = rows[name.removeprefix("mocap_")]
    R = filtered.settings[kf.S_R + getattr(kf, f"Z_{name.upper()}")]
    S = H @ before @ H + R
    K = before @ H / S
    innovation = 2.0 * math.sqrt(S)
    scores = filtered.update(**{name: now + innovation})
    assert scores[getattr(kf, f"Z_{name.upper()}")] == pytest.approx(2.0)
    IKH = np.eye(kf.N_E) - np.outer(K, H)
    np.testing.assert_allclose(filtered.cov, IKH @ before @ IKH.T + R * np.outer(K, K), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(filtered.x[7:13] - x[7:13], (K * innovation)[kf.E_NU : kf.E_ACT], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(filtered.x[:3] - x[:3], (K * innovation)[:3], rtol=1e-9, atol=1e-12)


def test_what_is_missing_or_no_number_changes_nothing():
    filtered = Filter().start()
    x, cov = filtered.x.copy(), filtered.cov.copy()
    for value in (math.nan, math.inf, -math.inf, 1e30):
        scores = filtered.take(np.full(kf.N_Z, value))
        assert np.isnan(scores).all()
    np.testing.assert_array_equal(filtered.x, x)
    np.testing.assert_array_equal(filtered.cov, cov)


@pytest.mark.parametrize("broken", ["state", "covariance"])
def test_a_measurement_whose_score_is_no_number_is_rejected(broken):
    filtered = Filter().start()
    if broken == "state":
        filtered.x[2] = math.nan
    else:
        filtered.cov[kf.E_POS + 2, kf.E_POS + 2] = math.nan
    before = filtered.x.copy()
    scores = filtered.update(depth=2.0)
    assert np.isnan(scores[kf.Z_DEPTH])
    assert filtered.rejected_for_s[kf.Z_DEPTH] == pytest.approx(0.1)
    np.testing.assert_allclose(filtered.x, before, rtol=1e-14, atol=0.0)


def arbitrate(filtered: Filter, seconds: float = 5.0) -> None:
    """Readings that agree with the filter itself, for a while."""
    for _ in range(round(seconds / 0.1)):
        filtered.predict(0.1)
        filtered.update(depth=filtered.x[2], **{k: v for k, v in readings(filtered).items() if k != "depth"})


def readings(filtered: Filter) -> dict[str, float]:
    from glider.firmware.core.maths.rotations import euler_from_quaternion

    angles = euler_from_quaternion(*filtered.x[3:7])
    values = (*angles, *filtered.x[10:13], filtered.x[2], filtered.x[14], filtered.x[15])
    return dict(zip(HERE, map(float, values), strict=True))


def test_a_spike_moves_nothing():
    filtered = Filter().start()
    arbitrate(filtered)
    filtered.predict(0.1)
    x = filtered.x.copy()
    scores = filtered.update(depth=x[2] + 5.0)
    assert scores[kf.Z_DEPTH] > kf.GATE
    np.testing.assert_allclose(filtered.x, x, rtol=1e-14, atol=0.0)


def test_a_sensor_that_stays_away_is_followed_in_the_end():
    filtered = Filter().start()
    arbitrate(filtered)
    speed = filtered.x[7:10].copy()
    jump = filtered.x[2] + 0.5
    for _ in range(round(kf.REJECTED_AT_MOST / 0.1) + 3):
        filtered.predict(0.1)
        filtered.update(**{**readings(filtered), "depth": jump})
        assert filtered.positive_definite()
    assert filtered.x[2] == pytest.approx(jump, abs=0.05)
    # the depth jumped, the vehicle did not speed off
    np.testing.assert_allclose(filtered.x[7:10], speed, atol=0.1)


def test_a_gyro_that_disagrees_with_the_attitude_is_not_believed():
    filtered = Filter().start()
    arbitrate(filtered)
    for _ in range(100):
        filtered.predict(0.1)
        filtered.update(**{**readings(filtered), "q": 0.5})
    assert abs(filtered.x[11]) < 0.05


def test_a_biased_gyro_is_found_out_by_the_attitude():
    filtered = Filter().start(spread=None)
    for _ in range(200):
        filtered.predict(0.1)
        seen = readings(filtered)
        filtered.update(**{**seen, "r": 0.01, "yaw": 0.5})
    assert filtered.x[kf.X_GYRO + 2] == pytest.approx(0.01, abs=0.003)
    assert abs(filtered.x[12]) < 0.004


def test_yaw_is_taken_the_short_way_round():
    filtered = Filter().start(euler=(0.0, 0.0, math.pi - 0.01))
    for _ in range(20):
        filtered.update(yaw=-math.pi + 0.01)
    assert abs(readings(filtered)["yaw"]) > math.pi - 0.02


def test_near_the_vertical_only_pitch_is_taken():
    filtered = Filter().start(euler=(0.3, 1.52, 0.2))
    scores = filtered.update(roll=0.3, pitch=1.52, yaw=0.2)
    assert np.isfinite(scores[kf.Z_PITCH])
    assert np.isnan(scores[[kf.Z_ROLL, kf.Z_YAW]]).all()
    assert np.isfinite(filtered.x).all()


def test_a_long_step_is_many_short_ones():
    one, many = Filter().start(), Filter().start()
    one.predict(0.1, (0.4, 0.01, 0.1))
    for _ in range(5):
        many.predict(0.02, (0.4, 0.01, 0.1))
    np.testing.assert_allclose(one.x, many.x, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(one.cov, many.cov, rtol=1e-9, atol=1e-15)


def test_an_unseen_servo_is_found_from_the_motion():
    mode = kf.SERVO_DRIVEN | kf.SLIDER_DRIVEN | kf.BALLAST_DRIVEN
    truth, filtered = Filter().start(speed=0.4), Filter(mode=mode).start(speed=0.4)
    rng = np.random.default_rng(4)
    for _ in range(100):
        truth.predict(0.1, (0.5, 0.0, 0.0))
        filtered.predict(0.1, (0.0, 0.0, 0.0))
        seen = {name: value + 0.002 * rng.standard_normal() for name, value in readings(truth).items()}
        filtered.update(**seen)
    assert filtered.x[13] == pytest.approx(0.5, abs=0.05)


@numba.njit
def many_steps(count, P, settings, sigma, x, cov, inflation, z, rejected_for_s, scores, work):
    for _ in range(count):
        estimator_step(P, settings, sigma, x, cov, inflation, 0, 0.1, 0.01, 0.1, 0.02, z, rejected_for_s, scores, work)


def test_a_step_allocates_nothing():
    from numba.core.runtime import _nrt_python, rtsys

    _nrt_python.memsys_enable_stats()
    filtered = Filter().start()
    z = np.full(kf.N_Z, 0.1)

    def allocated(count: int) -> int:
        before = rtsys.get_allocation_stats().alloc
        arrays = (filtered.P, filtered.settings, filtered.sigma, filtered.x, filtered.cov, filtered.inflation)
        many_steps(count, *arrays, z, filtered.rejected_for_s, filtered.scores, filtered.work)
        return rtsys.get_allocation_stats().alloc - before

    allocated(1)
    assert allocated(1000) == allocated(1)  # what is left is the call's own arguments


def test_the_covariance_stays_sound_under_nonsense():
    filtered = Filter().start()
    rng = np.random.default_rng(5)
    for _ in range(2000):
        filtered.predict(0.02, rng.normal(0.0, 0.3, 3))
        z = rng.normal(0.0, 3.0, kf.N_Z)
        z[rng.random(kf.N_Z) < 0.3] = np.nan
        filtered.take(z, 0.02)
    assert np.isfinite(filtered.x).all()
    assert np.isfinite(filtered.cov).all()
    assert filtered.positive_definite()


def test_a_linearised_flight_that_is_held_serves_as_well_as_a_fresh_one():
    held, fresh = Filter().start(), Filter(mode=kf.FRESH).start()
    rng = np.random.default_rng(6)
    for i in range(1500):
        commands = (0.5 * math.sin(0.002 * i), 0.02 * math.sin(0.005 * i), 0.15 * math.cos(0.004 * i))
        fresh.predict(0.02, commands)
        seen = {name: value + 0.003 * rng.standard_normal() for name, value in readings(fresh).items()}
        fresh.update(0.02, **seen)
        held.predict(0.02, commands)
        held.update(0.02, **seen)
    sure = np.sqrt(np.diag(fresh.cov))[: kf.E_ERR]
    np.testing.assert_allclose(np.sqrt(np.diag(held.cov))[: kf.E_ERR], sure, rtol=0.05)
    assert (np.abs(state_error(fresh.x, held.x)) < 0.2 * sure).all()
