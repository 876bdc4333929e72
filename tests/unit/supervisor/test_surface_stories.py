"""When has a flight ended: shallow for the held time, every sample, and the ballast measured at its light end."""

import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.runtime import Ending
from tests.support.stories import COARSE, flying
from tests.support.watchman import KG_PER_M, Watchman

LIGHT, HELD_S, SURFACE_M = -0.2, 3.0, 0.4
NEARLY = LIGHT + 0.019  # kg; 5 % of the range is 0.02
WAY_S = 1.5 * (0.4 / 0.03 + 0.3)  # stall_factor times the ballast's whole way


def ending(man: Watchman) -> Ending:
    return Ending(int(man.G[sup.ENDING]))


def after_the_dive(mode=ctl.COMPLETED, depth=0.2, ballast=LIGHT, **more) -> Watchman:
    """The mission is over, the vehicle stays where it is."""
    man = flying(**more)
    man.follows, man.sinks = False, 0.0
    man.ap[ctl.MODE], man.depth, man.places[1] = mode, depth, ballast
    man.wanted = [0.0, 0.01, LIGHT]
    return man


def seconds_to(man: Watchman, wanted: Ending, most: float) -> float:
    """Seconds until the ending, which no other comes before."""
    begin = man.t
    while ending(man) != wanted:
        assert man.t - begin <= most, f"{wanted.name} not within {most} s, but {ending(man).name}"
        man.step()
        assert ending(man) in (Ending.UNDER_WAY, wanted)
    return man.t - begin


@pytest.mark.parametrize("mode", [ctl.COMPLETED, ctl.ABORTED])
@pytest.mark.parametrize("ballast", [LIGHT, NEARLY])
def test_afloat_and_light_for_the_held_time_it_has_ended(mode, ballast):
    man = after_the_dive(mode, SURFACE_M - 0.05, ballast)
    man.seconds(0.4)  # screening does not believe at once that it came up so fast
    man.depth = SURFACE_M + 0.02
    man.step(4)
    man.depth = SURFACE_M - 0.05
    assert seconds_to(man, Ending.SURFACED, 4.0) == pytest.approx(HELD_S, abs=0.1)
    man.seconds(1.0)
    assert ending(man) == Ending.SURFACED


@pytest.mark.parametrize("mode", [ctl.WAITING, ctl.FLYING])
def test_a_mission_under_way_has_not_ended_wherever_it_is(mode):
    man = after_the_dive(mode, ballast=0.05)
    man.follows = True
    man.seconds(15.0)
    assert man.places[1] == pytest.approx(LIGHT, abs=0.01)
    assert ending(man) == Ending.UNDER_WAY


@pytest.mark.parametrize("ballast", [0.052, 0.0, -0.1, LIGHT + 0.021])
def test_a_ballast_not_at_its_light_end_has_not_ended(ballast):
    man = after_the_dive(ballast=ballast)
    man.seconds(10.0)
    assert ending(man) == Ending.UNDER_WAY


def test_one_deep_sample_begins_the_held_time_anew():
    man = after_the_dive()
    man.seconds(2.5)
    man.depth = SURFACE_M + 0.02
    man.step(2)
    man.depth = 0.2
    man.seconds(2.5)
    assert ending(man) == Ending.UNDER_WAY
    assert seconds_to(man, Ending.SURFACED, 1.0) > 0.2


def test_the_depth_measured_counts_and_not_the_estimate():
    man = after_the_dive(depth=2.0)
    man.est[ctl.EST_DEPTH] = 0.0
    man.seconds(5.0)
    assert ending(man) == Ending.UNDER_WAY
    man.depth, man.est[ctl.EST_DEPTH] = 0.1, 5.0
    seconds_to(man, Ending.SURFACED, 4.0)


def test_a_beacon_that_is_slow_is_enough_one_that_is_silent_is_not():
    man = after_the_dive(dt=COARSE)
    man.silence.add("beacon")
    for _ in range(4):
        man.seconds(1.5)
        man.silence.discard("beacon")
        man.step(2)
        man.silence.add("beacon")
    assert ending(man) == Ending.SURFACED
    man.seconds(HELD_S + 0.3)
    assert ending(man) == Ending.UNDER_WAY


@pytest.mark.parametrize("depth", [0.2, 2.0])
def test_a_pump_without_progress_is_given_up_at_the_surface_alone(depth):
    man = after_the_dive(depth=depth, ballast=0.05, dt=COARSE, no_ascent_s=3000.0, same_depth_s=3000.0)
    if depth > SURFACE_M:
        man.seconds(3 * WAY_S)
        assert ending(man) == Ending.UNDER_WAY
    else:
        assert seconds_to(man, Ending.PUMP_GIVEN_UP, 25.0) == pytest.approx(WAY_S, abs=0.5)


def test_a_pump_that_gets_on_is_not_given_up():
    man = after_the_dive(ballast=0.05, dt=COARSE)
    for _ in range(230):  # slow: 1 g a second
        man.seconds(1.0)
        man.places[1] -= 0.001
        assert ending(man) == Ending.UNDER_WAY
    man.places[1] = LIGHT
    man.seconds(1.0)
    assert ending(man) == Ending.SURFACED


def test_without_its_draw_wire_the_ballast_is_nowhere_and_the_pump_given_up():
    man = after_the_dive(ctl.FLYING, ballast=0.05, dt=COARSE)
    man.follows = True
    man.seconds(15.0)
    assert man.places[1] == pytest.approx(LIGHT, abs=0.01)  # light, as it was measured last
    man.ap[ctl.MODE] = ctl.COMPLETED
    man.silence.add("plunger_wire")
    man.seconds(4.0)
    assert ending(man) == Ending.UNDER_WAY
    assert seconds_to(man, Ending.PUMP_GIVEN_UP, 30.0) > 10.0


def test_a_draw_wire_that_comes_back_shows_the_pump_getting_on():
    man = after_the_dive(ballast=0.05, dt=COARSE)
    man.ap[ctl.MODE] = ctl.FLYING
    man.silence.add("plunger_wire")
    man.seconds(2.0)
    man.ap[ctl.MODE] = ctl.COMPLETED
    man.seconds(5.0)
    man.silence.discard("plunger_wire")
    for _ in range(100):
        man.seconds(1.0)
        man.places[1] -= 0.002
        assert ending(man) == Ending.UNDER_WAY


def test_when_every_reaction_was_asked_for_it_ends_under_water_too():
    man = after_the_dive(depth=3.0, ballast=0.1, dt=COARSE, no_ascent_s=5.0, same_depth_s=3000.0)
    assert seconds_to(man, Ending.NO_WAY_LEFT, 60.0) == pytest.approx(10.0, abs=1.5)
    man.depth, man.places[1] = 0.1, LIGHT  # it comes up after all
    man.seconds(4.0)
    assert ending(man) == Ending.SURFACED


def test_the_wire_is_read_as_mass_by_density_and_area():
    man = after_the_dive()
    man.say["plunger_wire"] = (LIGHT / KG_PER_M,)
    man.est[ctl.EST_DENSITY] = 0.5 * 998.2  # half the mass
    man.seconds(5.0)
    assert ending(man) == Ending.UNDER_WAY
