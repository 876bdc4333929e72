"""The first hour with one's own log, the vehicle weighed, measured and swung by a person: drag first, and its size."""

import pytest

from tests.support.first_hour import MEASURED, ends_right, told

pytestmark = pytest.mark.computes(seconds=70)


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    return told(tmp_path_factory.mktemp("hour"), MEASURED)


def test_it_ends_with_the_right_answer(story):
    ends_right(story)


def test_what_was_swung_and_weighed_is_no_guess(story):
    assert not {"J_x", "J_y", "m_t", "x_b"} & set(story.vehicle.assumed)
    assert story.vehicle.mass.J[1] == pytest.approx(1.5, rel=0.08)
