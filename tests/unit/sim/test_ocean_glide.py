"""How an ocean glider glides: each kernel against the equation it solves, and every label against no effect."""

import gsw
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from glider.sim_backend.ocean.catalogue import EFFECTS, NOT_ASKED, ODDS, ONE_ON_DEPTH, catalogue
from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.core.glide import (
    angle_of_attack,
    drag_coefficients,
    glide,
    net_buoyancy,
    next_speed,
    steady_speed,
    true_pitch,
)
from glider.sim_backend.ocean.vehicle import KIND, decode_ocean_vehicle, gravity, shipped_vehicles
from glider.tools.inference.core.ocean import propagate, read_state
from tests.support.examples import examples

NO_EFFECT = np.zeros(at.N_F)
VEHICLES = {name: decode_ocean_vehicle(text, name) for name, text in shipped_vehicles().items()}
# The same examples on every run; a kernel may have to be compiled inside the first.
pitches = st.floats(0.12, 0.8) | st.floats(-0.8, -0.12)


def vector(name: str = "slocum") -> np.ndarray:
    return VEHICLES[name].vector()


# --- the angle of attack and the balance ---
@examples()
@given(pitch=pitches, parasitic=st.floats(0.02, 0.3), induced=st.floats(1.0, 20.0), slope=st.floats(4.0, 12.0))
def test_the_angle_of_attack_solves_its_equation(pitch, parasitic, induced, slope):
    a = angle_of_attack(pitch, parasitic, induced, slope)
    assert 0.0 <= a <= at.STEEPEST_ANGLE
    if a < at.STEEPEST_ANGLE:
        residual = slope * a * np.tan(abs(pitch) + a) - parasitic - induced * a * a
        assert abs(residual) < 1e-9 * parasitic
        below = np.linspace(0.0, a, 50)[1:-1]  # the smallest root: a glide, no fall
        assert np.all(slope * below * np.tan(abs(pitch) + below) < parasitic + induced * below**2)


def test_a_pitch_too_small_to_glide_has_the_largest_angle():
    assert angle_of_attack(0.01, 0.15, 10.0, 7.5) == at.STEEPEST_ANGLE


@pytest.mark.parametrize("name", sorted(VEHICLES))
@examples()
@given(pitch=st.floats(0.3, 0.7) | st.floats(-0.7, -0.3), weight=st.floats(0.3, 4.0))
def test_in_a_steady_glide_forces_balance_along_and_across(name, pitch, weight):
    P, density = vector(name), 1027.0
    buoyancy = float(np.copysign(weight, pitch))
    speed, path = steady_speed(P, NO_EFFECT, pitch, density, buoyancy)
    a = abs(path) - abs(pitch)
    q = 0.5 * density * P[at.AREA] * speed**2
    parasitic, induced = drag_coefficients(P, NO_EFFECT, speed, density, pitch > 0.0)
    drag, lift = q * (parasitic + induced * a * a), q * P[at.LIFT_SLOPE] * a
    assert drag == pytest.approx(buoyancy * np.sin(path), rel=2e-3)
    assert lift == pytest.approx(weight * np.cos(path), rel=2e-3)


def test_climbing_mirrors_diving():
    down, up = (steady_speed(vector(), NO_EFFECT, s * 0.4, 1026.0, s * 2.0) for s in (-1.0, 1.0))
    assert up == pytest.approx((down[0], -down[1]), rel=1e-12)


def test_weight_against_the_pitch_stands_still():
    assert steady_speed(vector(), NO_EFFECT, -0.4, 1026.0, 1.0)[0] == at.LEAST_FLOW_SPEED


def test_the_seaglider_law_of_drag_goes_with_a_power_of_the_pressure():
    P = vector("seaglider")
    power = P[at.DRAG_EXPONENT]
    assert power == pytest.approx(-0.25)
    slow, fast = (drag_coefficients(P, NO_EFFECT, U, 1027.0, False)[0] for U in (0.2, 0.4))
    assert fast / slow == pytest.approx(4.0**power, rel=1e-12)
    reference = np.sqrt(2.0 * at.DRAG_PRESSURE / 1027.0)
    assert drag_coefficients(P, NO_EFFECT, reference, 1027.0, False)[0] == pytest.approx(P[at.DRAG_0], rel=1e-12)


