"""The shared memory: in order, whole or not at all, never waiting, and nothing allocated in a commit."""

import gc
import os
import subprocess
import sys
import time
import tracemalloc

import numpy as np
import pytest

from glider.hal.recorder import ring
from glider.hal.recorder.producer import Producer
from glider.hal.recorder.schema import INFO, Field, RecordSpec

TICK = RecordSpec("/tick", "glider/msg/Tick", tuple(Field(f"x{place}", "m") for place in range(60)))
TRUTH = RecordSpec("/truth", "glider/msg/Truth", (Field("a", "m"), Field("b", "m")), spare=True)
SLOTS = 64


class Clock:
    """A clock that a test moves."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def ends():
    layout = ring.Layout(SLOTS, ring.MIN_PAYLOAD + 20)
    fd = ring.create_shared(layout.size)
    clock = Clock()
    producer = Producer(fd, layout, (TICK, TRUTH))
    reader = ring.RingReader(fd, layout, [TICK.width, TRUTH.width], clock)
    os.close(fd)
    return producer, reader, clock


def _take_all(reader):
    taken = []
    while (record := reader.take()) is not None:
        taken.append(record)
    return taken


def test_records_arrive_in_order_with_their_time_and_values(ends):
    producer, reader, _ = ends
    tick, truth = producer.channels["/tick"], producer.channels["/truth"]
    for number in range(1000):  # many laps
        tick.values[:] = number
        assert tick.commit(number / 50)
        truth.values[:] = -number
        assert truth.commit(number / 50)
        first, second = _take_all(reader)
        assert (first.channel, first.sequence, first.time_s) == (0, number + 1, number / 50)
        assert np.frombuffer(first.payload).tolist() == [number] * TICK.width
        assert (second.channel, np.frombuffer(second.payload).tolist()) == (1, [-number, -number])
    assert reader.take() is None


def test_values_stay_what_they_were_until_the_caller_changes_them(ends):
    producer, _, _ = ends
    tick = producer.channels["/tick"]
    assert np.isnan(tick.values).all()
    tick.values[3] = 7.0
    tick.commit(0.0)
    assert tick.values[3] == 7.0


def test_a_full_ring_drops_and_counts_the_spare_first(ends):
    producer, reader, _ = ends
    tick, truth = producer.channels["/tick"], producer.channels["/truth"]
    assert [truth.commit(0.0) for _ in range(SLOTS)] == [True] * (SLOTS // 2) + [False] * (SLOTS // 2)
    room = SLOTS - SLOTS // 16 - SLOTS // 2
    assert [tick.commit(0.0) for _ in range(SLOTS)] == [True] * room + [False] * (SLOTS - room)
    assert [producer.event(0.0, INFO, "x") for _ in range(SLOTS // 16 + 1)] == [True] * (SLOTS // 16) + [False]
    assert reader.control[ring.DROPPED] == producer.dropped == SLOTS // 2 + SLOTS - room + 1
    assert len(_take_all(reader)) == SLOTS
    assert tick.commit(1.0)
    assert _take_all(reader)[0].sequence == SLOTS + 1  # the gap shows


def test_a_slot_that_is_not_whole_is_waited_for_and_never_delivered(ends):
    producer, reader, clock = ends
    tick = producer.channels["/tick"]
    slots = producer._slots
    for number in range(3):
        tick.values[:] = number
        tick.commit(float(number))
    keep = slots[0, 30]
    slots[0, 30] = 99.0  # as if this store were not visible yet
    assert reader.take() is None
    clock.now += ring.TORN_PATIENCE_S / 2
    assert reader.take() is None
    slots[0, 30] = keep
    assert np.frombuffer(reader.take().payload)[0] == 0.0  # it became whole in time

    slots[1, 30] = 99.0
    assert reader.take() is None
    clock.now += ring.TORN_PATIENCE_S * 2
    assert np.frombuffer(reader.take().payload)[0] == 2.0  # the torn one is passed over
    assert reader.control[ring.DAMAGED] == 1


@pytest.mark.parametrize("word", [ring.NUMBER, ring.CHANNEL, ring.SEQUENCE, ring.TIME, ring.RECORD_HEAD + 59])
def test_every_part_of_a_record_is_under_the_checksum(ends, word):
    producer, reader, clock = ends
    tick = producer.channels["/tick"]
    tick.values[:] = 7.0
    for value in (5.0, np.nan, -1.0, 1e300):
        before = reader.control[ring.DAMAGED]
        tick.commit(3.0)
        producer._slots[(producer.head - 1) & producer.mask, word] = value
        assert reader.take() is None
        clock.now += 1.0
        assert reader.take() is None
        assert reader.control[ring.DAMAGED] == before + 1


def test_a_record_of_the_last_lap_is_not_taken_for_a_new_one(ends):
    producer, reader, _ = ends
    tick = producer.channels["/tick"]
    for _ in range(SLOTS):
        tick.commit(0.0)
        _take_all(reader)
    producer.control[ring.HEAD] = SLOTS + 1  # handed over, but its stores are not visible yet
    assert reader.take() is None


def test_events_carry_text_and_cut_it_when_it_is_long(ends):
    producer, reader, _ = ends
    producer.event(1.5, INFO, "grüße")
    producer.event(2.5, INFO, "x" * 1000)
    first, second = _take_all(reader)
    head = 8 * ring.EVENT_HEAD
    assert first.channel == ring.EVENT_CHANNEL
    assert list(first.payload[:head].cast("d")) == [INFO, len("grüße".encode())]
    assert bytes(first.payload[head:]).rstrip(b"\0").decode() == "grüße"
    assert list(second.payload[:head].cast("d")) == [INFO, ring.EVENT_BYTES]


@pytest.mark.parametrize(("slots", "payload"), [(0, 100), (17, 100), (8, 100), (64, 1)])
def test_layouts_that_cannot_work_are_refused(slots, payload):
    with pytest.raises(ValueError, match="expected"):
        ring.Layout(slots, payload)


PRODUCER = """
import sys, time
from glider.hal.recorder import ring
from glider.hal.recorder.producer import Producer
from glider.hal.recorder.schema import Field, RecordSpec
spec = RecordSpec("/tick", "glider/msg/Tick", tuple(Field(f"x{i}", "m") for i in range(60)))
producer = Producer(int(sys.argv[1]), ring.Layout(64, ring.MIN_PAYLOAD + 20), (spec,))
print("go", flush=True)
channel, number = producer.channels["/tick"], 0
while number < 60_000:
    channel.values[:] = number
    if channel.commit(number * 0.001):
        number += 1
    else:
        time.sleep(0)
