"""The generated observer: manifolds, its filter against a Kalman filter, windows that never look ahead."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.data.errors import InputError
from glider.tools.own import kernels
from glider.tools.own.check import load_own
from glider.tools.own.declare import DERIVED
from glider.tools.own.diagnose import diagnose_own
from glider.tools.own.driven import driven_inputs
from glider.tools.own.effects import moved, noise_effects, nominal_point, standard_effects
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun
from glider.tools.own.skeleton import write_skeleton
from glider.tools.own.watch import watch

small = st.lists(st.floats(-0.5, 0.5), min_size=5, max_size=5)
KINDS = np.array([0, 1, 2, 3, 3, 3])
LINEAR = """
import numpy as np
inputs = {"push": "N"}
outputs = [("place", "m", "place_m", 0.1)]
parameters = [("damping", "1/s", 0.4, 0.1), ("mass", "kg", 2.0, 0.2)]
states = [("x", "m"), ("v", "m/s")]
noises = [("shove", "m/s2", 0.3)]
def step(x, u, w, theta, dt):
    return np.array([x[0] + dt * x[1], x[1] + dt * (u[0] / theta[1] - theta[0] * x[1] + w[0])])
def measure(x, u, theta):
    return np.array([x[0]])
def initial(y):
    return np.array([0.0, 0.0]), np.array([0.5, 0.5])