# --- the speed in time ---
@pytest.mark.parametrize(("speed", "force"), [(0.1, 0.8), (0.4, 0.5), (0.3, 0.0), (0.02, 2.0)])
def test_the_next_speed_is_that_of_the_equation_of_motion(speed, force):
    P, drag, dt = vector(), 8.0, 4.0
    mass = P[at.MASS] + P[at.ADDED_MASS]
    true = solve_ivp(lambda t, U: (force - drag * U * U) / mass, (0.0, dt), [speed], rtol=1e-10, atol=1e-12).y[0, -1]
    errors = []
    for steps in (1, 2, 4, 8):
        U = speed
        for _ in range(steps):
            U = next_speed(P, U, dt / steps, force, drag)[0]
        errors.append(abs(U - true))
    assert errors[-1] < 0.03 * max(abs(true - speed), 1e-3)
    assert np.all(np.array(errors[1:]) < 0.65 * np.array(errors[:-1]))  # of the first order


@examples()
@given(speed=st.floats(0.05, 0.8), force=st.floats(0.0, 2.0), dt=st.floats(0.5, 60.0))
def test_the_derivative_of_the_next_speed(speed, force, dt):
    P, h = vector(), 1e-6
    found = next_speed(P, speed, dt, force, 8.0)[1]
    ahead, behind = (next_speed(P, speed + s * h, dt, force, 8.0)[0] for s in (1.0, -1.0))
    assert found == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-5)


def test_any_step_is_stable():
    P = vector()
    steady_share = np.sqrt(0.9 / 8.0)
    assert next_speed(P, 0.1, 1e5, 0.9, 8.0)[0] == pytest.approx(steady_share, rel=1e-2)
    assert next_speed(P, 0.1, 60.0, -2.0, 8.0) == (at.LEAST_FLOW_SPEED, 0.0)


# --- what drives it ---
def test_net_buoyancy_is_that_of_its_closed_form():
    P, depth, oil = vector(), 150.0, 1.5e-4
    salt = gsw.SA_from_SP(35.2, gsw.p_from_z(-depth, 45.0), -20.0, 45.0)
    density = float(gsw.rho_t_exact(salt, 14.0, gsw.p_from_z(-depth, 45.0)))
    hull = P[at.VOLUME] * (1.0 - P[at.COMPRESSIBILITY] * 1e4 * depth + P[at.THERMAL_EXPANSION] * (14.0 - 10.0))
    expected = gsw.grav(45.0, 0.0) * (density * (hull + P[at.OIL_SCALE] * oil) - P[at.MASS])
    assert net_buoyancy(P, NO_EFFECT, depth, density, 14.0, oil, 0.0) == pytest.approx(expected, rel=1e-6)


@examples()
@given(latitude=st.floats(-90.0, 90.0))
def test_gravity_is_that_of_the_sea_surface(latitude):
    assert gravity(latitude) == pytest.approx(float(gsw.grav(latitude, 0.0)), rel=1e-7)


def test_pressure_on_the_hull_is_that_of_seawater():
    assert float(gsw.p_from_z(-100.0, 45.0)) * 1e4 == pytest.approx(100.0 * at.PASCALS_A_METRE, rel=0.01)


def test_true_pitch_takes_off_offset_scale_and_lag():
    P, F, true, rate = vector(), NO_EFFECT.copy(), -0.4, 0.002
    P[[at.PITCH_OFFSET, at.PITCH_SCALE]] = 0.03, 1.05
    F[[at.F_PITCH_BIAS, at.F_PITCH_SCALE, at.F_ATTITUDE_LAG]] = -0.01, 0.02, 8.0
    whole = 1.07 * true + 0.02  # what a sensor without a lag reads
    assert true_pitch(P, F, whole - 8.0 * rate, rate) == pytest.approx(true, rel=1e-12)


# --- labels ---
LISTED = [(effect.label, p) for effect in EFFECTS for p in effect.parameters]
ROWS = 40


