"""Tests on what is left: normal under white noise, strong under what they are made for."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.diagnose.record import FindingRecord
from glider.tools.diagnose.residuals import chi, goes_with, lagged, peak, worst

BOUNDS = np.array([0, 700, 1500, 2100])


def draws(function, count: int = 300) -> np.ndarray:
    rng = np.random.default_rng(8)
    return np.array([function(rng.standard_normal(BOUNDS[-1])) for _ in range(count)])


@pytest.mark.parametrize("function", [
    lambda e: lagged(e, np.ones(len(e), dtype=bool), BOUNDS, 3),
    lambda e: goes_with(e, np.ones(len(e), dtype=bool), np.sin(np.arange(len(e)) / 40.0), BOUNDS),
    lambda e: chi(e[:10]),
])  # fmt: skip
def test_white_noise_gives_standard_normal_deviates(function):
    from scipy import stats

    z = draws(function)
    assert stats.kstest(z, "norm").pvalue > 1e-3


def test_the_spectrums_highest_line_is_rare_only_where_there_is_one():
    z = draws(lambda e: peak(e, BOUNDS))
    assert (z > 3.0).mean() < 0.02
    rng = np.random.default_rng(1)
    wave = rng.standard_normal(BOUNDS[-1]) + 0.4 * np.sin(2.0 * np.pi * np.arange(BOUNDS[-1]) / 35.0)
    assert peak(wave, BOUNDS) > 6.0


def test_colour_shows_in_the_lags():
    rng = np.random.default_rng(2)
    e = rng.standard_normal(BOUNDS[-1])
    e[1:] += 0.3 * e[:-1]
    assert lagged(e, np.ones(len(e), dtype=bool), BOUNDS, 1) > 5.0


def test_the_worst_finding_is_corrected_for_how_many_were_looked_at():
    from scipy import stats

    few = [FindingRecord("q", "variance", 4.0)]
    many = [FindingRecord("q", f"lag {n}", 0.0) for n in range(500)]
    assert worst(few + many) < worst(few) < 4.0
    assert worst([]) == 0.0
    assert SimpleNamespace(sigma=worst(few)).sigma == pytest.approx(stats.norm.isf(2.0 * stats.norm.sf(4.0)))
