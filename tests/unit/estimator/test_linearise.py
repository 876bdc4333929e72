"""The linearised flight against differences of the flight itself, taken in plain Python."""

import numpy as np
import pytest

from glider.firmware.core.estimation.estimator import error_covariance, flight_derivative
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.linearise import linearise
from tests.support.estimating import Filter

STATES = {
    "dive": ((0.1, -0.5, 1.0), (0.4, 0.01, 0.03, 0.01, -0.02, 0.05), (0.2, 0.01, 0.15)),
    "turn": ((0.9, -0.4, -2.0), (0.35, -0.05, 0.02, 0.1, 0.05, -0.2), (0.8, -0.02, 0.1)),
    "climb": ((-0.3, 0.7, 3.0), (0.5, 0.02, -0.03, -0.05, 0.01, 0.1), (-0.4, 0.03, -0.19)),
}


def moved(x: np.ndarray, n: int, h: float) -> np.ndarray:
    """The state with its n-th error moved by h; attitude by a rotation about a body axis."""
    x = x.copy()
    if kf.E_ATT <= n < kf.E_NU:
        q0, (q1, q2, q3) = x[3], x[4:7]
        d = np.zeros(3)
        d[n - kf.E_ATT] = 0.5 * h
        x[3] = q0 - d @ x[4:7]
        x[4:7] = np.array([q1, q2, q3]) + q0 * d + np.cross([q1, q2, q3], d)
        x[3:7] /= np.linalg.norm(x[3:7])
    else:
        x[n if n < 3 else (n + 1)] += h
    return x


def error_rate(P, x, commands) -> np.ndarray:
    """Rates of position, of attitude as seen from a body that turns along, and of nu."""
    out = np.zeros(kf.N_XE)
    flight_derivative(P, x, 0, *commands, out)
    return np.concatenate([out[0:3], x[10:13], out[7:13]])


@pytest.mark.parametrize("name", STATES)
def test_the_matrix_is_the_derivative_of_the_flight(name):
    euler, nu, actuators = STATES[name]
    filtered = Filter()
    P, x = filtered.P, np.zeros(kf.N_XE)
    x[3:7], x[7:13], x[13:16] = quaternion_from_euler(*euler), nu, actuators
    A, y = np.zeros((kf.N_MOVING, kf.N_COUPLED)), np.zeros(kf.N_W)
    linearise(P, x, 0.0, 0.0, 0.0, A, y)
    h = 1e-6
    for n in range(kf.N_COUPLED):
        # commands at the actuators, so that moving one does not set it in motion
        up, down = moved(x, n, h), moved(x, n, -h)
        expected = (error_rate(P, up, up[13:16]) - error_rate(P, down, down[13:16])) / (2.0 * h)
        if kf.E_ATT <= n < kf.E_NU:
            # the error in attitude is measured in axes that turn with the estimate
            axis = np.zeros(3)
            axis[n - kf.E_ATT] = 1.0
            expected[3:6] = -np.cross(x[10:13], axis)
        np.testing.assert_allclose(A[:, n], expected, rtol=2e-3, atol=3e-4, err_msg=f"column {n}")


def test_the_models_error_is_what_drawn_parameters_do():
    """C against the scatter of accelerations over vehicles drawn from [uncertainty]."""
    filtered = Filter().start(euler=(0.4, -0.5, 1.0), speed=0.4)
    x = filtered.x
    x[9], x[13], x[15] = 0.03, 0.4, 0.15
    C = np.zeros((6, 6))
    settings = filtered.settings.copy()
    settings[[kf.S_SLIDER_BIAS, kf.S_BALLAST_BIAS]] = 0.0
    linearise(filtered.P, x, 0.0, 0.0, 0.0, filtered.work[kf.W_A : kf.W_TURNED], filtered.work[kf.W_POINT])
    error_covariance(filtered.P, settings, filtered.sigma, 0.0, 0.0, 0.0, C, filtered.work)
    rng, drawn, out = np.random.default_rng(1), [], np.zeros(kf.N_XE)
    for _ in range(4000):
        P = filtered.P + filtered.sigma * rng.standard_normal(layout.N_P)
        flight_derivative(P, x, 0, x[13], x[14], x[15], out)
        drawn.append(out[7:13].copy())
    expected = np.cov(np.array(drawn).T)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(C / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.1)
