"""Every row of the supervisor's as a story: all is well, something breaks, it is noticed in time, and what follows."""

import math

import numpy as np
import pytest

from firmware.core import control_layout as ctl
from firmware.core import supervisor_layout as at
from firmware.supervisor.settings import Limits
from firmware.supervisor.table import Reaction
from hal.ports import SLOTS, Condition, Validity
from tests.support.watchman import BALLAST_RANGE, DT, SLIDER_RANGE, Watchman

NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = Reaction
TWO_TICKS = 2 * DT + 1e-9
COARSE = 0.1  # s, the step of stories that take long


FLOWN: dict[str, Watchman] = {}


def flying(**more) -> Watchman:
    """Ten seconds into a dive in which all is well."""
    if repr(more) not in FLOWN:
        man = Watchman(**more)
        man.depth = 0.5
        man.wanted = [0.1, 0.01, 0.05]
        assert man.seconds(10.0) == NOTHING
        assert not man.G[at.FIRST : at.FIRST + at.N_ROWS].max() >= 0.0
        FLOWN[repr(more)] = man
    return FLOWN[repr(more)].copy()


def rising(man: Watchman) -> None:
    man.sinks, man.pitch = -0.2, 0.3


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
    assert man.supervisor.row == 1
    man.wanted = [0.5, -0.05, -0.1]
    held = man.commands.copy()
    man.seconds(0.9)
    assert (man.commands == held).all()
    assert man.until(ABORT, 0.2) <= 0.2
    assert man.ap[ctl.MODE] == ctl.ABORTED
    assert man.pilot.reason == "fault 1: IMU unplugged or frozen"


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
    assert man.supervisor.row == 2
    man.silence.clear()
    assert man.seconds(5.0) == ABORT
    assert man.supervisor.row == 2
    assert man.seconds(20.0) >= ABORT
    assert man.commands == pytest.approx([0.0, SLIDER_RANGE[0], BALLAST_RANGE[0]])


# --- rows 3, 5, 9, 16: what actuators say of themselves --------------------------------------------------------------
@pytest.mark.parametrize("name", ["slider", "ballast"])
def test_a_lost_drive_aborts(name):
    man = flying()
    man.silence.add(name)
    assert man.until(ABORT, 0.5) > 0.35
    assert man.supervisor.row == 3


def test_a_lost_servo_flies_level_until_it_answers():
    man = flying()
    man.silence.add("servo")
    assert man.until(WARN, 0.5) > 0.35
    assert man.supervisor.row == 5
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
        at.WELL,
        at.ALARM,
        at.ALARM_KEPT,
        at.RETRYING,
        at.GIVEN_UP,
        at.WRONG_WAY,
        at.MISCONFIGURED,
    ]
    assert (at.VALID, at.FAULT) == (Validity.VALID, Validity.FAULT)


# --- row 4: draw-wires ----------------------------------------------------------------------------------------------
def test_without_the_sliders_wire_the_flight_goes_on():
    man = flying()
    man.silence.add("slider_wire")
    assert man.until(WARN, 0.5) > 0.35
    assert man.supervisor.row == 4
    assert man.seconds(10.0) == WARN
    man.silence.clear()
    assert man.seconds(0.1) == NOTHING


def test_without_the_pumps_wire_it_does_not():
    man = flying()
    man.say["plunger_wire"] = (math.nan,)
    assert man.until(ABORT, 0.5) > 0.3
    assert man.supervisor.row == 4


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
    assert man.supervisor.row == 6


ABSURD = {
    "imu": [(math.nan, -0.3, 0, 0, 0, 0), (0, math.inf, 0, 0, 0, 0), (0, -0.3, 4.0, 0, 0, 0), (0, 1.9, 0, 0, 0, 0),
            (1.0, -0.3, 0, 0, 0, 0), (0, -0.3, 0, 11.0, 0, 0), (0, -0.3, 0, 0, 5.0, 0), (0, -0.3, 0, 0, 0, -5.0),
            (0, 0.3, 0, 0, 0, 0), (0, -0.3, 1.0, 0, 0, 0)],
    "beacon": [(math.nan, 20.0), (1e3, 20.0), (2e8, 20.0), (120_000.0, 80.0), (200_000.0, 20.0), (127_000.0, 30.0)],
    "slider_wire": [(math.nan,), (0.6,), (0.05,), (-0.03,)],
    "plunger_wire": [(-math.inf,), (-0.6,), (0.03,)],
    "leak": [(math.nan,), (2.0,)],
    "battery": [(math.nan,), (-1.0,), (30.0,)],
}  # fmt: skip


