"""Faults on the wire: damaged frames, replies that answer something else, refusals, hostile bytes.

The real codecs, drivers and Modbus master, in simulated time. `disabled` gives them a decoder that does not look.
"""

import math
import random
from collections.abc import Callable
from pathlib import Path

from glider.hal.boardfile import BeaconTable, ImuTable
from glider.hal.drivers.modbus_sensors import Beacon
from glider.hal.drivers.vn100 import Vn100
from glider.hal.ports import Validity
from glider.hal.protocols import modbus, vn100
from glider.hal.protocols.registers import preset, to_registers
from glider.tools.verify.faults.cases import DAMAGE, SAFE, GroundOutcome, observed
from glider.tools.verify.faults.damaged_streams import codecs, run_codec
from glider.tools.verify.faults.wire import Stamped, WireLine, stamp_reply

RATE_HZ = 100.0


class UncheckedImu(vn100.Vn100Decoder):
    """Takes any check sum for right."""

    crc = staticmethod(lambda data, start: 0)


class UncheckedModbus(modbus.RtuDecoder):
    """Takes any check sum for right."""

    check_sum_holds = staticmethod(lambda frame: True)


class AnyFrame(modbus.RtuDecoder):
    """Takes whatever comes for the reply."""

    answers = staticmethod(lambda frame, request: True)

    def frame_size(self, buffer: bytes, at: int, end: int) -> int:
        return end - at if end - at > 6 else 0


def damaged_imu(disabled: bool, folder: Path) -> GroundOutcome:
    """A frame with flipped bits every eight seconds; with the sixth the device is in error, and none is delivered."""
    driver = Vn100(ImuTable(device="vn100", port="p"), 115_200)
    if disabled:
        driver.decoder = UncheckedImu()
    driver.attach(lambda data: True)
    driver.start(0.0)
    wrong, noticed = 0, None
    for n in range(1, int(60 * RATE_HZ)):
        now = n / RATE_HZ
        good = (0.0, -20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8)
        frame = bytearray(vn100.encode_binary(vn100.FLIGHT_MASK, n, *good))
        if n % 800 == 0:
            frame[20] ^= 0x40
        driver.feed(bytes(frame), now)
        wrong += driver.validity == Validity.VALID and abs(driver.values[1] - math.radians(-20.0)) > 1e-6
        if noticed is None and driver.validity == Validity.FAULT:
            noticed = now - 8.0
    return noticed, "device in error" if noticed else "none", DAMAGE if wrong else SAFE


def damaged_beacon(disabled: bool, folder: Path) -> GroundOutcome:
    """Modbus replies with a broken check sum, one in a hundred."""
    values = [*to_registers("f32", 1.2), *to_registers("f32", 18.0)]
    broken: list[float] = []  # when

    def slave(frame: bytes, number: int) -> bytes:
        count = frame[5]
        data = b"".join(word.to_bytes(2, "big") for word in values[:count])
        reply = modbus.with_check_sum(frame[:2] + bytes((2 * count,)) + data)
        if number % 100 == 0:
            broken.append(line.now)
            reply = reply[:4] + bytes((reply[4] ^ 0x10,)) + reply[5:]
        return reply

    decoder = UncheckedModbus if disabled else modbus.RtuDecoder
    line = WireLine(slave, lambda rng: 0.002, seed=7, decoder=decoder)
    beacon = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
    beacon.start(0.0)
    line.bus.add(beacon.poll)
    wrong, noticed = 0, None
    while line.now < 60.0 and noticed is None:
        line.run(line.now + 0.02)
        wrong += beacon.validity == Validity.VALID and abs(beacon.values[0] - 1.2e5) > 1.0
        if beacon.validity == Validity.FAULT and len(broken) >= 6:
            noticed = line.now - broken[0]
    return noticed, "device in error" if noticed else "none", DAMAGE if wrong else SAFE


