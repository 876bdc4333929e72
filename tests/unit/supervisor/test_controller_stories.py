"""What the controller asks for, how late, and what the filter hands to it (rows 15, 22, 24, 35).

Each row as a story: all is well, something breaks, it is noticed in time, and what follows.
"""

import math

import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import Reaction
from tests.support.stories import ABORT, HOLD, LOG, NOTHING, WARN, flying
from tests.support.watchman import Watchman


# --- rows 15 and 22: what the controller asks for --------------------------------------------------------------------
@pytest.mark.parametrize("i", [0, 1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_past_a_limit_is_clamped_and_logged_in_the_same_tick(i, side):
    man = flying()
    high = (math.pi / 3, 0.06, 0.2)[i]
    man.wanted[i] = side * 1.5 * high
    assert man.step() == LOG
    assert man.supervisor.row == sup.FAULT_SOFT_LIMIT
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
    assert man.supervisor.row == sup.FAULT_NO_ANSWER


def test_two_without_an_answer_are_forgiven():
    man = flying()
    for _ in range(10):
        good, man.wanted = man.wanted, [math.nan] * 3
        man.step(2)
        man.wanted = good
        man.step()
    assert man.supervisor.worst(sup.FAULT_NO_ANSWER) == WARN
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
        assert man.G[sup.LAW_FAILED] == count
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
        assert man.G[sup.LAW_FAILED] == 0.0
    assert man.seconds(5.1) == NOTHING
    man.ap[ctl.LAW_STATUS] = 1.0
    man.pilot.C[ctl.CONTROLLER] = ctl.PID  # the status is an old one
    assert man.step() == NOTHING


def test_what_an_aborted_flight_wants_is_no_law():
    man = flying()
    man.ap[ctl.MODE] = ctl.ABORTED
    man.wanted = [math.nan] * 3
    man.step(5)
    assert man.supervisor.worst(sup.FAULT_NO_ANSWER) == NOTHING


# --- row 24 ---------------------------------------------------------------------------------------------------------
def late(man: Watchman, ticks: int = 1, by: float = 0.03) -> Reaction:
    man.G[sup.LATENESS] = by
    man.step(ticks)
    man.G[sup.LATENESS] = 0.0
    return man.supervisor.reaction


def test_one_overrun_is_logged_in_its_tick():
    man = flying()
    assert late(man, by=0.02) == NOTHING  # punctual to a period
    assert late(man, by=0.021) == LOG
    assert man.supervisor.row == sup.FAULT_OVERRUN
    assert man.step() == NOTHING


def test_ten_running_hold_then_abort():
    man = flying()
    assert late(man, 9) == LOG
    assert late(man, 1) == HOLD
    assert late(man, 49) == HOLD
    assert late(man, 2) == ABORT
    assert man.supervisor.row == sup.FAULT_OVERRUN


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
    assert man.supervisor.worst(sup.FAULT_OVERRUN) == LOG


# --- row 35 ---------------------------------------------------------------------------------------------------------
def test_a_restart_of_the_filter_warns_for_a_tick_and_the_third_aborts():
    man = flying()
    for count in (1.0, 2.0):
        man.ap[ctl.FILTER_RESTARTS] = count
        assert man.step() == WARN
        assert man.supervisor.row == sup.FAULT_ESTIMATE
        assert man.step() == NOTHING
        assert man.seconds(5.0) == NOTHING
    man.ap[ctl.FILTER_RESTARTS] = 3.0
    assert man.step() == ABORT
    assert man.supervisor.row == sup.FAULT_ESTIMATE
    assert man.pilot.reason.startswith("fault 35: ")


def test_more_restarts_are_borne_where_the_vehicle_file_says_so():
    man = flying(filter_restarts=5)
    for count in range(1, 5):
        man.ap[ctl.FILTER_RESTARTS] = float(count)
        assert man.step() == WARN
    man.ap[ctl.FILTER_RESTARTS] = 5.0
    assert man.step() == ABORT
