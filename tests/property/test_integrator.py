"""The integrator: fourth order where the motion is smooth, through any attitude, unit quaternions to the end."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glider.firmware.core.maths.rotations import euler_from_quaternion
from glider.firmware.core.maths.steps import MIDPOINT, RK4, end_stage
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run, nominal_step
from tests.independent.flights import fly_matrix
from tests.independent.make_reference import VEHICLE
from tests.independent.nominal import Glider
from tests.support.model_states import P, state


def flown(x: np.ndarray, act, dt: float, seconds: float, vehicle: np.ndarray = P) -> np.ndarray:
    x = x.copy()
    nominal_run(vehicle, x, *act, 0.0, 0.0, 0.0, dt, round(seconds / dt), np.zeros((5, layout.N_X)))
    return x


def attitude(x: np.ndarray) -> Rotation:
    return Rotation.from_quat(x[[4, 5, 6, 3]])


def test_fourth_order():
    act = (0.4, -0.02, 0.1)  # where they stand already: no rate limit, no kink
    start = state((0.3, -0.2, 0.5), (0.35, 0.05, 0.03, 0.3, 0.2, -0.2), act)
    exact = flown(start, act, 0.0005, 4.0)
    steps = np.array([0.04, 0.02, 0.01])
    errors = np.array([np.linalg.norm(flown(start, act, dt, 4.0) - exact) for dt in steps])
    orders = np.log2(errors[:-1] / errors[1:])
    assert ((orders > 3.7) & (orders < 4.4)).all(), orders
    assert errors[-1] < 1e-7


@pytest.mark.parametrize(("method", "order"), [(RK4, 4), (MIDPOINT, 2)])
def test_each_method_has_its_order(method, order):
    """On x' = t x - y, y' = x + t^2: an equation of its own, in which time and states work on each other."""

    def last(steps):
        x, k, total, dt = np.array([1.0, -0.5]), np.zeros(2), np.zeros(2), 2.0 / steps
        for n in range(steps):
            y = x.copy()
            for stage, (node, _) in enumerate(method):
                t = (n + node) * dt
                k[:] = t * y[0] - y[1], y[0] + t * t
                end_stage(method, stage, dt, x, k, total, y, 2)
        return x

    exact = last(4096) if order == 4 else last(4096) + (last(4096) - last(2048)) / 3.0
    errors = np.array([np.linalg.norm(last(steps) - exact) for steps in (32, 64, 128)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders == pytest.approx(order, abs=0.1)


def test_two_runs_are_one_run():
    start, act = state((0.3, -0.2, 0.5), (0.35, 0.05, 0.03, 0.3, 0.2, -0.2)), (0.4, -0.02, 0.1)
    halves = flown(flown(start, act, 0.01, 2.0), act, 0.01, 3.0)
    np.testing.assert_array_equal(halves, flown(start, act, 0.01, 5.0))


# Thrown over: theta passes +90 and -90 deg, with roll and yaw in it.
THROWN = dict(euler=(0.05, 0.1, 0.3), nu=(0.05, 0.02, 0.0, 0.1, 2.5, 0.2), act=(0.2, 0.005, 0.05))
WITHOUT_WATER_FORCES = P.copy()
WITHOUT_WATER_FORCES[layout.K_D0 : layout.K_R + 1] = 0.0


@pytest.mark.parametrize(
    # astern the angle of attack jumps from pi to -pi, and with it the forces: no step meets that exactly
    ("vehicle", "forces", "tolerance"), [(WITHOUT_WATER_FORCES, 0.0, 1e-8), (P, 1.0, 5e-3)], ids=["smooth", "water"]
)  # fmt: skip
def test_loops_through_both_poles(vehicle, forces, tolerance):
    """Against the independent model with a rotation matrix for its attitude."""
    glider = Glider.from_file(VEHICLE)
    glider.water.update({name: forces * value for name, value in glider.water.items()})
    times, act = np.linspace(0.0, 6.0, 61), np.array(THROWN["act"])
    begin = [0.0, 0.0, 0.0, *THROWN["euler"], *THROWN["nu"], *act]
    x, steepest, upside_down = state(**THROWN), 0.0, 0
    for row in fly_matrix(glider, begin, times, np.tile(act, (len(times), 1)))[1:]:
        x = flown(x, act, 0.002, times[1], vehicle)
        phi, theta, _ = euler_from_quaternion(*x[3:7])
        steepest, upside_down = max(steepest, abs(theta)), upside_down + (abs(phi) > 2.0)
        assert (attitude(x).inv() * Rotation.from_matrix(row[3:12].reshape(3, 3))).magnitude() < tolerance
        np.testing.assert_allclose(x[:3], row[:3], atol=tolerance)
        np.testing.assert_allclose(x[7:13], row[12:18], atol=tolerance)
    assert steepest > 1.4
    assert upside_down > 5


def test_loop_is_what_its_own_rates_add_up_to():
    """The attitude of a loop against scipy's rotation vectors, put together from the rates in the middle of steps."""
    act, dt = THROWN["act"], 0.001
    x, work = state(**THROWN), np.zeros((5, layout.N_X))
    turned = attitude(x)
    for _ in range(3000):
        nominal_step(WITHOUT_WATER_FORCES, x, *act, 0.0, 0.0, 0.0, 0.5 * dt, work)
        turned = turned * Rotation.from_rotvec(dt * x[10:13])
        nominal_step(WITHOUT_WATER_FORCES, x, *act, 0.0, 0.0, 0.0, 0.5 * dt, work)
    assert (turned.inv() * attitude(x)).magnitude() < 1e-5


def test_straight_through_the_pole():
    """Pitching up through exactly 90 deg wings level: the Euler rates break there, the flight does not."""
    start = state((0.0, np.pi / 2, 0.0), (0.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    x = flown(start, (0.0, 0.0, 0.0), 0.01, 1.0)
    assert np.isfinite(x).all()
    np.testing.assert_allclose(x[[1, 4, 6, 8, 10, 12]], 0.0, atol=1e-15)
    assert (attitude(x).inv() * attitude(start)).magnitude() > 0.5


def test_quaternion_stays_at_unit_length():
    x = flown(state((0.3, -0.2, 0.5), (0.35, 0.05, 0.03, 1.0, 1.0, 1.0)), (1.0, -0.02, 0.1), 0.01, 600.0)
    assert abs(np.linalg.norm(x[3:7]) - 1.0) < 1e-15
