"""The second writing of the frames: printed vectors, and byte for byte what the flight's own codecs make."""

import random

from hypothesis import given
from hypothesis import strategies as st

from glider.hal.outofband import wire
from glider.hal.outofband.plan import CODES, NumberPlan, PathPlan
from glider.hal.protocols import maestro, modbus
from glider.hal.protocols.registers import from_registers, to_registers

WORD = st.integers(0, 0xFFFF)
DEVICE = st.integers(1, 247)


def test_the_drives_printed_frames():
    """Recomputed vectors of the drive, the transmitter and the analog module."""
    words = [1, 0, 10_000, 0, 10_000, 10_000, 0, 16]  # as printed, a speed of 0 among them
    assert wire.write_many_frame(7, 0x6200, words) == bytes.fromhex(
        "0710620000081000010000271000002710271000000010" + "8D50"
    )
    assert wire.read_frame(1, 3, 0x1003, 1) == bytes.fromhex("01031003000170CA")
    assert wire.read_frame(1, 4, 0, 8) == bytes.fromhex("010400000008F1CC")
    assert wire.write_one_frame(1, 0x6002, 0x40) == bytes.fromhex("01066002004037FA")


@given(DEVICE, st.integers(0, 0xFF00), st.lists(WORD, min_size=1, max_size=100))
def test_modbus_frames_are_those_of_the_drivers(device, address, words):
    assert wire.write_many_frame(device, address, words) == modbus.write_many(device, address, words).frame
    assert wire.write_one_frame(device, address, words[0]) == modbus.write_one(device, address, words[0]).frame
    for function in (3, 4):
        count = len(words)
        assert wire.read_frame(device, function, address, count) == modbus.read(device, function, address, count).frame


@given(st.integers(0, 23), st.integers(0, 16383), st.none() | st.integers(0, 127), st.booleans())
def test_servo_frames_are_those_of_the_driver(channel, quarter, number, crc):
    assert wire.servo_frame(channel, quarter, number, crc) == maestro.set_target(
        channel, quarter, device=number, crc=crc
    )


def test_the_servos_printed_check_sum():
    assert wire.servo_frame(0, 6000, None, True) == bytes.fromhex("8400702E2B")


KINDS, STEPS = st.sampled_from(sorted(CODES)), st.sampled_from([1.0, 0.5, 4.0])


@given(KINDS, st.integers(-(1 << 33), 1 << 33), st.integers(0, 3), STEPS)
def test_numbers_are_those_of_the_drivers(kind, count, at, step):
    """Every type, past its ends too, written and read as the flight does."""
    number = NumberPlan(at, kind, step)
    words = wire.words_of(number, count)
    assert words == to_registers(kind, count / step)
    registers = [7] * at + words + [7]
    assert wire.number_of(number, registers) == from_registers(kind, registers, at) * step


def test_a_path_is_written_as_its_map_says():
    numbers = {name: NumberPlan(at, kind, 1.0) for name, at, kind in (
        ("position", 0, "i32"), ("speed", 2, "u32"), ("acceleration", 4, "u16"), ("deceleration", 5, "i16"),
        ("pause", 6, "u32"), ("trigger", 8, "u16"), ("mode", 9, "u16"),
    )}  # fmt: skip
    path = PathPlan(0x100, 10, **numbers)
    words = wire.path_words(path, absolute=1, counts=-70_000, rpm=60, ramp_ms=100, trigger=16)
    assert words == [0xFFFE, 0xEE90, 0, 60, 100, 100, 0, 0, 16, 1]


@given(DEVICE, st.lists(WORD, min_size=1, max_size=8))
def test_a_reply_counts_only_if_it_is_just_that_reply(device, words):
    body = bytes((device, 3, 2 * len(words))) + b"".join(word.to_bytes(2, "big") for word in words)
    reply = body + wire.crc16(body).to_bytes(2, "little")
    assert wire.registers_of(reply, device, 3, len(words)) == words
    assert wire.registers_of(reply, device % 247 + 1, 3, len(words)) is None
    assert wire.registers_of(reply, device, 4, len(words)) is None
    assert wire.registers_of(reply[:-1], device, 3, len(words)) is None
    rng = random.Random(len(words))
    for _ in range(20):
        wrong = bytearray(reply)
        wrong[rng.randrange(len(wrong))] ^= 1 << rng.randrange(8)
        assert wire.registers_of(bytes(wrong), device, 3, len(words)) is None
