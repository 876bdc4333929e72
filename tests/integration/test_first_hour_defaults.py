"""The first hour with one's own log, every question of `vehicle new` answered by Enter: drag first, and its size."""

import pytest

from tests.support.first_hour import ends_right, told

pytestmark = pytest.mark.computes(seconds=70)


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    return told(tmp_path_factory.mktemp("hour"), {})


def test_it_ends_with_the_right_answer(story):
    ends_right(story)


def test_every_guess_was_called_one_and_is_none_any_more(story):
    assert {"J_x", "J_y", "J_z", "m_t", "added_mass_z", "K_D0"} <= set(story.vehicle.assumed)
    assert not story.identified.assumed
