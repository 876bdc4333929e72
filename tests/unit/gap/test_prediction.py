"""Predictions of made-up flights: near the truth, whatever columns are missing."""

from dataclasses import replace

import numpy as np
import pytest

from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.vehicle import layout
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import root_mean_square, run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.load import load_model
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import fly as fly_model
from glider.tools.inference.predict import fly_windows_from, observe, predict
from glider.tools.inference.problem import cut, problem_of
from tests.support.cases import make_case
from tests.support.flights import World, case_of, fly, fly_case


def total(case, predictions=None) -> float:
    predictions = predict(case, nominal_model(case), case.runs) if predictions is None else predictions
    pairs = zip(case.runs, predictions, strict=True)
    return root_mean_square(
        [run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t)).total for run, Y in pairs]
    )


@pytest.mark.parametrize("mocap", [False, True])
@pytest.mark.parametrize(("speed", "most"), [(0.0, 1.6), (0.2, 1.3), (0.5, 1.2)])
def test_the_start_is_found_nearly_as_good_as_known(mocap, speed, most):
    """From rest a touch decides the course."""
    found, known = [], []
    for seed in range(5):
        case, flights = fly_case(World(mocap=mocap, start_speed=speed), seed, runs=2)
        problem, P, F = problem_of(case), nominal_model(case).P, np.zeros(ef.N_F)
        bounds = problem.recording.bounds
        gains = observe(problem, P, F)
        found.append(total(case, np.split(fly_windows_from(problem, P, F, gains), bounds[1:-1])))
        gains.X[:] = np.concatenate([flight.truth for flight in flights])
        known.append(total(case, np.split(fly_windows_from(problem, P, F, gains), bounds[1:-1])))
    assert root_mean_square(found) < most * root_mean_square(known)


@pytest.mark.parametrize("speed", [0.0, 0.2, 0.5])
def test_the_launch_is_found_whether_at_rest_or_gliding(speed):
    errors = []
    for seed in range(6):
        case, flights = fly_case(World(mocap=True, start_speed=speed, seconds=20.0), seed, runs=1)
        problem = problem_of(case)
        gains, row = observe(problem, problem.model.P, np.zeros(ef.N_F)), cut(problem).first[0] - 1
        errors.append(gains.X[row, 7] - flights[0].truth[row, 7])
    assert np.sqrt(np.mean(np.square(errors))) < 0.04


def test_without_noise_the_nominal_vehicle_is_predicted_to_the_millimetre():
    world = World(noise=0.0, bias=0.0, disturbance=0.0, uncertainty=0.0, mocap=True)
    case, _ = fly_case(world, 3, runs=2)
    assert total(case) < 0.1


@pytest.mark.parametrize("delay", [0.8, 1.5, 2.5])
def test_poses_that_come_late_are_flown_from_as_those_of_a_right_clock(tmp_path, delay):
    """Nothing recorded behind a window's start is looked at."""
    F, none = np.zeros(ef.N_F), np.zeros(ef.N_F)
    F[ef.MOCAP_DELAY] = delay
    right = problem_of(make_case(tmp_path / "right", none, seed=3, mocap=True))
    wandering = make_case(tmp_path / "late", none, seed=3, mocap=True, late=lambda t: delay * (1 + 0.1 * np.sin(t)))
    late = problem_of(wandering)
    bounds = late.recording.bounds[1:-1]
    of_right = total(right.case, np.split(fly_model(right, right.model.P, none), bounds))
    flown = fly_model(late, late.model.P, F)
    assert total(late.case, np.split(flown, bounds)) < 1.3 * of_right
    scored = cut(late)
    for window in range(2):
        first, last = scored.first[window], scored.last[window]
        blind = late.z.copy()
        blind[first:] = np.nan
        assert np.array_equal(fly_model(replace(late, z=blind), late.model.P, F)[first:last], flown[first:last])


def without(run: Run, *names: str) -> Run:
    return Run(run.name, None, {k: v for k, v in run.columns.items() if k not in names})


RATES, ANGLES = ("p_rad_s", "q_rad_s", "r_rad_s"), ("roll_rad", "pitch_rad", "yaw_rad")


@pytest.mark.parametrize(
    "missing",
    [RATES, ("yaw_rad",), ("slider_m", "ballast_kg"), ("depth_m",), (*ANGLES, *RATES, "depth_m"), ANGLES],
    ids=["rates", "yaw", "draw-wires", "depth", "mocap only", "attitude"],
)
def test_missing_columns_are_missed_but_not_fatal(missing):
    flight = fly(World(mocap=True), 7)
    case = case_of(World(mocap=True), [without(flight.run, *missing)])
    (Y,) = predict(case, nominal_model(case), case.runs)
    assert np.isfinite(Y).all()
    assert total(case, [Y]) < 1.5


