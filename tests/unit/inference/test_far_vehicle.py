"""A vehicle far from its file, its gyro scaled and its pressure port behind the origin: stages, and the fit beneath."""

from itertools import pairwise

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.case import Case
from glider.tools.diagnose.staged import Staged, staged
from glider.tools.diagnose.staged_answer import identified_text
from glider.tools.inference.model import nominal_model
from glider.tools.inference.prediction_error import PredictionError
from glider.tools.inference.problem import problem_of
from glider.tools.inference.vehicle_parameters import parameters
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=15)

TRUE = {
    "CG_OFFSET_X": -0.0023, "NET_MASS_OFFSET": 0.023, "DRAG_0": 0.46, "PITCH_TRIM": 0.37, "LIFT": 0.43,
    "SLIDER_SCALE": -0.4, "BALLAST_SCALE": 0.00099, "DRAG_ALPHA": -0.43, "PITCH_DAMPING": -0.029, "WEATHERCOCK": 0.19,
    "CG_OFFSET_Z": 0.00042, "GYRO_SCALE": -0.8, "DEPTH_LEVER": -0.3,
}  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    """Two flights."""
    F = np.zeros(ef.N_F)
    for name, value in TRUE.items():
        F[getattr(ef, name)] = value
    return make_case(tmp_path_factory.mktemp("far"), F, seed=35, runs=2)


@pytest.fixture(scope="module")
def found(case) -> Staged:
    return staged(case)


def test_the_staircase_falls_on_runs_left_out(found):
    assert [stage.name for stage in found.stages][:3] == ["nominal", "readings", "identified"]
    totals = [stage.total for stage in found.stages]
    assert all(later < earlier for earlier, later in pairwise(totals[1:]))
    assert totals[0] > 5.0
    assert totals[-1] < totals[0] / 5.0


def test_what_is_wrong_with_the_readings_is_selected_with_its_size(found):
    assert {"gyro_scale", "pressure_lever"} <= set(found.selected)
    scale, lever = found.sizes["gyro_scale"]["scale"], found.sizes["pressure_lever"]["ahead"]
    assert scale.estimate == pytest.approx(TRUE["GYRO_SCALE"], abs=0.03)
    assert lever.ci90[0] < TRUE["DEPTH_LEVER"] < lever.ci90[1]


def test_nothing_that_is_right_is_accused(found):
    assert set(found.selected) <= {"gyro_scale", "pressure_lever"}


def test_what_a_draw_wire_means_is_found(found):
    size = found.vehicle["slider_scale"]
    assert size.ci90[0] < TRUE["SLIDER_SCALE"] < size.ci90[1]
    assert size.ci90[1] < 0.0
    assert "draw-wire means" in identified_text(found)


def test_the_normal_matrix_is_the_slope_of_the_cost(case):
    """Against differences of the objective itself, the gains kept."""
    problem = problem_of(case, nominal_model(case), case.runs[:1])
    fitting = PredictionError(problem, parameters(problem, first=True))
    at = fitting.file_values
    cuts = [fitting.windows(8.0, 0.0)]
    gains = fitting.gains(at)
    _, slope = fitting.linear(at, gains, cuts)

    def cost(values: np.ndarray) -> float:
        e = fitting.residuals(fitting.fly([values], gains, cuts)[:, 0], cuts[0])[0]
        return fitting.weights(e)[1]

    for name in ("net_mass", "cg_x", "slider_scale"):
        n = fitting.free.names.index(name)
        step = 0.01 * np.eye(len(at))[n]
        assert (cost(at + step) - cost(at - step)) / 0.04 == pytest.approx(slope[n], rel=0.1)


def test_an_observer_that_doubts_expects_what_the_vehicle_is_off_by(case, found):
    """Much more than the file's disturbance by the file; by the vehicle that was found, less."""
    problem = problem_of(case, nominal_model(case))
    fitting = PredictionError(problem, parameters(problem, first=True), doubts=True)
    fitting.expect(fitting.file_values)
    far, (P, F) = fitting.level, found.model
    assert far >= 100.0
    fitting.model = lambda values: (P, F)
    fitting.expect(fitting.file_values)
    assert fitting.level < far


def test_a_vehicle_as_its_file_says_stays_there(tmp_path):
    """No parameter leaves its file's value by more than its posterior allows."""
    made = make_case(tmp_path, np.zeros(ef.N_F), seed=32, runs=1)
    problem = problem_of(made)
    fitting = PredictionError(problem, parameters(problem))
    fit = fitting.through(fitting.file_values)
    assert fit.cost < 1.0
    assert np.abs(fit.values / np.sqrt(np.diag(fit.covariance))).max() < 3.0
