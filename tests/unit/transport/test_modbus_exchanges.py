"""No reply is ever taken for the answer to another request: 10^5 exchanges in simulated time, with delay and loss."""

import math
import random

import pytest

from glider.hal.drivers.poll import Poll
from glider.hal.drivers.samples import Health
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus_master import ModbusBus
from glider.tools.verify.faults.wire import Stamped, WireLine, stamp_reply

EXCHANGES = 100_000


def exchange(delay, seed, exchanges=EXCHANGES, forget_s=0.5, longest_s=0.1):
    """Three devices, two of them asked for the same registers; every reply carries its request's number."""
    line = WireLine(stamp_reply, delay, seed, timeout_s=0.03, longest_s=longest_s, forget_s=forget_s)
    jobs = [Stamped(line, device, period) for device, period in ((1, 0.02), (2, 0.02), (3, 0.05))]
    while line.requests < exchanges:
        line.run(line.now + 1.0)
    return line.bus, jobs, line


def late_and_lost(rng):
    """One in twenty lost; most answer at once, one in ten late, up to three times the timeout."""
    luck = rng.random()
    if luck < 0.05:
        return math.inf
    return rng.uniform(0.03, 0.1) if luck < 0.15 else rng.uniform(0.001, 0.03)


def far_too_late(rng):
    """Replies that come long after the line was promised to be quiet: a stuck adapter lets go up to 0.4 s later."""
    luck = rng.random()
    if luck < 0.05:
        return math.inf
    return rng.uniform(0.1, 0.4) if luck < 0.15 else rng.uniform(0.001, 0.02)


@pytest.mark.parametrize("delay", [late_and_lost, far_too_late])
def test_no_reply_is_delivered_to_the_wrong_request(delay):
    bus, jobs, line = exchange(delay, seed=1)
    assert line.requests >= EXCHANGES
    assert sum(job.misdelivered for job in jobs) == 0
    assert min(job.delivered for job in jobs) > 1000
    assert bus.counts.timeouts > 5000
    assert bus.counts.late > 1000


def test_the_measurement_can_fail():
    """Without the quiet time and the memory of missing replies, late replies are taken for others' answers."""
    _, jobs, _ = exchange(late_and_lost, seed=1, exchanges=20_000, forget_s=0.0, longest_s=0.0)
    assert sum(job.misdelivered for job in jobs) > 50


def test_a_silent_device_leaves_the_line_to_the_others():
    """With device 1 dead, the others are answered as often as without it, but for its few timeouts."""
    dead, asked = {1}, [0]
    line = WireLine(stamp_reply, lambda rng: math.inf if asked[0] in dead else 0.002, 3, timeout_s=0.02, longest_s=0.02)
    forward = line._sent

    def note(frame):
        asked[0] = frame[0]
        return forward(frame)

    line.bus.attach(note)
    jobs = [Stamped(line, device, 0.04) for device in (1, 2, 3)]
    line.run(60.0)
    assert jobs[0].delivered == 0
    assert min(job.delivered for job in jobs[1:]) > 0.85 * 60.0 / 0.04
    dead.clear()
    line.run(70.0)
    assert jobs[0].delivered > 0.8 * 9.0 / 0.04


@pytest.mark.parametrize("code", [1, 2, 4, 6])
def test_exceptions_are_counted_and_slow_the_poll_down(code):
    def slave(frame, number):
        return modbus.with_check_sum(bytes((frame[0], frame[1] | 0x80, code)))

    line = WireLine(slave, lambda rng: 0.002, 4, timeout_s=0.02, longest_s=0.02)
    job = Stamped(line, 1, 0.02, run_batch=4)
    line.run(10.0)
    assert job.delivered == 0
    assert 0 <= line.requests - line.bus.counts.exceptions <= 1
    assert line.requests <= (12 if code < 4 else 130)


def test_replies_in_anothers_name_are_counted_as_wrong():
    def slave(frame, number):
        return modbus.with_check_sum(bytes((9, 3, 8)) + bytes(8))

    line = WireLine(slave, lambda rng: 0.002, 5, timeout_s=0.02, longest_s=0.02)
    job = Stamped(line, 1, 0.02, run_batch=4)
    line.run(5.0)
    assert job.delivered == 0
    assert line.bus.counts.wrong == line.bus.counts.timeouts > 8


def test_a_babbling_line_is_still_asked_now_and_then():
    bus = ModbusBus(9600, timeout_s=0.02, longest_s=0.02)
    sent = []
    bus.attach(lambda frame: sent.append(frame) or True)
    bus.add(Poll([modbus.read(1, 3, 0, 4)], 0.02, lambda *reply: None, Health("asked")))
    bus.connected(0.0)
    rng, now = random.Random(6), 0.0
    while now < 10.0:
        bus.feed(rng.randbytes(1), now)
        bus.service(now)
        now += bus.byte_s
    assert 10 <= len(sent) <= 60
