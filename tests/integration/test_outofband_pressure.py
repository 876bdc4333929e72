"""The way up seen by pressure, on twins on virtual serial ports: a vehicle under water, and nobody who flies it."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import msgspec
import pytest

from glider.hal.board import BoardRequest, board_builder
from glider.hal.heartbeat import Heartbeat
from glider.hal.outofband.plan import NAME, write_plan
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.ascent_plan import make_plan
from glider.tools.flight.status import snapshot
from tests.support.twinned import twins, until

pytestmark = pytest.mark.realtime(seconds=60)
PATIENCE_S = 4.0


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    with twins(tmp_path_factory.mktemp("pressure"), "--stand") as found:
        yield found


@contextlib.contextmanager
def brought_up(sea, folder):
    """The out-of-band process as a service at boot: the state says that a vehicle was under way. It has 4 s to rise."""
    text = sea.board.read_text()
    vehicle = load_vehicle("roughie")
    board = board_builder("devices")(
        BoardRequest(text=text, source=str(sea.board), vehicle=vehicle, water_density=1000.0)
    )
    settings = msgspec.structs.replace(vehicle.supervisor, no_ascent_s=PATIENCE_S)
    (folder / "watchdog").touch()
    plan = make_plan(board, flight="dive", settings=settings, water_density=1000.0, watchdog=str(folder / "watchdog"))
    write_plan(folder / NAME, plan)
    StateFile(folder).write(SortieState.DIVING, flight="dive")
    Heartbeat.create(folder, 0.02, "dive").close()  # the flight that is gone
    command = [sys.executable, "-m", "glider.hal.outofband", "--service", "--run", str(folder), "--state", str(folder)]
    with (folder / "said").open("w") as file, subprocess.Popen(command, stderr=file) as process:
        try:
            yield lambda: (folder / "said").read_text()
        finally:
            process.send_signal(signal.SIGTERM)


def fed(folder):
    """Whether the hardware watchdog is fed within the next 1.5 s (it is fed twice a second)."""
    os.truncate(folder / "watchdog", 0)
    with contextlib.suppress(AssertionError):
        until(lambda: (folder / "watchdog").stat().st_size > 0, 1.5)
    return (folder / "watchdog").stat().st_size > 0


def under_water(sea, depth):
    """Held on a stand at a depth: it rises when the stand is lifted."""
    assert sea.control(f"pose 0 0 0 {depth}") == "ok"


def test_it_sees_itself_arrive_at_the_surface(sea, tmp_path):
    under_water(sea, 3.0)
    with brought_up(sea, tmp_path) as said:
        until(lambda: "under water" in said(), 20.0)
        for depth in (2.0, 1.0, 0.1):
            under_water(sea, depth)
            time.sleep(1.0)
        until(lambda: "pump at its end, slider at its end, servo centred, at the surface" in said(), 30.0)
        assert fed(tmp_path)
    assert "row 18" not in said()


def test_one_that_does_not_rise_is_pumped_again_and_then_left_to_the_hardware(sea, tmp_path):
    sea.control("fault ballast stuck")  # jammed
    under_water(sea, 5.0)
    try:
        with brought_up(sea, tmp_path) as said:
            until(lambda: "at 5 m (row 18): " in said(), 30.0)
            assert fed(tmp_path)
            until(lambda: "no more feeding of the hardware watchdog" in said(), 20.0)
            assert not fed(tmp_path)
            found = StateFile(tmp_path).read()
            assert found.state.must_ascend
            until(lambda: StateFile(tmp_path).read().reason == "fault 18: no ascent out of band", 5.0)
            # What is shown to whoever looks on.
            assert ", 5.0 m deep" in snapshot(tmp_path)["problems"][0]
    finally:
        sea.control("fault ballast none")


def test_a_transmitter_that_always_says_the_same_is_none(sea, tmp_path):
    """Then nothing is concluded, and the pump is sent to its end all the same."""
    under_water(sea, 5.0)
    sea.control("fault beacon stuck")
    try:
        with brought_up(sea, tmp_path) as said:
            until(lambda: "no depth" in said(), 40.0)
            assert fed(tmp_path)
    finally:
        sea.control("fault beacon none")
