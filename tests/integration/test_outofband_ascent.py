"""The out-of-band ascent on twins, with real kills: the flight dies, hangs or asks; the vehicle comes up."""

import json
import os
import signal
import subprocess
import sys

import pytest

from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.outofband.plan import read_plan
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.data.log.reader import read_log
from tests.support.twinned import DIVE, flying, guard_pid, twins, until

pytestmark = pytest.mark.realtime(seconds=120)
DEEP_M = 0.8


@pytest.fixture
def sea(tmp_path):
    (tmp_path / "dive.toml").write_text(DIVE)
    with twins(tmp_path / "t") as found:
        yield found


def dive(sea, tmp_path, flight):
    """Arm, and be well under water; time enough for a busy machine."""
    until(lambda: sea.state()["z_m"] > DEEP_M or flight.poll() is not None, 300.0, every=0.1)
    assert StateFile(tmp_path / "state").read().state == SortieState.DIVING


def comes_up(sea, tmp_path, began):
    """By the pump, at its light end; the state says so."""
    until(lambda: StateFile(tmp_path / "state").read().state == SortieState.ABORTED, 4.0)
    until(lambda: sea.state()["z_m"] < 0.3, 120.0, every=0.1)
    pump = read_plan(tmp_path / "state" / "outofband.json").axes[0]
    until(lambda: abs(sea.state()["ballast_kg"] - pump.end_m * began["kg_per_m"]) < 0.01, 30.0)
    assert sea.state()["slider_m"] < -0.05
    assert abs(sea.state()["servo_rad"]) < 0.05


def taken_over(sea, tmp_path, flight):
    """Noticed at once (row 25: within 2 s, and a little for a busy machine), brought up, and said so in the log."""
    pulse = Heartbeat.open(tmp_path / "state")
    assert until(lambda: pulse.look().guard == Guard.ASCENDING, 10.0) < 2.5
    assert flight.wait(5.0) == -signal.SIGKILL  # one that hangs is ended first: its ports are needed
    comes_up(sea, tmp_path, {"kg_per_m": KG_PER_M})
    until(lambda: read_log(tmp_path / "flight.mcap").complete, 30.0)
    assert "died" in read_log(tmp_path / "flight.mcap").ending["ended"]


def test_a_flight_that_is_killed_is_brought_up_and_not_resumed(sea, tmp_path):
    with flying(sea.board, tmp_path / "dive.toml", tmp_path) as flight:
        dive(sea, tmp_path, flight)
        flight.kill()
        taken_over(sea, tmp_path, flight)

    # The next start, whatever mission it names, only ascends; the one after does not start at all.
    with flying(sea.board, tmp_path / "dive.toml", tmp_path, "--log", str(tmp_path / "second.mcap")) as flight:
        assert flight.wait(120.0) == 1
    result = json.loads((tmp_path / "stdout").read_text())
    assert not result["completed"]
    assert "given up, " in result["reason"]
    assert set(read_log(tmp_path / "second.mcap").topics["/tick"].column("mode")) == {3.0}
    assert StateFile(tmp_path / "state").read().state == SortieState.HELD
    with flying(sea.board, tmp_path / "dive.toml", tmp_path, "--log", str(tmp_path / "third.mcap")) as flight:
        assert flight.wait(60.0) == 1
    said = (tmp_path / "stderr").read_text()
    assert "not armed: the flight before (second): " in said
    assert not (tmp_path / "third.mcap").exists()


def test_a_watch_that_is_killed_is_replaced_and_the_next_brings_up_a_flight_that_hangs(sea, tmp_path):
    with flying(sea.board, tmp_path / "dive.toml", tmp_path) as flight:
        dive(sea, tmp_path, flight)
        first = guard_pid(tmp_path / "state")
        os.kill(first, signal.SIGKILL)
        until(lambda: guard_pid(tmp_path / "state") != first, 10.0)
        assert flight.poll() is None
        os.kill(flight.pid, signal.SIGSTOP)
        taken_over(sea, tmp_path, flight)


def test_with_the_watch_killed_too_the_next_service_brings_it_up(sea, tmp_path):
    """Everything dies at once, as when the power goes; then the service starts and finds the state."""
    with flying(sea.board, tmp_path / "dive.toml", tmp_path) as flight:
        dive(sea, tmp_path, flight)
        os.kill(guard_pid(tmp_path / "state"), signal.SIGKILL)
        flight.kill()
        flight.wait()
    sea.control("alarm ballast 3")  # and the pump's drive has stopped with an alarm
    command = [sys.executable, "-m", "glider.hal.outofband", "--service", "--run", str(tmp_path / "run")]
    (tmp_path / "run").mkdir()
    with subprocess.Popen([*command, "--state", str(tmp_path / "state")]) as service:
        try:
            comes_up(sea, tmp_path, {"kg_per_m": KG_PER_M})
        finally:
            service.terminate()


def test_a_second_flight_is_refused_and_an_orderly_end_leaves_nobody_watching(sea, tmp_path):
    """The vehicle belongs to the flight that is under way; after a person gave it up, the next may start."""
    with flying(sea.board, tmp_path / "dive.toml", tmp_path) as flight:
        dive(sea, tmp_path, flight)
        guard = guard_pid(tmp_path / "state")
        command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--board", str(sea.board), "--no-log"]
        command += ["--vehicle", str(tmp_path / "patient.toml")]
        done = subprocess.run(
            [*command, "--state", str(tmp_path / "state"), "--acknowledge"], capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 1
        assert "flight" in done.stderr
        assert flight.poll() is None
        flight.send_signal(signal.SIGINT)  # given up by a person
        assert flight.wait(180.0) == 1
        until(lambda: not os.path.exists(f"/proc/{guard}"), 10.0)
    assert Heartbeat.open(tmp_path / "state").look().state == SortieState.ENDED
    assert StateFile(tmp_path / "state").read().state == SortieState.ENDED
    assert sea.state()["z_m"] < 0.35


def _kg_per_m():
    from glider.firmware.core.vehicle.seawater import water_density
    from glider.tools.data.sources import load_vehicle

    return float(water_density(0.0, 20.0, 0.0)) * load_vehicle("roughie").actuators.ballast.plunger_area


KG_PER_M = _kg_per_m()