"""


@given(small, small)
def test_plus_and_minus_are_each_others_inverse(turn, error):
    x = kernels.plus(np.array([0.3, 3.0, 1.0, 0.0, 0.0, 0.0]), np.array(turn), KINDS)
    d = np.array(error)
    found = np.zeros(5)
    kernels.minus(kernels.plus(x, d, KINDS), x, KINDS, found)
    # a quaternion's error is twice the tangent of half the angle
    assert found == pytest.approx(d, abs=1e-9)
    assert np.linalg.norm(kernels.plus(x, d, KINDS)[2:]) == pytest.approx(1.0)


@pytest.fixture
def linear(tmp_path, monkeypatch):
    """A linear model in plain Python, and a run of it."""
    monkeypatch.setenv("GLIDER_OWN_PYTHON", "1")
    (tmp_path / "linear.py").write_text(LINEAR)
    (tmp_path / "linear.toml").write_text('format = 1\nmodel = "linear"\n[windows]\nseconds = 4.0\n')
    random = np.random.default_rng(3)
    t = np.arange(0.0, 12.0, 0.1)
    u = np.repeat(random.normal(size=12), 10)[:, None]
    x, y = np.zeros(2), []
    for row in range(len(t)):
        y.append(x[0] + 0.1 * random.normal())
        x = np.array(
            [x[0] + 0.1 * x[1], x[1] + 0.1 * (u[row, 0] / 2.0 - 0.4 * x[1] + 0.3 * random.normal() / np.sqrt(0.1))]
        )
    vehicle = load_own(tmp_path / "linear.toml")
    return vehicle, OwnRun("run0", t, u, np.array(y)[:, None])


def test_the_filter_of_a_linear_model_is_the_kalman_filter(linear):
    vehicle, run = linear
    observer = observer_of(vehicle, [run])
    observer.parts = 1  # the matrices below are of whole steps
    found = observer.filter(0, observer.point)
    F, G, H = np.array([[1.0, 0.1], [0.0, 1.0 - 0.04]]), np.array([[0.0], [0.1]]), np.array([[1.0, 0.0]])
    x, P, value = np.zeros((2, 1)), 0.25 * np.eye(2), 0.0
    for row in range(len(run.t)):
        if row:
            x = F @ x + np.array([[0.0], [0.05]]) * run.inputs[row - 1]
            P = F @ P @ F.T + G @ G.T * 0.3**2 / 0.1
        S = float((H @ P @ H.T)[0, 0]) + 0.1**2
        nu = float(run.outputs[row, 0] - x[0, 0])
        value += nu**2 / S + np.log(S)
        K = P @ H.T / S
        x, P = x + K * nu, P - K @ H @ P
        assert found.states[row] == pytest.approx(x[:, 0], abs=1e-6)
    assert found.value == pytest.approx(value, abs=1e-4)


def test_following_the_filters_own_model_gives_its_states(linear):
    vehicle, run = linear
    observer = observer_of(vehicle, [run])
    found = observer.filter(0, observer.point)
    assert observer.follow(0, observer.point, found) == pytest.approx(found.states, abs=1e-9)


def test_a_prediction_uses_nothing_behind_a_windows_warm_up(linear):
    vehicle, run = linear
    observer = observer_of(vehicle, [run])
    before = observer.predict(0, observer.point, 4.0, observer.filter(0, observer.point).states)
    blank = run.outputs.copy()
    blank[run.t > 8.41] = np.nan
    observer = observer_of(vehicle, [OwnRun("run0", run.t, run.inputs, blank)])
    after = observer.predict(0, observer.point, 4.0, observer.filter(0, observer.point).states)
    assert np.array_equal(before, after, equal_nan=True)
    assert np.isfinite(after).sum() > 70


def test_every_standard_effect_moves_what_it_is_of_and_nothing_at_no_size(linear):
    vehicle, run = linear
    observer = observer_of(vehicle, [run])
    effects = standard_effects(vehicle.declared, [run], observer.tolerances)
    assert {"push_gain", "push_rate_limit", "place_bias", "place_delay", "damping", "mass"} <= {
        one.label for one in effects
    }
    kinds = {"inputs": {one.kind for one in effects if one.family == "input"},
             "outputs": {one.kind for one in effects if one.family == "output"},
             "noises": {one.kind for one in noise_effects(vehicle.declared)}}  # fmt: skip
    assert {what: set(names) for what, names in DERIVED.items()} == kinds
    base = nominal_point(vehicle.declared)
    base.variance = observer.point.variance
    by = observer.filter(0, base)
    nothing = observer.residuals(0, [base], by, 4.0)[0]
    for one in effects:
        point = moved(vehicle.declared, base, [one], np.zeros(1))
        assert np.array_equal(observer.residuals(0, [point], by, 4.0)[0], nothing), one.label
        point = moved(vehicle.declared, base, [one], np.array([1e-9]))  # and no jump at its beginning
        assert observer.residuals(0, [point], by, 4.0)[0] == pytest.approx(nothing, abs=1e-6), one.label
        point = moved(vehicle.declared, base, [one], np.array([3.0]))
        moves = np.abs(observer.residuals(0, [point], by, 4.0)[0] - nothing).max()
        assert moves > 1e-3, one.label


def test_an_input_that_is_late_is_the_input_of_before(linear):
    vehicle, run = linear
    late = next(one for one in standard_effects(vehicle.declared, [run], np.ones(1)) if one.label == "push_delay")
    point = moved(vehicle.declared, nominal_point(vehicle.declared), [late], np.array([0.5 / late.spread]))
    assert driven_inputs(run, vehicle.declared, point)[60:, 0] == pytest.approx(run.inputs[55:-5, 0])


@pytest.mark.parametrize("interpolated", [False, True])
def test_an_input_that_lags_is_that_of_a_lag_flown_in_steps_a_hundred_times_finer(linear, interpolated):
    vehicle, run = linear
    declared = replace(vehicle.declared, inputs=(replace(vehicle.declared.inputs[0], interpolated=interpolated),))
    (lag,) = [one for one in standard_effects(declared, [run], np.ones(1)) if one.label == "push_lag"]
    point = moved(declared, nominal_point(declared), [lag], np.array([0.3 / lag.spread]))
    found, fine = driven_inputs(run, declared, point)[:, 0], 100
    u, dt, z = run.inputs[:, 0], float(run.t[1] - run.t[0]) / fine, run.inputs[0, 0]
    at_rows, means = [z], []
    for k in range(len(u) - 1):
        course = []
        for step in range(fine):
            wanted = u[k] + (u[k + 1] - u[k]) * (step + 0.5) / fine if interpolated else u[k]
            z += dt / 0.3 * (wanted - z)
            course.append(z)
        at_rows.append(z)
        means.append(np.mean(course))
    reach = np.ptp(u)
    assert found[:-1] == pytest.approx(np.array(at_rows[:-1] if interpolated else means), abs=0.01 * reach)


def test_what_is_known_of_a_start_holds_against_a_sensor(tmp_path, linear):
    vehicle, run = linear
    text = vehicle.text + "[start]\nplace = { value = 0.0, uncertainty = 0.01 }\n"
    vehicle.path.write_text(text)
    off = OwnRun("run0", run.t, run.inputs, run.outputs + 5.0)
    observer = observer_of(load_own(vehicle.path), [off])
    x, P = observer.start(0, observer.point)
    assert abs(x[0]) < 0.01
    assert np.sqrt(P[0, 0]) == pytest.approx(0.01, rel=0.01)


def test_states_known_at_the_start_hold_against_the_models_own_initial_and_what_sensors_read_off_is_predicted(tmp_path):
    file = tmp_path / "mine.toml"
    write_skeleton(file)
    text = file.read_text().replace("[start]", "[start]\nsink_rate = { value = 0.3, uncertainty = 0.01 }")
    file.write_text(text)
    t = np.arange(0.0, 30.0, 0.1)
    y, off_by = np.tile([2.0, 0.1, 0.0], (len(t), 1)), np.array([7.0, 0.0, 0.0])
    run = OwnRun("run0", t, np.zeros((len(t), 2)), y)
    x, P = observer_of(load_own(file), [run]).start(0, nominal_point(load_own(file).declared))
    assert (x[0], x[1]) == (2.0, 0.3)
    assert np.sqrt(np.diag(P))[:2] == pytest.approx([0.05, 0.01])
    file.write_text(text.replace("[sensors.depth]", "[sensors.depth]\noffset = 7.0"))
    off = observer_of(load_own(file), [replace(run, outputs=y + off_by)])
    file.write_text(text)
    assert off.predicted(0) == pytest.approx(observer_of(load_own(file), [run]).predicted(0) + off_by)


def test_errors_of_an_angle_are_counted_through_turns_where_they_are_fitted(tmp_path, linear):
    _, run = linear
    (tmp_path / "turning.py").write_text(
        LINEAR.replace(
            '[("place", "m", "place_m", 0.1)]',
            '[{"name": "heading", "unit": "rad", "noise": 0.1, "angle": True, "tolerance": 0.1}]',
        )
    )
    (tmp_path / "turning.toml").write_text('format = 1\nmodel = "turning"\n[windows]\nseconds = 4.0\n')
    turned = np.linspace(0.0, 9.0, len(run.t))[:, None]
    turned[40] = np.nan
    observer = observer_of(load_own(tmp_path / "turning.toml"), [OwnRun("run0", run.t, run.inputs, turned)])
    starts, ends = observer.windows(0, 12.0)
    counted = observer.errors(0, np.zeros_like(turned), 12.0, wrapped=False)
    rows = np.arange(starts[0] + 1, ends[0])
    assert counted[:, 0] == pytest.approx(turned[rows, 0] / 0.1, nan_ok=True)
    assert np.nanmax(np.abs(observer.errors(0, np.zeros_like(turned), 12.0))) <= np.pi / 0.1


def test_a_vehicle_whose_file_leaves_nothing_open_is_watched_and_diagnosed(tmp_path):
    (tmp_path / "sure.py").write_text(LINEAR.replace("0.4, 0.1)", "0.4, 0.0)").replace("2.0, 0.2)", "2.0, 0.0)"))
    (tmp_path / "sure.toml").write_text('format = 1\nmodel = "sure"\n[windows]\nseconds = 4.0\n')
    random, t = np.random.default_rng(1), np.arange(0.0, 12.0, 0.1)
    runs = [OwnRun(f"run{n}", t, np.ones((len(t), 1)), 0.1 * random.normal(size=(len(t), 1))) for n in range(5)]
    vehicle = load_own(tmp_path / "sure.toml")
    assert len(watch(vehicle, runs).plain()["runs"]) > 0
    found, _ = diagnose_own(vehicle, runs[:2])
    assert sum(found.chances.values()) == pytest.approx(1.0)


def test_windows_without_a_length_are_of_all_runs_time_constants_in_whatever_order(tmp_path, monkeypatch):
    """Quadratic damping: the faster a run, the faster it decays."""
    monkeypatch.setenv("GLIDER_OWN_PYTHON", "1")
    (tmp_path / "fast.py").write_text(LINEAR.replace("theta[0] * x[1]", "theta[0] * abs(x[1]) * x[1]"))
    (tmp_path / "fast.toml").write_text('format = 1\nmodel = "fast"\n')
    vehicle, t = load_own(tmp_path / "fast.toml"), np.arange(0.0, 12.0, 0.1)
    runs = [OwnRun(str(push), t, np.full((len(t), 1), 2.0 * push), (0.6 * push**0.5 * t)[:, None], None)
            for push in (0.02, 0.5, 1.0)]  # fmt: skip
    seconds = [observer_of(vehicle, [runs[n] for n in order]).horizon for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0))]
    assert seconds == pytest.approx([seconds[0]] * 3)
    each = [observer_of(vehicle, [run]).horizon for run in runs]
    assert each[2] < each[1] < each[0]
    assert seconds[0] == pytest.approx(each[1], rel=0.01)


STIFF = """
import numpy as np
inputs = {"push": "N"}
outputs = [("place", "m", "place_m", 0.1)]
parameters = [("damping", "1/m", 30.0, 5.0)]
states = [("x", "m"), ("v", "m/s")]
noises = [("shove", "m/s2", 0.05)]
def derivative(x, u, w, theta):
    return np.array([x[1], u[0] - theta[0] * abs(x[1]) * x[1] + w[0]])
