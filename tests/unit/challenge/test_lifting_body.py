"""The water's forces on a vehicle of another form, and that such vehicles fly about as ROUGHIE does."""

import math

import numpy as np
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle import layout
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign import lifting_body as body
from glider.sim_backend.foreign.foreign_flight import fly_foreign
from glider.sim_backend.foreign.foreign_mission import fly_mission
from glider.tools.data.sources import load_mission, load_vehicle
from glider.tools.verify.challenge.design import POOL, draw_run
from glider.tools.verify.challenge.form_cases import FormTrial, gross_behaviour, pilot_of, plausible
from glider.tools.verify.challenge.form_vehicle import COEFFICIENTS, draw_body, spheroid
from glider.tools.verify.challenge.forms import draw_waves

pytestmark = pytest.mark.computes(seconds=20)

VEHICLE = load_vehicle("roughie")
MISSIONS = ("sawtooth", "spiral", "circle_to_s")


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    return draw_body(np.random.default_rng(seed), VEHICLE)


def symmetric(seed: int) -> np.ndarray:
    """A drawn body with every surface set straight."""
    F = drawn(seed)[1]
    for number in range(4):
        F[fo.FB_SURFACES + number * fo.N_FBS + fo.FBS_INCIDENCE] = 0.0
    return F


def test_formulas_keep_to_their_sources():
    assert body.ittc_friction(1e6) == pytest.approx(0.075 / 16.0)
    assert body.blasius_friction(1e4) == pytest.approx(0.01328)
    assert body.helmbold_slope(1e6) == pytest.approx(2.0 * math.pi, rel=1e-4)  # a wing without ends
    assert body.helmbold_slope(0.01) == pytest.approx(0.5 * math.pi * 0.01, rel=1e-2)  # a slender one (Jones)
    k1, k2, turning = spheroid(6.01)  # Lamb's table: 0.045, 0.918, 0.764
    assert (k1, k2, turning) == pytest.approx((0.045, 0.918, 0.764), abs=2e-3)
    # beyond the stall: continuous there, a flat plate across the flow
    at, most = body.stalled(0.2, 8.0, 0.2, 0.9, 0.06), 1.11 + 0.018 * 8.0
    assert at == pytest.approx((0.9, 0.06))
    assert body.stalled(0.5 * math.pi, 8.0, 0.2, 0.9, 0.06) == pytest.approx((0.0, most), abs=1e-9)


