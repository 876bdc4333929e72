"""The second writing of the frames: printed vectors, and byte for byte what the flight's own codecs make."""

import random

from hypothesis import given
from hypothesis import strategies as st

from hal.outofband import wire
from hal.protocols import maestro, modbus
from hal.protocols.registers import to_registers

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


@given(st.integers(-(1 << 31), (1 << 31) - 1))
def test_positions_are_high_word_first(counts):
    assert wire.path_words(1, counts, 60, 100, 16)[1:3] == to_registers("i32", counts)


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
