"""The drive: stalls and wrong ways are seen, limits hold, the wire carries the zero along."""

import math

import pytest

from glider.hal.boardfile import DriveTable
from glider.hal.drivers.drive import Drive, StallDetector
from glider.hal.drivers.maestro import Servo
from glider.hal.drivers.samples import Sensor
from glider.hal.ports import SLOTS
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus_master import ModbusBus
from glider.hal.protocols.registers import preset, to_registers

SERVO = {"device": "maestro", "port": "p", "channel": 0, "us_per_rad": 600.0, "zero_us": 1500.0}


def drive(follow="drive", counts_per_m=2e6, **more):
    table = DriveTable(
        device="leadshine-cs2rs", port="p", id=7, counts_per_m=counts_per_m, limits_m=(-0.05, 0.06), speed_m_s=0.03,
        follow=follow, **more,
    )  # fmt: skip
    wire = Sensor("slider_wire", SLOTS["slider_wire"], 0.04, ((-0.1, 0.1),))
    return Drive("slider", table, preset("leadshine-cs2rs"), 1.0, (-0.06, 0.04), wire), wire


def move(watch, places, target, step=0.1):
    return [verdict for i, place in enumerate(places) if (verdict := watch.look(target, place, step * i))]


def test_a_move_that_shows_is_no_stall():
    assert move(StallDetector(0.002, 1.0), [0.001 * i for i in range(51)], 0.05) == []


def test_standing_at_the_target_is_no_stall():
    assert move(StallDetector(0.002, 1.0), [0.0195] * 100, 0.02) == []


def test_standing_away_from_the_target_is_a_stall_after_the_patience():
    verdicts = move(StallDetector(0.002, 1.0), [0.0] * 12, 0.02)
    assert verdicts == ["stalled"]


def test_creeping_is_a_stall():
    assert "stalled" in move(StallDetector(0.002, 1.0), [0.00002 * i for i in range(30)], 0.02)


def test_the_wrong_way_is_seen_as_soon_as_it_shows():
    verdicts = move(StallDetector(0.002, 1.0), [0.0, -0.001, -0.0025], 0.02)
    assert ["wrong way" in one for one in verdicts] == [True]


def compare(watch, ways):
    return [verdict for counted, wire in ways if (verdict := watch.compare(counted, wire))]


def test_a_wire_that_goes_along_is_well_wherever_its_zero_is():
    assert compare(StallDetector(0.002, 1.0), [(0.0005 * i, 0.03 + 0.00045 * i) for i in range(100)]) == []


def test_a_wire_may_lag():
    there = [0.0005 * i for i in range(60)]
    places = [*there, *reversed(there)]
    lagging = [places[max(i - 2, 0)] for i in range(len(places))]
    assert compare(StallDetector(0.002, 1.0), list(zip(places, lagging, strict=True))) == []


def test_a_wire_that_stands_while_the_drive_counts_is_a_stall():
    assert compare(StallDetector(0.002, 1.0), [(0.0005 * i, 0.01) for i in range(10)]) == ["stalled"]


def test_a_wire_that_goes_the_other_way_is_seen_within_twice_the_least_way():
    verdicts = compare(StallDetector(0.002, 1.0), [(0.0005 * i, -0.0005 * i) for i in range(10)])
    assert ["wrong way" in one for one in verdicts] == [True]


def test_limits_are_the_tighter_of_file_and_vehicle():
    item, _ = drive()
    assert item.limits == (-0.05, 0.04)
    assert item.command(1.0) == 0.04
    assert item.command(-1.0) == -0.05
    assert item.command(math.nan) == -0.05
    assert item.target == -0.05


@pytest.mark.parametrize("counts_per_m", [2e6, -2e6])
def test_no_count_past_the_files_limits_is_ever_asked_for(counts_per_m):
    item, _ = drive(counts_per_m=counts_per_m)
    for metres in (-10.0, 10.0):
        assert item.counts_for(metres) / counts_per_m == pytest.approx(-0.05 if metres < 0 else 0.06)


def test_nothing_is_written_before_enable_or_without_a_command():
    item, _ = drive()
    item._took_position(None, [0, 0], 1.0, 1.0)
    assert item._mover.due == math.inf
    item.command(0.01)
    assert item._mover.due == math.inf
    item.enabled = True
    assert item._mover.due < math.inf
    item.stop()
    (stop, other) = item._mover.requests(2.0)
    assert stop.frame.hex(" ") == "07 06 60 02 00 40 37 9c"
    assert other.function == 16


