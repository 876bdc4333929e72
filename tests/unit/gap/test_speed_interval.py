"""The interval of a dive's mean speed where several models are as likely."""

import numpy as np
import pytest

from glider.tools.gap.velocity import interval_over


def test_of_one_model_it_is_the_normal_one():
    assert interval_over(np.array([0.3, 0.3]), 0.01) == pytest.approx([0.3 - 0.01645, 0.3 + 0.01645])


@pytest.mark.parametrize("means", [[0.25, 0.30], [0.2, 0.22, 0.31]])
def test_of_several_it_holds_nine_in_ten_of_what_they_say(means):
    rng = np.random.default_rng(1)
    drawn = rng.choice(means, 200_000) + 0.01 * rng.standard_normal(200_000)
    low, high = interval_over(np.array(means), 0.01)
    assert np.mean(drawn < low) == pytest.approx(0.05, abs=0.003)
    assert np.mean(drawn > high) == pytest.approx(0.05, abs=0.003)
