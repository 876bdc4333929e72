"""The observer of ocean gliders: its derivatives, its innovations, what it looks at, and what is no steady flight."""

from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.sim_backend.ocean.core import layout as at
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run, load_run
from glider.tools.inference.core.ocean import propagate, read_state, reading_derivative
from glider.tools.inference.ocean_inputs import AFTER, BEFORE, input_table, spread_out, states, unsteady
from glider.tools.inference.ocean_kind import MIN_READING_INTERVAL_S
from glider.tools.inference.predict import predict
from glider.tools.inference.problem import problem_of
from glider.tools.inference.steady import depth_rate, first_guess
from tests.support.ocean import as_case, fly_dives, without

NO_EFFECT = np.zeros(at.N_F)
DIVES, DRAWS = 6, 12


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return as_case(tmp_path_factory.mktemp("mission") / "case", fly_dives(DIVES, speed=True).runs)


@pytest.fixture(scope="module")
def problem(case):
    return problem_of(case)


# --- derivatives ---
def step(P, x, dt=4.0, pitch=-0.4):
    """The state a step on, and the derivative."""
    inputs = np.zeros((2, at.N_U))
    inputs[:, at.U_PITCH], inputs[:, at.U_OIL], inputs[:, at.U_YAW] = pitch, np.copysign(2e-4, pitch), 0.7
    inputs[:, at.U_DENSITY], inputs[:, at.U_TEMPERATURE] = P[at.MASS] / P[at.VOLUME], 12.0
    moved, Phi = x.copy(), np.zeros((at.N_ERR, at.N_ERR))
    propagate(P, NO_EFFECT, moved, np.array([0.0, dt]), inputs, 1, 0, Phi)
    return moved, Phi, inputs


@pytest.mark.parametrize("pitch", [-0.4, 0.35])
@pytest.mark.parametrize("dt", [1.0, 20.0])
def test_the_derivative_of_a_step(case, dt, pitch):
    P, x, h = case.vehicle.vector(), np.array([90.0, 0.27, 0.008, 0.05, -0.4]), 1e-5
    P[at.COMPRESSIBILITY] = 0.0  # what a metre of depth changes is left out of it
    Phi = step(P, x, dt, pitch)[1]
    for n in range(at.N_ERR):
        ahead, behind = x.copy(), x.copy()
        ahead[n] += h
        behind[n] -= h
        column = (step(P, ahead, dt, pitch)[0] - step(P, behind, dt, pitch)[0])[: at.N_ERR] / (2.0 * h)
        assert Phi[:, n] == pytest.approx(column, rel=1e-5, abs=1e-7)


def test_what_a_metre_of_depth_does_to_the_speed_can_be_left_out(case):
    P, x = case.vehicle.vector(), np.array([90.0, 0.27, 0.0, 0.0, -0.4])
    deeper = x + np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    assert 0.0 < abs(step(P, deeper, 10.0)[0][at.X_SPEED] - step(P, x, 10.0)[0][at.X_SPEED]) < 3e-4


def test_the_derivative_of_the_readings(case):
    P, x, h = case.vehicle.vector(), np.array([90.0, 0.27, 0.008, 0.05, -0.5]), 1e-5
    inputs, H, y = step(P, x)[2], np.zeros((at.N_Y, at.N_ERR)), np.zeros((2, at.N_Y))
    reading_derivative(x, inputs, 1, H)
    for n in range(at.N_ERR):
        for k, s in enumerate((1.0, -1.0)):
            moved = x.copy()
            moved[n] += s * h
            read_state(P, NO_EFFECT, moved, inputs, 1, y[k])
        assert H[:, n] == pytest.approx((y[0] - y[1]) / (2.0 * h), rel=1e-6, abs=1e-9)


# --- innovations ---
def test_a_model_that_follows_with_its_own_gains_has_the_filters_innovations(problem):
    P, F = problem.model.P, NO_EFFECT
    gains = problem.filter(P, F)
    other = P.copy()
    other[at.DRAG_0] *= 1.1
    E = problem.follow([(P, F), (other, F)], gains)
    assert np.allclose(E[0], gains.E[problem.valid], rtol=1e-12, atol=1e-12)
    assert np.abs(E[1] - E[0]).max() > 0.5


@pytest.fixture(scope="module")
def innovations(problem):
    """Of the model's own simulated runs that fly steadily all the time: (draws, rows, N_Y)."""
    inputs = problem.recording.inputs.copy()
    inputs[:, at.U_UNSTEADY] = 0.0
    steady = replace(problem, recording=replace(problem.recording, inputs=inputs))
    P, found = first_guess(problem), []
    begins = steady.filter(P, NO_EFFECT).X[problem.recording.bounds[:-1]]
    for seed in range(DRAWS):
        z = steady.simulated(P, NO_EFFECT, begins, np.random.default_rng(seed))
        found.append(replace(steady, z=z, starts=begins, spreads=1e-3 * steady.spreads).filter(P, NO_EFFECT).E)
    return np.array(found)


