"""What is said of events found: which matter, and which are parts of one that no label names."""

import numpy as np
import pytest

from glider.tools.diagnose.noise_probes import NoiseProbe
from glider.tools.diagnose.unknown import place_alone
from glider.tools.watch.events import GROWING, STEP, Span
from glider.tools.watch.history import ChangeEvent
from glider.tools.watch.unknown import NO_RESIDUAL, Residual
from glider.tools.watch.verdicts import ResolvedEvent, one_form


def resolved(label: str, first: int, end: int, course: str = STEP) -> ResolvedEvent:
    event = ChangeEvent(label, Span(first, end, course), 100.0, {label: 100.0}, np.array([1.0]), np.eye(1), 100.0)
    return ResolvedEvent(event, NO_RESIDUAL, 0.995, 0.005, 0)


ALL_TOUCH = [("pitch_trim", 11, 14, GROWING), ("pitch_damping", 9, 10), ("slider_scale", 12, 13), ("lift", 7, 8)]


def test_changes_that_come_and_go_from_run_to_run_are_one_of_an_unknown_form():
    found = one_form([resolved(*one) for one in ALL_TOUCH])
    assert [one.unknown for one in found] == [True] * 4
    assert [one.label for one in found] == [None] * 4


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (ALL_TOUCH[:2], "two changes may be two changes"),
        ([("drag", 5, 14), ("lift", 7, 14), ("pump_slow", 9, 14, GROWING)], "none comes and goes with a run"),
        ([("drag", 5, 6), ("lift", 9, 10), ("pump_slow", 13, 14)], "they have runs without any between them"),
        ([*ALL_TOUCH[:2], ("turbulence", 12, 13)], "rougher water beside two changes"),
    ],
)
def test_other_changes_keep_their_labels(changes, why):
    found = [resolved(*one) for one in changes]
    assert one_form(found) == found, why


def test_a_change_far_from_those_keeps_its_label():
    found = one_form([resolved("drag", 1, 4), *(resolved(*one) for one in ALL_TOUCH)])
    assert [one.unknown for one in found] == [False, True, True, True, True]


def test_what_is_left_where_the_label_sits_and_nowhere_else_is_another_form():
    """A gyro whose error grows with depth is no bias, though a bias explains nine tenths of it."""
    gyro, servo = NoiseProbe("gyro", "sensor", "sensing", "gyro"), NoiseProbe("servo", "actuator", "actuation", "servo")
    assert place_alone([(servo, 1.0), (gyro, 300.0), (gyro, 20.0)]) == (("sensing", "gyro"), 1.0)
    assert place_alone([(gyro, 300.0), (servo, 150.0)])[1] == 0.0
    assert 0.0 < place_alone([(gyro, 300.0), (servo, 100.0)])[1] < 1.0
    assert Residual(0.09, []).probability < 0.4
    assert Residual(0.09, [], own=True).probability > 0.8
    assert Residual(0.005, [], own=True).probability < 0.1
