"""One test for each row of docs/reference/ledger.md that concerns code that is here."""

import math
import re

import numpy as np
import pytest
from hypothesis import given

from glider.firmware.core.control.control import reference_step
from glider.firmware.core.control.input_forms import exact_form, paper_form, roll_form
from glider.firmware.core.control.law import axis_demand
from glider.firmware.core.jit import PACKAGES_DIR
from glider.firmware.core.maths.rotations import euler_rates, rotation_nb, rotation_nb_euler
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.mass import first_moment, inertia
from glider.firmware.core.vehicle.water import water_wrench
from glider.firmware.model.vehicle import decode_vehicle
from tests.support.examples import examples
from tests.support.law_flights import down, form_at, output_accelerations, plant_rates
from tests.support.model_states import (
    VEHICLE_TEXT,
    P,
    actuators,
    angles,
    derivative,
    full_mass_matrix,
    pitches,
    rates,
    state,
    velocities,
)

LEDGER = PACKAGES_DIR / "docs" / "reference" / "ledger.md"


def test_every_test_the_ledger_names_is_here():
    named = re.findall(r"`(test_L\w+)`", LEDGER.read_text(encoding="utf-8"))
    here = [name for name in globals() if name.startswith("test_L")]
    assert sorted(named) == sorted(here)


def test_L1_gravity_moment_is_trimmed_out_at_neutral():
    """Masses off the origin along x leave the vehicle level at neutral; their inertia stays."""
    vehicle = P.copy()
    vehicle[layout.X_R], vehicle[layout.R_SX0] = 0.12, -0.25
    neutral = (0.0, 0.0, 0.0)
    assert first_moment(vehicle, *neutral) == first_moment(P, *neutral)
    assert first_moment(vehicle, *neutral)[:2] == (0.0, 0.0)
    np.testing.assert_array_equal(derivative(state(), neutral, vehicle=vehicle)[7:13], 0.0)
    added = 2.0 * 0.12**2 + 2.0 * 0.25**2
    assert inertia(vehicle, *neutral)[1] - inertia(P, *neutral)[1] == pytest.approx(added, rel=1e-12)
    assert inertia(vehicle, *neutral)[0] == inertia(P, *neutral)[0]