@pytest.mark.parametrize(("name", "values"), [(name, values) for name in ABSURD for values in ABSURD[name]])
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
    assert man.supervisor.worst(10) == LOG
    assert man.supervisor.worst(2) == NOTHING


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_yaw_and_roll_go_round(way):
    man = flying()
    for number in range(400):
        man.roll = angle = math.remainder(way * 0.02 * number, 2 * math.pi)
        man.say["imu"] = (angle, -0.3, angle, 0.0, 0.0, 1e-6 * number)
        man.step()
    assert man.supervisor.worst(10) == NOTHING


def test_upright_roll_and_yaw_mean_nothing():
    man = flying(mode=ctl.COMPLETED)
    rising(man)
    for pitch in np.linspace(-0.3, 1.3, 100):
        man.pitch = pitch
        man.step()
    for i in range(10):
        man.say["imu"] = (3.0 * (-1) ** i, 1.3, 2.0 * (-1) ** i, 0.0, 0.0, 1e-6 * i)
        man.step()
    assert man.supervisor.worst(10) == NOTHING


def test_what_moved_while_nobody_listened_is_no_jump():
    man = flying(pressure_s=9.0)
    man.silence.add("beacon")
    man.seconds(2.0)
    man.depth += 5.0
    man.silence.clear()
    man.step(2)
    assert man.supervisor.worst(10) == NOTHING


# --- row 11: stuck --------------------------------------------------------------------------------------------------
def test_stuck_pressure_in_a_dive_is_seen_and_ends_it():
    man = flying()
    man.frozen.add("beacon")
    begin = man.t
    man.until(ABORT, 3.0)
    assert man.supervisor.noticed(11) - begin <= 2.0 + TWO_TICKS
    assert man.supervisor.worst(11) == WARN
    assert man.supervisor.row == 2


def test_pressure_that_stands_still_while_nothing_moves_is_not_stuck():
    man = flying()
    man.pitch, man.wanted = 0.05, [0.0, 0.0, 0.05]
    man.sinks = 0.0
    man.step(60)
    man.frozen.add("beacon")
    man.seconds(5.0)
    assert man.supervisor.worst(11) == NOTHING
    man.wanted[2] = 0.15  # heavy: now it should sink
    man.seconds(3.0)
    assert man.supervisor.worst(11) == WARN


@pytest.mark.parametrize(("name", "index", "way"), [("slider_wire", 1, 0.01), ("plunger_wire", 2, 0.04)])
def test_a_stuck_wire_is_seen_once_its_actuator_was_sent_elsewhere(name, index, way):
    man = flying()
    man.frozen.add(name)
    man.seconds(4.0)
    assert man.supervisor.worst(11) == NOTHING
    man.wanted[index] += way
    begin = man.t
    man.seconds(2.1)
    assert man.supervisor.worst(11) == WARN
    assert man.supervisor.noticed(11) - begin <= 2.0 + TWO_TICKS


@pytest.mark.parametrize(("name", "index", "way"), [("slider_wire", 1, 0.004), ("plunger_wire", 2, 0.015)])
def test_a_wire_need_not_show_a_small_move(name, index, way):
    man = flying()
    man.frozen.add(name)
    man.wanted[index] += way
    man.seconds(4.0)
    assert man.supervisor.worst(11) == NOTHING


def test_a_leak_sensor_that_always_says_the_same_is_not_stuck():
    man = flying(fitted=("leak",))
    man.seconds(10.0)
    assert man.supervisor.worst(11) == NOTHING


