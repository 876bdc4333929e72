"""What a blind test holds, and how large its effects are."""

import numpy as np
import pytest

from glider.tools.verify.challenge.forms import FORMS, KNOWN
from glider.tools.verify.challenge.magnitude import find_strength
from glider.tools.verify.challenge.plan import NONE, PAIR, SINGLE, UNKNOWN, Counts, plan


def test_counts_labels_weak_and_strong():
    cases = plan(4, Counts())
    kinds = [case.kind for case in cases]
    assert [kinds.count(kind) for kind in (SINGLE, NONE, PAIR, UNKNOWN)] == [100, 60, 30, 30]
    assert [case.number for case in cases] == list(range(220))
    singles = [case for case in cases if case.kind == SINGLE]
    for form in KNOWN:
        weak = [case.weak[0] for case in singles if case.labels == (form.label,)]
        assert len(weak) >= 2
        assert {True, False} <= set(weak)


def test_half_have_motion_capture_and_those_that_need_it():
    cases = plan(4, Counts())
    assert sum(case.mocap for case in cases) == 110
    for case in cases:
        assert case.mocap or not any(FORMS[label].by_mocap for label in case.labels)


def test_the_order_says_nothing_and_the_seed_everything():
    kinds = [case.kind for case in plan(4, Counts())]
    assert kinds != sorted(kinds)
    assert plan(4, Counts()) == plan(4, Counts())
    assert plan(4, Counts()) != plan(5, Counts())


def test_pairs_are_of_two_places():
    for case in plan(9, Counts()):
        if case.kind == PAIR:
            first, second = (FORMS[label] for label in case.labels)
            assert first.places != second.places


@pytest.mark.parametrize(("gain", "target"), [(3.0, 2.5), (40.0, 6.0), (0.9, 2.0), (900.0, 20.0)])
def test_a_strength_is_found_where_the_gap_grows_with_its_square(gain, target):
    found = find_strength(lambda s: float(np.sqrt(1.0 + (gain * s) ** 2)), target, 5.0)
    assert np.sqrt(1.0 + (gain * found) ** 2) == pytest.approx(target, rel=0.11)


def test_a_strength_is_found_where_it_does_not():
    def value(s):
        return 1.0 + 20.0 * max(0.0, s - 0.8) ** 3

    assert value(find_strength(value, 4.0, 3.0)) == pytest.approx(4.0, rel=0.11)


def test_what_cannot_be_flown_or_reached_gives_the_most_there_is():
    assert find_strength(lambda s: 1.0 + s, 5.0, 2.0) == 2.0
    found = find_strength(lambda s: 1.0 + s if s < 1.0 else float("nan"), 5.0, 4.0)
    assert 0.9 < found < 1.0
    assert find_strength(lambda s: float("nan"), 5.0, 4.0) == 0.0