def measure(x, u, theta):
    return np.array([x[0]])
"""


def sped(vehicle) -> OwnRun:
    """At rest, then pushed to half a metre a second, a row each second; flown in small steps."""
    t, x, places = np.arange(0.0, 20.0, 1.0), np.zeros(2), []
    push = np.where(t < 3.0, 0.0, 7.5)[:, None]
    for row in range(len(t)):
        places.append(x[0])
        for _ in range(200):
            x = x + 0.005 * np.asarray(vehicle.model.derivative(x, push[row], np.zeros(1), np.array([30.0])))
    return OwnRun("run7", t, push, np.array(places)[:, None], None)


def test_a_model_that_is_stiff_only_at_speed_is_flown_in_smaller_steps(tmp_path, monkeypatch):
    monkeypatch.setenv("GLIDER_OWN_PYTHON", "1")
    (tmp_path / "stiff.py").write_text(STIFF)
    (tmp_path / "stiff.toml").write_text('format = 1\nmodel = "stiff"\n[windows]\nseconds = 10.0\n')
    vehicle = load_own(tmp_path / "stiff.toml")
    found = observer_of(vehicle, [sped(vehicle)])
    assert found.parts > 1
    assert any("stiff" in note for note in found.notes)
    assert found.gaps(0, found.point, 10.0)[0] < 0.5


def test_a_filter_that_is_lost_is_said_to_be_and_its_windows_count_as_lost(tmp_path, monkeypatch):
    """The model has no answer beyond 2 m: windows before are flown, those behind are lost."""
    monkeypatch.setenv("GLIDER_OWN_PYTHON", "1")
    (tmp_path / "whole.py").write_text(STIFF)
    (tmp_path / "whole.toml").write_text('format = 1\nmodel = "whole"\n')
    (tmp_path / "edge.py").write_text(STIFF.replace("u[0] -", "u[0] + 0.0 * float(np.log(max(2.0 - x[0], 0.0))) -"))
    (tmp_path / "edge.toml").write_text('format = 1\nmodel = "edge"\n[windows]\nseconds = 4.0\n')
    found = observer_of(load_own(tmp_path / "edge.toml"), [sped(load_own(tmp_path / "whole.toml"))])
    assert any(note.startswith("run7: the filter is lost ") for note in found.notes), found.notes
    errors = np.abs(found.errors(0, found.predict(0, found.point, 4.0, found.filter(0, found.point).states), 4.0))
    assert errors[0] < 1.0
    assert errors[-1] == 100.0


def test_a_sensor_that_reads_seldom_says_all_the_same_how_a_run_begins(linear):
    """Every 4 s, the first time after 8 s: its first readings and their slope, not NaN."""
    vehicle, run = linear
    y = np.where((np.arange(len(run.t)) % 40 == 0) & (run.t > 7.0), 1.0 + 0.1 * run.t, np.nan)[:, None]
    longer = replace(run, t=4.0 * run.t, outputs=y)
    readings = observer_of(vehicle, [longer]).first_readings(0, nominal_point(vehicle.declared))
    assert readings["place"] == pytest.approx(1.8)
    assert np.isnan(readings["place_rate"])  # two readings
    more = replace(
        longer, outputs=np.where(np.arange(len(run.t))[:, None] % 20 == 0, 1.0 + 0.1 * run.t[:, None], np.nan)
    )
    assert observer_of(vehicle, [more]).first_readings(0, nominal_point(vehicle.declared))[
        "place_rate"
    ] == pytest.approx(0.025)


def test_a_model_that_jumps_at_speed_is_said_to_and_its_steps_stay(tmp_path, monkeypatch):
    monkeypatch.setenv("GLIDER_OWN_PYTHON", "1")
    (tmp_path / "whole.py").write_text(STIFF)
    (tmp_path / "whole.toml").write_text('format = 1\nmodel = "whole"\n')
    jump = "(100.0 if np.sin(1e4 * x[1]) > 0.0 else -100.0) * (abs(x[1]) > 0.05) + u[0] -"
    (tmp_path / "jumps.py").write_text(STIFF.replace("u[0] -", jump))
    (tmp_path / "jumps.toml").write_text('format = 1\nmodel = "jumps"\n[windows]\nseconds = 4.0\n')
    found = observer_of(load_own(tmp_path / "jumps.toml"), [sped(load_own(tmp_path / "whole.toml"))])
    assert found.parts == 1
    assert any("do not agree along the runs" in note for note in found.notes)


TURNING = """
import numpy as np
inputs = {"push": "N"}
outputs = [("place", "m", "place_m", 0.1)]
parameters = [("damping", "1/s", 0.4, 0.1)]
states = [("x", "m"), ("course", "rad", "angle"), *((f"q{n}", "1", "quaternion") for n in range(4))]
noises = [("shove", "m/s2", 0.3)]
def derivative(x, u, w, theta):
    if x[0] > 2.0:
        raise ValueError("deeper than it was built for")
    p, q, r = 0.3 * x[0], -0.2 * np.sin(x[1]), 0.5
    return np.array([u[0] - theta[0] * x[0] * abs(x[0]) + w[0], 0.7 * x[0] * np.cos(x[1]),
                     -0.5 * (x[3] * p + x[4] * q + x[5] * r), 0.5 * (x[2] * p + x[4] * r - x[5] * q),
                     0.5 * (x[2] * q + x[5] * p - x[3] * r), 0.5 * (x[2] * r + x[3] * q - x[4] * p)])
