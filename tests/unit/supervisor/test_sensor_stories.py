"""What sensors say: lost, late, absurd, stuck (rows 1, 2, 4, 6, 10, 11).

Each row as a story: all is well, something breaks, it is noticed in time, and what follows.
"""

import math

import numpy as np
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.model.supervisor_settings import Limits
from glider.hal.ports import SLOTS, Validity
from tests.support.stories import ABORT, HOLD, LOG, NOTHING, TWO_TICKS, WARN, flying, rising
from tests.support.watchman import BALLAST_RANGE, DT, SLIDER_RANGE, Watchman


def test_nothing_is_asked_for_while_all_is_well():
    man = flying(fitted=("leak", "battery"), limits=Limits(low_voltage=12.0, least_voltage=11.0))
    assert man.commands == pytest.approx([0.1, 0.01, 0.05])
    assert man.supervisor.row == 0
    assert man.supervisor.news() == []


# --- row 1: the IMU -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("how", ["silent", "frozen", "faulty"])
def test_imu_lost_holds_then_aborts(how):
    man = flying()
    if how == "silent":
        man.silence.add("imu")
    elif how == "frozen":
        man.frozen.add("imu")
    else:
        man.say["imu"] = (math.nan,) * 6
    assert man.until(HOLD, 0.2) <= 0.2 + TWO_TICKS
    assert man.supervisor.row == sup.FAULT_IMU_LOST
    man.wanted = [0.5, -0.05, -0.1]
    held = man.commands.copy()
    man.seconds(0.9)
    assert (man.commands == held).all()
    assert man.until(ABORT, 0.2) <= 0.2
    assert man.ap[ctl.MODE] == ctl.ABORTED
    assert man.pilot.reason.startswith("fault 1: ")


def test_an_imu_that_comes_back_within_the_hold_flies_on():
    man = flying()
    man.silence.add("imu")
    man.seconds(0.8)
    assert man.supervisor.reaction == HOLD
    man.silence.clear()
    assert man.seconds(0.1) == NOTHING
    man.silence.add("imu")
    man.seconds(0.8)  # the hold begins anew
    assert man.supervisor.reaction == HOLD


def test_an_imu_that_never_spoke_is_lost_too():
    man = Watchman(mode=ctl.WAITING)
    man.silence.add("imu")
    assert man.until(HOLD, 0.2) <= 0.2
    assert man.seconds(1.1) == ABORT


# --- row 2: pressure ------------------------------------------------------------------------------------------------
def test_pressure_lost_aborts_and_never_clears():
    man = flying()
    man.silence.add("beacon")
    assert man.until(ABORT, 0.5) > 0.35
    assert man.supervisor.row == sup.FAULT_PRESSURE_LOST
    man.silence.clear()
    assert man.seconds(5.0) == ABORT
    assert man.supervisor.row == sup.FAULT_PRESSURE_LOST
    assert man.seconds(20.0) >= ABORT
    assert man.commands == pytest.approx([0.0, SLIDER_RANGE[0], BALLAST_RANGE[0]])


# --- row 4: draw-wires ----------------------------------------------------------------------------------------------
def test_without_the_sliders_wire_the_flight_goes_on():
    man = flying()
    man.silence.add("slider_wire")
    assert man.until(WARN, 0.5) > 0.35
    assert man.supervisor.row == sup.FAULT_WIRE_LOST
    assert man.seconds(10.0) == WARN
    man.silence.clear()
    assert man.seconds(0.1) == NOTHING


def test_without_the_pumps_wire_it_does_not():
    man = flying()
    man.say["plunger_wire"] = (math.nan,)
    assert man.until(ABORT, 0.5) > 0.3
    assert man.supervisor.row == sup.FAULT_WIRE_LOST


# --- rows 6 and 10: samples that are not fit -------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["imu", "beacon", "slider_wire", "plunger_wire"])
@pytest.mark.parametrize("late", [0.2, -0.1])
def test_a_sample_from_another_time_is_not_used(name, late):
    man = flying()
    man.late[name] = late
    assert man.until(LOG, 0.04) <= 0.04
    assert man.asked(6) == LOG
    assert man.frame[SLOTS[name].validity] == Validity.FAULT


@pytest.mark.parametrize("name", ["imu", "beacon", "slider_wire", "plunger_wire", "leak", "battery"])
def test_another_sample_under_the_same_time_is_not_used(name):
    man = flying(fitted=("leak", "battery"))
    slot = SLOTS[name]
    for i in range(len(slot.names)):
        man.say = {name: (*man.values(name)[:i], man.values(name)[i] + 1e-3, *man.values(name)[i + 1 :])}
        man._raw[slot.values] = man.say[name]
        man.silence.add(name)
        man.step()
        assert man.asked(6) == LOG
        assert man.frame[slot.validity] == Validity.FAULT
        man.say, man.silence = {}, set()
        assert man.step(10) == NOTHING


def test_a_slow_sensor_is_old_after_three_periods():
    man = flying()
    man.silence.add("beacon")
    assert man.until(LOG, 0.2) == pytest.approx(3 * 0.04 + DT, abs=0.041)
    assert man.supervisor.row == sup.FAULT_SAMPLE_TIME


