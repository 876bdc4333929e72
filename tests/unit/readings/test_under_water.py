"""What was measured while the hull is partly out of the water is no flight, however short."""

import numpy as np
import pytest

from glider.tools.data.runs.run import Run
from glider.tools.readings.stretches import since_dive, under_water


def run(depth, every=1):
    """A run of 10 Hz with this depth, read in every so-manieth row."""
    t = np.arange(len(depth)) / 10.0
    read = np.where(np.arange(len(t)) % every == 0, depth, np.nan)
    return Run("run00", None, {"t_s": t, "cmd_servo_rad": 0.1 + 0.0 * t, "pitch_rad": 0.2 + 0.0 * t, "depth_m": read})


def course(end):
    """Up from 2 m to `end` (m) at 5 cm/s, where it stays: 60 s in all."""
    return np.maximum(2.0 - 0.05 * np.arange(0.0, 60.0, 0.1), end)


FLOATS_NOWHERE = pytest.mark.parametrize(
    "depth",
    [course(0.3), course(-0.01) - 1.5, 0.0 * course(0.3) + 0.02],
    ids=["submerged", "another zero", "all of it"],
)


@pytest.mark.parametrize("every", [1, 3])
def test_the_last_seconds_afloat_are_cut_off(every):
    before = run(course(-0.01), every)
    after = under_water(before)
    afloat = np.arange(0.0, 60.0, 0.1) > 35.0
    assert after.rows == pytest.approx((~afloat).sum(), abs=10)
    for name, values in after.columns.items():
        np.testing.assert_array_equal(values, before.columns[name][: after.rows])


def test_a_moment_at_the_surface_between_two_dives_is_missing_but_times_and_commands():
    t = np.arange(0.0, 60.0, 0.1)
    before = run(1.0 - 1.02 * np.exp(-(((t - 30.0) / 5.0) ** 2)))
    after = under_water(before)
    surface = before.columns["depth_m"] < 0.04
    assert surface.any()
    assert np.isnan(after.columns["pitch_rad"][surface]).all()
    assert np.isfinite(after.columns["pitch_rad"][:200]).all()
    np.testing.assert_array_equal(after.t, before.t)
    assert np.isfinite(after.columns["cmd_servo_rad"]).all()


@FLOATS_NOWHERE
def test_what_never_came_up_or_has_another_zero_stays(depth):
    before = run(depth)
    after = under_water(before)
    for name, values in before.columns.items():
        np.testing.assert_array_equal(after.columns[name], values)


def test_what_lies_before_the_first_dive_and_long_between_two_stays():
    """Without readings there an observer is blind where the next windows begin."""
    t = np.arange(0.0, 60.0, 0.1)
    waiting = run(np.where(t < 9.0, 0.0, 0.1 * (t - 9.0)))
    assert under_water(waiting) is waiting
    between = run(np.clip(np.abs(t - 30.0) - 8.0, 0.0, 2.0))
    assert (between.columns["depth_m"] < 0.04).sum() > 100
    assert under_water(between) is between


def test_a_fit_begins_where_the_hull_is_under_water():
    """Down from the surface at 0.1 m/s, after 9 s afloat."""
    t = np.arange(0.0, 60.0, 0.1)
    waiting = run(np.where(t < 9.0, 0.0, 0.1 * (t - 9.0)))
    after = since_dive(waiting)
    assert after.t[0] == pytest.approx(10.0, abs=0.2)
    for name, values in after.columns.items():
        np.testing.assert_array_equal(values, waiting.columns[name][-after.rows :])


@FLOATS_NOWHERE
def test_a_run_without_a_first_dive_is_fitted_as_it_is(depth):
    before = run(depth)
    assert since_dive(before) is before
