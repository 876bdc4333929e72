"""A flight at the speed of the clock, looked at: time, depth, pitch, leg and what is left of it; what Ctrl-C says."""

import os
import re
import subprocess
import sys
import time

import pexpect
import pyte
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.tools.data.log.parts import read_flight
from glider.tools.flight import display
from glider.tools.flight.compose import build_flight

pytestmark = pytest.mark.realtime(seconds=40)
COMMAND = ["-m", "glider.tools.cli.main", "fly", "--realtime", "--mission", "spiral"]
STATUS = re.compile(
    r" +(\d+) s  depth +(\d+\.\d\d) m, pitch +([+-]\d+\.\d) deg  leg 1 of 3: \d\.\d m left to 4\.5 m, limit in \d+ s$"
)


class Screen:
    """What a person sees of a program in a terminal of 100 columns."""

    def __init__(self, folder):
        self.child = pexpect.spawn(sys.executable, COMMAND, cwd=folder, dimensions=(12, 100))
        self._screen = pyte.Screen(100, 12)
        self._stream = pyte.ByteStream(self._screen)

    def lines(self):
        return [line.rstrip() for line in self._screen.display if line.strip()]

    def until(self, shows, seconds=60.0):
        """The lines once they show something; how long that took is left to the caller."""
        end = time.monotonic() + seconds
        while not shows(self.lines()):
            assert time.monotonic() < end, self.lines()
            try:
                self._stream.feed(self.child.read_nonblocking(65_536, timeout=0.1))
            except pexpect.TIMEOUT:
                continue
            except pexpect.EOF:
                break
        return self.lines()


def test_a_terminal_shows_the_flight_and_what_ctrl_c_does(tmp_path):
    screen = Screen(tmp_path)
    try:
        seen = []
        for _ in range(3):
            lines = screen.until(lambda now: now and STATUS.match(now[-1]) and now[-1:] != seen[-1:])
            seen.append(lines[-1])
        assert len([line for line in lines if STATUS.match(line)]) == 1  # renewed, not one below the other
        seconds = [int(STATUS.match(line)[1]) for line in seen]
        assert seconds == sorted(set(seconds))
        screen.until(lambda now: (found := STATUS.match(now[-1])) and float(found[2]) > 1.0)  # seconds from the surface
        screen.child.sendintr()
        pressed = time.monotonic()
        screen.until(lambda now: "surfacing; Ctrl-C again stops at once" in now)
        assert time.monotonic() - pressed < 2.0  # of a busy machine; and not at the flight's end
        assert screen.child.isalive()
        screen.until(lambda now: now[-1].endswith("given up (asked to by the operator), surfacing"))
        screen.child.sendintr()
        lines = screen.until(lambda now: "stopped" in now)
        assert "spiral-001.mcap" in lines[-2]
    finally:
        screen.child.close(force=True)
    log = read_flight(tmp_path / "spiral-001.mcap")
    assert log.whole
    assert log.topics["/tick"].count > 100


def test_elsewhere_a_line_now_and_then(tmp_path):
    process = subprocess.Popen([sys.executable, *COMMAND, "--no-log"], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    try:
        began = []
        while len(began) < 2:
            line = process.stderr.readline()
            assert line
            if STATUS.match(line):
                began.append(int(STATUS.match(line)[1]))
        assert began == [0, 10]
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


# --- what is said --------------------------------------------------------------------------------------------------
@pytest.fixture
def flying():
    """A flight in the air, so to speak: in its first leg since t = 100 s, 1 m deep."""
    flight = build_flight(mission="spiral")
    ap, est = flight.autopilot.ap, flight.autopilot.est
    ap[ctl.MODE], ap[ctl.LEG_START] = ctl.FLYING, 100.0
    est[ctl.EST_STARTED], est[ctl.EST_DEPTH], est[ctl.EST_PITCH] = 1.0, 1.0, 0.1
    return flight


@pytest.mark.parametrize(
    ("leg", "memory", "said"),
    [
        ({}, {}, "3.5 m left to 4.5 m, limit in 110 s"),
        ({ctl.LEG_HOLD: 30.0}, {ctl.REACHED: 105.0}, "25 s of hold left, limit in 110 s"),
        ({ctl.LEG_DURATION: 40.0}, {}, "30 s left"),
        ({ctl.LEG_DURATION: 5.0}, {}, "0 s left"),
        ({ctl.LEG_TURNED: 6.2831853}, {ctl.TURNED: -1.5707963}, "270 deg of turn left, limit in 110 s"),
        ({}, {ctl.MODE: ctl.WAITING}, "waiting for the sensors"),
        ({}, {ctl.MODE: ctl.COMPLETED}, "mission completed, surfacing"),
        ({}, {ctl.MODE: ctl.ABORTED, ctl.REASON: ctl.REASON_BEACON}, "given up (no depth), surfacing"),
    ],
)
def test_what_is_left_of_a_leg_in_its_own_measure(flying, leg, memory, said):
    autopilot = flying.autopilot
    autopilot.legs[0, ctl.LEG_DEPTH], autopilot.legs[0, ctl.LEG_TIME_LIMIT] = 4.5, 120.0
    for place, value in leg.items():
        autopilot.legs[0, place] = value
    for place, value in memory.items():
        autopilot.ap[place] = value
    assert display.left_of_leg(flying, 110.0) == said
    assert display.status(flying, 110.0, 10.0).endswith(said)


def test_a_new_leg_and_every_ten_seconds_have_a_line(flying, capfd):
    shown = display.Display(flying)
    for t in range(26):
        flying.autopilot.ap[ctl.LEG] = float(t >= 13)
        shown.second(100.0 + t)
    lines = [re.match(r" *(\d+) s .*  leg (\d)", line).groups() for line in capfd.readouterr().err.splitlines()]
    assert lines == [("0", "1"), ("10", "1"), ("13", "2"), ("23", "2")]


def test_a_late_tick_gives_no_second_twice(flying, capfd):
    shown = display.Display(flying)
    for leg, t in enumerate((100.6, 101.0, 102.7, 103.0)):
        flying.autopilot.ap[ctl.LEG] = float(leg % 3)
        shown.second(t)
    assert [int(line.split()[0]) for line in capfd.readouterr().err.splitlines()] == [0, 1, 2, 3]


def test_who_does_not_read_holds_no_flight_up(flying, monkeypatch):
    reading, writing = os.pipe()
    try:
        monkeypatch.setattr(display, "STDERR", writing)
        shown, begin, written = display.Display(flying), time.monotonic(), 0
        for t in range(3000):
            flying.autopilot.ap[ctl.LEG] = float(t % 2)
            shown.second(float(t))
        assert time.monotonic() - begin < 10.0
        os.close(writing)
        writing = None
        while data := os.read(reading, 65_536):
            written += len(data)
        assert 30_000 < written < 100_000  # a pipe's fill, whole lines
        assert not display.write_at_once("to nobody\n")
    finally:
        os.close(reading)
        if writing is not None:
            os.close(writing)