@pytest.mark.parametrize("reading", [at.Y_DEPTH, at.Y_ROLL, at.Y_SPEED])
def test_of_its_own_simulated_runs_they_are_white_and_of_size_one(problem, innovations, reading):
    e = innovations[:, problem.valid[:, reading], reading]
    count = e.size
    assert count > 2000
    assert np.mean(e**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / count))
    assert np.mean(e) == pytest.approx(0.0, abs=4.0 / np.sqrt(count))
    for lag in (1, 2, 5):
        assert np.mean(e[:, lag:] * e[:, :-lag]) == pytest.approx(0.0, abs=4.0 / np.sqrt(count))


# --- what it looks at ---
def test_readings_that_are_looked_at_are_half_a_minute_apart(problem):
    r, looked = problem.recording, problem.valid.any(axis=1)
    for a, b in zip(r.bounds[:-1], r.bounds[1:], strict=True):
        t = r.t[a:b][looked[a:b]]
        assert np.all(np.diff(t) >= MIN_READING_INTERVAL_S)
        assert np.max(np.diff(t)) < MIN_READING_INTERVAL_S + 10.0
    rough = r.inputs[:, at.U_UNSTEADY] > 0.0
    assert problem.valid[rough, at.Y_DEPTH].any()
    assert not problem.valid[rough][:, [at.Y_ROLL, at.Y_SPEED]].any()
    assert problem.valid[~rough & looked][:, [at.Y_DEPTH, at.Y_ROLL, at.Y_SPEED]].all()


def test_what_was_measured_behind_a_windows_look_in_changes_no_prediction(case, problem):
    run, kind = case.runs[0], problem.kind
    window = kind.measures.windows(run.t)[1]
    measured = (names.DEPTH, names.ATTITUDE[0], names.SPEED)
    blank = {n: np.where(np.arange(run.rows) >= window.start, np.nan, v) if n in measured else v
             for n, v in run.columns.items()}  # fmt: skip
    inside = slice(window.start, window.end)
    whole, blanked = (predict(case, problem.model, [one])[0] for one in (run, replace(run, columns=blank)))
    assert np.isfinite(whole[inside]).all()
    assert np.array_equal(whole[inside], blanked[inside])
    looked = {n: np.where(run.t >= run.t[window.first], np.nan, v) if n in measured else v
              for n, v in run.columns.items()}  # fmt: skip
    assert not np.array_equal(whole[inside], predict(case, problem.model, [replace(run, columns=looked)])[0][inside])


@pytest.mark.parametrize("column", [names.OIL, names.DENSITY, names.DEPTH, names.ATTITUDE[1]])
def test_a_column_that_it_needs(case, tmp_path, column):
    path = case.runs[1].path
    with pytest.raises(InputError) as refused:
        problem_of(without(case, column, (1,)))
    assert str(path) in str(refused.value)
    assert column in str(refused.value)
    assert column in load_run(path).columns


def test_a_run_without_temperature_has_the_reference(case):
    cold = without(case, names.TEMPERATURE).runs[0]
    assert set(input_table(cold)[:, at.U_TEMPERATURE]) == {10.0}
    assert input_table(case.runs[0])[:, at.U_TEMPERATURE].max() > 12.0


# --- steady flight ---
STEP = 5.0


def hand_made(rows=240, **columns) -> Run:
    """A steady dive from 10 m down with a reading every 5 s; columns: what is otherwise."""
    t = STEP * np.arange(rows)
    base = {
        names.TIME: t, names.DEPTH: 10.0 + 0.15 * t, names.ATTITUDE[0]: np.full(rows, 0.02),
        names.ATTITUDE[1]: np.full(rows, -0.4), names.OIL: np.full(rows, -2e-4), names.DENSITY: np.full(rows, 1026.0),
        names.TEMPERATURE: np.full(rows, 12.0), names.PUMP: np.zeros(rows),
    }  # fmt: skip
    return Run("run00", None, base | columns)


def changed(name: str, value: float, first: int = 100, end: int = 110) -> Run:
    values = hand_made().columns[name].copy()
    values[first:end] = value
    return hand_made(**{name: values})


def only(run: Run) -> dict[str, np.ndarray]:
    """The states that hold anywhere, with their rows."""
    return {why: np.flatnonzero(when) for why, when in states(run).items() if when.any()}


def test_a_steady_dive_is_steady():
    assert only(hand_made()) == {}
    assert not unsteady(hand_made()).any()


