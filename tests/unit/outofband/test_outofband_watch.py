"""The watch over a flight's heartbeat, with real processes: what counts as its end, and when watchdogs are fed."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.outofband import guard
from glider.hal.outofband.guard import GuardWatch
from glider.hal.outofband.plan import NAME, AscentPlan, AxisPlan, NumberPlan, PathPlan, ReadPlan, write_plan
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile

pytestmark = pytest.mark.realtime(seconds=35)

FLIGHT = """
import os, select, sys, time
from glider.hal import heartbeat as hb
pulse = hb.Heartbeat.create(sys.argv[1], 0.02, "test")
pulse.beat(0.0)
pulse.publish(hb.SortieState.DIVING)
print("flying", flush=True)
beating = recording = True
while True:
    if select.select([0], [], [], 0.02)[0]:
        word = os.read(0, 100).decode().strip()
        if word == "quiet":
            beating = False
        elif word == "recorder hangs":
            pulse.words[hb.W_RECORDER_EXPECTED], recording = 1, False
            pulse.words[hb.W_RECORDER_NS] = time.monotonic_ns()
        elif word == "recorder given up":
            pulse.words[hb.W_RECORDER_EXPECTED] = 0
        elif word:
            pulse.publish(hb.SortieState[word])
            print(word, flush=True)
    if beating:
        pulse.beat(1.0)
"""


class Flight:
    """A process that beats."""

    def __init__(self, folder):
        self.process = subprocess.Popen(
            [sys.executable, "-c", FLIGHT, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self.process.stdout.readline() == b"flying\n"

    def tell(self, word):
        self.process.stdin.write(word.encode() + b"\n")
        self.process.stdin.flush()
        if word.isupper():
            assert self.process.stdout.readline().decode().strip() == word


@pytest.fixture
def flight(tmp_path):
    found = Flight(tmp_path)
    yield found
    found.process.kill()
    found.process.communicate()


@pytest.fixture
def dog(tmp_path, monkeypatch):
    """A hardware watchdog's device and systemd's socket, both as files to be looked into."""
    (tmp_path / "watchdog").write_bytes(b"")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(str(tmp_path / "notify"))
        line.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))

        class Dog:
            def fed(self):
                """Since the last look: the hardware's feedings, systemd's."""
                told = []
                while True:
                    try:
                        told.append(line.recv(1000))
                    except BlockingIOError:
                        break
                data = (tmp_path / "watchdog").read_bytes()
                os.truncate(tmp_path / "watchdog", 0)
                return data.count(b"\0"), told.count(b"WATCHDOG=1"), b"V" in data

        yield Dog()


@pytest.fixture
def watch(tmp_path, monkeypatch):
    monkeypatch.setattr(guard, "FEED_S", 0.05)
    nowhere = str(tmp_path / "no-port")
    word = [NumberPlan(at, "u16", 1.0) for at in range(7)]
    register = ReadPlan(function=3, address=1, words=1, number=word[0])
    pump = AxisPlan(
        name="pump", port=nowhere, baud=115200, id=8, status=register, position=register, path=PathPlan(3, 7, *word),
        auxiliary=4, absolute=1, trigger=1, clear_alarm=1, zero_counts=0.0, counts_per_m=1.0, end_m=0.0, last_m=0.0,
        tolerance_m=0.1, rpm=1, ramp_ms=1, wire=None,
    )  # fmt: skip
    write_plan(tmp_path / NAME, AscentPlan("test", (pump,), None, watchdog=str(tmp_path / "watchdog")))
    found = GuardWatch(tmp_path, tmp_path, service=False)
    found.start()
    yield found
    found.close(in_order=True)


def run(watch, seconds, condition=None):
    """Step for a while, or until a condition holds; False where a step said that nothing is left to watch."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not (condition and condition()):
        if not watch.step():
            return False
        time.sleep(0.01)
    return True


def ascending(watch):
    return watch._ascent is not None


def test_while_all_answer_both_watchdogs_are_fed(flight, dog, watch, tmp_path):
    assert run(watch, 0.5)
    hardware, service, _ = dog.fed()
    assert hardware > 1
    assert service > 1
    assert not ascending(watch)
    assert Heartbeat.open(tmp_path).look().guard == Guard.WATCHING


