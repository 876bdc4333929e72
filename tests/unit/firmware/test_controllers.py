"""Every registered controller: a number of its own, a row in docs/explanation/control.md, a mission on the nominal
vehicle."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.model.gains import Control
from glider.hal.strict import decode
from glider.tools.flight.compose import build_flight

CONTROL_PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "control.md"


def test_numbers_are_their_own():
    assert len({row.number for row in CONTROLLERS.values()}) == len(CONTROLLERS)


def test_each_is_documented_in_the_order_of_the_registry():
    page = CONTROL_PAGE.read_text().split("## Controllers")[1].split("## ")[0]
    assert re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE)[1:] == list(CONTROLLERS)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_file_may_name_it(name):
    assert decode(f'controller = "{name}"', Control, "mission").controller == name
    assert msgspec.structs.replace(Control(), controller=name).law_flown is not None


@pytest.mark.parametrize("name", CONTROLLERS)
def test_it_flies_a_sawtooth(name):
    flight = build_flight(mission="sawtooth", seed=2)
    world, pilot = flight.board.world, flight.autopilot
    pilot.C[ctl.CONTROLLER] = CONTROLLERS[name].number
    flown = set()
    for tick in range(20_000):
        world.advance(0.02 * tick)
        pilot.frame[...] = world.frame
        assert np.isfinite(pilot.tick(0.02 * tick)).all()
        world.cmd[...] = pilot.commands
        flown.add(float(pilot.ap[ctl.ACTIVE]))
        if pilot.finished:
            break
    assert pilot.mode == "completed"
    assert (flown - {ctl.PID} != set()) == (name != "pid")
