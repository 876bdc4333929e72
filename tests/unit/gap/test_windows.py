"""Windows: 20 s one after the other, a short run is one, the rest at the end is not scored."""

import numpy as np
import pytest

from glider.tools.inference.channels import ROUGHIE_MEASURES


def rows(count: int, rate: float = 10.0, begin: float = 0.0) -> list[tuple[int, int, int, bool]]:
    found = ROUGHIE_MEASURES.windows(begin + np.arange(count) / rate)
    return [(w.first, w.start, w.end, w.scored) for w in found]


def test_a_minute_at_10_hz_is_three_windows():
    assert rows(600) == [(0, 20, 200, True), (200, 220, 400, True), (400, 420, 600, True)]


def test_one_sample_short_of_a_minute_leaves_the_third_unscored():
    assert rows(599) == [(0, 20, 200, True), (200, 220, 400, True), (400, 420, 599, False)]


def test_what_is_left_is_a_window_of_its_own_that_nobody_scores():
    assert rows(605)[-1] == (600, 605, 605, False)
    assert rows(650)[-1] == (600, 620, 650, False)


@pytest.mark.parametrize("count", [1, 15, 25, 199])
def test_a_short_run_is_one_window(count):
    assert rows(count) == [(0, min(20, count), count, True)]


def test_the_clock_may_begin_anywhere():
    assert rows(400, begin=1234.567) == rows(400)


def test_at_50_hz_a_window_has_a_thousand_rows():
    assert rows(2000, rate=50.0) == [(0, 100, 1000, True), (1000, 1100, 2000, True)]


def test_a_gap_in_the_log_drops_the_windows_it_swallows():
    t = np.concatenate([np.arange(0.0, 15.0, 0.1), np.arange(65.0, 100.0, 0.1)])
    found = ROUGHIE_MEASURES.windows(t)
    assert [(round(t[w.first], 3), w.scored) for w in found] == [(0.0, True), (65.0, True), (80.0, True)]
    assert t[found[1].start] == pytest.approx(65.0)  # nothing of its first 2 s was recorded
