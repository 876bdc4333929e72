"""How sure an ocean glider's numbers are: what the pulls of runs and strata make of the covariance."""

import numpy as np
import pytest

from glider.tools.data.runs import columns as names
from glider.tools.identify.ocean.identify import BANDS, covariance, larger, strata, stratum_pulls
from glider.tools.inference.expansion import Expansion
from glider.tools.inference.parameters import FreeParameter
from glider.tools.inference.shared_parameters import SharedParameters
from tests.support.ocean import fly_dives

RUNS, HEAT, CURVATURE = 12, 4.0, 25.0  # curvature of a run in each of two numbers
SHARED = SharedParameters([FreeParameter("", name, "P", n, 1.0) for n, name in enumerate("ab")], {}, {}, 1.0)


def parabola(slope, share: float = 1.0, parts=()) -> Expansion:
    return Expansion(np.zeros(2), 0.0, np.array(slope, float), share * CURVATURE * np.eye(2), 1.0, 100, list(parts))


def flown(of_run=0.0, of_stratum=0.0) -> list[Expansion]:
    """Runs whose pulls in the first number go from side to side: from run to run, or from stratum to stratum."""
    strata_slopes = [((-1) ** k * of_stratum, 0.0) for k in range(2 * BANDS)]
    parts = [parabola(slope, 1.0 / (2 * BANDS)) for slope in strata_slopes]
    return [parabola(((-1) ** n * of_run, 0.0), parts=parts) for n in range(RUNS)]


def variance(noise: float) -> float:
    """Of a number whose runs' slopes vary by `noise` in all: N^-1 (prior + noise / heat^2) N^-1."""
    precision = RUNS * CURVATURE / HEAT + 1.0
    return (1.0 + noise / HEAT**2) / precision**2


def test_runs_that_agree_are_as_sure_as_their_noise_says():
    assert np.allclose(covariance(flown(), SHARED, HEAT), variance(RUNS * CURVATURE) * np.eye(2), rtol=1e-9)


@pytest.mark.parametrize(
    ("of_run", "of_stratum", "count"), [(20.0, 0.0, RUNS), (0.0, 3.0, 2 * BANDS)], ids=["runs", "strata"]
)
def test_pulls_that_differ_make_their_direction_less_sure(of_run, of_stratum, count):
    C = covariance(flown(of_run, of_stratum), SHARED, HEAT)
    pull = of_run if of_run else RUNS * of_stratum  # alike in all runs: they add up
    assert C[0, 0] == pytest.approx(variance(count * pull**2 * count / (count - 1.0)), rel=1e-9)
    assert C[1, 1] == pytest.approx(variance(RUNS * CURVATURE), rel=1e-9)


def test_what_pulls_all_strata_alike_is_no_error_of_the_form():
    common = [parabola((5.0, 1.0), 1.0 / (2 * BANDS)) for _ in range(2 * BANDS)]
    found = [parabola((40.0, 8.0), parts=common) for _ in range(RUNS)]
    assert np.allclose(stratum_pulls(found, RUNS * CURVATURE * np.eye(2)), 0.0, atol=1e-9)


def test_the_larger_of_two_covariances_in_each_direction():
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    A, B = turn @ np.diag([1.0, 4.0]) @ turn.T, turn @ np.diag([2.0, 3.0]) @ turn.T
    assert np.allclose(larger(A, B), turn @ np.diag([2.0, 4.0]) @ turn.T)


def test_strata_are_ways_and_depths():
    run = fly_dives(1).runs[0]
    found, depth = strata(run), run.columns[names.DEPTH]
    climbs = run.columns[names.ATTITUDE[1]] > 0.0
    assert set(found) == set(range(2 * BANDS))
    assert (found[climbs] >= BANDS).all()
    assert (found[~climbs] < BANDS).all()
    for way in (climbs, ~climbs):
        order = np.argsort(depth[way])
        assert (np.diff(found[way][order]) >= 0).all()
