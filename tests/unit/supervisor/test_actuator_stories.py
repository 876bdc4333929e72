"""What actuators do, and say of themselves: lost, alarmed, jammed, the wrong way (rows 3, 5, 9, 14, 16).

Each row as a story: all is well, something breaks, it is noticed in time, and what follows.
"""

import math

import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.hal.ports import Condition, Validity
from tests.support.stories import ABORT, NOTHING, TWO_TICKS, WARN, flying
from tests.support.watchman import BALLAST_RANGE, DT, SLIDER_RANGE, Watchman


# --- rows 3, 5, 9, 16: what actuators say of themselves --------------------------------------------------------------
@pytest.mark.parametrize("name", ["slider", "ballast"])
def test_a_lost_drive_aborts(name):
    man = flying()
    man.silence.add(name)
    assert man.until(ABORT, 0.5) > 0.35
    assert man.supervisor.row == sup.FAULT_BUS_LOST


def test_a_lost_servo_flies_level_until_it_answers():
    man = flying()
    man.silence.add("servo")
    assert man.until(WARN, 0.5) > 0.35
    assert man.supervisor.row == sup.FAULT_SERVO_LOST
    man.seconds(2.0)
    assert man.commands == pytest.approx([0.0, 0.01, 0.05])
    assert man.ap[ctl.MODE] == ctl.FLYING
    man.silence.clear()
    man.seconds(1.0)
    assert man.supervisor.reaction == NOTHING
    assert man.commands[0] == pytest.approx(0.1)


def test_actuators_that_say_nothing_of_themselves_are_not_watched():
    man = Watchman()
    man.fitted = ("imu", "beacon", "slider_wire", "plunger_wire")
    assert man.seconds(5.0) == NOTHING


@pytest.mark.parametrize("name", ["servo", "slider", "ballast"])
@pytest.mark.parametrize(
    ("condition", "row", "reaction"),
    [
        (Condition.WELL, 0, NOTHING),
        (Condition.ALARM, 16, WARN),
        (Condition.ALARM_KEPT, 16, ABORT),
        (Condition.RETRYING, 14, WARN),
        (Condition.GIVEN_UP, 14, ABORT),
        (Condition.WRONG_WAY, 14, ABORT),
        (Condition.MISCONFIGURED, 9, ABORT),
    ],
)
def test_conditions_ask_for_their_rows(name, condition, row, reaction):
    man = flying()
    man.say[name] = (float(condition),)
    assert man.step(2) == reaction
    assert man.supervisor.row == row
    man.say.clear()
    assert man.step(2) == (reaction if reaction == ABORT else NOTHING)


def test_the_layout_says_what_the_ports_say():
    assert list(Condition) == [
        sup.WELL,
        sup.ALARM,
        sup.ALARM_KEPT,
        sup.RETRYING,
        sup.GIVEN_UP,
        sup.WRONG_WAY,
        sup.MISCONFIGURED,
    ]
    assert (sup.VALID, sup.FAULT) == (Validity.VALID, Validity.FAULT)


# --- row 14: the draw-wires see a stall or a wrong way ---------------------------------------------------------------
WAYS = [(0, 0.05, 0.02, 0.15, 0.12), (1, -0.15, 0.03, 0.3, 0.4)]


def standing() -> Watchman:
    """Three seconds in which nothing moves."""
    man = Watchman(same_depth_s=3600.0)
    man.depth, man.sinks, man.pitch = 2.0, 0.0, 0.0
    assert man.seconds(3.0) == NOTHING
    return man


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_a_jammed_actuator_is_tried_twice_more_then_given_up(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    way = abs(goal) / rate + tau
    first = man.until(WARN, 1.5 * way + 1.0)
    assert man.supervisor.row == sup.FAULT_STALL
    assert first <= 1.5 * (abs(goal) / rate + tau) + 2.0
    place = man.commands[1 + i]
    man.seconds(0.9)
    assert abs(man.commands[1 + i]) < abs(place)  # rests, back to where it stands
    assert man.G[sup.STALLS + i] == 1.0
    man.until(ABORT, 5.0 * way)
    assert man.G[sup.STALLS + i] == 3.0
    assert man.supervisor.row == sup.FAULT_STALL


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_an_actuator_that_frees_itself_is_forgiven(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    man.until(WARN, 20.0)
    man.follows = True
    man.seconds(25.0)
    assert man.supervisor.reaction == NOTHING
    assert man.G[sup.STALLS + i] == 0.0
    assert man.commands[1 + i] == pytest.approx(goal)


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_a_slow_actuator_is_no_stall(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    for _ in range(round(abs(goal) / rate / DT * 2.5)):
        left = man.G[sup.SENT + 1 + i] - man.places[i]
        man.places[i] += math.copysign(min(abs(left), 0.5 * rate * DT), left)
        assert man.step() == NOTHING


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_the_wrong_way_is_stopped_at_once(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    moved = 0.0
    begin = man.t
    while man.step() < ABORT:
        moved -= math.copysign(rate * DT, goal)
        man.places[i] = moved
        assert man.t - begin <= 0.3 + TWO_TICKS
    assert man.supervisor.row == sup.FAULT_STALL
    assert man.G[sup.STOPPED + i] == 1.0
    assert man.commands[1 + i] == pytest.approx(moved, abs=0.2 * rate)
    place = man.commands[1 + i]
    man.seconds(3.0)
    assert man.commands[1 + i] == place  # stays there, while the other goes up
    assert man.commands[2 - i] == pytest.approx((SLIDER_RANGE[0], BALLAST_RANGE[0])[1 - i], abs=0.12)


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
@pytest.mark.parametrize("delay", [0.0, 0.2, 0.5])
def test_commands_that_show_late_are_no_wrong_way(i, goal, rate, tau, span, delay):
    """To and fro, each time before it has arrived."""
    man = standing()
    man.follows = False
    sent, place = [0.0] * 200, 0.0
    for n in range(1500):
        man.wanted[1 + i] = goal if n // 70 % 2 else -goal
        man.step()
        sent.append(man.G[sup.SENT + 1 + i])
        old = sent[-1 - round(delay / DT)]
        place += min(max((old - place) / tau, -rate), rate) * DT
        man.places[i] = place
    assert man.G[sup.STOPPED + i] == 0.0
    assert man.supervisor.worst(sup.FAULT_STALL) == NOTHING


def test_a_wire_that_jumps_about_is_not_a_stall():
    man = standing()
    man.say["slider_wire"] = (math.nan,)
    man.wanted[1] = 0.05
    man.seconds(20.0)
    assert man.supervisor.worst(sup.FAULT_STALL) == NOTHING
