"""One test for each row of docs/LEDGER.md that concerns code that is here."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from model_states import (
    VEHICLE_TEXT,
    P,
    actuators,
    angles,
    derivative,
    full_mass_matrix,
    rates,
    repeatable,
    state,
    velocities,
)

from firmware.core import layout
from firmware.core.control import reference_step
from firmware.core.jit import PACKAGES_DIR
from firmware.core.mass import first_moment, inertia
from firmware.core.rotations import euler_rates, rotation_nb, rotation_nb_euler
from firmware.core.water import water_wrench
from firmware.model.vehicle import decode_vehicle

LEDGER = PACKAGES_DIR / "docs" / "LEDGER.md"


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
    weight = 0.1 * layout.G * np.array(rotation_nb(*x[3:7]))[6:]
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


@repeatable
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


@repeatable
@given(actuators)
def test_L41_sliding_mass_is_at_r_s_and_ballast_stays_at_x_b(act):
    servo, slider, ballast = act
    S = np.array(first_moment(P, *act))
    np.testing.assert_allclose(S - first_moment(P, servo, 0.0, ballast), [P[layout.M_S] * slider, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(S - first_moment(P, servo, slider, 0.0), [ballast * P[layout.X_B], 0.0, 0.0], atol=1e-15)


@repeatable
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