def _late(rng: random.Random) -> float:
    luck = rng.random()
    if luck < 0.05:
        return math.inf
    return rng.uniform(0.03, 0.1) if luck < 0.15 else rng.uniform(0.001, 0.03)


def late_replies(disabled: bool, folder: Path) -> GroundOutcome:
    """20,000 exchanges, one in twenty lost and one in ten late; every reply carries its request's number."""
    forget_s, longest_s = (0.0, 0.0) if disabled else (0.5, 0.1)
    line = WireLine(stamp_reply, _late, seed=1, timeout_s=0.03, forget_s=forget_s, longest_s=longest_s)
    jobs = [Stamped(line, device, 0.02) for device in (1, 2, 3)]
    while line.requests < 20_000:
        line.run(line.now + 1.0)
    wrong = sum(job.misdelivered for job in jobs)
    seen = line.bus.counts.late > 0 and not wrong
    return 0.03 if seen else None, "never delivered" if not wrong else f"{wrong} delivered", DAMAGE if wrong else SAFE


def foreign_reply(change: Callable[[bytes], bytes]) -> Callable[[bool, Path], GroundOutcome]:
    """Replies in another's name, of another function, of another length."""

    def show(disabled: bool, folder: Path) -> GroundOutcome:
        decoder = AnyFrame if disabled else modbus.RtuDecoder
        line = WireLine(
            lambda frame, number: change(stamp_reply(frame, number)), lambda rng: 0.002, seed=2, decoder=decoder
        )
        job = Stamped(line, 1, 0.02, run_batch=3)
        line.run(2.0)
        counts = line.bus.counts
        if job.delivered:
            return None, f"{job.delivered} delivered", DAMAGE
        return line.bus.timeout_s if counts.timeouts else None, "never delivered", SAFE

    return show


def wrong_id(reply: bytes) -> bytes:
    return modbus.with_check_sum(b"\x09" + reply[1:-2])


def wrong_function(reply: bytes) -> bytes:
    return modbus.with_check_sum(reply[:1] + b"\x04" + reply[2:-2])


def wrong_length(reply: bytes) -> bytes:
    return modbus.with_check_sum(reply[:2] + bytes((reply[2] + 2,)) + reply[3:-2] + b"\0\0")


def exception(code: int) -> Callable[[bool, Path], GroundOutcome]:
    """The beacon answers every request with an exception."""

    def show(disabled: bool, folder: Path) -> GroundOutcome:
        line = WireLine(
            lambda frame, number: modbus.with_check_sum(bytes((frame[0], frame[1] | 0x80, code))), lambda rng: 0.002, 3
        )
        beacon = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
        beacon.start(0.0)
        line.bus.add(beacon.poll)
        if disabled:
            beacon.poll._in_error = None
        noticed = None
        while line.now < 5.0 and noticed is None:
            line.run(line.now + 0.01)
            noticed = line.now if beacon.validity == Validity.FAULT else None
        tries = line.bus.counts.exceptions
        asked = tries == 1 if code <= 3 else tries == 3
        return noticed, "device in error" if noticed and asked else f"{tries} tries", SAFE

    return show


def hostile_bytes(disabled: bool, folder: Path) -> GroundOutcome:
    """Damage through every codec: back in step within a longest frame, no exception, nothing made up, little kept."""
    bad, made_up = 0, 0
    chosen = codecs(UncheckedImu, UncheckedModbus) if disabled else codecs()
    for codec in chosen:
        outcome = run_codec(codec, 100_000, random.Random(f"31 {codec.name}"), lambda n: None)
        bad += not outcome.passed or outcome.most_kept > codec.longest
        if codec.name in ("vn100", "modbus expected reply"):
            decoder, rng = codec.make(), random.Random(31)
            made_up += sum(len(decoder.feed(rng.randbytes(512))) for _ in range(400))
    good = not bad and not made_up
    return observed(good, "back in step", f"{made_up} made up", end=DAMAGE, after=256 * 10 / 9600)