def flown(F: np.ndarray, pitch: float) -> np.ndarray:
    """Depth and roll, (rows, 2), of a glide that begins to pitch, with effects F (N_F,)."""
    P, t = vector(), 10.0 * np.arange(ROWS)
    inputs = np.zeros((ROWS, at.N_U))
    inputs[:, at.U_PITCH] = pitch * (1.0 - 0.3 * np.exp(-t / 100.0))
    inputs[:, at.U_PITCH_RATE] = np.gradient(inputs[:, at.U_PITCH], t)
    inputs[:, at.U_OIL] = np.copysign(2e-4, pitch)
    inputs[:, at.U_DENSITY], inputs[:, at.U_TEMPERATURE] = P[at.MASS] / P[at.VOLUME] + 0.5, 16.0
    x, y, Phi, out = np.zeros(at.N_X), np.zeros(at.N_Y), np.zeros((at.N_ERR, at.N_ERR)), np.zeros((ROWS, 2))
    x[at.X_DEPTH], x[at.X_SPEED] = 100.0, 0.3
    for i in range(1, ROWS):
        propagate(P, F, x, t, inputs, i, 0, Phi)
        read_state(P, F, x, inputs, i, y)
        out[i] = y[at.Y_DEPTH], y[at.Y_ROLL]
    return out


@pytest.mark.parametrize(("label", "parameter"), LISTED, ids=[f"{label}.{p.name}" for label, p in LISTED])
def test_every_label_changes_the_flight_at_its_spread(label, parameter):
    if label == "vertical_water":  # no course of its own: it is rougher water
        assert parameter.entry == -1
        return
    F = NO_EFFECT.copy()
    F[parameter.entry] = parameter.spread
    moved = max(np.abs(flown(F, pitch) - flown(NO_EFFECT, pitch)).max() for pitch in (-0.4, 0.4))
    assert moved > 0.02
    assert parameter.low <= 0.0 <= parameter.high
    assert parameter.low <= parameter.spread <= parameter.high


def test_climb_dive_asymmetry_goes_both_ways():
    F = NO_EFFECT.copy()
    F[at.F_CLIMB_DIVE] = 0.2
    for pitch, factor in ((0.4, 1.2), (-0.4, 0.8)):
        bare = glide(vector(), NO_EFFECT, 0.3, pitch, 1026.0)[1]
        same = glide(vector(), F, 0.3, pitch, 1026.0)[1]
        assert np.sign(same - bare) == np.sign(factor - 1.0)
        parts = drag_coefficients(vector(), F, 0.3, 1026.0, pitch > 0.0)
        assert parts == pytest.approx(factor * np.array(drag_coefficients(vector(), NO_EFFECT, 0.3, 1026.0, True)))


def test_what_is_not_asked_is_in_no_catalogue():
    assert not set(NOT_ASKED) & set(catalogue())
    assert set(ODDS) <= set(catalogue())
    assert set(ONE_ON_DEPTH) <= set(catalogue())
    assert len(catalogue()) == len(EFFECTS)
    entries = [p.entry for _, p in LISTED if p.entry >= 0]
    assert len(entries) == len(set(entries))


# --- layouts ---
GROUPS = {"X_": (at.N_X,), "U_": (at.N_U,), "Y_": (at.N_Y,), "Q_": (at.N_SPECTRAL,), "F_": (at.N_F,)}
PLAIN = [name for name, value in vars(at).items()
         if name.isupper() and isinstance(value, int) and name[:2] not in (*GROUPS, "N_")]  # fmt: skip


@pytest.mark.parametrize("prefix", sorted(GROUPS))
def test_a_vectors_names_have_a_place_each(prefix):
    places = sorted(v for name, v in vars(at).items() if name.startswith(prefix) and isinstance(v, int))
    assert places == list(range(*GROUPS[prefix]))


def test_the_vehicles_names_have_a_place_each():
    assert sorted(getattr(at, name) for name in PLAIN) == list(range(at.N_P))
    assert at.N_ERR == at.N_X - 1 == at.X_GLIDE


@pytest.mark.parametrize("name", sorted(VEHICLES))
def test_a_shipped_vehicle_fills_its_vector(name):
    P = vector(name)
    set_or_zero = {at.DRAG_EXPONENT, at.PITCH_OFFSET, at.ROLL_TRIM}
    assert VEHICLES[name].kind == KIND
    assert {n for n in range(at.N_P) if P[n] == 0.0} <= set_or_zero
    assert np.all(VEHICLES[name].sigma() >= 0.0)