def test_L2_printed_matrix_takes_body_to_ned():
    nose_up = np.reshape(rotation_nb_euler(0.0, math.radians(30.0), 0.0), (3, 3))
    np.testing.assert_allclose(nose_up @ [1, 0, 0], [math.sqrt(0.75), 0.0, -0.5], atol=1e-15)
    eastward = np.reshape(rotation_nb_euler(0.0, 0.0, math.pi / 2), (3, 3))
    np.testing.assert_allclose(eastward @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    starboard_down = np.reshape(rotation_nb_euler(math.radians(30.0), 0.0, 0.0), (3, 3))
    np.testing.assert_allclose(starboard_down @ [0, 1, 0], [0.0, math.sqrt(0.75), 0.5], atol=1e-15)
    # a heavy vehicle at rest falls along NED down in every attitude: its weight acts along the third row
    x = state((0.4, -0.7, 2.0), act=(0.0, 0.0, 0.1))
    vehicle = P.copy()
    vehicle[[layout.X_B, layout.R_R, layout.R_S]] = 0.0  # no moments, so that M is diagonal
    force = full_mass_matrix(x[13:], vehicle) @ derivative(x, x[13:], vehicle=vehicle)[7:13]
    weight = 0.1 * layout.GRAVITY * np.array(rotation_nb(*x[3:7]))[6:]
    np.testing.assert_allclose(force, [*weight, 0, 0, 0], atol=1e-14)


def test_L4_lift_is_linear_in_alpha_and_the_printed_form_selectable():
    def lift(vehicle: np.ndarray, alpha: float) -> float:
        """Upward across the flow, per speed squared."""
        ca, sa = math.cos(alpha), math.sin(alpha)
        F1, _, F3, *_ = water_wrench(vehicle, 0.4 * ca, 0.0, 0.4 * sa, 0.0, 0.0, 0.0)
        return (sa * F1 - ca * F3) / 0.4**2

    printed = decode_vehicle(VEHICLE_TEXT.replace("K_r = ", 'lift_law = "printed"\nK_r = '), "printed").vector()
    for alpha in (0.02, 0.1):
        assert lift(P, alpha) == pytest.approx(P[layout.K_L] * alpha, rel=1e-12)
        assert lift(P, -alpha) == pytest.approx(-lift(P, alpha), rel=1e-12)  # climbing mirrors diving
        assert lift(printed, alpha) == pytest.approx(P[layout.K_L] * alpha**2, rel=1e-12)
        assert lift(printed, -alpha) == pytest.approx(lift(printed, alpha), rel=1e-12)


@examples()
@given(velocities, rates)
def test_L4_climbing_mirrors_diving(V, omega):
    """With linear lift (and K_L0 = K_M0 = 0) flow from above and flow from below do the same, mirrored.

    Not so the moment of sideslip about the roll axis, K_MR beta, which has an up and a down: without sideslip here.
    """
    (u, v, w), (p, q, r) = V, omega
    force, mirrored = water_wrench(P, u, v, w, p, q, r)[:3], water_wrench(P, u, v, -w, -p, -q, r)[:3]
    np.testing.assert_allclose(mirrored, force * np.array([1, 1, -1]), atol=1e-12)
    moment, mirrored = water_wrench(P, u, 0.0, w, p, q, r)[3:], water_wrench(P, u, 0.0, -w, -p, -q, r)[3:]
    np.testing.assert_allclose(mirrored, moment * np.array([-1, -1, 1]), atol=1e-12)


@examples()
@given(actuators)
def test_L41_sliding_mass_is_at_r_s_and_ballast_stays_at_x_b(act):
    servo, slider, ballast = act
    S = np.array(first_moment(P, *act))
    np.testing.assert_allclose(S - first_moment(P, servo, 0.0, ballast), [P[layout.M_S] * slider, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(S - first_moment(P, servo, slider, 0.0), [ballast * P[layout.X_B], 0.0, 0.0], atol=1e-15)


@examples()
@given(angles, angles, velocities, rates, actuators)
def test_L17_signs_of_the_depth_acceleration(phi, psi, V, omega, act):
    """(17) as printed, from nu_dot of equation (1), is the derivative of (16) along the motion."""
    theta, (u, v, w), (p, q, r) = 0.4 * psi, V, omega
    x = state((phi, theta, psi), (*V, *omega), act)
    dx = derivative(x, act)
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    phi_dot, theta_dot, _ = euler_rates(phi, theta, p, q, r)
    printed = (
        phi_dot * (v * cf * ct - w * sf * ct)
        - theta_dot * (u * ct + v * sf * st + w * cf * st)
        - st * dx[7]
        + sf * ct * dx[8]
        + cf * ct * dx[9]
    )
    h = 1e-6
    ahead, behind = derivative(x + h * dx, act)[2], derivative(x - h * dx, act)[2]
    assert abs((ahead - behind) / (2.0 * h) - printed) < 1e-7


# Two vehicles in which there is nothing that the paper's forms leave out: they must be exact there.
# All masses on the axis, no added mass: no first moment while slider and ballast are at neutral.
SLENDER = P.copy()
SLENDER[[layout.A_X, layout.A_Y, layout.A_Z, layout.R_R, layout.R_S]] = 0.0
# So heavy that S moves nothing sideways, of such inertia that Jt is diagonal: at rest weight alone turns it.
HEAVY = P.copy()
HEAVY[layout.M_T], HEAVY[layout.J_XX : layout.J_ZZ + 1] = 1e12, (1e4, 1.3e4, 1.7e4)


def roll_acceleration(x: np.ndarray, nu_dot: np.ndarray, phi: float, theta: float) -> float:
    """(21) as printed."""
    p, q, r = x[10:13]
    sf, cf, tt, sec = math.sin(phi), math.cos(phi), math.tan(theta), 1.0 / math.cos(theta)
    phi_dot, theta_dot, _ = euler_rates(phi, theta, p, q, r)
    return (
        nu_dot[3] + cf * tt * q * phi_dot + sf * sec**2 * q * theta_dot + sf * tt * nu_dot[4]
        - sf * tt * r * phi_dot + cf * sec**2 * r * theta_dot + cf * tt * nu_dot[5]
    )  # fmt: skip


@examples()
@given(angles, pitches, velocities, rates, actuators)
def test_L14_pitch_form_has_the_pitch_moment_and_both_parts(phi, theta, V, omega, act):
    """(14) with T_2 under c_phi and the r_dot part under s_phi; exact where nothing is left out."""
    (p, q, r), (gamma, dr_s, m_b) = omega, act
    x = state((phi, theta, 0.0), (*V, *omega), act)
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    Ixx, Iyy, Izz = inertia(P, *act)[:3]
    _, _, _, _, T_2, T_3 = water_wrench(P, *V, *omega)
    sr = P[layout.M_R] * P[layout.R_R] + P[layout.M_S] * P[layout.R_S]
    A = -(q * sf + r * cf) * (p + sf * st / ct * q + cf * st / ct * r)
    # m_r r_r1 + m_s r_sx0 are trimmed out (ledger L1)
    q_dot = (
        (Izz - Ixx) * p * r - layout.GRAVITY * (st * sr * math.cos(gamma) + cf * ct * m_b * P[layout.X_B]) + T_2
    ) / Iyy
    r_dot = (
        (Ixx - Iyy) * p * q + layout.GRAVITY * (st * sr * math.sin(gamma) + sf * ct * m_b * P[layout.X_B]) + T_3
    ) / Izz
    C = -P[layout.M_S] * layout.GRAVITY * ct * (cf**2 / Iyy + sf**2 / Izz)
    f_t, _, g_ts, g_tb, _, _ = form_at(P, x, form=paper_form)
    printed = A + cf * q_dot - sf * r_dot + C * dr_s
    assert f_t + g_ts * dr_s + g_tb * m_b == pytest.approx(printed, rel=1e-11, abs=1e-11)
    assert g_ts == pytest.approx(C, rel=1e-12)

    swung = state((phi, theta, 0.0), (*V, *omega), (gamma, 0.0, 0.0))
    exact = output_accelerations(swung, plant_rates(SLENDER, swung, swung[13:])[7:13])[0]
    assert form_at(SLENDER, swung, form=paper_form)[0] == pytest.approx(exact, rel=1e-9, abs=1e-9)

    hanging = state((phi, theta, 0.0), (0.0, 0.0, 0.0, *omega), act)
    exact = output_accelerations(hanging, plant_rates(HEAVY, hanging, hanging[13:])[7:13])[0]
    f_t, _, g_ts, g_tb, _, _ = form_at(HEAVY, hanging, form=paper_form)
    # Jt off its diagonal: 1e-3 of 1e4 kg m2, at rates of 1 rad/s
    assert f_t + g_ts * dr_s + g_tb * m_b == pytest.approx(exact, abs=2e-6)


@examples()
@given(angles, pitches, velocities, rates, actuators)
def test_L17_depth_form_is_18_and_the_exact_one_all_of_M(phi, theta, V, omega, act):
    (u, v, w), (p, q, r), (_, dr_s, m_b) = V, omega, act
    x = state((phi, theta, 0.0), (*V, *omega), act)
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    m_t = P[layout.M_T]
    F_1, F_2, F_3 = water_wrench(P, *V, *omega)[:3]
    phi_dot, theta_dot, _ = euler_rates(phi, theta, p, q, r)
    D = phi_dot * (v * cf * ct - w * sf * ct) - theta_dot * (u * ct + v * sf * st + w * cf * st)
    printed = (
        D
        - st / m_t * (m_t * (r * v - q * w) + F_1)
        + sf * ct / m_t * (m_t * (p * w - r * u) + F_2)
        + cf * ct / m_t * (m_t * (q * u - p * v) + F_3)
        + layout.GRAVITY / m_t * m_b
    )
    _, f_z, _, _, g_zs, g_zb = form_at(P, x, form=paper_form)
    assert g_zs == 0.0
    assert f_z + g_zb * m_b == pytest.approx(printed, abs=1e-9 * (1.0 + 1.0 / ct))
    # what the plant does, by the form with all of M: at the present actuators it is the same, to rounding
    nu_dot = plant_rates(P, x, act)[7:13]
    f_t, f_z, g_ts, g_tb, g_zs, g_zb = form_at(P, x, form=exact_form)
    form = np.array([f_t + g_ts * dr_s + g_tb * m_b, f_z + g_zs * dr_s + g_zb * m_b])
    np.testing.assert_allclose(form, output_accelerations(x, nu_dot), rtol=1e-10, atol=1e-10)
    # and where nothing is left out, the paper's form does, too
    neutral = state((phi, theta, 0.0), (*V, *omega), (act[0], 0.0, 0.0))
    both = [form_at(SLENDER, neutral, form=form) for form in (exact_form, paper_form)]
    np.testing.assert_allclose(both[1], both[0], rtol=1e-9, atol=1e-9)


@examples()
@given(angles, pitches, velocities, rates, actuators)
def test_L22_roll_hangs_from_what_is_below_the_axis(phi, theta, V, omega, act):
    """(22), (23) with sr: exact where nothing is left out, at rest where phi = gamma, and no length along x in it."""
    theta *= 0.8

    def form(vehicle, x):
        J, a, b = roll_form(vehicle, *down(x), *x[7:16])
        return J + a * math.sin(x[13]) + b * math.cos(x[13])

    swung = state((phi, theta, 0.0), (*V, *omega), (act[0], 0.0, 0.0))
    exact = roll_acceleration(swung, plant_rates(SLENDER, swung, swung[13:])[7:13], phi, theta)
    assert form(SLENDER, swung) == pytest.approx(exact, rel=1e-9, abs=1e-9)

    hanging = state((phi, theta, 0.0), (0.0, 0.0, 0.0, *omega), act)
    exact = roll_acceleration(hanging, plant_rates(HEAVY, hanging, hanging[13:])[7:13], phi, theta)
    assert form(HEAVY, hanging) == pytest.approx(exact, abs=2e-5)

    gamma, dr_s = act[0], act[1]
    for slider in (0.0, dr_s):
        still = state((gamma, 0.0, 0.0), act=(gamma, slider, 0.0))
        assert form(P, still) == pytest.approx(0.0, abs=1e-12)
        # mass forward lowers the nose, and Jt off its diagonal makes next to nothing of it roll
        assert abs(plant_rates(P, still, still[13:])[10]) <= (1e-12 if slider == 0.0 else 5e-4)
        for lean in (-0.1, 0.1):
            leaning = state((gamma + lean, 0.0, 0.0), act=(gamma, slider, 0.0))
            assert form(P, leaning) * lean < -0.05  # rad/s2 for 0.1 rad: back to gamma


def test_L30_one_law_with_both_saturations_and_their_eps():
    """What k2 adds is g k2 sat(s/eps) sat(g/eps): linear within the layer, constant outside, weaker for a weak g."""

    def sliding(s, g, eps):
        with_k2, found = axis_demand(s, 0.0, 0.0, 0.0, g, 1.0, 0.02, 0.5, eps, math.inf)
        without, _ = axis_demand(s, 0.0, 0.0, 0.0, g, 1.0, 0.0, 0.5, eps, math.inf)
        assert found == s
        return without - with_k2

    assert sliding(0.025, -7.5, 0.1) == pytest.approx(7.5 * 0.02 * 0.25)
    assert sliding(0.3, -7.5, 0.1) == pytest.approx(7.5 * 0.02)
    assert sliding(-0.3, 7.5, 0.1) == pytest.approx(-7.5 * 0.02)
    assert sliding(0.3, 0.05, 0.1) == pytest.approx(0.05 * 0.02 * 0.5)


def test_Lref_damping_term_holds_the_s():
    """The filter's step response is that of wn^2/(s^2 + 2 zeta wn s + wn^2); it settles on its target."""
    wn, dt, target = 0.4, 0.02, 1.5
    for zeta in (0.5, 1.0):
        position = rate = 0.0
        for k in range(1, 4001):
            position, rate, acceleration = reference_step(position, rate, target, wn, zeta, dt)
            time = k * dt
            if zeta == 1.0:
                expected = target * (1.0 - (1.0 + wn * time) * math.exp(-wn * time))
            else:
                wd = wn * math.sqrt(1.0 - zeta**2)
                ring = math.cos(wd * time) + zeta * wn / wd * math.sin(wd * time)
                expected = target * (1.0 - ring * math.exp(-zeta * wn * time))
            assert position == pytest.approx(expected, abs=1e-7)
            assert acceleration == pytest.approx(-(wn**2) * (position - target) - 2.0 * zeta * wn * rate, abs=1e-12)
        assert position == pytest.approx(target, abs=1e-5)
