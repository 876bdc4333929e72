"""Leak, battery, and what the runtime tells (rows 20, 23, 25, 27, 33).

Each row as a story: all is well, something breaks, it is noticed in time, and what follows.
"""

import pytest

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.model.supervisor_settings import Limits
from tests.support.stories import ABORT, COARSE, LOG, NOTHING, WARN, flying


# --- rows 20 and 23 -------------------------------------------------------------------------------------------------
def test_one_wet_sample_warns_for_good_and_three_abort():
    man = flying(dt=COARSE, fitted=("leak",))
    man.say["leak"] = (1.0,)
    man.step(man.slow)
    assert man.supervisor.reaction == WARN
    assert man.supervisor.row == sup.FAULT_LEAK
    man.say.clear()
    assert man.seconds(20.0) == WARN
    man.say["leak"] = (1.0,)
    man.step(man.slow)
    assert man.supervisor.reaction == WARN
    assert man.step(man.slow) == ABORT
    assert man.supervisor.row == sup.FAULT_LEAK


def test_a_leak_aborts_within_a_second():
    man = flying(fitted=("leak",))
    man.say["leak"] = (1.0,)
    assert man.until(ABORT, 1.0) <= 1.0


def test_under_voltage_warns_then_aborts():
    man = flying(dt=COARSE, fitted=("battery",), limits=Limits(low_voltage=12.0, least_voltage=11.0))
    man.say["battery"] = (11.5,)
    assert man.until(WARN, 10.0) > 8.0
    assert man.supervisor.row == sup.FAULT_VOLTAGE
    assert man.seconds(20.0) == WARN
    man.say["battery"] = (13.0,)
    man.seconds(0.5)
    assert man.supervisor.reaction == NOTHING
    man.say["battery"] = (10.5,)
    assert man.until(ABORT, 10.0) > 8.0


def test_a_dip_of_voltage_is_no_under_voltage():
    man = flying(dt=COARSE, fitted=("battery",), limits=Limits(low_voltage=12.0, least_voltage=11.0))
    for _ in range(5):
        man.say["battery"] = (10.0,)
        man.seconds(8.0)
        man.say["battery"] = (13.0,)
        man.seconds(0.4)
    assert man.supervisor.worst(sup.FAULT_VOLTAGE) == NOTHING


def test_sags_with_a_silence_between_them_are_no_under_voltage():
    man = flying(dt=COARSE, fitted=("battery",), limits=Limits(low_voltage=12.0, least_voltage=11.0))
    for _ in range(3):
        man.say["battery"] = (10.0,)
        man.silence.clear()
        man.seconds(0.4)
        man.silence.add("battery")
        man.seconds(10.0)
    assert man.supervisor.worst(sup.FAULT_VOLTAGE) == NOTHING
    man.silence.clear()
    assert man.until(ABORT, 10.0) > 8.0


def test_under_voltage_is_judged_at_the_rate_of_its_device():
    """At 1 Hz samples are newer than three periods all the time; at 5 Hz, as without a word on it, they are not."""
    man = flying(dt=COARSE, fitted=("battery",), slow_s=1.0, limits=Limits(low_voltage=12.0, least_voltage=11.0))
    man.say["battery"] = (10.0,)
    assert man.until(ABORT, 11.0) > 8.0
    assert man.supervisor.worst(sup.FAULT_SAMPLE_TIME) == NOTHING


# --- rows 25, 27, 33 ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("place", "value", "row", "reaction"),
    [
        (sup.RESTARTED, 1.0, 25, ABORT), (sup.RECORDER, 1.0, 27, LOG), (sup.RECORDER, 2.0, 27, WARN),
        (sup.GROWTH, 1.0, 33, WARN), (sup.GROWTH, 2.0, 33, ABORT),
    ],
)  # fmt: skip
def test_what_the_runtime_tells_is_heard_in_the_same_tick(place, value, row, reaction):
    man = flying()
    man.G[place] = value
    assert man.step() == reaction
    assert man.supervisor.row == row
    man.G[place] = 0.0
    assert man.step() == (ABORT if reaction == ABORT else NOTHING)
