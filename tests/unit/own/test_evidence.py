"""Intervals of sizes: normal ones, within what an effect can be."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
