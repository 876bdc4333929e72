"""Value and rate of a recorded output at a time, by its readings until a later one."""

import numpy as np
import pytest

from glider.tools.own.trends import trend_of


def wandering(seed: int, every: int, power: float = 0.05, sigma: float = 0.2):
    """A value whose rate wanders, at ten rows a second, read every so many-th row with noise."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 60.0, 0.1)
    rate = np.cumsum(np.sqrt(0.1 * power) * random.standard_normal(len(t)))
    value = np.cumsum(0.1 * rate)
    y = value + sigma * random.standard_normal(len(t))
    y[np.arange(len(t)) % every != 0] = np.nan
    return t, y, value, rate


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("said", [0.1, 0.2, 0.6])
@pytest.mark.parametrize("later", [0.0, 2.0])
def test_value_and_rate_are_as_far_off_as_it_says_whatever_noise_the_file_has(every, said, later):
    far = []
    for seed in range(12):
        t, y, value, rate = wandering(seed, every)
        found = trend_of(t, y, said, angle=False)
        for row in range(103, len(t) - 30, 50):
            x, P = found.at(t[row], t[row] + later)
            error = x - [value[row], rate[row]]
            far.append(error @ np.linalg.solve(P, error))
    assert 1.4 < np.mean(far) < 3.0  # two numbers each


def test_readings_shortly_after_make_it_surer():
    t, y, value, _ = wandering(5, 5)
    found = trend_of(t, y, 0.2, angle=False)
    rows = range(103, 560, 20)
    filtered, smoothed = ([found.at(t[row], t[row] + later) for row in rows] for later in (0.0, 3.0))
    assert all(b[1][1, 1] < 0.7 * a[1][1, 1] for a, b in zip(filtered, smoothed, strict=True))
    off = [np.std([x[0] - value[row] for (x, _), row in zip(one, rows, strict=True)]) for one in (filtered, smoothed)]
    assert off[1] < off[0]


def test_an_angle_is_counted_over_a_turn():
    t = np.arange(0.0, 20.0, 0.1)
    found = trend_of(t, np.mod(0.5 * t + np.pi, 2.0 * np.pi) - np.pi, 0.01, angle=True)
    for when in (6.0, 6.25, 12.0):
        (value, rate), _ = found.at(when, when + 1.0)
        assert rate == pytest.approx(0.5, abs=0.05)
        assert np.cos(value - 0.5 * when) == pytest.approx(1.0, abs=1e-3)


def test_no_reading_behind_counts_and_before_the_first_it_is_led_back():
    t, y, *_ = wandering(3, 10)
    y[:100] = np.nan
    found = trend_of(t, y, 0.2, angle=False)
    assert np.isnan(found.at(t[50], t[99])[0]).all()
    x, P = found.at(t[95], t[140])
    there, near = found.at(t[100], t[140])
    assert x == pytest.approx([there[0] - 0.5 * there[1], there[1]])
    assert P[0, 0] > near[0, 0]
    later = trend_of(t, y + np.where(t > t[400], 0.01, 0.0), 0.2, angle=False)
    assert later.at(t[390], t[400])[0] == pytest.approx(found.at(t[390], t[400])[0])
    assert np.isnan(trend_of(t, np.full(len(t), np.nan), 0.2, angle=False).at(1.0, 2.0)[0]).all()
