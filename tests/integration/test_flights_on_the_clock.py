"""The simulated board at the clock's pace: given up by Ctrl-C, late ticks, and samples that are not of the future."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import Reaction
from glider.hal.ports import SLOTS
from glider.hal.recorder.recorder import NullRecorder
from glider.tools.flight.compose import build_flight, build_runtime, record_specs
from tests.support.patience import patient_vehicle
from tests.support.twinned import until

pytestmark = pytest.mark.realtime


def test_ctrl_c_gives_the_dive_up_and_the_log_is_whole(tmp_path):
    flight = subprocess.Popen(
        [sys.executable, "-m", "glider.tools.cli.main", "fly", "--realtime", "--json",
         "--vehicle", patient_vehicle(tmp_path)],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ},
    )  # fmt: skip
    log = tmp_path / "sawtooth-001.mcap"
    try:
        until(lambda: log.exists() and log.stat().st_size > 60_000, 120.0)
        flight.send_signal(signal.SIGINT)
        out, err = flight.communicate(timeout=60)
    finally:
        flight.kill()
        flight.wait()
    result = json.loads(out)
    assert flight.returncode == 1, err
    assert result["reason"] == "asked to by the operator"
    assert result["surfaced"]
    assert result["records"]["complete"]


def test_a_tick_that_comes_late_finds_the_present():
    """Not the samples of when it was due: a machine that stood still for a second is no IMU unplugged (row 1)."""
    flight = build_flight(mission="sawtooth", realtime=True)
    flight.board.open()
    runtime = build_runtime(flight, NullRecorder(record_specs(flight)))
    runtime.arm()
    try:
        for _ in range(5):
            runtime.tick()
        time.sleep(1.0)
        runtime.tick()
        assert runtime.timing.worst_s > 0.9
        assert runtime.timing.missed >= 40
        taken = flight.board.world.frame[SLOTS["imu"].all][0]
        assert flight.board.clock.now() - taken < 0.2
        for _ in range(5):
            runtime.tick()
        assert flight.supervisor.worst(sup.FAULT_IMU_LOST) == Reaction.NOTHING
    finally:
        runtime.disarm()


def test_no_sample_is_of_the_future_wherever_the_ticks_fall():
    """Steps of the world and deadlines begin apart; a sample ahead of the clock is refused as mistimed."""
    flight = build_flight(mission="sawtooth", realtime=True)
    flight.board.open()
    clock, world = flight.board.clock, flight.board.world
    begin = clock.now() + 0.02
    for tick in range(40):
        deadline = begin + 0.0213 * tick
        clock.sleep_until(deadline)
        assert deadline - world.dt - 1e-9 < world.time <= clock.now()
