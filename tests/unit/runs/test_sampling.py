"""How often a sensor is read: its own rate, whole rows apart or not, with holes and with samples lost at random."""

import numpy as np
import pytest

from glider.tools.data.runs.sampling import missing_share, own_period

ROW = 0.02  # s, a log of 50 Hz
T = ROW * np.arange(5000)


def read_at(hz: float, t: np.ndarray = T) -> np.ndarray:
    """A reading that stands in the row after each of its samples."""
    rows = np.unique(np.ceil(np.arange(0.0, t[-1], 1.0 / hz) / ROW - 1e-9).astype(int))
    values = np.full(len(t), np.nan)
    values[rows[rows < len(t)]] = 1.0
    return values


@pytest.mark.parametrize("hz", [50.0, 33.0, 25.0, 20.0, 12.5, 10.0, 7.0, 1.0])
def test_a_slower_sensor_lacks_nothing(hz):
    assert own_period(T, read_at(hz)) == pytest.approx(1.0 / hz, rel=0.01)
    assert missing_share(T, read_at(hz)) < 0.01


@pytest.mark.parametrize("hz", [50.0, 25.0, 20.0, 10.0])
def test_a_hole_counts_against_the_sensor_s_own_rate(hz):
    values = read_at(hz)
    values[1000:2500] = np.nan
    assert own_period(T, values) == pytest.approx(1.0 / hz, rel=0.02)
    assert missing_share(T, values) == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("hz", [50.0, 25.0])
def test_samples_lost_at_random_are_missing(hz):
    values = read_at(hz)
    values[np.random.default_rng(1).random(len(T)) < 0.3] = np.nan
    assert missing_share(T, values) == pytest.approx(0.3, abs=0.03)


def test_rows_that_are_not_quite_even():
    t = T + np.random.default_rng(2).uniform(-0.1, 0.1, len(T)) * ROW
    assert missing_share(t, read_at(25.0)) < 0.01


def test_hardly_a_sample():
    assert missing_share(T, np.full(len(T), np.nan)) == 1.0
    one = np.full(len(T), np.nan)
    one[3] = 1.0
    assert missing_share(T, one) == pytest.approx(1.0, abs=1e-3)
