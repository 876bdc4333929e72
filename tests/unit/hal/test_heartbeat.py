"""The loop's pulse, seen from another process; stamping makes nothing that stays."""

import os
import subprocess
import sys
import time

import pytest

from glider.hal import heartbeat as hb
from glider.hal.heartbeat import Guard, Heartbeat, HeartbeatHeld
from glider.hal.sortie import SortieState


def test_what_the_loop_stamps_another_map_sees(tmp_path):
    pulse = Heartbeat.create(tmp_path, 0.02, "sawtooth-001")
    watcher = Heartbeat.open(tmp_path)
    first = watcher.look()
    assert (first.pid, first.state, first.period_s, first.ticks) == (os.getpid(), SortieState.ASHORE, 0.02, 0)
    assert first.age_s == float("inf")
    assert watcher.flight == "sawtooth-001"
    pulse.publish(SortieState.DIVING)
    for number in range(5):
        pulse.beat(number / 50)
    seen = watcher.look()
    assert (seen.state, seen.ticks, seen.guard) == (SortieState.DIVING, 5, Guard.ABSENT)
    assert 0.0 <= seen.age_s < 1.0
    assert watcher.values[hb.V_TIME_S] == 4 / 50
    time.sleep(0.05)
    assert watcher.look().age_s >= 0.05


def test_one_flight_at_a_time_and_a_dead_ones_place_is_free(tmp_path):
    code = "import sys, time; from glider.hal.heartbeat import Heartbeat; Heartbeat.create(sys.argv[1], 0.02)"
    code += "; print(1, flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        with pytest.raises(HeartbeatHeld, match=f"process {other.pid}"):
            Heartbeat.create(tmp_path, 0.02)
        other.kill()
    pulse = Heartbeat.create(tmp_path, 0.02)
    assert pulse.look().pid == os.getpid()


def test_the_guards_words_outlive_a_new_flight(tmp_path):
    first = Heartbeat.create(tmp_path, 0.02)
    first.words[hb.W_GUARD_STATUS], first.words[hb.W_GUARD_STAGE] = Guard.WATCHING, 2
    first.words[hb.W_TICKS] = 7
    first.close()
    second = Heartbeat.create(tmp_path, 0.02)
    assert (second.look().guard, second.look().ticks) == (Guard.WATCHING, 0)
    assert second.words[hb.W_GUARD_STAGE] == 2


@pytest.mark.parametrize("data", [b"", b"x" * 10, b"\xff" * hb.SIZE])
def test_what_is_no_heartbeat_is_refused(tmp_path, data):
    (tmp_path / hb.NAME).write_bytes(data)
    with pytest.raises(ValueError, match="heartbeat"):
        Heartbeat.open(tmp_path)


def test_words_that_make_no_sense_read_as_the_worst(tmp_path):
    pulse = Heartbeat.create(tmp_path, 0.02)
    pulse.words[hb.W_STATE] = pulse.words[hb.W_GUARD_STATUS] = 99
    assert (pulse.look().state, pulse.look().guard) == (SortieState.ABORTED, Guard.ABSENT)


def test_stamping_gains_no_memory(tmp_path):
    pulse = Heartbeat.create(tmp_path, 0.02)
    for number in range(1000):
        pulse.beat(float(number))
    before = sys.getallocatedblocks()
    for number in range(10_000):
        pulse.beat(float(number))
    assert sys.getallocatedblocks() - before < 20
