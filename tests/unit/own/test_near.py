"""Models near one, flown with it at once, against each of them flown by itself; and functions that are called back."""

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.own.check import load_own
from glider.tools.own.compiled import plain
from glider.tools.own.effects import moved, standard_effects, unexplained
from glider.tools.own.near import errors_near, errors_pushed, errors_unsettled
from glider.tools.own.observer import LOST, Observer
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun

HORIZON = 5.0
PENDULUM = """
import math
import numpy as np
states = [("angle", "rad", "angle"), ("rate", "rad/s"), ("q0", "1", "quaternion"), ("q1", "1", "quaternion"),
          ("q2", "1", "quaternion"), ("q3", "1", "quaternion")]
inputs = {"torque": "N m"}
outputs = [{"name": "angle", "unit": "rad", "noise": 0.01, "angle": True, "tolerance": 0.05},
           {"name": "tilt", "unit": "1", "noise": 0.01, "tolerance": 0.05}]
parameters = [("stiffness", "1/s2", 2.0, 0.2), ("drag", "1/rad", 0.3, 0.1), ("gain", "1/kg m2", 1.5, 0.2),
              {"name": "trim", "unit": "rad/s2", "value": 0.1, "uncertainty": 0.1, "scope": "run"}]
noises = [("shake", "rad/s2", 0.05), ("turn", "rad/s", 0.02)]


def derivative(x, u, w, theta):
    out = np.empty(6)
    out[0] = x[1]
    out[1] = theta[3] - theta[0] * math.sin(x[0]) - theta[1] * x[1] * abs(x[1]) + theta[2] * u[0] + w[0]
    p, q = 0.2 * x[1] + w[1], 0.3
    out[2] = 0.5 * (-x[3] * p - x[4] * q)
    out[3] = 0.5 * (x[2] * p - x[5] * q)
    out[4] = 0.5 * (x[2] * q + x[5] * p)
    out[5] = 0.5 * (x[3] * q - x[4] * p)
    return out


def measure(x, u, theta):
    y = np.empty(2)
    y[0], y[1] = x[0], 2.0 * (x[3] * x[4] - x[2] * x[5])
    return y


def initial(y):
    return np.array([y["angle"], y["angle_rate"], 1.0, 0.0, 0.0, 0.0]), np.array([0.02, 0.1, 0.05, 0.05, 0.05])
"""
DICTIONARIES = (
    PENDULUM.replace("    out[0] = x[1]\n", "    out[0] = x[PLACES['rate']]\n").replace(
        "    y = np.empty(2)\n", "    y = np.empty(2)\n    assert x[0] == x[0]\n"
    )
    + """
PLACES = {"rate": 1}
"""
)


def observer(folder, source):
    """A pendulum with an attitude beside it, and a run of 12 s in which it swings."""
    (folder / "pendulum.py").write_text(source)
    (folder / "vehicle.toml").write_text('format = 1\nmodel = "pendulum"\n')
    vehicle = load_own(folder / "vehicle.toml")
    random, t = np.random.default_rng(5), np.arange(0.0, 12.0, 0.1)
    u, x = np.repeat(0.7 * random.normal(size=12), 10)[:, None], np.array([0.5, 0.0, 1.0, 0.0, 0.0, 0.0])
    theta, readings = np.array([2.1, 0.25, 1.6, 0.05]), []
    for row in range(len(t)):
        readings.append(vehicle.kernels.measure(x, u[row], theta) + 0.01 * random.normal(size=2))
        x = vehicle.kernels.advance(x, u[row], 0.1 * random.normal(size=2), theta, 0.1, 4)
    return observer_of(vehicle, [OwnRun("run0", t, u, np.array(readings))])


@pytest.fixture(scope="module")
def swinging(tmp_path_factory) -> Observer:
    return observer(tmp_path_factory.mktemp("compiled"), PENDULUM)


def test_models_near_one_are_what_each_is_by_itself(swinging):
    by = swinging.filter(0, swinging.point)
    effects = standard_effects(swinging.declared, swinging.runs, swinging.tolerances)
    effects += unexplained(swinging.declared, swinging.runs)
    sizes = [0.3 if one.one_sided else 0.01 for one in effects]
    points = [moved(swinging.declared, swinging.point, effects, np.where(np.arange(len(effects)) == k, size, 0.0))
              for k, size in enumerate(sizes)]  # fmt: skip
    each = swinging.residuals(0, [swinging.point, *points], by, HORIZON)
    near = errors_near(swinging, 0, [swinging.point, *points], by, HORIZON)
    by = swinging.filter(0, swinging.point, linear=True)
    assert errors_near(swinging, 0, [swinging.point, *points], by, HORIZON) == pytest.approx(near, abs=1e-7)
    assert near[0] == pytest.approx(each[0], abs=1e-9)
    for effect, one, other in zip(effects, each[1:] - each[0], near[1:] - near[0], strict=True):
        assert np.abs(one).max() > 1e-4, effect.label
        allowed = 0.1 if effect.one_sided else 0.03  # to first order: these are of a finite size
        assert np.sqrt(np.mean((other - one) ** 2)) < allowed * np.sqrt(np.mean(one**2)), effect.label


