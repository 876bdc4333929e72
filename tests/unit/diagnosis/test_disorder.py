"""Disorder: turbulence, and a clock of motion capture that wanders, told to a second search that sees the rest."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.diagnosis import model_text
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE
from glider.tools.diagnose.search import run
from glider.tools.diagnose.verdict import conclude
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=55)


def test_rough_water_is_turbulence_however_rough(tmp_path):
    answer = conclude(run(problem_of(make_case(tmp_path, np.zeros(ef.N_F), seed=7, runs=2, mocap=True, rough=20.0))))
    assert answer.main == TURBULENCE
    assert answer.noise.probe.name == TURBULENCE
    assert 10.0 < answer.noise.scale < 40.0


def test_rough_water_is_turbulence_beside_a_sensor_with_more_nats(tmp_path):
    """Gyros that read a third too much say more of the readings than the water does, and take little of the gap."""
    F = np.zeros(ef.N_F)
    F[ef.GYRO_SCALE] = -0.3
    answer = conclude(run(problem_of(make_case(tmp_path, F, seed=9, runs=2, rough=10.0))))
    assert answer.main == TURBULENCE
    assert answer.selected == [TURBULENCE, "gyro_scale"]
    assert answer.probabilities["unknown"] < 0.1


def test_a_clock_that_wanders_is_late_and_hides_nothing_beside_it(tmp_path):
    F = np.zeros(ef.N_F)
    F[ef.DRAG_0] = 1.0
    case = make_case(tmp_path, F, seed=8, mocap=True, late=lambda t: 1.2 + 0.25 * np.sin(2.0 * np.pi * t / 7.0))
    answer = conclude(run(problem_of(case)))
    assert answer.noise.probe.name == CLOCK
    assert set(answer.selected) == {"mocap_delay", "drag"}
    assert answer.probabilities["unknown"] < 0.2
    clock = answer.search.clock
    assert clock.values[0] * clock.free[0].spread == pytest.approx(1.2, abs=0.1)
    assert answer.shrinkage.after < 0.3 * answer.shrinkage.before
    assert answer.shrinkage.recalibrated < 2.0 * answer.shrinkage.before
    corrected = model_text(case, *answer.search.model(answer.hypothesis))
    assert "[effects.mocap_delay]" in corrected
    assert "[effects.drag]" in corrected


@pytest.fixture(scope="module")
def beside_a_clock(tmp_path_factory):
    """Concludes of runs whose motion capture is a third of a second late and wanders, with what else is given."""

    def concluded(seed: int, gyro_scale: float = 0.0, rough: float = 1.0):
        F = np.zeros(ef.N_F)
        F[ef.GYRO_SCALE] = gyro_scale
        late = {"mocap": True, "late": lambda t: 0.33 + 0.07 * np.sin(2.0 * np.pi * t / 7.0)}
        case = make_case(tmp_path_factory.mktemp("late"), F, seed=seed, runs=2, rough=rough, **late)
        return conclude(run(problem_of(case)))

    return concluded


def test_a_second_search_begins_at_what_the_first_found_however_far_out(beside_a_clock):
    """Gyros that turn two and a half times as far hold no filter that does not know of it, and lead it anywhere."""
    answer = beside_a_clock(8, gyro_scale=1.5)
    assert answer.noise.probe.name == CLOCK
    assert answer.main == "gyro_scale"
    assert set(answer.selected) == {"gyro_scale", "mocap_delay"}
    assert answer.probabilities["gyro_scale"] > 0.8


def test_rough_water_is_turbulence_beside_a_clock_that_wanders(beside_a_clock):
    answer = beside_a_clock(7, rough=10.0)
    assert answer.main == TURBULENCE
    assert set(answer.selected) == {TURBULENCE, "mocap_delay"}
    assert answer.search.clock.label == "mocap_delay"
