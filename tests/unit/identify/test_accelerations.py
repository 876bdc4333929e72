"""The paper's likelihood in weak form: it finds what was flown, and a capture without noise leaves little error."""

import numpy as np
import pytest

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.data.errors import InputError
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.acceleration_likelihood import _width, fit_accelerations, kinematics
from glider.tools.identify.core.regressors import flown_servo
from glider.tools.identify.design import make_runs
from glider.tools.inference.model import Model
from glider.tools.inference.vehicle_parameters import coefficient_sizes


def errors(seed: int, square: bool) -> np.ndarray:
    """Errors of the coefficients in their sizes, (12,), from all 45 runs."""
    vehicle = load_vehicle("roughie")
    runs, world = make_runs(vehicle, seed, square=square)
    P = vehicle.vector()
    statistics, free = fit_accelerations(Model("nominal", P, np.zeros_like(P)), runs)
    truth = [world.coefficients()[name] for name in COEFFICIENTS]
    return np.abs(free.si(statistics.mode) - truth) / coefficient_sizes(P)


def test_coefficients_are_found_where_the_capture_sits_square():
    found = errors(2, square=True)
    assert np.median(found) < 0.01
    assert found.max() < 0.05


def test_a_capture_that_sits_askew_and_late_biases_this_likelihood():
    found = errors(2, square=False)  # what the trajectory likelihood is for
    assert 0.01 < np.median(found) < 0.1


def test_velocities_are_those_flown():
    vehicle = load_vehicle("roughie")
    runs, world = make_runs(vehicle, 3, [0])
    motion = kinematics(runs[0], vehicle.vector())
    speed = np.linalg.norm(motion.nu[50:-50, :3], axis=1)
    path = np.column_stack([runs[0].columns[name] for name in ("mocap_x_m", "mocap_y_m", "mocap_z_m")])
    ends = path[np.isfinite(path).all(axis=1)]
    assert np.all(speed < 1.0)
    assert speed.mean() * 18.0 > np.linalg.norm(ends[-1] - ends[0])  # no path is shorter than a straight line
    assert world.P.shape == vehicle.vector().shape


@pytest.mark.parametrize("time_constant", [0.1, 0.002])
def test_a_servo_is_flown_exactly_however_fast(time_constant):
    t = np.arange(41) * 0.05
    commands = np.where(t < 1.0, 0.5, -2.0)  # the last is beyond its range
    low, high, rate = -0.7, 0.7, 2.0
    servo, exact, at = np.empty(41), [0.0], 0.0
    flown_servo(t, commands, low, high, rate, time_constant, servo)
    for command in commands[:-1]:
        for _ in range(1000):
            at += 5e-5 * np.clip((np.clip(command, low, high) - at) / time_constant, -rate, rate)
        exact.append(at)
    np.testing.assert_allclose(servo, exact, atol=1e-4)
    assert servo[-1] == pytest.approx(low, abs=0.002)


def test_bandwidth_is_as_stated():
    half = _width(50.0) // 2
    assert 4.0 / (3.2 * half - 4.6) * 50.0 / 2.0 == pytest.approx(2.3, abs=0.05)  # Schafer (2011), equation (12)


def test_runs_without_capture_are_refused():
    vehicle = load_vehicle("roughie")
    P = vehicle.vector()
    run = Run("run00", None, {"t_s": np.arange(10.0)})
    with pytest.raises(InputError, match="motion capture"):
        fit_accelerations(Model("nominal", P, np.zeros_like(P)), [run])
