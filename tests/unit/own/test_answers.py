"""What an answer says of its sizes, and its cautions."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.own.decision import from_one_session
from glider.tools.own.diagnose import worse
from glider.tools.own.effects import PARAMETER, Effect
from glider.tools.own.evidence import interval


def mass(low: float, high: float) -> Effect:
    return Effect("mass", PARAMETER, "mass", "value", "kg", 0.5, low, high)


def test_a_size_in_the_open_has_the_normal_interval_in_its_unit():
    assert interval(mass(-100.0, 100.0), 2.0, 1.0) == pytest.approx([1.0 - 0.5 * 1.645, 1.0 + 0.5 * 1.645])


@given(st.floats(-5.0, 0.0), st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.floats(1e-6, 1e3))
def test_no_interval_passes_what_the_effect_can_be_and_each_holds_its_size(low, high, share, sd):
    size = low + share * (high - low)
    below, above = interval(mass(low, high), size, sd)
    assert 0.5 * low <= below <= 0.5 * size + 1e-12
    assert 0.5 * size - 1e-12 <= above <= 0.5 * high


@pytest.mark.parametrize(("after", "shrinkage", "cautions"), [(4.4, -0.36, 1), (0.8, 0.75, 0), (4.4, None, 0)])
def test_a_cause_with_which_the_gap_grows_comes_with_a_caution(after, shrinkage, cautions):
    found = worse({"before": {"total": 3.24}, "after": {"total": after}, "shrinkage": {"value": shrinkage}})
    assert len(found) == cautions
    assert not cautions or "3.24 -> 4.40" in found[0]


@pytest.mark.parametrize(("sessions", "cautions"), [(1, 1), (2, 0)])
def test_what_sessions_differ_by_is_not_known_from_one(sessions, cautions):
    assert len(from_one_session(sessions)) == cautions
