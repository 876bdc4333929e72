"""Windows of a model that lacks a sensor's error begin where its reading shows the vehicle."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.as_read import begun_as_read
from glider.tools.inference.model import effect_vector
from glider.tools.inference.predict import fly_windows_from
from glider.tools.inference.problem import cut, problem_of
from tests.support.cases import make_case


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """A problem without motion capture, a depth that reads 2 % more and a pitch 3 degrees more, and its filter."""
    F = np.zeros(ef.N_F)
    F[ef.DEPTH_SCALE], F[ef.PITCH_BIAS] = 0.02, 0.05
    problem = problem_of(make_case(tmp_path_factory.mktemp("lake"), F, seed=11, runs=2))
    nominal = effect_vector(problem.model)
    return problem, nominal + F, nominal, problem.filter(problem.model.P, nominal + F, begin=True)


def reading(problem, F, gains):
    Y = np.empty_like(problem.z)
    r = problem.recording
    problem.kind.read_rows(F, gains.X, gains.path, r.t, r.bounds, Y)
    return Y[cut(problem).first - 1, : ef.Y_ONBOARD]


def test_both_models_read_the_same_at_the_start(lake):
    problem, F, nominal, gains = lake
    begun = begun_as_read(problem, F, nominal, gains)
    assert np.abs(reading(problem, F, gains) - reading(problem, nominal, gains)).max() > 0.02
    assert reading(problem, nominal, begun) == pytest.approx(reading(problem, F, gains), abs=1e-9)


def test_an_offset_that_the_start_takes_up_makes_no_gap(lake):
    problem, _, nominal, gains = lake
    F, scored = nominal.copy(), cut(problem)
    F[ef.DEPTH_OFFSET] += 0.3
    rows = np.concatenate([np.arange(a, b) for a, b in zip(scored.first, scored.last, strict=True)])

    def apart(start):
        flown = fly_windows_from(problem, problem.model.P, nominal, start)
        whole = fly_windows_from(problem, problem.model.P, F, gains)
        return np.abs((flown - whole)[rows, ef.Y_DEPTH]).max()

    assert apart(gains) == pytest.approx(0.3)
    assert apart(begun_as_read(problem, F, nominal, gains)) < 1e-6


def test_where_motion_capture_sees_the_vehicle_its_start_stays(tmp_path):
    F = np.zeros(ef.N_F)
    F[ef.DEPTH_SCALE] = 0.02
    problem = problem_of(make_case(tmp_path, F, seed=12, runs=1, mocap=True))
    nominal = effect_vector(problem.model)
    gains = problem.filter(problem.model.P, nominal + F, begin=True)
    assert begun_as_read(problem, nominal + F, nominal, gains) is gains