IMPLAUSIBLE = {
    "imu": [(math.nan, -0.3, 0, 0, 0, 0), (0, math.inf, 0, 0, 0, 0), (0, -0.3, 4.0, 0, 0, 0), (0, 1.9, 0, 0, 0, 0),
            (1.0, -0.3, 0, 0, 0, 0), (0, -0.3, 0, 11.0, 0, 0), (0, -0.3, 0, 0, 5.0, 0), (0, -0.3, 0, 0, 0, -5.0),
            (0, 0.3, 0, 0, 0, 0), (0, -0.3, 1.0, 0, 0, 0)],
    "beacon": [(math.nan, 20.0), (1e3, 20.0), (2e8, 20.0), (120_000.0, 80.0), (200_000.0, 20.0), (127_000.0, 30.0)],
    "slider_wire": [(math.nan,), (0.6,), (0.05,), (-0.03,)],
    "plunger_wire": [(-math.inf,), (-0.6,), (0.03,)],
    "leak": [(math.nan,), (2.0,)],
    "battery": [(math.nan,), (-1.0,), (30.0,)],
}  # fmt: skip


@pytest.mark.parametrize(("name", "values"), [(name, values) for name in IMPLAUSIBLE for values in IMPLAUSIBLE[name]])
def test_an_absurd_sample_is_rejected_and_five_running_are_an_error(name, values):
    man = flying(fitted=("leak", "battery"))
    due = {"imu": 1, "leak": 10, "battery": 10}.get(name, 2)
    while man.number % due:
        man.step()
    man.say[name] = values
    man.step()
    assert man.asked(10) == LOG
    assert man.frame[SLOTS[name].validity] == Validity.FAULT
    if not all(math.isfinite(value) for value in values):  # what merely jumped may be true after a while
        man.step(3 * due)
        assert man.asked(10) == LOG
        man.step(due)
        assert man.asked(10) == WARN


def test_one_bad_sample_between_good_ones_is_never_an_error():
    man = flying()
    for _ in range(20):
        man.say["beacon"] = (math.nan, 20.0)
        man.step(2)
        man.say.clear()
        man.step(2)
    assert man.supervisor.worst(sup.FAULT_IMPLAUSIBLE) == LOG
    assert man.supervisor.worst(sup.FAULT_PRESSURE_LOST) == NOTHING


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_yaw_and_roll_go_round(way):
    man = flying()
    for number in range(400):
        man.roll = angle = math.remainder(way * 0.02 * number, 2 * math.pi)
        man.say["imu"] = (angle, -0.3, angle, 0.0, 0.0, 1e-6 * number)
        man.step()
    assert man.supervisor.worst(sup.FAULT_IMPLAUSIBLE) == NOTHING


def test_upright_roll_and_yaw_mean_nothing():
    man = flying(mode=ctl.COMPLETED)
    rising(man)
    for pitch in np.linspace(-0.3, 1.3, 100):
        man.pitch = pitch
        man.step()
    for i in range(10):
        man.say["imu"] = (3.0 * (-1) ** i, 1.3, 2.0 * (-1) ** i, 0.0, 0.0, 1e-6 * i)
        man.step()
    assert man.supervisor.worst(sup.FAULT_IMPLAUSIBLE) == NOTHING


def test_what_moved_while_nobody_listened_is_no_jump():
    man = flying(pressure_s=9.0)
    man.silence.add("beacon")
    man.seconds(2.0)
    man.depth += 5.0
    man.silence.clear()
    man.step(2)
    assert man.supervisor.worst(sup.FAULT_IMPLAUSIBLE) == NOTHING


# --- row 11: stuck --------------------------------------------------------------------------------------------------
def test_stuck_pressure_in_a_dive_is_seen_and_ends_it():
    man = flying()
    man.frozen.add("beacon")
    begin = man.t
    man.until(ABORT, 3.0)
    assert man.supervisor.noticed(sup.FAULT_STUCK_SENSOR) - begin <= 2.0 + TWO_TICKS
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == WARN
    assert man.supervisor.row == sup.FAULT_PRESSURE_LOST


def test_pressure_that_stands_still_while_nothing_moves_is_not_stuck():
    man = flying()
    man.pitch, man.wanted = 0.05, [0.0, 0.0, 0.05]
    man.sinks = 0.0
    man.step(60)
    man.frozen.add("beacon")
    man.seconds(5.0)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == NOTHING
    man.wanted[2] = 0.15  # heavy: now it should sink
    man.seconds(3.0)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == WARN


@pytest.mark.parametrize(("name", "index", "way"), [("slider_wire", 1, 0.01), ("plunger_wire", 2, 0.04)])
def test_a_stuck_wire_is_seen_once_its_actuator_was_sent_elsewhere(name, index, way):
    man = flying()
    man.frozen.add(name)
    man.seconds(4.0)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == NOTHING
    man.wanted[index] += way
    begin = man.t
    man.seconds(2.1)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == WARN
    assert man.supervisor.noticed(sup.FAULT_STUCK_SENSOR) - begin <= 2.0 + TWO_TICKS


@pytest.mark.parametrize(("name", "index", "way"), [("slider_wire", 1, 0.004), ("plunger_wire", 2, 0.015)])
def test_a_wire_need_not_show_a_small_move(name, index, way):
    man = flying()
    man.frozen.add(name)
    man.wanted[index] += way
    man.seconds(4.0)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == NOTHING


def test_a_leak_sensor_that_always_says_the_same_is_not_stuck():
    man = flying(fitted=("leak",))
    man.seconds(10.0)
    assert man.supervisor.worst(sup.FAULT_STUCK_SENSOR) == NOTHING
