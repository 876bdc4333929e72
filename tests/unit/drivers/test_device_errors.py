"""When a device counts as in error: too many damaged frames in a minute, refusals for good, and how that passes."""

import pytest

from glider.hal.boardfile import BeaconTable, DriveTable, ServoTable
from glider.hal.drivers.drive import Drive
from glider.hal.drivers.maestro import Servo
from glider.hal.drivers.modbus_sensors import Beacon
from glider.hal.drivers.poll import TRIES
from glider.hal.drivers.samples import DAMAGES, Sensor
from glider.hal.ports import SLOTS, Condition, Validity, empty_frame
from glider.hal.protocols import maestro, modbus
from glider.hal.protocols.modbus_master import Failure
from glider.hal.protocols.registers import preset, to_registers
from glider.tools.verify.faults.wire import WireLine


def sensor() -> Sensor:
    found = Sensor("slider_wire", SLOTS["slider_wire"], 0.04, ((-0.1, 0.1),))
    found.start(0.0)
    return found


def test_a_few_damaged_frames_are_counted_and_no_more():
    item = sensor()
    for n in range(DAMAGES):
        item.damage(1.0 + n)
    assert item.accept(10.0, (0.01,), 10.0)
    assert (item.validity, item.health.damaged) == (Validity.VALID, DAMAGES)


def test_more_than_five_in_a_minute_are_an_error_until_there_are_fewer():
    item = sensor()
    item.accept(0.5, (0.01,), 0.5)
    for n in range(DAMAGES + 1):
        item.damage(1.0 + 10.0 * n)
    assert item.validity == Validity.FAULT
    assert "damaged frames" in item.health.error
    assert not item.accept(55.0, (0.01,), 55.0)
    assert item.validity == Validity.FAULT
    assert item.accept(61.5, (0.01,), 61.5)
    assert (item.validity, item.health.error) == (Validity.VALID, "")


def test_a_burst_counts_frame_by_frame():
    item = sensor()
    item.damage(1.0, frames=50)
    assert (item.validity, item.health.damaged) == (Validity.FAULT, 50)


def beacon_on(reply):
    line = WireLine(reply, lambda rng: 0.002, seed=1)
    item = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
    item.start(0.0)
    line.bus.add(item.poll)
    return line, item


def good(frame: bytes, number: int) -> bytes:
    words = [*to_registers("f32", 1.2), *to_registers("f32", 18.0)][: frame[5]]
    data = b"".join(word.to_bytes(2, "big") for word in words)
    return modbus.with_check_sum(frame[:2] + bytes((len(data),)) + data)


def refuses(code: int, first: int, last: int):
    def reply(frame: bytes, number: int) -> bytes:
        if first <= number <= last:
            return modbus.with_check_sum(bytes((frame[0], frame[1] | 0x80, code)))
        return good(frame, number)

    return reply


@pytest.mark.parametrize("code", [1, 2, 3])
def test_a_refusal_for_good_is_an_error_at_once_and_an_answer_ends_it(code):
    line, item = beacon_on(refuses(code, 5, 5))
    while line.bus.counts.exceptions == 0:
        line.run(line.now + 0.01)
    assert item.validity == Validity.FAULT
    line.run(line.now + 2.0)
    assert item.validity == Validity.VALID


@pytest.mark.parametrize("code", [4, 5, 6])
def test_other_exceptions_have_three_tries(code):
    line, item = beacon_on(refuses(code, 5, 4 + TRIES - 1))
    line.run(2.0)
    assert item.validity == Validity.VALID
    assert "VALID" not in item.health.error
    line, item = beacon_on(refuses(code, 5, 4 + TRIES))
    while line.bus.counts.exceptions < TRIES:
        line.run(line.now + 0.01)
    assert item.validity == Validity.FAULT
    assert f"exception {code}" in item.health.error


def test_a_damaged_reply_is_told_from_silence():
    seen = []
    line = WireLine(lambda frame, number: good(frame, number)[:-1] + b"\x00", lambda rng: 0.002, seed=1)

    class Job:
        device, due = 1, 0.0

        def requests(self, now):
            self.due = now + 0.5
            return (modbus.read(1, 3, 0x0100, 4),)

        def answered(self, *answer):
            raise AssertionError

        def failed(self, request, failure, exception, now):
            seen.append(failure)

    line.bus.add(Job())
    line.run(0.6)
    assert seen[0] is Failure.DAMAGED


# --- what actuators say of themselves -------------------------------------------------------------------------------
def drive() -> Drive:
    table = DriveTable(
        device="leadshine-cs2rs", port="p", id=7, counts_per_m=2e6, limits_m=(-0.06, 0.06), speed_m_s=0.03
    )
    return Drive("slider", table, preset("leadshine-cs2rs"), 1.0, (-0.06, 0.06), None)


def state(item) -> tuple[float, float, float]:
    frame = empty_frame()
    item.read(frame[SLOTS[item.name].all])
    return tuple(frame[SLOTS[item.name].all])


def test_a_drive_says_when_it_answered_and_how_it_does():
    item = drive()
    assert state(item)[1] == Validity.MISSING
    item.start(10.0)
    assert state(item) == (0.0, Validity.VALID, Condition.WELL)
    item._took_position(None, [0, 0], 12.0, 12.01)
    assert state(item)[0] == pytest.approx(2.01)
    item._took_status(None, [1], 12.0, 12.0)
    item._took_position(None, [0, 0], 12.1, 12.1)
    assert state(item)[2] == Condition.ALARM
    item._mover.clears = 1
    item._mover.clear_wanted = False
    item._took_status(None, [1], 12.2, 12.2)
    assert state(item)[2] == Condition.ALARM_KEPT
    item.reset()
    item._took_status(None, [0], 12.3, 12.3)
    item._took_position(None, [0, 0], 12.3, 12.3)
    assert state(item)[2] == Condition.WELL
    item.refused(12.4, "exception 2 (illegal address)")
    assert state(item)[2] == Condition.MISCONFIGURED


def test_a_servo_says_when_it_answered():
    table = ServoTable(
        device="maestro", port="p", channel=0, us_per_rad=600.0, zero_us=1500.0, limits_us=(1000.0, 2000.0)
    )
    servo = Servo(table, (-1.0, 1.0))
    servo.attach(lambda data: True)
    servo.start(5.0)
    servo.connected(5.0)
    servo.service(6.0)
    servo.replies.expect(maestro.GET_ERRORS)
    servo.feed(b"\x00\x00", 6.05)
    assert state(servo) == (pytest.approx(1.05), Validity.VALID, Condition.WELL)


def test_damage_that_somebody_has_looked_at_is_forgotten():
    item = sensor()
    item.damage(1.0, DAMAGES + 1)
    assert not item.accept(2.0, (0.01,), 2.0) or item.validity == Validity.FAULT
    item.reset_damage_count()
    assert item.accept(3.0, (0.01,), 3.0)
    assert item.validity == Validity.VALID
