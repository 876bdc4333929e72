"""Deviations of runs: numbers that make up for each other, steps among them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.inference.pooled import (
    Parabola,
    Scatter,
    learn_scatter,
    learn_scatter_together,
    log_evidence,
    run_values,
)
from glider.tools.own.hierarchy import shortened


@pytest.mark.parametrize("little", [0.15, 0.3])
def test_numbers_that_make_up_for_each_other_scatter_far_and_do_little_together(little):
    """Of three numbers of a run the sum of the first two is what its rows show best; it differs by `little`."""
    random, A = np.random.default_rng(4), np.diag([20.0, 20.0, 20.0]) + 2000.0 * np.outer([1, 1, 0], [1, 1, 0])
    runs = []
    for _ in range(40):
        apart, both, third = random.standard_normal(3) * np.array([1.0, little, 0.5])
        truth = np.array([apart + 0.5 * both, -apart + 0.5 * both, third])
        runs.append(
            Parabola(truth + np.linalg.cholesky(np.linalg.inv(A)) @ random.standard_normal(3), 0.0, np.zeros(3), A)
        )
    V, usual = 4.0 * np.eye(3), np.full(3, 0.5)
    alone, (found, _) = learn_scatter(runs, V, Scatter(usual)), learn_scatter_together(runs, V, usual, A[None])
    assert log_evidence(runs, V, found) > log_evidence(runs, V, alone) + 10.0
    sums = [np.sqrt(np.array([1, 1, 0]) @ one.covariance @ np.array([1, 1, 0])) for one in (alone, found)]
    assert sums[1] == pytest.approx(little, rel=0.4)
    assert sums[0] > 2.0 * sums[1]
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(1.0, rel=0.3)


def test_numbers_that_scatter_by_themselves_have_no_effect_together():
    random, A = np.random.default_rng(6), np.diag([30.0, 40.0, 20.0])
    runs = [Parabola(random.standard_normal(3), 0.0, np.zeros(3), A) for _ in range(60)]
    found, _ = learn_scatter_together(runs, np.eye(3), np.ones(3), A[None])
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(np.ones(3), rel=0.3)


def test_a_scatter_is_its_covariance():
    random = np.random.default_rng(8)
    root = random.standard_normal((4, 4))
    root[2] = 0.0
    C = root @ root.T
    found, x = Scatter.of(C), random.standard_normal(4) * (np.arange(4) != 2)
    places = [0, 1, 3]
    assert found.covariance == pytest.approx(C)
    assert found.distance(x) == pytest.approx(x[places] @ np.linalg.solve(C[np.ix_(places, places)], x[places]))
    one = Parabola(np.zeros(4), 0.0, random.standard_normal(4), np.diag([2.0, 1.0, 3.0, 5.0]))
    own = run_values(one, np.zeros(4), found)

    def cost(x):
        return one.at_place(x) + found.distance(x)

    assert own[2] == 0.0
    assert all(
        cost(own + 0.01 * (np.arange(4) == k)) > cost(own) < cost(own - 0.01 * (np.arange(4) == k)) for k in places
    )


@given(st.integers(0, 10_000), st.floats(0.1, 50.0))
def test_a_step_that_is_shortened_leads_down_and_no_number_further_than_it_may(seed, far):
    random = np.random.default_rng(seed)
    root, most = random.standard_normal((5, 5)), random.uniform(0.5, 3.0, 5)
    H, best = root @ root.T + 1e-3 * np.eye(5), far * random.standard_normal(5)
    step = shortened(best, most)
    assert (np.abs(step) <= most * (1.0 + 1e-9)).all()
    assert (step - best) @ H @ (step - best) < best @ H @ best
