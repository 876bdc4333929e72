"""Ports and the hub: exclusive, never waiting, reconnecting, bounded."""

import contextlib
import os
import time

import pytest

from glider.hal.protocols import modbus
from glider.hal.protocols.modbus_master import ModbusBus
from glider.hal.transport.hub import RETRY_S, SPARE, Hub, SerialLink
from glider.hal.transport.port import Busy, SerialPort, Unplugged
from glider.sim_backend.twins.line import open_pty


class Recorder:
    """A handler that notes what happens to it."""

    def __init__(self):
        self.events, self.data = [], b""

    def attach(self, send):
        self.send = send

    def connected(self, now):
        self.events.append("connected")

    def lost(self, now):
        self.events.append("lost")

    def feed(self, data, now):
        self.data += data

    def service(self, now):
        return now + 1.0


@pytest.fixture
def pty():
    master, slave, path = open_pty()
    yield master, path
    for fd in (master, slave):
        with contextlib.suppress(OSError):
            os.close(fd)


def linked(path, baud=115_200):
    handler = Recorder()
    link = SerialLink("port", SerialPort(path, baud), handler)
    return link, handler, Hub([link], time.monotonic)


def test_bytes_pass_both_ways(pty):
    master, path = pty
    link, handler, hub = linked(path)
    link.open(time.monotonic())
    os.write(master, b"\x00\x11\x13\x0d\x0a\xff")  # nothing of this is a terminal's business
    assert handler.send(b"\x03\x04\x1a")
    hub.serve(time.monotonic() + 0.05)
    assert handler.data == b"\x00\x11\x13\x0d\x0a\xff"
    assert os.read(master, 100) == b"\x03\x04\x1a"
    link.port.close()


def test_a_port_is_opened_once(pty):
    _, path = pty
    first, second = SerialPort(path, 9600), SerialPort(path, 9600)
    first.open()
    with pytest.raises(Busy, match="another program"):
        second.open()
    first.close()
    second.open()
    second.close()


def test_a_port_that_is_not_there_says_so_at_once(tmp_path):
    begin = time.monotonic()
    with pytest.raises(Unplugged, match="not there"):
        SerialPort(str(tmp_path / "none"), 9600).open()
    (tmp_path / "file").write_text("no port")
    with pytest.raises(Unplugged):
        SerialPort(str(tmp_path / "file"), 9600).open()
    assert time.monotonic() - begin < 0.05


def test_unplugging_is_noticed_and_plugging_in_again_too(tmp_path):
    name = tmp_path / "port"
    master, slave, path = open_pty()
    name.symlink_to(path)
    link, handler, hub = linked(str(name))
    link.open(time.monotonic())
    hub.serve(time.monotonic() + 0.02)
    os.close(master)
    os.close(slave)
    name.unlink()
    hub.serve(time.monotonic() + 0.05)
    assert handler.events == ["connected", "lost"]
    assert not link.up
    assert not handler.send(b"lost")
    master, slave, path = open_pty()
    name.symlink_to(path)
    hub.serve(time.monotonic() + RETRY_S + 0.1)
    assert handler.events == ["connected", "lost", "connected"]
    assert link.connections == 2
    os.close(master)
    os.close(slave)
    link.port.close()


def test_serving_ends_at_its_deadline_whatever_the_line_does(pty):
    """Counted in looks at the clock, which a busy machine does not change: none is left but the round under way, and
    one that only takes what waits."""
    master, path = pty
    looks = []

    def now():
        looks.append(time.monotonic())
        return looks[-1]

    link, handler, _ = linked(path)
    hub = Hub([link], now)
    hub.set_period(0.02)
    link.open(time.monotonic())
    for _ in range(20):
        with_room = True
        while with_room:
            try:
                os.write(master, b"\xaa" * 1000)
            except BlockingIOError:
                with_room = False
        before, begin = len(handler.data), time.monotonic()
        looks.clear()
        hub.serve(begin + 0.02)
        assert sum(at >= begin + 0.02 for at in looks) <= 13
        # bounded work: twice the line rate, what is spare, and the chunk that was under way
        passed = time.monotonic() - begin + 0.02
        assert len(handler.data) - before <= SPARE + 0.2 * 115_200 * passed + 1024
    link.port.close()


def test_a_line_that_takes_nothing_refuses_more_and_keeps_little(pty):
    _, path = pty
    link, handler, _ = linked(path)
    link.open(time.monotonic())
    sent = [handler.send(b"x" * 500) for _ in range(60)]
    assert sent[0]
    assert not sent[-1]
    link.port.close()


def test_old_bytes_are_dropped_after_an_absence(pty):
    master, path = pty
    link, handler, hub = linked(path)
    link.open(time.monotonic())
    hub.serve(time.monotonic())
    os.write(master, b"old")
    time.sleep(0.25)
    hub.serve(time.monotonic() + 0.01)
    assert handler.data == b""
    os.write(master, b"new")
    hub.serve(time.monotonic() + 0.02)
    assert handler.data == b"new"
    link.port.close()


@pytest.mark.parametrize("away_s", [0.08, 0.15])
def test_a_reply_that_came_while_the_loop_was_away_is_read_before_it_is_missed(pty, away_s):
    """The loop is away for longer than the timeout; the answer waits in the system's buffer. It is neither missed nor
    late, and the next request follows without the quiet time after a timeout."""
    master, path = pty
    bus, taken = ModbusBus(115_200, timeout_s=0.05, longest_s=0.1), []
    link = SerialLink("port", SerialPort(path, 115_200), bus)
    hub = Hub([link], time.monotonic)
    link.open(time.monotonic())
    hub.serve(time.monotonic() + 0.12)  # until the line counts as quiet
    bus.ask(modbus.read(1, 3, 0x0100, 1), lambda reply, code: taken.append(reply))
    hub.serve(time.monotonic())
    assert os.read(master, 100) == modbus.read(1, 3, 0x0100, 1).frame
    os.write(master, modbus.with_check_sum(bytes((1, 3, 2, 0x12, 0x34))))
    time.sleep(away_s)
    hub.serve(time.monotonic())
    link.port.close()
    assert [reply.registers for reply in taken if reply is not None] == [[0x1234]]
    assert (bus.counts.timeouts, bus.counts.late) == (0, 0)
