"""A flight whose recording process is killed under way: it flies on, and its log is one again afterwards."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.log.parts import FlightLog, read_flight
from glider.tools.data.log.repair import repair
from tests.support.patience import patient_vehicle
from tests.support.twinned import until

pytestmark = pytest.mark.realtime


def recorders_of(pid):
    """The recording processes that a flight started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if parent == pid and b"glider.hal.recorder.writer" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:  # gone meanwhile
            continue
    return found


def test_a_recording_process_killed_in_flight_costs_half_a_second_and_no_more(tmp_path):
    first, second = tmp_path / "dive.mcap", tmp_path / "dive-part2.mcap"
    command = [
        "-m",
        "glider.tools.cli.main",
        "fly",
        "--realtime",
        "--log",
        str(first),
        "--vehicle",
        patient_vehicle(tmp_path),
    ]
    flight = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        until(lambda: first.exists() and first.stat().st_size > 60_000, 120.0)
        (recorder,) = recorders_of(flight.pid)
        os.kill(recorder, signal.SIGKILL)
        until(lambda: second.exists() and second.stat().st_size > 60_000, 30.0)
        time.sleep(0.5)
        flight.send_signal(signal.SIGINT)
        out, err = flight.communicate(timeout=120)
    finally:
        flight.kill()
        flight.wait()
    assert " part 2" in err
    assert out.strip() == str(first)
    log = read_flight(first)
    assert isinstance(log, FlightLog)
    assert [part.log.complete for part in log.parts] == [False, True]
    tick = log.topics["/tick"]
    assert tick.missing == log.parts[1].lost["/tick"]
    assert log.parts[1].gap_s < 1.0
    assert (np.diff(tick.column("t_s")) > 0).all()
    whole = read_flight(repair(first).out)
    assert whole.whole
    np.testing.assert_array_equal(whole.topics["/tick"].data, tick.data)
