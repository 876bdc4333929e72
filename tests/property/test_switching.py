"""The hybrid: it switches where it should, keeps its choice, and no switch makes a step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.control import law
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle import layout
from glider.firmware.model.gains import Control, HybridTable
from glider.hal.strict import ConfigError, decode
from glider.tools.flight.compose import build_flight
from tests.support.examples import examples

RATES = {"servo": layout.SERVO_RATE, "slider": layout.SLIDER_RATE, "ballast": layout.BALLAST_RATE}


def flown(controller, noise, seed=1, mission="sawtooth", seconds=200.0):
    """Every tick of a flight: time, controller at work, commands, status of the law."""
    flight = build_flight(mission=mission, seed=seed)
    world, pilot = flight.board.world, flight.autopilot
    pilot.C[ctl.CONTROLLER] = controller
    world.E[6] = world.E[7] = noise
    rows = []
    for tick in range(int(seconds / 0.02)):
        world.advance(0.02 * tick)
        pilot.frame[...] = world.frame
        pilot.tick(0.02 * tick)
        world.cmd[...] = pilot.commands
        rows.append((0.02 * tick, pilot.ap[ctl.ACTIVE], *pilot.commands, pilot.ap[ctl.LAW_STATUS]))
        if pilot.finished:
            break
    return pilot, np.array(rows)


def test_transitions_are_the_laws_and_steady_flight_the_pids():
    pilot, rows = flown(ctl.HYBRID, 0.003)
    assert pilot.mode == "completed"
    share = rows[:, 1].mean()
    assert 0.1 < share < 0.95  # both are at work
    assert rows[100:150, 1].mean() == 1.0  # two seconds into the first leg: a transition


def test_rough_water_is_the_laws():
    _, calm = flown(ctl.HYBRID, 0.003)
    _, noise_scale = flown(ctl.HYBRID, 0.1)
    assert noise_scale[:, 1].mean() > calm[:, 1].mean()
    assert noise_scale[500:, 1].mean() > 0.9


@pytest.mark.parametrize("noise", [0.003, 0.03, 0.1])
def test_a_choice_stands_for_its_dwell_time(noise):
    pilot, rows = flown(ctl.HYBRID, noise)
    switches = rows[1:, 0][np.diff(rows[:, 1]) != 0.0]
    assert (np.diff(switches) >= pilot.C[ctl.HYBRID_DWELL] - 0.02).all()


@pytest.mark.parametrize("noise", [0.003, 0.1])
def test_no_switch_makes_a_step_larger_than_the_actuators_rate(noise):
    pilot, rows = flown(ctl.HYBRID, noise)
    switched = np.flatnonzero(np.diff(rows[:, 1]) != 0.0)
    assert switched.size
    limit = pilot.P[list(RATES.values())] * 0.02
    steps = np.abs(np.diff(rows[:, 2:5], axis=0))
    assert (steps <= limit * (1 + 1e-9)).all()


def test_a_switch_is_bumpless_where_the_water_is_calm():
    """At a switch, the slider moves no more than it does within a second around it without one."""
    _, rows = flown(ctl.HYBRID, 0.0)
    slider = rows[:, 3]
    for i in np.flatnonzero(np.diff(rows[:, 1]) != 0.0):
        around = np.abs(np.diff(slider[max(i - 50, 0) : i])).max(initial=0.0)
        assert abs(slider[i + 1] - slider[i]) <= around + 1e-4


switches = st.lists(st.integers(1, 400), min_size=1, max_size=8)  # ticks from one to the next


@examples(25)
@given(switches, st.sampled_from([ctl.LAW, ctl.LAW_PLUS]), st.floats(0.0, 0.1), st.integers(0, 1000))
def test_a_switch_at_any_moment_sends_on_what_was_sent(gaps, law_kind, noise, seed):
    """Whatever the water and the moment, either way: the first command of the other controller is the last of the one.

    Where integrator or bump would have to be larger than the actuator's range, it is within rate and range only.
    """
    flight = build_flight(mission="sawtooth", seed=seed)
    world, pilot = flight.board.world, flight.autopilot
    world.E[6] = world.E[7] = noise
    limit = pilot.P[list(RATES.values())] * 0.02
    moments, kinds = set(np.cumsum(gaps)), (ctl.PID, law_kind)
    seen = 0
    for tick in range(int(np.sum(gaps)) + 5):
        if tick in moments:
            pilot.C[ctl.CONTROLLER] = kinds[seen % 2 == 0]
            seen += 1
        before = pilot.commands.copy()
        world.advance(0.02 * tick)
        pilot.frame[...] = world.frame
        sent = pilot.tick(0.02 * tick)
        world.cmd[...] = sent
        assert (np.abs(sent - before) <= limit * (1 + 1e-9)).all()
        if tick in moments and pilot.mode == "flying":
            most = 0.98 * pilot.P[[layout.SLIDER_MAX, layout.BALLAST_MAX]]
            left = pilot.ap[[ctl.BUMP_SLIDER, ctl.BUMP_BALLAST]]
            whole = (np.abs(pilot.ap[[ctl.INT_PITCH, ctl.INT_DEPTH]]) < most) & (np.abs(left) < most)
            step = np.abs(sent - before)[1:]
            assert (step[whole] <= 0.02 * limit[1:][whole]).all()
    assert seen == len(moments)


@pytest.mark.parametrize("controller", [ctl.LAW, ctl.LAW_PLUS])
def test_the_law_flies_the_mission_alone(controller):
    pilot, rows = flown(controller, 0.003)
    assert pilot.mode == "completed"
    assert (rows[1:, 1] == ctl.LAW).all()
    assert (rows[:, 5] == law.OK).all()


def test_where_the_law_has_no_answer_the_pid_takes_over():
    """A body rate that is no number gives NOT_FINITE, and the commands stay finite and within range."""
    flight = build_flight(mission="sawtooth")
    world, pilot = flight.board.world, flight.autopilot
    pilot.C[ctl.CONTROLLER], pilot.C[ctl.ESTIMATOR] = ctl.LAW, ctl.GIVEN
    seen = set()
    for tick in range(300):
        world.advance(0.02 * tick)
        pilot.frame[...] = world.frame
        given = pilot.nav[ctl.NAV_GIVEN : ctl.NAV_GIVEN + layout.N_X]
        given[...] = world.x[: layout.N_X]
        if 100 <= tick < 150:
            given[layout.X_NU] = np.nan
        sent = pilot.tick(0.02 * tick)
        assert np.isfinite(sent).all()
        world.cmd[...] = sent
        seen.add(int(pilot.ap[ctl.LAW_STATUS]))
    assert law.NOT_FINITE in seen
    assert pilot.ap[ctl.LAW_STATUS] == law.OK


def test_thresholds_without_hysteresis_are_refused():
    with pytest.raises(ConfigError, match=r"pitch_off: .*pitch_on"):
        decode("pitch_on = 0.1\npitch_off = 0.1\n", HybridTable, "m.toml")


def test_the_law_without_body_velocities_is_refused():
    with pytest.raises(ConfigError, match="body velocities"):
        decode('controller = "law"\nestimator = "measured"\n', Control, "m.toml")
