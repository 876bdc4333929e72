"""Guidance flown: turns go the way they are told to, diving and climbing; headings are held; the circle is a circle."""

import math

import numpy as np
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.guidance.mission import decode_mission
from glider.sim_backend.core.closed_loop import N_END, N_TRACE, fly
from glider.tools.flight.compose import build_flight

HEAD = 'format = 1\nname = "m"\ntime_limit_s = 600.0\n[site]\nname = "deep"\ndepth_m = 60.0\n'
ENTRY = "[[leg]]\nduration_s = 25.0\npitch_deg = {pitch}\nballast_kg = {ballast}\n"


def end_state(tmp_path, legs, seed=0):
    path = tmp_path / "m.toml"
    path.write_text(HEAD + legs)
    flight = build_flight(mission=str(path), seed=seed)
    world, pilot = flight.board.world, flight.autopilot
    world.x[2] = 30.0
    trace, end = np.zeros((1, N_TRACE)), np.zeros(N_END)
    fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
        world.errors, world.seed, world.x, world.dt, 30_000, 30_000, trace, end,
    )  # fmt: skip
    assert end[0] == ctl.COMPLETED
    x = world.x
    yaw = math.atan2(2 * (x[3] * x[6] + x[4] * x[5]), 1 - 2 * (x[5] ** 2 + x[6] ** 2))
    return x, yaw


@pytest.mark.parametrize("side", ["starboard", "port"])
@pytest.mark.parametrize(("pitch", "ballast"), [(-25.0, 0.15), (25.0, -0.15)], ids=["dive", "climb"])
def test_a_turn_goes_the_way_it_is_told_to(side, pitch, ballast, tmp_path):
    legs = ENTRY.format(pitch=pitch, ballast=ballast) + (
        f'[[leg]]\nturned_deg = 60.0\nturn = "{side}"\nroll_deg = 40.0\npitch_deg = {pitch}\nballast_kg = {ballast}\n'
        "time_limit_s = 60.0\n"
    )
    _, yaw = end_state(tmp_path, legs)
    assert math.degrees(yaw) == pytest.approx(60.0 if side == "starboard" else -60.0, abs=4.0)


@pytest.mark.parametrize(("pitch", "ballast"), [(-25.0, 0.15), (25.0, -0.15)], ids=["dive", "climb"])
@pytest.mark.parametrize("heading", [40.0, -120.0])
def test_a_heading_is_reached_and_held(pitch, ballast, heading, tmp_path):
    legs = (
        f"[[leg]]\nduration_s = 90.0\nheading_deg = {heading}\nroll_deg = 40.0\npitch_deg = {pitch}\n"
        f"ballast_kg = {ballast}\n"
    )
    _, yaw = end_state(tmp_path, legs)
    assert math.degrees(yaw) == pytest.approx(heading, abs=5.0)


@pytest.mark.parametrize(
    ("leg", "said"),
    [
        ('turned_deg = 90.0\nturn = "port"\nroll_deg = 40.0\n', "time_limit_s"),
        ('duration_s = 9.0\nturn = "port"\n', "roll_deg"),
        ('duration_s = 9.0\nturn = "left"\nroll_deg = 9.0\n', "turn"),
        ("duration_s = 9.0\nturned_deg = 90.0\nroll_deg = 9.0\n", "duration_s and turned_deg"),
        ('duration_s = 9.0\nturn = "port"\nheading_deg = 3.0\nroll_deg = 9.0\n', "not both"),
    ],
)
def test_turns_that_cannot_be_are_refused(leg, said):
    with pytest.raises(ValueError, match=said):
        decode_mission(HEAD + "[[leg]]\npitch_deg = -20.0\nballast_kg = 0.1\n" + leg, "m.toml")