def measure(x, u, theta):
    return np.array([x[0]])
"""


def turning(folder):
    (folder / "turning.py").write_text(TURNING)
    (folder / "turning.toml").write_text('format = 1\nmodel = "turning"\n[windows]\nseconds = 4.0\n')
    return load_own(folder / "turning.toml")


@pytest.mark.parametrize("parts", [1, 3])
def test_what_a_derivative_makes_of_errors_is_what_its_steps_make_of_them(tmp_path, parts):
    model = turning(tmp_path).model

    def motion(out, x, u, w, theta, dt):
        out[:] = model.derivative(x, u, w, theta)

    def whole(out, x, u, w, theta, dt):
        out[:] = kernels.advance(motion, False, x, u, w, theta, dt, parts)

    own, density, dt = np.array([[0.0], [0.1], [1e-6]]), np.array([0.3]), 0.05
    x = kernels.normalised(np.array([0.8, 1.1, 0.7, -0.4, 0.5, 0.2]), KINDS)
    found = []
    for given_motion, stepped, taken in ((motion, False, parts), (whole, True, 1)):
        F, G, theta = np.zeros((6, 6)), np.zeros((6, 1)), np.array([0.4])
        after = kernels.transition(
            (given_motion, stepped, dt, taken),
            x,
            np.array([0.3]),
            np.zeros(1),
            theta,
            KINDS,
            np.ones(5),
            density,
            own,
            F,
            G,
            np.empty((parts, 6, 6 + 1 + 1 + 3)),
        )
        found.append((after, F, G))
    (by_rates, F, G), (by_steps, F_steps, G_steps) = found
    assert by_rates == pytest.approx(by_steps, abs=1e-12)
    assert pytest.approx(F_steps, abs=1e-4) == F
    assert pytest.approx(G_steps, abs=1e-5) == G
    assert np.abs(F[:5, 5]).max() > 1e-3
    assert np.abs(F[2:5, 0]).max() > 1e-3


def test_what_a_compiled_function_raises_is_said_where_the_run_is_lost(tmp_path):
    vehicle = turning(tmp_path)
    assert vehicle.kernels.compiled, vehicle.kernels.why
    t = 0.1 * np.arange(60)
    run = OwnRun("run3", t, np.full((60, 1), 0.1), np.linspace(0.1, 2.5, 60)[:, None])
    notes = observer_of(vehicle, [run]).notes
    assert any(note.startswith("run3: the filter is lost") and "turning.py:10: " in note for note in notes), notes
    with pytest.raises(InputError, match=r"turning\.py:10: run3: ValueError: deeper than"):
        observer_of(vehicle, [replace(run, inputs=30.0 * run.inputs)])


def test_the_observer_is_compiled_once_for_all_models(tmp_path):
    for damping in (0.3, 0.5):
        folder = tmp_path / str(damping)
        folder.mkdir()
        (folder / "linear.py").write_text(LINEAR.replace("0.4", str(damping)))
        (folder / "linear.toml").write_text('format = 1\nmodel = "linear"\n[windows]\nseconds = 4.0\n')
        vehicle = load_own(folder / "linear.toml")
        run = OwnRun("run0", 0.1 * np.arange(60), np.zeros((60, 1)), np.zeros((1, 60)).T)
        observer = observer_of(vehicle, [run])
        assert np.isfinite(observer.filter(0, observer.point).value)
        assert vehicle.kernels.compiled, vehicle.kernels.why
        assert len(vehicle.kernels.filter_run.func.signatures) == 1