@pytest.mark.parametrize(
    ("why", "run"),
    [
        ("the engine runs", changed(names.PUMP, 1.0)), ("level or too steep", changed(names.ATTITUDE[1], -1.0)),
        ("on its side", changed(names.ATTITUDE[0], 0.5)), ("at the surface", changed(names.DEPTH, 2.0)),
    ],
)  # fmt: skip
def test_a_state_holds_in_its_rows_and_spreads(why, run):
    found = only(run)
    assert list(found[why]) == list(range(100, 110))
    rough = np.flatnonzero(unsteady(run))
    first = min(rows[0] for rows in found.values())
    last = max(rows[-1] for rows in found.values())
    assert rough[0] == first - BEFORE / STEP
    assert rough[-1] == last + AFTER / STEP
    assert len(rough) == rough[-1] - rough[0] + 1


def test_level_flight_is_no_glide():
    found = only(changed(names.ATTITUDE[1], 0.05, 0, 240))
    assert list(found) == ["level or too steep"]
    assert unsteady(changed(names.ATTITUDE[1], 0.05, 0, 240)).all()


def test_an_engine_that_moves_runs_though_no_flag_says_so():
    oil = hand_made().columns[names.OIL].copy()
    oil[50:] += np.minimum(3e-6 * np.arange(190), 2e-4)
    found = only(hand_made(**{names.OIL: oil}))
    assert list(found) == ["the engine runs"]
    assert found["the engine runs"][0] == 51
    assert len(found["the engine runs"]) == pytest.approx(2e-4 / 3e-6, abs=1.0)


def test_pitching_is_no_steady_flight():
    pitch = np.clip(-0.4 + 0.02 * STEP * (np.arange(240) - 100), -0.4, -0.2)
    assert "pitching" in only(hand_made(**{names.ATTITUDE[1]: pitch}))
    slowly = -0.4 + 0.0005 * STEP * np.arange(240) * 0.2
    assert only(hand_made(**{names.ATTITUDE[1]: slowly})) == {}


def test_holes_in_time_in_depth_and_in_the_water():
    run = hand_made()
    late = run.t.copy()
    late[120:] += 100.0
    assert list(only(hand_made(**{names.TIME: late}))["no samples"]) == [120]
    depth, water = (run.columns[name].copy() for name in (names.DEPTH, names.DENSITY))
    depth[100:140] = np.nan
    found = only(hand_made(**{names.DEPTH: depth}))["no samples"]
    assert found[0] == 113  # 70 s from the last sample
    assert found[-1] == 126
    water[50:110] = np.nan
    found = only(hand_made(**{names.DENSITY: water}))
    assert list(found) == ["no samples of the water"]
    assert found["no samples of the water"][0] == 74  # 125 s from it


def test_a_state_spreads_by_time_not_by_rows():
    t = np.array([0.0, 1.0, 30.0, 100.0, 115.0, 130.0, 185.0, 200.0])
    assert list(spread_out(t, t == 115.0)) == [False, False, False, True, True, True, False, False]
    assert not spread_out(t, np.zeros(8, dtype=bool)).any()


# --- the first guess ---
def test_depth_rate_is_a_slope():
    t = 4.0 * np.arange(60)
    depth = 20.0 + 0.12 * t
    depth[::3] = np.nan
    assert depth_rate(t, depth)[10:50] == pytest.approx(np.full(40, 0.12))
    assert np.isnan(depth_rate(t, np.where(t > 100.0, np.nan, depth))[40:]).all()


def test_the_first_guess_finds_volume_and_drag(problem):
    """Of runs that the model itself flies with other numbers, along the recorded attitude."""
    P = first_guess(problem)
    P[at.VOLUME] *= 1.0008
    P[at.DRAG_0] *= 1.3
    whole = replace(problem, valid=np.ones_like(problem.valid))
    starts = problem.filter(P, NO_EFFECT).X[problem.recording.bounds[:-1]]
    starts[:, at.X_DEPTH] = 40.0
    z = whole.simulated(P, NO_EFFECT, starts, np.random.default_rng(3))
    bounds = problem.recording.bounds
    runs = [replace(run, columns=run.columns | {names.DEPTH: z[a:b, at.Y_DEPTH]})
            for run, a, b in zip(problem.runs, bounds[:-1], bounds[1:], strict=True)]  # fmt: skip
    found = first_guess(problem_of(problem.case, runs=runs))
    assert found[at.VOLUME] == pytest.approx(P[at.VOLUME], rel=1e-3)
    assert found[at.DRAG_0] == pytest.approx(P[at.DRAG_0], rel=0.2)
    assert abs(found[at.VOLUME] / problem.model.P[at.VOLUME] - 1.0) > 1e-3


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_first_guess_of_another_simulators_mission(tmp_path, seed):
    dives = fly_dives(4, seed=seed)
    found = first_guess(problem_of(as_case(tmp_path / "case", dives.runs)))
    assert found[at.VOLUME] == pytest.approx(dives.mission.V[foreign.VOLUME], rel=1e-3)
    assert found[at.DRAG_0] == pytest.approx(dives.mission.V[foreign.DRAG], rel=0.2)
