"""A flight's end on twins, judged by the plant five minutes later, with the board closed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from glider.hal.heartbeat import Heartbeat
from glider.hal.outofband.plan import read_plan
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.bench.boardtext import accepted, set_values
from tests.support.twinned import DIVE, end_guard, flying, guard_pid, twins, until

pytestmark = pytest.mark.realtime(seconds=150)
FLOATS_M = 0.5
WEATHER_PA = 4_500.0

SAWTOOTH_LEG = """
format = 1
name = "leg"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
depth_m = 4.0
pitch_deg = -20.0
time_limit_s = 60.0
"""
DIP = """
format = 1
name = "dip"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
duration_s = 4.0
pitch_deg = -10.0
ballast_kg = 0.1
"""


def adrift(sea):
    return json.loads(sea.control("adrift 300"))["z_m"]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "leg.toml").write_text(SAWTOOTH_LEG)
    (tmp_path / "dip.toml").write_text(DIP)
    (tmp_path / "dive.toml").write_text(DIVE)
    return tmp_path


def ticks(folder):
    return Heartbeat.open(folder / "state").look().ticks


@pytest.mark.parametrize("at", [60, 110, 250])
def test_given_up_in_the_first_seconds_a_heavy_vehicle_floats(folder, at):
    """The pump is on its way to heavy, the vehicle hardly sinks yet: given up, it must not end where it stands."""
    text = Path("sim_backend/boards/twin.toml").read_text() + "\n[effects.net_buoyancy]\nmass = 0.003\n"
    (folder / "heavy.toml").write_text(text)
    with (
        twins(folder / "t", "--board", str(folder / "heavy.toml")) as sea,
        flying(sea.board, folder / "leg.toml", folder) as flight,
    ):
        until(lambda: ticks(folder) > at or flight.poll() is not None, 120.0)
        flight.send_signal(signal.SIGINT)
        assert flight.wait(120.0) == 1
        result = json.loads((folder / "stdout").read_text())
        assert result["surfaced"]
        assert sea.state()["ballast_kg"] < -0.17
        assert adrift(sea) < FLOATS_M
        assert StateFile(folder / "state").read().state == SortieState.ENDED


def test_a_mission_that_completes_heavy_ends_light(folder):
    with twins(folder / "t") as sea, flying(sea.board, folder / "dip.toml", folder) as flight:
        assert flight.wait(120.0) == 0
        assert json.loads((folder / "stdout").read_text())["ended"] == {"by": "surfaced", "state": "ended"}
        assert adrift(sea) < FLOATS_M


def test_in_other_weather_surfaced_is_said_at_the_surface(folder):
    """Air 45 hPa below the filed: without the zero taken at arming every depth is 0.46 m too small."""
    with twins(folder / "t") as sea:
        text = set_values(sea.board.read_text(), {"beacon.surface_pa": 101_325.0 + WEATHER_PA})
        sea.board.write_text(accepted(text, "board.toml"))
        with flying(sea.board, folder / "dip.toml", folder) as flight:
            assert flight.wait(120.0) == 0
        assert sea.state()["z_m"] < 0.35
        assert adrift(sea) < FLOATS_M
        assert measured_surface(folder) == pytest.approx(101_325.0, abs=500.0)
        # A flight that broke off: the next only ascends, and knows the surface from it.
        StateFile(folder / "state").write(SortieState.DIVING, flight="before")
        with flying(sea.board, folder / "dip.toml", folder, "--log", str(folder / "second.mcap")) as flight:
            assert flight.wait(120.0) == 1
        assert json.loads((folder / "stdout").read_text())["surfaced"]
        assert measured_surface(folder) == pytest.approx(101_325.0, abs=500.0)


def measured_surface(folder):
    return read_plan(folder / "state" / "outofband.json").pressure.surface_pa


def test_a_wet_hull_and_a_flat_battery_do_not_arm(folder):
    vehicle = Path("firmware/model/vehicles/roughie.toml").read_text()
    assert "\n[limits]" in vehicle
    (folder / "low.toml").write_text(vehicle.replace("\n[limits]", "\n[limits]\nlow_voltage = 12.0\n#", 1))
    with twins(folder / "t") as sea:
        for wrong, mend, said in (
            ("leak 1", "leak 0", "leak: wet"),
            ("battery 10", "battery 15", "battery: 10.0 V, below the vehicle's low_voltage of 12 V"),
        ):
            sea.control(wrong)
            command = [
                sys.executable,
                "-m",
                "glider.tools.cli.main",
                "fly",
                "--board",
                str(sea.board),
                "--yes",
                "--no-log",
            ]
            command += ["--vehicle", str(folder / "low.toml"), "--state", str(folder / "state")]
            done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
            assert done.returncode == 1
            assert said in done.stderr
            assert "not armed: " in done.stderr
            assert StateFile(folder / "state").read().state == SortieState.ASHORE
            sea.control(mend)


SLOW_DISK = """
import os, sys, time
honest = os.fsync
def slow(fd):
    time.sleep(1.5)
    honest(fd)
os.fsync = slow
sys.argv[0] = "glider"
from glider.tools.cli.main import main
main()
"""


def test_a_slow_disk_at_the_end_is_waited_for(folder):
    """Two copies of the state, 1.5 s each, after the last beat: nobody takes the flight for lost."""
    with twins(folder / "t") as sea:
        command = [sys.executable, "-c", SLOW_DISK, "fly", "--board", str(sea.board), "--yes", "--no-log"]
        command += ["--mission", str(folder / "dip.toml"), "--state", str(folder / "state"), "--json"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=180)
        finally:
            end_guard(folder / "state")
        assert done.returncode in (0, 1), done.stderr  # 1: a busy machine's late ticks; never killed
        assert json.loads(done.stdout)["surfaced"]
        assert StateFile(folder / "state").read().state in (SortieState.ENDED, SortieState.HELD)
        assert adrift(sea) < FLOATS_M


def test_ctrl_c_in_the_ascent_after_a_fault_leaves_what_a_person_must_look_at(folder):
    state = folder / "state"
    with twins(folder / "t") as sea:
        StateFile(state).write(SortieState.ABORTED, flight="before", reason="leak")
        with flying(sea.board, folder / "leg.toml", folder) as flight:
            until(lambda: ticks(folder) > 20 or flight.poll() is not None, 120.0)
            os.kill(flight.pid, signal.SIGINT)
            time.sleep(0.1)
            os.kill(flight.pid, signal.SIGINT)  # at the surface the second one stops at once
            flight.wait(60.0)
        assert not StateFile(state).read().state.may_arm


def test_a_services_watch_that_stops_is_replaced(folder):
    state = folder / "state"
    state.mkdir()
    command = [sys.executable, "-m", "glider.hal.outofband", "--service", "--run", str(state), "--state", str(state)]
    with twins(folder / "t") as sea, subprocess.Popen(command) as service:
        try:
            with flying(sea.board, folder / "dive.toml", folder) as flight:
                until(lambda: ticks(folder) > 20 or flight.poll() is not None, 120.0)
                assert guard_pid(state) == service.pid
                service.kill()
                until(lambda: guard_pid(state) != service.pid, 10.0)
                assert flight.poll() is None
                flight.send_signal(signal.SIGINT)
                assert flight.wait(120.0) == 1
        finally:
            service.kill()