def test_a_lift_curve_is_odd_and_has_no_jumps():
    angles = np.linspace(-math.pi, math.pi, 20001)
    found = np.array([body.section(angle, 10.0, 0.2, 0.02, 0.85) for angle in angles])
    np.testing.assert_allclose(found[:, 0], -found[::-1, 0], atol=1e-12)
    np.testing.assert_allclose(found[:, 1], found[::-1, 1], atol=1e-12)
    assert (found[:, 1] >= 0.02).all()
    ahead = np.abs(angles) < 0.5 * math.pi - 1e-3
    assert np.abs(np.diff(found[ahead], axis=0)).max() < 0.01
    small = np.abs(angles) < 0.1
    np.testing.assert_allclose(found[small, 0], body.helmbold_slope(10.0) * angles[small], atol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_water_takes_energy_whatever_the_motion(seed):
    F, rng = drawn(seed)[1], np.random.default_rng(1000 + seed)
    for _ in range(2000):
        nu = rng.standard_normal(6) * (0.4, 0.4, 0.4, 1.0, 1.0, 1.0) * 10.0 ** rng.uniform(-2.0, 0.5)
        assert np.dot(body.body_wrench(F, *nu), nu) <= 1e-15
    still = np.array(body.body_wrench(F, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert not still.any()


@pytest.mark.parametrize("speed", [0.0, 0.1, 0.35])
@pytest.mark.parametrize("axis", [3, 4, 5])
def test_every_rate_is_damped_and_the_damping_goes_with_the_speed(speed, axis):
    F = symmetric(3)

    def damping(rate: float, u: float) -> float:
        """The moment's part that is odd in the rate: drag above the axis pitches a vehicle that does not turn, too."""
        nu = np.array([u, 0.0, 0.0, 0.0, 0.0, 0.0])
        nu[axis] = rate
        against = nu.copy()
        against[axis] = -rate
        return 0.5 * (body.body_wrench(F, *nu)[axis] - body.body_wrench(F, *against)[axis])

    for rate in (0.02, 0.5):
        assert damping(rate, speed) < 0.0
    if speed:  # small rates: twice the speed, about twice the moment; equation (4) would have four times
        assert 1.7 < damping(0.01, 2.0 * speed) / damping(0.01, speed) < 2.2


def test_a_symmetric_vehicle_has_symmetric_forces():
    F, rng = symmetric(5), np.random.default_rng(2)
    for _ in range(200):
        u, v, w, p, q, r = rng.standard_normal(6) * (0.3, 0.1, 0.1, 0.3, 0.3, 0.3)
        X, Y, Z, K, M, N = body.body_wrench(F, u, v, w, p, q, r)
        mirrored = body.body_wrench(F, u, -v, w, -p, q, -r)
        np.testing.assert_allclose(mirrored, (X, -Y, Z, -K, M, -N), atol=1e-12)
    straight = body.body_wrench(F, 0.35, 0.0, 0.03, 0.0, 0.0, 0.0)
    np.testing.assert_allclose((straight[1], straight[3], straight[5]), 0.0, atol=1e-15)


def test_a_neutral_vehicle_at_rest_stays_there():
    P, F = VEHICLE.vector(), symmetric(4)
    P[COEFFICIENTS] = 0.0
    x, rows = np.zeros(fo.N_FX), 300
    x[2], x[3] = 5.0, 1.0
    design = draw_run(np.random.default_rng(1), POOL, "fixed", draw_waves(np.random.default_rng(1)))
    legs = np.zeros_like(design.legs)
    legs[:, fo.L_FIXED], legs[:, fo.L_TIME], legs[:, fo.L_STEP_TIME] = 1.0, 1e9, 1e9
    commands, X, Y = np.zeros((rows, 3)), np.zeros((rows, fo.N_FX)), np.zeros((rows, fo.N_FR))
    fly_foreign(P, F, design.waves, np.zeros((2, fo.N_FR)), 0.0, 0.0, np.uint64(1), x, legs, commands, X, Y)
    np.testing.assert_array_equal(X[:, 7:13], 0.0)
    np.testing.assert_array_equal(X[-1, :3], X[0, :3])


def test_motion_dies_out_without_weight():
    """Kinetic energy only falls where nothing but the water acts: no weight, no pendulum, no motor."""
    P, F = drawn(6)
    P[layout.R_R] = P[layout.R_S] = P[layout.NET_MASS] = 0.0
    P[layout.CG_X : layout.CG_Z + 1] = 0.0
    x = np.zeros(fo.N_FX)
    x[2], x[3] = 5.0, 1.0
    x[7:13] = 0.4, 0.1, -0.2, 0.8, -0.6, 0.7
    rows = 600
    legs = np.zeros((1, fo.N_L))
    legs[:, fo.L_FIXED], legs[:, fo.L_TIME], legs[:, fo.L_STEP_TIME] = 1.0, 1e9, 1e9
    commands, X, Y = np.zeros((rows, 3)), np.zeros((rows, fo.N_FX)), np.zeros((rows, fo.N_FR))
    waves = np.zeros((0, fo.N_FW))
    fly_foreign(P, F, waves, np.zeros((2, fo.N_FR)), 0.0, 0.0, np.uint64(1), x, legs, commands, X, Y)
    m, J = P[layout.M_T] + P[layout.A_X : layout.A_Z + 1], P[layout.J_XX : layout.J_ZZ + 1]
    J = J + P[layout.B_X : layout.B_Z + 1]
    energy = 0.5 * (X[:, 7:10] ** 2 @ m + X[:, 10:13] ** 2 @ J)
    assert (np.diff(energy) < 1e-6).all()
    assert energy[-1] < 0.05 * energy[0]


def mission_flown(P: np.ndarray, F: np.ndarray, name: str) -> tuple[float, np.ndarray]:
    """The autopilot's mode at the end of a shipped mission, and the states until it ended."""
    autopilot, rows, start = pilot_of(VEHICLE, load_mission(name)[2]), 3000, np.zeros(fo.N_FX)
    start[2], start[3] = 1.0, 1.0
    X = np.zeros((rows, fo.N_FX))
    mode, ended = fly_mission(
        P, F, np.zeros((0, fo.N_FW)), np.zeros((2, fo.N_FR)), 0.003, 0.003, np.uint64(4), start, autopilot.P,
        autopilot.C, autopilot.legs, autopilot.nav, np.zeros((rows, 3)), X, np.zeros((rows, fo.N_FR)),
    )  # fmt: skip
    return mode, X[:ended]


@pytest.mark.parametrize("seed", range(12))
def test_drawn_vehicles_fly_the_shipped_missions_about_as_roughie_does(seed):
    P, F = drawn(seed)
    assert not P[COEFFICIENTS].any()
    trial = FormTrial(VEHICLE, POOL, P, F, np.zeros((2, fo.N_FR)), [], 0, VEHICLE)
    seen = gross_behaviour(trial)
    assert plausible(trial)
    assert 0.2 <= seen["slowest"] <= seen["fastest"] <= 0.5
    assert seen["pitch"] < 0.05
    for name in MISSIONS:
        mode, _ = mission_flown(P, F, name)
        assert mode == ctl.COMPLETED, name


def test_the_same_seed_draws_the_same_vehicle_and_another_another():
    (P, F), (again, same), (_, other) = drawn(7), drawn(7), drawn(8)
    assert P.tobytes() == again.tobytes()
    assert F.tobytes() == same.tobytes()
    different = F[fo.FB_LENGTH :] != other[fo.FB_LENGTH :]
    assert different.mean() > 0.6