def test_a_hanging_recorder_is_not_fed_for_one_given_up_is(flight, dog, watch, monkeypatch):
    monkeypatch.setattr(guard, "RECORDER_SILENT_S", 0.3)
    flight.tell("recorder hangs")
    run(watch, 0.8)
    dog.fed()
    run(watch, 0.3)
    assert dog.fed()[:2] == (0, 0)
    flight.tell("recorder given up")  # the flight has seen to it: it flies on without a log
    run(watch, 0.5)
    assert dog.fed()[0] > 1
    assert not ascending(watch)


@pytest.mark.parametrize("end", ["quiet", signal.SIGSTOP, signal.SIGKILL, "ABORTED"])
def test_a_heart_that_stops_is_noticed_within_two_seconds_and_its_process_ended(flight, dog, watch, tmp_path, end):
    assert run(watch, 0.3)
    if isinstance(end, str):
        flight.tell(end)
    else:
        flight.process.send_signal(end)
    began = time.monotonic()
    run(watch, 5.0, lambda: ascending(watch))
    assert time.monotonic() - began < (4.0 if end == "ABORTED" else 2.0 + 0.5)  # asked politely, it has a second
    assert flight.process.wait(5.0) == -signal.SIGKILL
    run(watch, 0.5)
    assert Heartbeat.open(tmp_path).look().guard == Guard.ASCENDING
    assert StateFile(tmp_path).read().state == SortieState.ABORTED
    assert StateFile(tmp_path).read().flight == "test"


def test_on_the_way_up_it_feeds_until_the_pump_was_silent_for_too_long(flight, dog, watch, monkeypatch):
    monkeypatch.setattr(guard, "PUMP_SILENT_S", 1.5)
    assert run(watch, 0.3)
    flight.process.kill()
    assert run(watch, 10.0, lambda: ascending(watch))
    dog.fed()
    assert run(watch, 0.7)
    assert dog.fed()[0] > 0
    assert run(watch, 1.2)
    dog.fed()
    assert run(watch, 0.3)
    assert dog.fed()[:2] == (0, 0)


def test_an_end_in_order_stops_the_watchdog_and_the_watch(flight, dog, watch):
    assert run(watch, 0.2)
    flight.tell("ENDED")
    run(watch, 0.2)
    assert dog.fed()[2]
    flight.process.kill()
    flight.process.wait()
    assert not run(watch, 1.0)
    assert not ascending(watch)


@pytest.mark.parametrize("state", list(SortieState))
def test_what_a_service_does_at_its_start_is_the_states_to_say(tmp_path, state):
    StateFile(tmp_path).write(state, reason="because")
    service = GuardWatch(tmp_path, tmp_path, service=True)
    service.start()
    assert ascending(service) == state.must_ascend
    assert run(service, 0.3)  # without a plan it has nothing to go up with, and waits for one
    service.close(in_order=True)


def test_a_service_rests_once_a_person_has_looked(tmp_path, monkeypatch):
    monkeypatch.setattr(guard, "STEP_S", 0.05)
    StateFile(tmp_path).write(SortieState.DIVING)
    service = GuardWatch(tmp_path, tmp_path, service=True)
    service.start()
    run(service, 0.3)
    StateFile(tmp_path).write(SortieState.ASHORE)
    run(service, 10.0, lambda: not ascending(service))
    assert not ascending(service)
    service.close(in_order=True)


def test_a_flight_left_over_from_before_is_judged_by_the_state(flight, tmp_path):
    flight.process.kill()
    flight.process.wait()
    for state, wanted in ((SortieState.ASHORE, False), (SortieState.DIVING, True)):
        StateFile(tmp_path).write(state)
        watch = GuardWatch(tmp_path, tmp_path, service=False)
        watch.start()
        assert run(watch, 1.5, lambda watch=watch: ascending(watch)) == wanted
        watch.close(in_order=True)


def test_ports_that_never_come_end_a_twins_watch(flight, tmp_path, watch):
    import dataclasses

    write_plan(tmp_path / NAME, dataclasses.replace(watch.plan, give_up_s=0.5))
    watch._read_plan()
    assert run(watch, 0.3)
    flight.process.kill()
    assert run(watch, 5.0, lambda: ascending(watch))
    assert not run(watch, 5.0)