def test_without_motion_capture_and_gyro_the_attitude_is_enough():
    case = case_of(World(), [without(fly(World(), 8).run, *RATES)])
    assert total(case) < 1.5


def test_a_run_of_nothing_but_time_and_commands_is_still_flown():
    run = without(fly(World(), 8).run, *RATES, *ANGLES, "depth_m", "slider_m", "ballast_kg")
    case = case_of(World(), [run])
    (Y,) = predict(case, nominal_model(case), case.runs)
    assert np.isfinite(Y).all()


def test_stretches_of_nothing_are_bridged():
    run = fly(World(mocap=True), 9).run
    for name, values in run.columns.items():
        if name != "t_s" and not name.startswith("cmd_"):
            values[0:7] = np.nan
            values[230:290] = np.nan
    case = case_of(World(mocap=True), [run])
    (Y,) = predict(case, nominal_model(case), case.runs)
    assert np.isfinite(Y).all()
    assert total(case, [Y]) < 3.0


@pytest.mark.parametrize("rows", [1, 2, 12, 60, 199])
def test_a_single_short_run(rows):
    run = fly(World(), 10).run
    case = case_of(World(), [Run("run00", None, {k: v[:rows] for k, v in run.columns.items()})])
    (Y,) = predict(case, nominal_model(case), case.runs)
    assert Y.shape[0] == rows
    assert np.isfinite(Y).all()


def test_without_commands_the_draw_wires_fly_it():
    flight = fly(World(commands=False), 11)
    run = flight.run
    run.columns["slider_m"][50:60] = np.nan
    case = case_of(World(), [run])
    model = nominal_model(case)
    assert problem_of(case, model).recording.modes[0] == kf.SERVO_DRIVEN | kf.SLIDER_DRIVEN | kf.BALLAST_DRIVEN
    (Y,) = predict(case, model, case.runs)
    seen = np.isfinite(run.columns["ballast_kg"])
    np.testing.assert_allclose(Y[seen, kf.Z_BALLAST], run.columns["ballast_kg"][seen], atol=2e-3)
    gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
    assert gap.channels["depth"] < 3.0
    assert gap.channels["pitch"] < 3.0


def test_a_current_is_in_the_gap_of_the_position_and_in_no_other():
    case, _ = fly_case(World(mocap=True, water=(0.15, -0.1)), 12, runs=2)
    for run, Y in zip(case.runs, predict(case, nominal_model(case), case.runs), strict=True):
        gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
        assert gap.channels["xy"] > 5.0
        assert gap.channels["depth"] < 2.0
        assert gap.channels["yaw"] < 1.5


def test_a_depth_sensor_that_is_off_does_not_move_the_start_where_motion_capture_knows_better():
    flight = fly(World(mocap=True), 13)
    flight.run.columns["depth_m"] += 0.5
    case = case_of(World(mocap=True), [flight.run])
    (Y,) = predict(case, nominal_model(case), case.runs)
    gap = run_gap(ROUGHIE_MEASURES, flight.run, Y, ROUGHIE_MEASURES.windows(flight.run.t))
    assert gap.channels["depth"] == pytest.approx(10.0, rel=0.3)


def test_commands_that_come_late_are_held():
    run = fly(World(), 14).run
    full = predict(case_of(World(), [run]), nominal_model(case_of(World(), [run])), [run])[0]
    thin = Run("run00", None, {k: v.copy() for k, v in run.columns.items()})
    for name in ("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg"):
        values = thin.columns[name]
        values[1:][np.diff(run.columns[name]) == 0.0] = np.nan  # recorded only when they change
    held = predict(case_of(World(), [thin]), nominal_model(case_of(World(), [thin])), [thin])[0]
    np.testing.assert_array_equal(held, full)


def test_a_vehicle_file_is_a_model(tmp_path):
    from glider.firmware.model.library import shipped

    case, _ = fly_case(World(uncertainty=0.0, changes={layout.K_D0: 1.5}), 15, runs=2)
    text = shipped("model/vehicles")["roughie"].replace("K_D0 = 3.0", "K_D0 = 4.5")
    path = tmp_path / "draggy.toml"
    path.write_text(text)
    better = [predict(case, load_model(str(path), case), case.runs), predict(case, nominal_model(case), case.runs)]
    assert total(case, better[0]) < 0.5 * total(case, better[1])
