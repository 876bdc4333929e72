"""No flight is resumed: what each start does by what the one before left, step by step and killed at each."""

import itertools

import pytest

from hal.state_file import Phase, StateFile
from tools.flight.keeper import Life, told

STEPS = ("armed", "diving", "ended")
END = {"surfaced": True, "orderly": True, "reason": ""}


def start(folder, steps, **end):
    """One start that gets through so many steps and is then killed; whether it would fly the mission."""
    life = Life(folder, "test")
    mission = life.before.may_start
    if life.before.phase != Phase.HELD:
        for step in STEPS[:steps]:
            getattr(life, step)(**({**END, **end} if step == "ended" else {}))
    return mission


def test_an_undisturbed_flight_may_be_followed_by_another(tmp_path):
    assert start(tmp_path, 3)
    assert start(tmp_path, 3)
    assert StateFile(tmp_path).read().phase == Phase.ASHORE


@pytest.mark.parametrize("killed", list(itertools.product(range(4), repeat=3)))
def test_whatever_is_killed_in_whatever_order_nothing_is_resumed(tmp_path, killed):
    under_way = False
    for steps in (*killed, 3, 3):
        flown = start(tmp_path, steps)
        assert not (flown and under_way)
        if not flown:
            under_way = True  # brought up, or held: until a person has looked
        elif steps in (1, 2):
            under_way = True


@pytest.mark.parametrize(
    ("end", "phase"),
    [
        ({"surfaced": True, "orderly": True}, Phase.ASHORE),
        ({"surfaced": True, "orderly": False}, Phase.HELD),
        ({"surfaced": False, "orderly": True}, Phase.ABORTED),
        ({"surfaced": False, "orderly": False}, Phase.ABORTED),
    ],
)
def test_how_it_ended_decides_about_the_next(tmp_path, end, phase):
    start(tmp_path, 3, reason="leg over its time limit", **end)
    found = Life(tmp_path, "next")
    assert found.before.phase == phase
    assert bool(found.reason) == (phase != Phase.ASHORE)
    if found.reason:
        assert "leg over its time limit" in told(found.before)
        assert "(test)" in told(found.before)


def test_a_vehicle_brought_up_is_held_whatever_the_mission_said(tmp_path):
    start(tmp_path, 2)
    assert not start(tmp_path, 3)
    assert StateFile(tmp_path).read().phase == Phase.HELD
    assert not start(tmp_path, 3)
    assert StateFile(tmp_path).read().phase == Phase.HELD
