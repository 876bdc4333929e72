"""The input forms against the independent model, their determinant, and the figures of docs/explanation/control.md."""

import copy
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.control import input_forms
from glider.firmware.core.control.input_forms import exact_form, paper_form
from glider.firmware.core.control.law import OK, STEEP, solve_inputs
from glider.firmware.core.control.law_plus import on_outputs
from glider.firmware.core.jit import PACKAGES_DIR
from glider.firmware.core.vehicle import layout
from glider.tools.verify.figures import law
from tests.independent.make_reference import VEHICLE
from tests.independent.nominal import DOWN, GRAVITY, Glider, body_to_ned, euler_angle_rates, skew
from tests.support.examples import examples
from tests.support.law_flights import down, form_at, output_accelerations, outputs, plant_rates
from tests.support.law_states import actuator_speeds, flying, trimmed_vehicles
from tests.support.model_states import P, derivative, state


def scaled_glider(factors) -> tuple[Glider, np.ndarray]:
    """The independent model and the kernels' vector of one perturbed vehicle."""
    glider, vehicle = copy.deepcopy(Glider.from_file(VEHICLE)), P.copy()
    for index, name in enumerate(("m_t", "m_r", "m_s", "R_r", "R_s", "x_b")):
        glider.mass[name] *= factors[index]
        vehicle[getattr(layout, name.upper())] *= factors[index]
    for index, name in enumerate(glider.water):
        glider.water[name] *= factors[index % len(factors)]
        vehicle[getattr(layout, name.upper())] *= factors[index % len(factors)]
    return glider, vehicle


@examples(200)
@given(
    st.tuples(*[st.floats(0.8, 1.25)] * 7), flying(st.floats(-1.4, 1.4)), actuator_speeds,
    st.floats(-0.5, 0.5), st.floats(-1.0, 1.0),
)  # fmt: skip
def test_exact_form_is_the_independent_model_for_any_inputs(factors, x, speeds, slider, ballast):
    """f + G u against matrices: M where the actuators are, the inputs acting through weight, pitch by differences."""
    glider, vehicle = scaled_glider(factors)
    f_t, f_z, g_ts, g_tb, g_zs, g_zb = form_at(vehicle, x, speeds)
    act, nu = x[layout.X_ACT :], x[7:13]
    phi, theta, psi = input_angles(x)
    R = body_to_ned(phi, theta, psi)
    put = np.array([act[0], slider, ballast])

    def weight(where):
        vertical = R.T @ DOWN
        return GRAVITY * np.concatenate([where[2] * vertical, np.cross(glider.first_moment(where), vertical)])

    M = glider.mass_matrix(act)
    nu_dot = glider.acceleration(R, nu, act, np.array(speeds)) + np.linalg.solve(M, weight(put) - weight(act))
    h = 1e-5
    phi_rate, theta_rate, _ = euler_angle_rates(phi, theta, nu[3:])
    ahead, behind = (
        euler_angle_rates(phi + t * phi_rate, theta + t * theta_rate, nu[3:] + t * nu_dot[3:])[1] for t in (h, -h)
    )
    pitch_acc = (ahead - behind) / (2.0 * h)
    depth_acc = (R @ (skew(nu[3:]) @ nu[:3] + nu_dot[:3]))[2]
    size = 1.0 + np.abs(nu_dot).max()
    assert abs(f_t + g_ts * slider + g_tb * ballast - pitch_acc) < 1e-7 * size / math.cos(theta) ** 3
    assert abs(f_z + g_zs * slider + g_zb * ballast - depth_acc) < 1e-7 * size


def input_angles(x: np.ndarray) -> tuple[float, float, float]:
    """phi, theta, psi from the rotation matrix's own elements, not by the quaternion's half angles."""
    q0, q1, q2, q3 = x[3:7]
    k = down(x)
    yaw = math.atan2(2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return math.atan2(k[1], k[2]), math.asin(max(-1.0, min(1.0, -k[0]))), yaw


@examples()
@given(trimmed_vehicles(), flying(st.floats(-1.57, 1.57)), actuator_speeds, st.booleans())
def test_the_slider_loses_its_grip_at_the_poles_alone(vehicle, x, speeds, paper):
    """det G = -m_s g^2 ctheta det N with N positive definite: at every roll, phi = +-90 deg included."""
    _, _, g_ts, g_tb, g_zs, g_zb = form_at(vehicle, x, speeds, paper_form if paper else exact_form)
    cos_pitch = math.hypot(*down(x)[1:])
    det_N = (g_ts * g_zb - g_tb * g_zs) / (-vehicle[layout.M_S] * layout.GRAVITY**2 * cos_pitch)
    # 1/(m Jt) between that of the heaviest axes and that of the lightest
    assert 0.5 / (35.0 * 4.0) < det_N < 2.0 / (10.0 * 1.5)
    assert g_ts < 0.0 < g_zb
    _, _, status = solve_inputs(g_ts, g_tb, g_zs, g_zb, 0.1, 0.1, cos_pitch, -np.inf, np.inf, -np.inf, np.inf)
    assert status == (OK if cos_pitch >= 0.1 else STEEP)


@examples()
@given(flying(), actuator_speeds, st.tuples(*[st.floats(-0.1, 0.1)] * 6))
def test_accelerations_beside_the_models_add_to_the_outputs(x, speeds, acc):
    command = x[layout.X_ACT :]
    with_it, without = (plant_rates(P, x, command, np.array(a))[7:13] for a in (acc, (0.0,) * 6))
    difference = output_accelerations(x, with_it) - output_accelerations(x, without)
    np.testing.assert_allclose(on_outputs(*down(x), *acc), difference, atol=1e-12)
    k, nu_dot = down(x), plant_rates(P, x, command)[7:13]
    np.testing.assert_allclose(
        input_forms.output_accelerations(*k, *x[7:13], *nu_dot), output_accelerations(x, nu_dot), atol=1e-10
    )
    _, theta_rate, _, Z_rate = outputs(x)
    np.testing.assert_allclose(input_forms.output_rates(*k, *x[7:13])[1:], (theta_rate, Z_rate), atol=1e-14)


def test_derivative_of_the_plant_is_the_nominal_one_here():
    """Still water, no surface, no floor: what the law is held against is equation (1)."""
    glide, command = state((0.1, -0.4, 0.0), (0.4, 0.0, 0.03, 0.0, 0.02, 0.0), (0.1, 0.01, 0.1)), (0.2, 0.0, 0.0)
    np.testing.assert_array_equal(plant_rates(P, glide, command), derivative(glide, command))


def test_figures_of_the_document_are_those_measured(capsys):
    """The two tables that `python -m glider.tools.verify.figures.law` prints stand in docs/explanation/control.md,
    row by row."""
    law.main()
    printed = [line.split("|") for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    document = (PACKAGES_DIR / "docs" / "explanation" / "control.md").read_text(encoding="utf-8").splitlines()
    rows = {line.split("|")[1]: line.split("|") for line in document if line.startswith("|")}
    figures = [cells for cells in printed if re.match(r" [\d.e-]+ $", cells[2])]
    assert len(figures) == 9
    for cells in figures:
        told = [float(cell) for cell in rows[cells[1]][2:6]]
        assert told == pytest.approx([float(cell) for cell in cells[2:6]], rel=0.1, abs=1e-5)
