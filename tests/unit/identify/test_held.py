"""Which vehicle an identification hands out, and which terms beside equation (4) it keeps."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.gap.measure import RunGap
from glider.tools.identify.earned import mean_and_error, unearned
from glider.tools.identify.held import FILE, LIKELIHOOD, PREDICTION, Candidate, choose
from glider.tools.inference.prediction_error import Fitted

RUNS = 12


def candidate(name: str, totals) -> Candidate:
    return Candidate(name, None, "", [RunGap(f"run{n:02}", {"roll": g}, g, 1) for n, g in enumerate(totals)], [])


def scattered(size: float, seed: int) -> np.ndarray:
    """Gaps of runs about a size; the same seed has the same runs hard for everybody."""
    return size * np.exp(0.3 * np.random.default_rng(seed).standard_normal(RUNS))


def chosen(file, likelihood, prediction) -> str:
    gaps = zip((FILE, LIKELIHOOD, PREDICTION), (file, likelihood, prediction), strict=True)
    return choose([candidate(name, totals) for name, totals in gaps])[0].name


def test_the_likelihood_s_fit_is_kept_where_others_are_as_good():
    assert chosen(scattered(5.0, 1), scattered(0.40, 2), scattered(0.40, 3)) == LIKELIHOOD
    assert chosen(scattered(5.0, 1), scattered(0.40, 2), 0.97 * scattered(0.40, 2)) == LIKELIHOOD


def test_what_is_clearly_better_in_all_runs_is_handed_out():
    assert chosen(scattered(5.0, 1), scattered(1.5, 2), scattered(0.9, 3)) == PREDICTION
    assert chosen(scattered(5.0, 1), scattered(0.40, 2), 0.8 * scattered(0.40, 2)) == PREDICTION


def test_one_run_that_goes_astray_does_not_decide():
    totals = scattered(0.40, 2)
    totals[3] *= 10.0
    assert chosen(scattered(5.0, 1), totals, scattered(0.40, 2)) == LIKELIHOOD


def test_nothing_worse_than_the_file_is_handed_out():
    assert chosen(scattered(0.9, 1), scattered(5.8, 2), scattered(1.4, 3)) == FILE
    assert chosen(scattered(0.9, 1), scattered(5.8, 2), np.full(RUNS, np.nan)) == FILE
    assert choose([candidate(FILE, [1.0]), candidate(LIKELIHOOD, [3.0])])[0].name == FILE


def test_a_fit_that_cannot_fly_a_run_is_not_preferred():
    lost = scattered(0.40, 2)
    lost[5] = np.nan
    assert chosen(scattered(5.0, 1), scattered(0.9, 2), lost) == LIKELIHOOD


def test_few_runs_leave_more_to_chance():
    """A run alone has to say more than twelve that agree."""
    less = np.log(np.full(RUNS, 1.2))
    assert mean_and_error(less)[1] == pytest.approx(0.2 / RUNS)
    assert mean_and_error(less[:1])[1] == pytest.approx(0.2)


def test_without_a_term_the_others_stand_where_they_are_most_probable():
    rng = np.random.default_rng(5)
    A = rng.normal(size=(6, 6))
    normal, best, file = A @ A.T + np.eye(6), rng.normal(size=6), np.zeros(6)
    values = Fitted(best, 1.0, normal, 100.0).conditional(file, np.array([1, 4]))
    assert values[[1, 4]].tolist() == [0.0, 0.0]
    slope = normal @ (values - best)
    assert np.abs(slope[[0, 2, 3, 5]]).max() < 1e-9  # least there
    assert np.abs(slope[[1, 4]]).min() > 1e-3


def log_evidence(normal: np.ndarray, slope: np.ndarray, free: list[int]) -> float:
    """Of a quadratic log posterior with a normal prior of unit variance, what is not free at 0."""
    own = normal[np.ix_(free, free)]
    return float(-0.5 * np.linalg.slogdet(own)[1] + 0.5 * slope[free] @ np.linalg.solve(own, slope[free]))


def test_the_evidence_of_a_term_is_the_ratio_of_integrals_with_and_without_it():
    rng = np.random.default_rng(6)
    A = rng.normal(size=(6, 6))
    normal, best = A @ A.T + np.eye(6), rng.normal(size=6)
    found, at = Fitted(best, 1.0, normal, 100.0), np.zeros(6)
    whole = log_evidence(normal, normal @ best, [0, 1, 2, 3, 5])
    without = log_evidence(normal, normal @ best, [0, 2, 5])
    assert found.evidence(at, np.array([1, 3]), np.array([4])) == pytest.approx(whole - without)


def test_a_term_that_the_runs_say_nothing_of_or_that_is_not_there_goes_and_one_that_is_there_stays():
    fitting = SimpleNamespace(free=SimpleNamespace(names=["K_q", "x_b", "stall", "pressure_lever"]))
    fitting.file_values = np.zeros(4)
    precision = np.array([5.0, 30.0, 1.0 + 1e-6, 4.0])
    found = Fitted(np.array([0.3, 0.02, 0.0, -1.8]), 1.0, np.diag(precision), 100.0)
    assert set(unearned(found, fitting)) == {("x_b",), ("stall",)}
