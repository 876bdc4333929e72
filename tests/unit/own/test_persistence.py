"""Errors that are the same in all windows of a run: of which channels, and by how much they count for less."""

import numpy as np
import pytest

from glider.tools.inference.pooled import Pooled, Scatter
from glider.tools.own.persistence import ChannelScores, persistence

RUNS, WINDOWS, NUMBERS = 200, 10, 4
COMMON = np.array([0.0, 1.0, 0.3])  # sd, by channel, of the error of all a run's windows, over a window's own


@pytest.fixture(scope="module")
def runs() -> list[ChannelScores]:
    rng, found = np.random.default_rng(7), []
    for _ in range(RUNS):
        J = rng.normal(size=(len(COMMON), NUMBERS, 1)) * np.ones(WINDOWS)
        e = rng.normal(size=(len(COMMON), WINDOWS)) + COMMON[:, None] * rng.normal(size=(len(COMMON), 1))
        found.append(ChannelScores(np.zeros(NUMBERS), np.einsum("ykw,yw->yk", J, e), J @ J.transpose(0, 2, 1)))
    return found


def test_each_channel_has_the_inflation_of_its_own_errors(runs):
    found = persistence(runs, 100.0 * np.eye(NUMBERS), Scatter(np.zeros(NUMBERS)), np.ones(NUMBERS, dtype=bool))
    assert found == pytest.approx(1.0 + WINDOWS * COMMON**2, rel=0.25)


def test_what_a_run_has_of_its_own_is_no_error_of_its_windows(runs):
    rng, scatter = np.random.default_rng(8), np.array([0.0, 0.0, 0.0, 2.0])
    shifted = []
    for one in runs:
        own = scatter * rng.normal(size=NUMBERS)
        shifted.append(ChannelScores(one.at, one.slope + one.curvature @ own, one.curvature))
    of, V = np.array([True, True, True, False]), 100.0 * np.eye(NUMBERS)
    assert persistence(shifted, V, Scatter(scatter), of)[0] < 1.5
    assert persistence(shifted, V, Scatter(np.zeros(NUMBERS)), of)[0] > 3.0


def test_shared_values_are_as_uncertain_as_they_scatter(runs):
    """About the truth, 0, by a channel whose errors repeat: chi-square of the pooled values is their number."""
    V = 100.0 * np.eye(NUMBERS)
    found = persistence(runs, V, Scatter(np.zeros(NUMBERS)), np.ones(NUMBERS, dtype=bool))

    def surprise(inflation: np.ndarray) -> float:
        total = 0.0
        for a in range(0, RUNS, 10):
            pooled = Pooled.of([one.pooled(inflation) for one in runs[a : a + 10]], V)
            total += float(pooled.mean() @ np.linalg.solve(pooled.covariance(), pooled.mean()))
        return total / (RUNS // 10) / NUMBERS

    assert surprise(found) == pytest.approx(1.0, abs=0.35)
    assert surprise(np.ones(len(COMMON))) > 2.0