# --- row 13 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("nose", [1, -1])
def test_pitch_and_depth_rate_that_disagree_make_the_controller_cautious(nose):
    man = flying()
    man.pitch, man.sinks = -0.3 * nose, -0.2 * nose
    man.depth = 3.0
    man.G[at.JUMP] = man.G[at.JUMP + 1] = 10.0
    begin = man.t
    if nose == -1:
        man.pitch = 0.3
    assert man.until(WARN, 7.0) >= 4.0
    assert man.supervisor.row == 13
    assert man.supervisor.noticed(13) - begin < 4.8 + 2.0
    man.step()
    assert man.ap[ctl.CAUTIOUS] == 1.0
    man.sinks *= -1
    man.seconds(3.0)
    assert man.supervisor.reaction == NOTHING
    assert man.ap[ctl.CAUTIOUS] == 0.0


@pytest.mark.parametrize(("pitch", "sinks"), [(0.1, 0.2), (0.3, 0.03), (-0.3, 0.2)])
def test_a_flat_or_slow_glide_does_not_disagree(pitch, sinks):
    man = flying(dt=COARSE)
    man.G[at.JUMP + 1] = 10.0
    man.pitch, man.sinks = pitch, sinks
    assert man.seconds(10.0) == NOTHING


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
    assert man.supervisor.row == 14
    assert first <= 1.5 * (abs(goal) / rate + tau) + 2.0
    place = man.commands[1 + i]
    man.seconds(0.9)
    assert abs(man.commands[1 + i]) < abs(place)  # rests, back to where it stands
    assert man.G[at.STALLS + i] == 1.0
    man.until(ABORT, 5.0 * way)
    assert man.G[at.STALLS + i] == 3.0
    assert man.supervisor.row == 14


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_an_actuator_that_frees_itself_is_forgiven(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    man.until(WARN, 20.0)
    man.follows = True
    man.seconds(25.0)
    assert man.supervisor.reaction == NOTHING
    assert man.G[at.STALLS + i] == 0.0
    assert man.commands[1 + i] == pytest.approx(goal)


@pytest.mark.parametrize(("i", "goal", "rate", "tau", "span"), WAYS)
def test_a_slow_actuator_is_no_stall(i, goal, rate, tau, span):
    man = standing()
    man.follows = False
    man.wanted[1 + i] = goal
    for _ in range(round(abs(goal) / rate / DT * 2.5)):
        left = man.G[at.SENT + 1 + i] - man.places[i]
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
    assert man.supervisor.row == 14
    assert man.G[at.STOPPED + i] == 1.0
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
        sent.append(man.G[at.SENT + 1 + i])
        old = sent[-1 - round(delay / DT)]
        place += min(max((old - place) / tau, -rate), rate) * DT
        man.places[i] = place
    assert man.G[at.STOPPED + i] == 0.0
    assert man.supervisor.worst(14) == NOTHING


def test_a_wire_that_jumps_about_is_not_a_stall():
    man = standing()
    man.say["slider_wire"] = (math.nan,)
    man.wanted[1] = 0.05
    man.seconds(20.0)
    assert man.supervisor.worst(14) == NOTHING


# --- rows 15 and 22: what the controller asks for --------------------------------------------------------------------
@pytest.mark.parametrize("i", [0, 1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_past_a_limit_is_clamped_and_logged_in_the_same_tick(i, side):
    man = flying()
    high = (math.pi / 3, 0.06, 0.2)[i]
    man.wanted[i] = side * 1.5 * high
    assert man.step() == LOG
    assert man.supervisor.row == 15
    man.seconds(25.0)
    assert man.commands[i] == pytest.approx(side * high, rel=1e-4)
    assert abs(man.commands[i]) <= high * (1 + 1e-4)
    man.wanted[i] = side * 0.5 * high
    assert man.step() == NOTHING


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e6])
@pytest.mark.parametrize("i", [0, 1, 2])
def test_no_answer_keeps_the_last_good_command_and_three_running_abort(bad, i):
    man = flying()
    last = man.commands.copy()
    man.wanted[i] = bad
    assert man.step() == WARN
    assert man.asked(22) == WARN
    assert man.commands[i] == last[i]
    assert man.ap[ctl.CAUTIOUS] == 1.0
    man.step()
    assert man.commands[i] == last[i]
    assert man.supervisor.reaction == WARN
    assert man.step() == ABORT
    assert man.supervisor.row == 22


def test_two_without_an_answer_are_forgiven():
    man = flying()
    for _ in range(10):
        good, man.wanted = man.wanted, [math.nan] * 3
        man.step(2)
        man.wanted = good
        man.step()
    assert man.supervisor.worst(22) == WARN
    assert man.ap[ctl.CAUTIOUS] == 1.0
    man.seconds(5.1)
    assert man.ap[ctl.CAUTIOUS] == 0.0


@pytest.mark.parametrize("status", [1.0, 2.0])
def test_a_law_without_a_solution_hands_over_to_the_pid_and_three_times_aborts(status):
    man = flying()
    man.pilot.C[ctl.CONTROLLER] = ctl.LAW
    man.ap[ctl.ACTIVE] = ctl.LAW
    for count in (1.0, 2.0):
        man.ap[ctl.LAW_STATUS], man.ap[ctl.ACTIVE] = status, ctl.LAW
        assert man.step() == WARN
        assert man.G[at.LAW_FAILED] == count
        man.ap[ctl.ACTIVE] = ctl.PID
        man.step(10)
        assert man.ap[ctl.CAUTIOUS] == 1.0
    man.ap[ctl.ACTIVE] = ctl.LAW
    assert man.step() == ABORT


def test_a_law_that_answers_again_starts_afresh():
    man = flying()
    man.pilot.C[ctl.CONTROLLER] = ctl.LAW
    man.ap[ctl.ACTIVE] = ctl.LAW
    for _ in range(5):
        man.ap[ctl.LAW_STATUS] = 1.0
        man.step(2)
        man.ap[ctl.LAW_STATUS] = 0.0
        man.step()
        assert man.G[at.LAW_FAILED] == 0.0
    man.ap[ctl.LAW_STATUS] = 1.0
    man.pilot.C[ctl.CONTROLLER] = ctl.PID  # the status is an old one
    assert man.step() == NOTHING


def test_what_an_aborted_flight_wants_is_no_law():
    man = flying()
    man.ap[ctl.MODE] = ctl.ABORTED
    man.wanted = [math.nan] * 3
    man.step(5)
    assert man.supervisor.worst(22) == NOTHING


# --- row 17 ---------------------------------------------------------------------------------------------------------
def test_deeper_than_the_working_depth_aborts_and_at_risk_goes_out_of_band():
    man = flying(limits=Limits(working_depth_m=4.0, at_risk_depth_m=5.0))
    man.depth = 3.9
    man.sinks = 0.05
    while man.depth < 4.0:
        man.step()
    assert man.supervisor.reaction == NOTHING
    assert man.until(ABORT, 1.0) <= 1.0
    assert man.supervisor.row == 17
    man.depth, man.sinks = 5.0, 0.2
    man.G[at.JUMP + 6] = 1e6
    assert man.until(OOB, 0.2) <= 0.2
    assert man.supervisor.row == 17


def test_a_spike_of_depth_is_not_too_deep():
    man = flying(limits=Limits(working_depth_m=4.0))
    man.depth = 3.9
    man.sinks = 0.0
    man.seconds(1.0)
    for _ in range(5):
        man.depth = 4.05
        man.step(10)
        man.depth = 3.95
        man.step(10)
    assert man.supervisor.worst(17) == NOTHING


def test_without_a_working_depth_the_sites_counts():
    man = flying(site=6.0)
    man.depth = 6.05
    man.sinks = 0.0
    man.G[at.JUMP + 6] = 1e6
    assert man.until(ABORT, 1.0) <= 1.0
    man.depth = 6.65
    assert man.until(OOB, 0.2) <= 0.2


# --- row 18 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", [ctl.COMPLETED, ctl.ABORTED])
def test_no_ascent_goes_out_of_band_then_to_the_hardware(mode):
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = mode
    man.sinks = 0.0
    took = man.until(OOB, 30.0 + TWO_TICKS)
    assert took > 29.0
    assert man.supervisor.row == 18
    man.seconds(25.0)
    assert man.supervisor.reaction == OOB
    man.until(HW, 10.0)
    assert man.supervisor.row == 18
    assert man.seconds(5.0) == HW


def test_an_ascent_however_slow_is_one():
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = ctl.ABORTED
    man.seconds(5.0)  # sinks on for a while
    man.sinks = -0.02
    man.seconds(200.0)
    assert man.supervisor.worst(18) == NOTHING


def test_at_the_surface_nothing_has_to_ascend():
    man = flying(dt=COARSE)
    man.depth, man.sinks, man.ap[ctl.MODE] = 0.3, 0.0, ctl.COMPLETED
    man.G[at.JUMP + 6] = 1e6
    man.seconds(100.0)
    assert man.supervisor.worst(18) == NOTHING


def test_an_ascent_that_stops_halfway_is_noticed():
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = ctl.ABORTED
    rising(man)
    man.G[at.JUMP + 1] = 10.0
    man.seconds(5.0)
    man.sinks = 0.0
    assert man.until(OOB, 30.0 + 1.5) > 28.0


def test_blind_the_out_of_band_process_is_called_but_the_weight_stays_for_long():
    man = flying(dt=COARSE)
    man.silence.add("beacon")
    man.until(ABORT, 1.0)
    assert man.until(OOB, 31.0) > 29.0
    man.seconds(250.0)
    assert man.supervisor.reaction == OOB
    man.until(HW, 60.0)


# --- row 19 ---------------------------------------------------------------------------------------------------------
def test_the_same_depth_for_too_long_aborts():
    man = flying(dt=COARSE)
    man.sinks = 0.0
    assert man.until(ABORT, 121.0) > 115.0
    assert man.supervisor.row == 19


def test_holding_a_depth_that_was_reached_is_meant():
    man = flying(dt=COARSE)
    man.sinks = 0.0
    man.ap[ctl.REACHED] = man.t
    man.seconds(200.0)
    assert man.supervisor.reaction == NOTHING


@pytest.mark.parametrize("sinks", [0.01, -0.01])
def test_a_slow_glide_is_not_the_same_depth(sinks):
    man = flying(dt=COARSE)
    man.pitch, man.sinks = 0.0, sinks
    man.seconds(250.0)
    assert man.supervisor.worst(19) == NOTHING


@pytest.mark.parametrize(("mode", "reaction"), [
    (ctl.FLYING, ABORT), (ctl.ABORTED, ABORT), (ctl.COMPLETED, NOTHING), (ctl.WAITING, NOTHING),
])  # fmt: skip
def test_overtime(mode, reaction):
    man = flying()
    man.G[at.MISSION_TIME] = 5.0
    man.ap[ctl.MISSION_START] = man.t - 4.0
    man.ap[ctl.MODE] = mode
    assert man.seconds(0.9) == NOTHING
    man.seconds(0.2)
    assert man.supervisor.reaction == reaction
    assert man.supervisor.row == (19 if reaction else 0)


# --- rows 20 and 23 -------------------------------------------------------------------------------------------------
def test_one_wet_sample_warns_for_good_and_three_abort():
    man = flying(dt=COARSE, fitted=("leak",))
    man.say["leak"] = (1.0,)
    man.step(man.slow)
    assert man.supervisor.reaction == WARN
    assert man.supervisor.row == 20
    man.say.clear()
    assert man.seconds(20.0) == WARN
    man.say["leak"] = (1.0,)
    man.step(man.slow)
    assert man.supervisor.reaction == WARN
    assert man.step(man.slow) == ABORT
    assert man.supervisor.row == 20


def test_a_leak_aborts_within_a_second():
    man = flying(fitted=("leak",))
    man.say["leak"] = (1.0,)
    assert man.until(ABORT, 1.0) <= 1.0


def test_under_voltage_warns_then_aborts():
    man = flying(dt=COARSE, fitted=("battery",), limits=Limits(low_voltage=12.0, least_voltage=11.0))
    man.say["battery"] = (11.5,)
    assert man.until(WARN, 10.0) > 8.0
    assert man.supervisor.row == 23
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
    assert man.supervisor.worst(23) == NOTHING


# --- row 21 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("what", ["pitch", "roll"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_too_steep_or_rolling_over_flies_the_pid_then_aborts(what, side):
    man = flying()
    man.G[at.JUMP : at.JUMP + 3] = 10.0
    setattr(man, what, side * (1.1 if what == "pitch" else 1.4))
    if side * man.pitch > 0:
        man.sinks = 0.0
    assert man.step() == WARN
    assert man.supervisor.row == 21
    assert man.ap[ctl.CAUTIOUS] == 1.0
    assert man.until(ABORT, 2.0) > 1.5
    assert man.supervisor.row == 21


def test_a_leg_that_is_meant_to_be_steep_may_be():
    man = flying()
    man.G[at.JUMP + 1] = 10.0
    man.ap[ctl.REF_PITCH] = -1.2
    man.pitch = -1.3
    assert man.seconds(5.0) == NOTHING
    man.pitch = -1.56
    assert man.step() == WARN


def test_a_vehicle_that_comes_upright_again_flies_on():
    man = flying()
    man.G[at.JUMP + 1] = 10.0
    man.pitch = -1.1
    man.seconds(1.5)
    man.pitch = -0.3
    assert man.step() == NOTHING
    man.pitch = -1.1
    man.seconds(1.5)
    assert man.supervisor.reaction == WARN


def test_an_ascent_may_be_as_steep_as_it_comes():
    man = flying(mode=ctl.COMPLETED)
    man.G[at.JUMP + 1] = 10.0
    rising(man)
    man.pitch = 1.5
    man.seconds(5.0)
    assert man.supervisor.worst(21) == NOTHING


# --- row 24 ---------------------------------------------------------------------------------------------------------
def late(man: Watchman, ticks: int = 1, by: float = 0.03) -> Reaction:
    man.G[at.LATENESS] = by
    man.step(ticks)
    man.G[at.LATENESS] = 0.0
    return man.supervisor.reaction


def test_one_overrun_is_logged_in_its_tick():
    man = flying()
    assert late(man, by=0.02) == NOTHING  # punctual to a period
    assert late(man, by=0.021) == LOG
    assert man.supervisor.row == 24
    assert man.step() == NOTHING


def test_ten_running_hold_then_abort():
    man = flying()
    assert late(man, 9) == LOG
    assert late(man, 1) == HOLD
    assert late(man, 49) == HOLD
    assert late(man, 2) == ABORT
    assert man.supervisor.row == 24


def test_ten_with_a_pause_hold_nothing():
    man = flying()
    assert late(man, 9) == LOG
    man.step()
    assert late(man, 9) == LOG


def test_more_than_one_percent_of_a_minute_holds():
    man = flying()
    man.seconds(51.0)  # a new minute begins
    for _ in range(30):
        assert late(man) == LOG
        assert man.step() == NOTHING
    assert late(man) == HOLD


def test_overruns_of_another_minute_are_forgotten():
    man = flying()
    man.sinks = 0.05
    man.seconds(49.0)
    for _ in range(20):
        late(man)
        man.step()
    man.seconds(1.0)
    for _ in range(20):
        assert late(man) == LOG
        man.step()
    assert man.supervisor.worst(24) == LOG


# --- rows 25, 27, 33 ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("place", "value", "row", "reaction"),
    [
        (at.RESTARTED, 1.0, 25, ABORT), (at.RECORDER, 1.0, 27, LOG), (at.RECORDER, 2.0, 27, WARN),
        (at.GROWTH, 1.0, 33, WARN), (at.GROWTH, 2.0, 33, ABORT),
    ],
)  # fmt: skip
def test_what_the_runtime_tells_is_heard_in_the_same_tick(place, value, row, reaction):
    man = flying()
    man.G[place] = value
    assert man.step() == reaction
    assert man.supervisor.row == row
    man.G[place] = 0.0
    assert man.step() == (ABORT if reaction == ABORT else NOTHING)