"""


def test_two_processes_at_full_speed_lose_and_tear_nothing():
    layout = ring.Layout(64, ring.MIN_PAYLOAD + 20)
    fd = ring.create_shared(layout.size)
    reader = ring.RingReader(fd, layout, [60])
    with subprocess.Popen([sys.executable, "-c", PRODUCER, str(fd)], pass_fds=(fd,), stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"go\n"
        number, deadline = 0, time.monotonic() + 30.0
        while number < 60_000 and time.monotonic() < deadline:
            record = reader.take()
            if record is None:
                continue
            values = np.frombuffer(record.payload)
            assert values[0] == number
            assert (values == number).all()
            assert record.time_s == number * 0.001
            number += 1
    os.close(fd)
    assert number == 60_000
    assert reader.control[ring.DAMAGED] == 0


def test_a_commit_allocates_nothing_but_a_few_boxed_numbers(ends):
    producer, reader, _ = ends
    tick = producer.channels["/tick"]
    time_s = 123.456
    for _ in range(20):
        tick.commit(time_s)
    _take_all(reader)
    peaks = []
    tracemalloc.start()
    try:
        for round_ in range(200):
            if round_ % 40 == 0:
                _take_all(reader)
            tracemalloc.reset_peak()
            before, _ = tracemalloc.get_traced_memory()
            tick.commit(time_s)
            _, peak = tracemalloc.get_traced_memory()
            peaks.append(peak - before)
    finally:
        tracemalloc.stop()
    assert producer.dropped == 0
    assert max(peaks) < 150


def test_a_hundred_thousand_commits_gain_no_memory(ends):
    producer, reader, _ = ends
    tick = producer.channels["/tick"]

    def fly(commits):
        for number in range(commits):
            tick.commit(number * 0.02)
            if number % 50 == 49:
                _take_all(reader)

    fly(1000)
    gc.collect()
    before = sys.getallocatedblocks()
    fly(100_000)
    gc.collect()
    assert sys.getallocatedblocks() - before < 20
    # The way taken when there is no room is as clean.
    for _ in range(SLOTS):
        tick.commit(0.0)
    before = sys.getallocatedblocks()
    for _ in range(10_000):
        assert not tick.commit(0.0)
    assert sys.getallocatedblocks() - before < 20


def test_a_commit_takes_microseconds(ends):
    producer, reader, _ = ends
    tick = producer.channels["/tick"]
    seconds = []
    for number in range(4000):
        start = time.perf_counter()
        tick.commit(0.5)
        seconds.append(time.perf_counter() - start)
        if number % 50 == 49:
            _take_all(reader)
    assert np.median(seconds) < 10e-6  # about 1 us here
