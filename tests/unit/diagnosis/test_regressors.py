"""What an effect explains: the feature that its prediction follows, and bins of it."""

import itertools

import numpy as np

from glider.tools.diagnose.regressors import BINS, _bins, _follows
from glider.tools.diagnose.residuals import smoothed

RNG = np.random.default_rng(3)
SPEED, DEPTH = RNG.uniform(0.1, 0.6, 4000), RNG.uniform(0.0, 15.0, 4000)


def test_a_prediction_is_shown_against_what_it_follows():
    assert _follows(-3.0 * DEPTH, {"speed": SPEED, "depth": DEPTH}) == "depth"
    assert _follows(SPEED**2 - 0.1, {"depth": DEPTH, "speed": SPEED}) == "speed"
    on = (DEPTH > 9.0).astype(float)
    assert _follows(5.0 * on, {"speed": SPEED, "pump running": on}) == "pump running"


def test_of_equally_good_features_the_first_is_taken():
    assert _follows(np.full(4000, 2.0), {"speed": SPEED, "depth": DEPTH}) == "speed"


def test_bins_are_equally_filled_and_in_order():
    parts = _bins(SPEED)
    assert len(parts) == BINS
    assert sorted(np.concatenate(parts).tolist()) == list(range(4000))
    assert max(map(len, parts)) - min(map(len, parts)) <= 2
    assert all(SPEED[a].max() <= SPEED[b].min() for a, b in itertools.pairwise(parts))


def test_equal_values_stay_in_one_bin():
    on = np.repeat([0.0, 1.0], [3000, 1000])
    assert [np.unique(on[part]).tolist() for part in _bins(on)] == [[0.0], [1.0]]
    assert _bins(np.zeros(5)) == []  # too few samples to average


def test_smoothing_keeps_the_length_and_the_place():
    t = np.arange(100) / 10.0
    spike = np.zeros(100)
    spike[60] = 1.0
    found = smoothed(spike, t)
    assert len(found) == 100
    assert abs(int(found.argmax()) - 60) <= 10  # within the second before and after
    assert len(smoothed(np.ones(5), t[:5])) == 5  # a run shorter than that
