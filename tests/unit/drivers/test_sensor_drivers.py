"""Sensors: what makes a sample fit, how it grows old, calibration, mounting."""

import math

import numpy as np
import pytest

from glider.hal.boardfile import ImuTable, WireTable
from glider.hal.drivers.count import unwrap_low_word
from glider.hal.drivers.modbus_sensors import wire
from glider.hal.drivers.samples import FAULTY_AFTER, Sensor
from glider.hal.drivers.vn100 import Vn100, euler, rotation
from glider.hal.ports import SLOTS, Validity, empty_frame
from glider.hal.protocols import vn100


def sensor():
    found = Sensor("slider_wire", SLOTS["slider_wire"], 0.04, ((-0.1, 0.1),))
    found.start(100.0)
    return found


def test_a_sample_has_the_boards_time():
    item, frame = sensor(), empty_frame()
    item.accept(100.5, (0.02,), 100.51)
    item.read(frame[SLOTS["slider_wire"].all])
    assert frame[SLOTS["slider_wire"].all].tolist() == [0.5, Validity.VALID, 0.02]


def test_samples_before_the_start_or_running_back_are_not_taken():
    item = sensor()
    item.accept(99.0, (0.02,), 100.0)
    assert item.validity == Validity.MISSING
    item.accept(100.5, (0.02,), 100.5)
    item.accept(100.4, (0.03,), 100.6)
    assert item.values == (0.02,)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 0.2, -0.2])
def test_an_unfit_sample_is_rejected_and_five_running_are_a_fault(bad):
    item = sensor()
    item.accept(100.1, (0.02,), 100.1)
    for i in range(FAULTY_AFTER):
        assert item.validity == Validity.VALID
        assert item.values == (0.02,)
        assert not item.accept(100.2 + 0.1 * i, (bad,), 100.2 + 0.1 * i)
    assert item.validity == Validity.FAULT
    assert item.health.unfit == FAULTY_AFTER
    assert item.accept(101.0, (0.03,), 101.0)
    assert item.validity == Validity.VALID
    assert item.health.error == ""


def test_a_sample_grows_stale_after_three_periods():
    item = sensor()
    item.accept(100.1, (0.02,), 100.1)
    item.age(100.1 + 0.119)
    assert item.validity == Validity.VALID
    item.age(100.1 + 0.121)
    assert item.validity == Validity.STALE
    assert "no sample" in item.health.error


@pytest.mark.parametrize("per_m", [80_000.0, -80_000.0])
def test_a_wires_sign_is_its_direction(per_m):
    item = wire("slider_wire", WireTable(device="waveshare-8ai", port="p", per_m=per_m, zero=12_000.0))
    item.take(13_600.0, 1.0, 1.0)
    assert item.values[0] == pytest.approx(math.copysign(0.02, per_m))


def test_a_broken_wire_is_no_sample():
    table = WireTable(device="waveshare-8ai", port="p", per_m=80_000.0, zero=12_000.0, broken_below=3800.0)
    item = wire("slider_wire", table)
    item.take(0.0, 1.0, 1.0)
    assert item.validity == Validity.MISSING
    assert item.health.unfit == 1


@pytest.mark.parametrize(
    ("low", "last", "found"), [(5, 0, 5), (0xFFFF, 0, -1), (0, 65_535, 65_536), (10, -65_530, -65_526)]
)
def test_a_low_word_is_the_nearest_count(low, last, found):
    assert unwrap_low_word(low, last) == found


def feed_imu(imu, roll, pitch, yaw, rates=(0.0, 0.0, 0.0), now=1.0):
    degrees = [math.degrees(angle) for angle in (yaw, pitch, roll)]
    imu.feed(vn100.encode_binary(vn100.FLIGHT_MASK, 1, *degrees, *rates, 0.0, 0.0, -9.8), now)


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (3.0, -4.0, 0.0), (180.0, 0.0, 90.0), (-90.0, 10.0, 170.0)])
def test_the_hulls_attitude_and_rates_do_not_depend_on_how_the_imu_is_mounted(mount):
    imu = Vn100(ImuTable(device="vn100", port="p", mount_deg=mount), 115_200)
    hull, rates = (0.3, -0.4, 1.2), np.array([0.1, -0.2, 0.3])
    R_bd = rotation(*(math.radians(angle) for angle in mount))
    feed_imu(imu, *euler(rotation(*hull) @ R_bd), tuple(R_bd.T @ rates))
    assert imu.values[:3] == pytest.approx(hull, abs=1e-5)
    assert imu.values[3:] == pytest.approx(rates, abs=1e-6)


def test_imu_time_is_arrival_less_the_line():
    imu = Vn100(ImuTable(device="vn100", port="p", delay_s=0.001), 115_200)
    imu.start(0.0)
    feed_imu(imu, 0.0, 0.0, 0.0, now=5.0)
    assert imu.time == pytest.approx(5.0 - 0.001 - 50 * 10 / 115_200)


def test_a_silent_imu_is_set_up_again_and_again():
    imu, sent = Vn100(ImuTable(device="vn100", port="p"), 115_200), []
    imu.attach(lambda data: sent.append(data) or True)
    imu.connected(0.0)
    for tenth in range(35):
        imu.service(0.1 * tenth)
    assert len(sent) == 4
    assert b"$VNWRG,75,2,8,01,0129*75\r\n" in sent[0]


def test_an_imu_that_streams_is_asked_for_its_model_until_it_says_it():
    imu, sent = Vn100(ImuTable(device="vn100", port="p"), 115_200), []
    imu.attach(lambda data: sent.append(data) or True)
    imu.connected(0.0)

    def second(begin: float) -> None:
        for tenth in range(10):
            feed_imu(imu, 0.0, 0.0, 0.0, now=begin + 0.1 * tenth)
            assert imu.service(begin + 0.1 * tenth) > begin + 0.1 * tenth

    second(0.0)  # it streams already
    second(1.0)  # its answer was damaged on the line
    assert sent == [vn100.encode_text("VNRRG,01")] * 2
    imu.feed(vn100.encode_text("VNRRG,01,VN-100T-CR"), 2.0)
    second(2.0)
    assert imu.model == "VN-100T-CR"
    assert len(sent) == 2


def test_text_output_is_taken_too():
    imu = Vn100(ImuTable(device="vn100", port="p"), 115_200)
    text = "VNYMR,+090.000,+010.000,-005.000,+0.2,+0.0,+0.4,+0.0,+0.0,-9.8,+0.10,-0.20,+0.30"
    imu.feed(vn100.encode_text(text), 1.0)
    assert imu.values == pytest.approx([math.radians(a) for a in (-5.0, 10.0, 90.0)] + [0.1, -0.2, 0.3])