def test_the_wire_carries_the_zero_along():
    """The drive has lost 3 mm: with follow = "wire" its counts are corrected, while its own position was wrong."""
    item, wire = drive(follow="wire")
    for i in range(100):
        wire.accept(1.0 + 0.04 * i, (0.007,), 1.0 + 0.04 * i)
        item._took_position(None, [0, 20_000], 1.0 + 0.04 * i, 1.0 + 0.04 * i)
    assert item.position() == pytest.approx(0.007, abs=1e-6)
    assert item.counts_for(0.007) == pytest.approx(20_000, abs=1)


def test_without_a_good_wire_the_drive_counts_on():
    item, _ = drive(follow="wire")
    item._took_position(None, [0xFFFF, 0xFFFF - 19_999], 1.0, 1.0)
    assert item.counts == -20_000
    assert item.measured() == pytest.approx(-0.01)


def test_servo_pulses_stay_within_the_files_limits():
    from glider.hal.boardfile import ServoTable

    servo = Servo(ServoTable(limits_us=(1000.0, 2100.0), **SERVO), (-1.0472, 1.0472))
    assert servo.limits == pytest.approx((-500 / 600, 1.0))
    assert servo.command(5.0) == pytest.approx(1.0)
    assert servo.quarter_us(5.0) == 4 * 2100
    assert servo.command(math.nan) == pytest.approx(1.0)


def test_the_servo_sends_nothing_before_enable_and_repeats_itself_after():
    from glider.hal.boardfile import ServoTable

    servo, sent = Servo(ServoTable(limits_us=(1000.0, 2100.0), **SERVO), (-1.0, 1.0)), []
    servo.attach(lambda data: sent.append(data) or True)
    servo.connected(0.0)
    servo.command(0.1)
    servo.service(0.0)
    assert [data[0] for data in sent] == [0xA1]
    servo.enabled = True
    for i in range(100):
        servo.service(0.01 * i)
    assert 8 <= sum(data[0] == 0x84 for data in sent) <= 12
    servo.stop()
    before = len(sent)
    servo.service(1.0)
    assert all(data[0] == 0xA1 for data in sent[before:])


# --- what was written, and may not have arrived ---------------------------------------------------------------------
class Line:
    """A bus whose requests are kept; a reply to the last is fed by hand."""

    def __init__(self, item):
        self.bus, self.sent, self.now = ModbusBus(115_200, timeout_s=0.05, longest_s=0.1), [], 0.0
        self.bus.attach(lambda data: self.sent.append(data) or True)
        self.bus.connected(0.0)
        self.item = item
        item.enabled = True
        self.bus.add(item._mover)

    def wait(self, seconds):
        """Let time pass; what was sent in it."""
        before, end = len(self.sent), self.now + seconds
        while self.now < end:
            self.now += 0.001
            self.bus.service(self.now)
        return self.sent[before:]

    def stands(self, counts):
        """The drive's position, as its poll takes it."""
        words = to_registers("i32", counts)
        self.item._took_position(self.item._position._variants[0], words, self.now, self.now)

    def echo(self):
        """The last request has arrived."""
        self.bus.feed(modbus.with_check_sum(self.sent[-1][:6]), self.now)


@pytest.fixture
def line():
    item, _ = drive()
    line = Line(item)
    line.stands(0)
    item.command(0.01)
    assert line.wait(0.15)
    line.echo()
    assert line.wait(0.2) == []  # it was written, and nothing is left to write
    return line


def lose_the_line(line):
    line.bus.lost(line.now)
    line.bus.connected(line.now)


def refuse(line):
    sent = line.sent[-1]
    line.bus.feed(modbus.with_check_sum(bytes((sent[0], sent[1] | 0x80, 4))), line.now)


@pytest.mark.parametrize(
    "fail", [lose_the_line, refuse, lambda line: line.wait(0.1)], ids=["lost", "refused", "silent"]
)
def test_a_path_that_may_have_arrived_does_not_hide_the_next(line, fail):
    """Sent to 40 mm, no echo, and back to 10 mm, which is what was written before: the drive may be on its way to
    40 mm, so that the path to 10 mm is written again."""
    line.item.command(0.04)
    while not (sent := line.wait(0.001)):
        pass
    assert len(sent) == 1
    line.item.command(0.01)
    fail(line)
    (path, *_) = [frame for frame in line.wait(1.0) if frame[1] == modbus.WRITE_MANY]
    begin = 7 + 2 * (0x6201 - int.from_bytes(path[2:4], "big"))  # the path with its mode, or without
    assert int.from_bytes(path[begin : begin + 4], "big") == 20_000


def test_a_drive_that_was_silent_is_written_to_again(line):
    """It may have been without power: what it was told is gone with it."""
    line.now += 5.0
    line.stands(0)
    assert [frame[1] for frame in line.wait(0.2)][:1] == [modbus.WRITE_MANY]
