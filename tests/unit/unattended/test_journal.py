"""No flight is resumed: what each start does by what the one before left, step by step and killed at each."""

import itertools

import pytest

from glider.firmware.runtime import Ending
from glider.hal.ports import BoardError
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.flight.compose import build_flight
from glider.tools.flight.sortie import FlightHost


@pytest.fixture(scope="module")
def flight():
    return build_flight(mission="sawtooth")


def start(flight, folder, steps, *, ending=Ending.SURFACED, mode=2.0, reaction=0.0, error=None):
    """One start that gets through so many steps and is then killed (or left by `error`); whether it would fly the
    mission. mode: 2 completed, 3 given up."""
    from glider.firmware.core.layouts import control_layout as ctl
    from glider.firmware.core.layouts import supervisor_layout as sup

    host = FlightHost(flight, name="test", folder=folder)
    flight.autopilot.ap[ctl.MODE], flight.supervisor.G[sup.HIGHEST] = mode, reaction
    flight.autopilot.ap[ctl.REASON] = ctl.REASON_NONE if mode == 2.0 else ctl.REASON_LEG_TIME
    todo = (host.prepare, lambda: host.begin(None), lambda: host.closing(ending), host.end)
    try:
        for step in todo[:steps]:
            step()
    except BoardError:
        return False
    if error is not None:
        host.__exit__(error, error(), None)
    return not host.ascent_only and host.journal.before.state.may_arm


def left(folder):
    return StateFile(folder).read().state


def test_an_undisturbed_flight_may_be_followed_by_another(flight, tmp_path):
    assert start(flight, tmp_path, 4)
    assert left(tmp_path) == SortieState.ENDED
    assert start(flight, tmp_path, 4)
    assert left(tmp_path) == SortieState.ENDED


@pytest.mark.parametrize("killed", list(itertools.product(range(5), repeat=3)))
def test_whatever_is_killed_in_whatever_order_nothing_is_resumed(flight, tmp_path, killed):
    under_way = False
    for steps in (*killed, 4, 4):
        flown = start(flight, tmp_path, steps)
        assert not (flown and under_way)
        # once under way: brought up, or held, until a person has looked
        under_way = under_way or not flown or steps in (1, 2, 3)


@pytest.mark.parametrize(
    ("how", "state"),
    [
        ({}, SortieState.ENDED),
        ({"mode": 3.0}, SortieState.HELD),
        ({"reaction": 4.0}, SortieState.HELD),  # a fault on the way up from a mission completed
        ({"ending": Ending.PUMP_GIVEN_UP}, SortieState.ABORTED),
        ({"ending": Ending.NO_WAY_LEFT}, SortieState.ABORTED),
        ({"ending": Ending.HANDED_OVER, "mode": 3.0}, SortieState.ABORTED),
    ],
)
def test_how_it_ended_decides_about_the_next(flight, tmp_path, how, state):
    start(flight, tmp_path, 4, **how)
    assert left(tmp_path) == state
    found = StateFile(tmp_path).read()
    if how.get("mode"):
        assert "leg 1: not at" in found.describe()
        assert "(test)" in found.describe()


def test_a_vehicle_brought_up_is_held_whatever_the_mission_said(flight, tmp_path):
    start(flight, tmp_path, 2)
    assert not start(flight, tmp_path, 4)
    assert left(tmp_path) == SortieState.HELD
    assert not start(flight, tmp_path, 4)
    assert left(tmp_path) == SortieState.HELD


@pytest.mark.parametrize("error", [KeyboardInterrupt, BoardError, ValueError])
@pytest.mark.parametrize(("steps", "state"), [(1, SortieState.ASHORE), (2, SortieState.DIVING)])
def test_who_breaks_off_leaves_nothing_behind_before_the_first_tick_alone(flight, tmp_path, error, steps, state):
    start(flight, tmp_path, steps, error=error)
    assert left(tmp_path) == state


@pytest.mark.parametrize("state", [SortieState.HELD, SortieState.DIVING, SortieState.ABORTED, SortieState.UNKNOWN])
def test_ctrl_c_in_an_ascent_leaves_what_a_person_must_look_after(flight, tmp_path, state):
    """Stopped in the ascent of an aborted dive: the next start must not take the vehicle for well."""
    StateFile(tmp_path).write(state, flight="before", reason="leak")
    start(flight, tmp_path, 2, error=KeyboardInterrupt)
    assert not left(tmp_path).may_arm
