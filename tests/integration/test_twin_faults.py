"""Faults on demand: what the drivers make of silence, lateness, damage, noise and unplugging, and that it passes."""

import time

import pytest

from glider.hal.board import BoardRequest, board_builder
from glider.hal.drivers.samples import Sensor
from glider.hal.ports import BoardError, Validity
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle

pytestmark = pytest.mark.realtime

FILE = load_board_file("twin")
REQUEST = BoardRequest(text=FILE.text, source=FILE.source, vehicle=load_vehicle("roughie"), site_depth=5.0)


@pytest.fixture(scope="module")
def board():
    board = board_builder("twin")(REQUEST)
    board.open()
    yield board
    board.close()


def serve(board, seconds):
    """As between two ticks, again and again."""
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        board.serve(now + 0.02)


def until(board, condition, seconds=10.0):
    """Serve until the condition holds; False if it does not in time (ample: the machine may be busy)."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        serve(board, 0.02)
    return True


def well(board, name):
    return not any(line.startswith(f"{name} ") for line in board.silent())


@pytest.fixture
def fault(board):
    """fault(device, kind): a fault that is over, and the board well again, when the test ends."""
    broken = []

    def begin(device, kind):
        broken.append(device)
        assert board.control(f"fault {device} {kind}") == "ok"

    yield begin
    for device in broken:
        assert board.control(f"fault {device} none") == "ok"
        if isinstance(sensor := getattr(board, device), Sensor):
            serve(board, 0.3)  # what was on the line has been read
            sensor.reset_damage_count()
        assert until(board, lambda name=device: well(board, name)), board.silent()


@pytest.mark.parametrize("kind", ["silent", "bad_crc", "nan", "babble", "unplug"])
def test_imu_faults_are_seen_at_once(board, fault, kind):
    assert until(board, lambda: board.imu.validity == Validity.VALID)  # it was set up before it fell silent
    samples = board.beacon.health.samples
    fault("imu", kind)
    assert until(board, lambda: board.imu.validity in (Validity.STALE, Validity.FAULT), 1.0)
    assert board.imu.health.error
    assert until(board, lambda: board.beacon.health.samples - samples > 5)  # the others go on


BEACON_FAULTS = ("silent", "wrong_id", "bad_crc", "nan", "exception 4", "exception 2", "babble", "unplug")


@pytest.mark.parametrize("kind", BEACON_FAULTS)
def test_beacon_faults_are_seen_at_once(board, fault, kind):
    samples = board.imu.health.samples
    fault("beacon", kind)
    assert until(board, lambda: board.beacon.validity in (Validity.STALE, Validity.FAULT), 1.5)
    assert until(board, lambda: board.imu.health.samples - samples > 5)


def test_a_late_beacon_gives_no_sample_and_others_on_its_line_go_on(board, fault):
    bus = board.buses[board.file.beacon.port]
    late, wires = bus.counts.late, board.slider_wire.health.samples
    fault("beacon", "late 0.08")
    assert until(board, lambda: board.beacon.validity == Validity.STALE, 2.0)
    assert until(board, lambda: bus.counts.late > late)
    assert until(board, lambda: board.slider_wire.health.samples - wires > 10)


def test_noise_around_replies_is_skipped(board, fault):
    fault("beacon", "noise 1.0")
    samples = board.beacon.health.samples
    assert until(board, lambda: board.beacon.health.samples - samples > 10)


def test_a_stuck_sensor_repeats_itself(board, fault):
    fault("beacon", "stuck")
    serve(board, 0.2)
    seen = set()
    for _ in range(10):
        serve(board, 0.05)
        seen.add(board.beacon.values[0])
    assert len(seen) == 1


def test_a_broken_wire_is_a_fault(board, fault):
    fault("slider_wire", "nan")
    assert until(board, lambda: board.slider_wire.validity == Validity.FAULT, 3.0)


LOST_ACTUATORS = [("servo", "silent"), ("servo", "unplug"), ("slider", "silent"), ("ballast", "unplug")]


@pytest.mark.parametrize(("device", "kind"), LOST_ACTUATORS)
def test_a_lost_actuator_is_seen(board, fault, device, kind):
    fault(device, kind)
    assert until(board, lambda: board.health()[device]["error"] != "", 3.0)


def test_a_jammed_slider_is_tried_twice_more_and_then_left_alone(board, fault):
    fault("slider", "stuck")
    board.slider.command(0.02)
    assert until(board, lambda: board.slider.fault == "stalled", 20.0)
    assert board.slider.stalls == 3
    board.slider.command(0.0)
    board.slider.reset()


def test_a_drive_alarm_is_cleared_once_and_the_second_stays(board, fault):
    board.control("alarm slider 5")
    assert until(board, lambda: board.slider.status & 1 == 0 and board.slider._mover.clears == 1, 5.0)
    board.control("alarm slider 5")
    assert until(board, lambda: board.slider.fault == "drive alarm", 5.0)
    board.slider.reset()
    assert until(board, lambda: board.slider.status & 1 == 0, 5.0)


def test_leak_and_battery(board):
    board.control("leak 1")
    assert until(board, lambda: board.leak.values == (1.0,))
    board.control("leak 0")
    assert until(board, lambda: board.leak.values == (0.0,))
    board.control("battery 11.5")
    assert until(board, lambda: abs(board.battery.values[0] - 11.5) < 0.01)


def test_a_port_has_one_owner(board):
    from glider.hal.transport.port import Busy, SerialPort

    path = board.links["imu"].port.path
    with pytest.raises(Busy, match="another program"):
        SerialPort(path, 115_200).open()


def test_twins_say_what_they_do_not_understand(board):
    assert board.control("fault beacon nonsense").startswith("error: no fault 'nonsense'")
    assert board.control("fault rudder silent").startswith("error: no device 'rudder'")
    assert board.control("fault beacon late").startswith("error: 'late' ")
    assert board.control("dance").startswith("error: ")


def test_a_board_with_a_silent_device_does_not_open_and_says_which(monkeypatch):
    broken = board_builder("twin")(REQUEST)
    connect = broken.connect

    def connect_and_break():
        connect()
        broken.control("fault beacon silent")

    monkeypatch.setattr(broken, "connect", connect_and_break)
    monkeypatch.setattr("glider.hal.devices.FIRST_ANSWER_S", 0.5)
    with pytest.raises(BoardError, match=r"^beacon \(keller-33x, port sensors, id 1\): "):
        broken.open()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("per_m = 80000.0", "per_m = -80000.0", "calibration: "),
        ("calibration = ", 'calibration = ""  # ', "never calibrated"),
    ],
)
def test_a_board_whose_calibration_was_changed_does_not_arm(old, new, said):
    request = BoardRequest(text=FILE.text.replace(old, new), source=FILE.source, vehicle=REQUEST.vehicle)
    changed = board_builder("twin")(request)
    with pytest.raises(BoardError, match=said):
        changed.open()
    changed.close()
