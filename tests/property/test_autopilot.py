"""The autopilot under any samples whatever: commands finite, within range and rate, always."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle import layout
from glider.firmware.guidance.mission import decode_mission
from glider.firmware.model.library import shipped
from glider.hal.ports import BEACON, FRAME_SIZE, IMU, PLUNGER_WIRE, SLIDER_WIRE
from glider.tools.data.sources import load_mission, load_vehicle
from tests.support.examples import examples

VEHICLE = load_vehicle("roughie")
PERIODS = {"imu": 0.02, "beacon": 0.04, "wires": 0.04}
DT = 0.02
LOW = VEHICLE.vector()[[layout.SERVO_MIN, layout.SLIDER_MIN, layout.BALLAST_MIN]]
HIGH = VEHICLE.vector()[[layout.SERVO_MAX, layout.SLIDER_MAX, layout.BALLAST_MAX]]
RATE = VEHICLE.vector()[[layout.SERVO_RATE, layout.SLIDER_RATE, layout.BALLAST_RATE]]


def autopilot(mission="sawtooth") -> Autopilot:
    _, source, the_mission = load_mission(mission)
    return Autopilot(VEHICLE, the_mission, configuration(VEHICLE, the_mission, dt=DT, periods=PERIODS), source)


def feed(pilot, t, depth=1.0, roll=0.0, pitch=0.0, slider=0.0, plunger=0.0):
    frame = pilot.frame
    for start, values in (
        (IMU, (roll, pitch, 0.0, 0.0, 0.0, 0.0)),
        (BEACON, (101325.0 + 998.2 * 9.80665 * depth, 20.0)),
        (SLIDER_WIRE, (slider,)),
        (PLUNGER_WIRE, (plunger,)),
    ):
        frame[start], frame[start + 1] = t, 1.0
        frame[start + 2 : start + 2 + len(values)] = values
    return pilot.tick(t).copy()


# what sensors could say, and what no sensor would: NaN, infinite, absurd
sample = st.one_of(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(width=64))


@pytest.mark.parametrize("controller", ["pid", "law", "hybrid", "law+"])
@examples(60)
@given(st.lists(st.lists(sample, min_size=FRAME_SIZE, max_size=FRAME_SIZE), min_size=3, max_size=12))
def test_absurd_samples_never_reach_an_actuator(controller, frames):
    pilot = autopilot()
    pilot.C[ctl.CONTROLLER] = CONTROLLERS[controller].number
    last = feed(pilot, 0.0)
    for number, frame in enumerate(frames, start=1):
        pilot.frame[:] = frame
        pilot.frame[[s + 1 for s in (IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE)]] = 1.0
        pilot.frame[[IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE]] = number * DT
        sent = pilot.tick(number * DT).copy()
        assert np.isfinite(sent).all()
        assert ((sent >= LOW) & (sent <= HIGH)).all()
        assert (np.abs(sent - last) <= RATE * DT * (1 + 1e-9)).all()
        last = sent


def test_nothing_is_commanded_before_the_first_samples():
    pilot = autopilot()
    for tick in range(100):
        assert (pilot.tick(tick * DT) == 0.0).all()
    assert pilot.mode == "waiting"


def test_an_old_or_repeated_sample_is_not_a_new_one():
    pilot = autopilot()
    feed(pilot, 0.0, pitch=0.1)
    pilot.frame[IMU + 3] = 0.5  # the same time: not a new sample
    pilot.tick(0.02)
    assert pilot.est[ctl.NEW_PITCH] == 0.1
    pilot.frame[IMU] = 0.04
    pilot.tick(0.04 + pilot.C[ctl.MAX_AGE_IMU] + 0.01)  # too old when it is seen
    assert pilot.est[ctl.NEW_PITCH] == 0.1


@pytest.mark.parametrize(("dead", "reason"), [(IMU, "no attitude"), (BEACON, "no depth")])
def test_a_dead_sensor_gives_the_dive_up(dead, reason):
    pilot = autopilot()
    for tick in range(200):
        t = tick * DT
        feed(pilot, t)
        if t > 1.0:
            pilot.frame[dead + 1] = 0.0
            pilot.est[ctl.EST_IMU_TIME if dead == IMU else ctl.EST_BEACON_TIME] = 1.0
        pilot.tick(t)
    assert pilot.mode == "aborted"
    assert pilot.reason == reason
    for tick in range(200, 1000):
        sent = pilot.tick(tick * DT)
    assert sent == pytest.approx([0.0, LOW[1], LOW[2]])  # servo centred, mass aft, ballast out


def test_a_leg_past_its_time_gives_the_dive_up_and_says_which():
    pilot = autopilot()
    tick = 0
    while not pilot.finished and tick < 20_000:
        feed(pilot, tick * DT, depth=1.0)  # never gets deeper
        tick += 1
    assert pilot.mode == "aborted"
    assert pilot.reason == "leg 1: not at 4 m within 120 s"


def test_deeper_than_the_site_gives_the_dive_up():
    pilot = autopilot()
    for tick in range(500):
        feed(pilot, tick * DT, depth=1.0 + 0.02 * tick)
    assert (pilot.mode, pilot.reason) == ("aborted", "deeper than the site")


def test_net_ballast_mass_follows_from_travel_and_density():
    """Paper 3.1: m_b = rho A_p dr_b, the density from pressure and temperature."""
    pilot = autopilot()
    feed(pilot, 0.0)
    feed(pilot, 0.02, depth=2.0, plunger=0.01)
    area = VEHICLE.actuators.ballast.plunger_area
    assert pilot.est[ctl.NEW_BALLAST] == pytest.approx(998.2 * area * 0.01, rel=1e-4)
    assert pilot.est[ctl.NEW_DEPTH] == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("name", shipped("guidance/missions"))
def test_shipped_missions_are_sound(name):
    mission = decode_mission(shipped("guidance/missions")[name], name)
    legs = mission.matrix(VEHICLE, name)
    assert mission.name == name
    assert legs.shape == (len(mission.leg), ctl.N_LEG)