def test_few_at_once_are_the_same_as_many(swinging, monkeypatch):
    by = swinging.filter(0, swinging.point)
    effects = standard_effects(swinging.declared, swinging.runs, swinging.tolerances)
    points = [moved(swinging.declared, swinging.point, effects, 0.1 * row) for row in np.eye(len(effects))]
    many = errors_near(swinging, 0, [swinging.point, *points], by, HORIZON)
    monkeypatch.setattr("glider.tools.own.near.MOST_ROWS", 5 * len(swinging.runs[0].t))
    monkeypatch.setattr("glider.tools.own.observer.MOST_LINEAR", 100)
    by = swinging.filter(0, swinging.point, linear=True)
    assert by.linear.size == 0
    assert errors_near(swinging, 0, [swinging.point, *points], by, HORIZON) == pytest.approx(many, abs=1e-9)


def test_models_near_one_whose_filter_is_lost_go_on(swinging):
    lost = swinging.point.copy()
    lost.variance[:] = -1.0
    by, whole = swinging.filter(0, lost, linear=True), swinging.filter(0, lost)
    assert by.value == np.inf
    other = swinging.point.copy()
    other.theta *= 1.01
    near = errors_near(swinging, 0, [lost, other], by, HORIZON)
    assert near == pytest.approx(errors_near(swinging, 0, [lost, other], whole, HORIZON))
    assert near[0] == pytest.approx(swinging.residuals(0, [lost], whole, HORIZON)[0], abs=1e-9)
    assert np.abs(near).max() < LOST


def test_forces_and_starts_move_windows_as_each_does_by_itself(swinging, monkeypatch):
    pushes = np.zeros((3, len(swinging.runs[0].t), 2))
    pushes[0, :, 0], pushes[1, 20:60, 0], pushes[2, :, 1] = 1e-3, 1e-3, 1e-3
    # a start is 1 sigma of the filter off: a small one
    monkeypatch.setattr(swinging.point, "variance", 1e-4 * swinging.point.variance)
    monkeypatch.setattr(swinging.point, "density", 1e-2 * swinging.point.density)
    pushed, begun = errors_pushed(swinging, 0, pushes, HORIZON), errors_unsettled(swinging, 0, HORIZON)
    monkeypatch.setattr(Observer, "gives_rates", False)
    for near, each in ((pushed, errors_pushed(swinging, 0, pushes, HORIZON)),
                       (begun, errors_unsettled(swinging, 0, HORIZON))):  # fmt: skip
        assert near[0] == pytest.approx(each[0], abs=1e-9)
        for one, other in zip(each[1:] - each[0], near[1:] - near[0], strict=True):
            assert np.sqrt(np.mean((other - one) ** 2)) < 0.03 * np.sqrt(np.mean(one**2))
            assert np.abs(one).max() > 0.0


def test_functions_that_are_called_back_are_the_compiled_ones(swinging, tmp_path):
    called = observer(tmp_path, DICTIONARIES)
    assert not called.vehicle.kernels.compiled
    assert "plain Python" in called.vehicle.kernels.said
    by, again = swinging.filter(0, swinging.point), called.filter(0, called.point)
    assert again.value == pytest.approx(by.value, abs=1e-6)
    assert again.gains == pytest.approx(by.gains, abs=1e-9)
    effects = standard_effects(called.declared, called.runs, called.tolerances)
    points = [moved(called.declared, called.point, effects, 0.1 * row) for row in np.eye(len(effects))]
    assert errors_near(called, 0, points, again, HORIZON) == pytest.approx(
        errors_near(swinging, 0, points, by, HORIZON), abs=1e-6
    )
    called.vehicle._kernels = plain(called.vehicle.model, "nothing is compiled")
    slowly = called.filter(0, called.point)
    assert slowly.states == pytest.approx(again.states, abs=1e-9)
    assert errors_near(called, 0, points, slowly, HORIZON) == pytest.approx(
        errors_near(swinging, 0, points, by, HORIZON), abs=1e-6
    )


@pytest.mark.parametrize(
    ("error", "raised"), [("KeyError('late')", InputError), ("KeyboardInterrupt()", KeyboardInterrupt)]
)
def test_what_a_function_raises_that_is_called_back_ends_the_call_and_not_the_next(tmp_path, error, raised):
    called = observer(tmp_path, DICTIONARIES)
    by = called.filter(0, called.point)
    user = called.vehicle.model.derivative.__globals__
    line = 1 + PENDULUM.splitlines().index(next(one for one in PENDULUM.splitlines() if "math.sin" in one))

    class Math:
        def __getattr__(self, name):
            raise eval(error)

    user["math"], kept = Math(), user["math"]
    with pytest.raises(raised) as said:
        called.filter(0, called.point)
    if raised is InputError:
        assert f"pendulum.py:{line}" in str(said.value)
    user["math"] = kept
    assert called.filter(0, called.point).value == by.value
