"""Means, gaps, wrapping angles, rates out of attitude."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.importers.resample import bins_of, body_rates, fill_gaps, means


def test_a_row_is_the_mean_of_what_lies_within_half_a_period_of_it():
    t = np.array([0.94, 0.96, 1.0, 1.04, 1.06, 1.3])
    bins = bins_of(t, 1.0, 10.0)
    assert bins.tolist() == [-1, 0, 0, 0, 1, 3]
    mean = means(np.array([9.0, 1.0, 2.0, 6.0, 4.0, 5.0]), bins, 4, angle=False)
    np.testing.assert_array_equal(mean, [3.0, 4.0, np.nan, 5.0])


def test_missing_samples_are_passed_over():
    mean = means(np.array([np.nan, 2.0, np.nan]), np.array([0, 0, 1]), 2, angle=False)
    np.testing.assert_array_equal(mean, [2.0, np.nan])


angles = st.floats(-3.1, 3.1)


@given(middle=angles, spread=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=6))
def test_the_mean_of_angles_does_not_know_where_they_wrap(middle, spread):
    samples = wrap(middle + np.array(spread))
    mean = means(samples, np.zeros(len(spread), dtype=int), 1, angle=True)
    assert wrap(mean - (middle + np.mean(spread)))[0] == pytest.approx(0.0, abs=1e-12)
    assert -np.pi <= mean[0] <= np.pi


def test_continuous_angles_stay_continuous():
    t = (np.arange(300) + 0.5) / 100
    mean = means(10.0 * t, bins_of(t, 0.0, 10.0), 31, angle=True)
    np.testing.assert_allclose(mean[1:-1], np.arange(1.0, 30.0), atol=1e-12)


def test_short_gaps_are_interpolated_and_long_ones_are_not():
    t = np.array([0.0, 0.1, 0.3, 0.4, 1.0])
    values = np.array([0.0, 1.0, 3.0, 4.0, 10.0])
    grid = np.arange(11) / 10
    mean = means(values, bins_of(t, 0.0, 10.0), 11, angle=False)
    filled = fill_gaps(mean, grid, t, values, 0.25, angle=False)
    np.testing.assert_allclose(filled, [0, 1, 2, 3, 4, *[np.nan] * 5, 10])
    np.testing.assert_array_equal(fill_gaps(mean, grid, t, values, 0.0, angle=False), mean)
    np.testing.assert_allclose(fill_gaps(mean, grid, t, values, 1.0, angle=False), 10 * grid)


def test_gaps_of_angles_are_filled_the_short_way_round():
    t, yaw = np.array([0.0, 0.2]), np.array([3.1, -3.1])
    mean = means(yaw, bins_of(t, 0.0, 10.0), 3, angle=True)
    filled = fill_gaps(mean, np.arange(3) / 10, t, yaw, 0.5, angle=True)
    assert abs(filled[1]) == pytest.approx(np.pi)


def test_nothing_is_invented_outside_the_samples():
    t, values = np.array([0.5, 0.6]), np.array([1.0, 2.0])
    grid = np.arange(12) / 10
    filled = fill_gaps(means(values, bins_of(t, 0.0, 10.0), 12, angle=False), grid, t, values, 9.0, angle=False)
    assert np.isnan(filled[:5]).all()
    assert np.isnan(filled[7:]).all()


def test_body_rates_are_those_of_the_rotation():
    """A body that turns at constant p, q, r about its own axes, integrated as a rotation matrix."""
    rate = np.array([0.2, -0.1, 0.3])
    t = np.arange(0.0, 6.0, 0.01)
    angle = np.linalg.norm(rate)
    axis = rate / angle
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R = np.array([np.eye(3) + np.sin(angle * s) * skew + (1 - np.cos(angle * s)) * skew @ skew for s in t])
    roll, pitch, yaw = np.arctan2(R[:, 2, 1], R[:, 2, 2]), -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    for found, wanted in zip(body_rates(t, roll, pitch, yaw), rate, strict=True):
        np.testing.assert_allclose(found[1:-1], wanted, atol=1e-4)
    gap = yaw.copy()
    gap[300] = np.nan
    assert np.isnan(body_rates(t, roll, pitch, gap)[2][299:302]).any()
