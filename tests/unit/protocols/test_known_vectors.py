"""Frames printed in manuals, recomputed; two of them through pymodbus, which is not ours."""

from binascii import crc_hqx

import pytest

from glider.hal.protocols import maestro, modbus, vn100
from glider.hal.protocols.registers import from_registers, preset, presets, to_registers, value_of
from glider.hal.strict import ConfigError

DRIVE = preset("leadshine-cs2rs")


@pytest.mark.parametrize(("body", "check"), [("VNWRG,75,2,8,01,0129", "75"), ("VNWRG,06,14", "59"), ("VNRRG,01", "72")])
def test_vn100_commands(body, check):
    assert vn100.encode_text(body) == f"${body}*{check}\r\n".encode()


def test_vn100_rate_command_asks_for_what_the_driver_decodes():
    assert vn100.FLIGHT_MASK == 0x0129
    assert vn100.payload_size(0x0129) == 8 + 12 + 12 + 12


def test_crc_over_data_and_crc_is_zero():
    frame = vn100.encode_binary(vn100.FLIGHT_MASK, 1, *(0.5 * i for i in range(9)))
    assert frame[0] == 0xFA
    assert crc_hqx(frame[1:], 0) == 0


@pytest.mark.parametrize(("data", "crc"), [("84 00 70 2E", 0x2B), ("83 01", 0x17)])
def test_maestro_crc7(data, crc):
    assert maestro.crc7(bytes.fromhex(data)) == crc


def test_maestro_1500_us_on_channel_0():
    assert maestro.set_target(0, 6000) == bytes.fromhex("84 00 70 2E")
    assert maestro.set_target(0, 6000, crc=True) == bytes.fromhex("84 00 70 2E 2B")
    assert maestro.set_target(0, 6000, device=12) == bytes.fromhex("AA 0C 04 00 70 2E")
    assert maestro.encode(maestro.GET_ERRORS) == b"\xa1"
    assert maestro.encode(maestro.GO_HOME) == b"\xa2"


PATH = [1, *to_registers("i32", 10_000), 0, 10_000, 10_000, 0, 0x10]


@pytest.mark.parametrize(
    ("request_", "frame", "reply_size"),
    [
        (preset("keller-33x").read(1, "all"), "01 03 01 00 00 04 45 F5", 13),
        (preset("keller-33x").read(1, "pressure_old"), "01 03 00 02 00 02 65 CB", 9),
        (preset("waveshare-8ai").read(1, "all"), "01 04 00 00 00 08 F1 CC", 21),
        (DRIVE.read(1, "status"), "01 03 10 03 00 01 70 CA", 7),
        (modbus.write_one(1, DRIVE.word["control"], DRIVE.command["quick_stop"]), "01 06 60 02 00 40 37 FA", 8),
        (
            modbus.write_many(7, DRIVE.block["path"].address, [1, 0, 10_000, 0, 10_000, 10_000, 0, 0x10]),
            "07 10 62 00 00 08 10 00 01 00 00 27 10 00 00 27 10 27 10 00 00 00 10 8D 50",
            8,
        ),
    ],
    ids=["pressure and temperature", "pressure", "analog", "status", "stop", "path"],
)
def test_modbus_requests(request_, frame, reply_size):
    assert request_.frame == bytes.fromhex(frame)
    assert request_.reply_size == reply_size


def test_the_drives_reply_to_a_path_is_taken():
    decoder = modbus.RtuDecoder()
    decoder.expect(modbus.write_many(7, 0x6200, PATH))
    (frame,) = decoder.feed(bytes.fromhex("07 10 62 00 00 08 DE 11"))
    assert (frame.device, frame.function, frame.exception) == (7, 16, 0)


def test_floats_stand_high_word_first():
    block = preset("keller-33x").block["all"]
    registers = [*to_registers("f32", 1.01325), *to_registers("f32", 20.5)]
    assert registers[2:] == [0x41A4, 0x0000]
    assert value_of(block, "pressure", registers) == pytest.approx(101_325.0, rel=1e-7)
    assert value_of(block, "temperature", registers) == 20.5


@pytest.mark.parametrize("kind", ["u16", "i16", "u32", "i32"])
@pytest.mark.parametrize("number", [-1e12, -70_000, -1, 0, 1, 40_000, 3_000_000_000, 1e12])
def test_integers_are_held_within_their_type(kind, number):
    back = from_registers(kind, to_registers(kind, number))
    bits, signed = int(kind[1:]), kind[0] == "i"
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    assert back == min(max(number, low), high)


def test_all_presets_read_and_an_unknown_one_is_named():
    assert {preset(name).name for name in presets()} == set(presets())
    with pytest.raises(ConfigError, match=r"no device 'abacus'; known: .*keller-33x"):
        preset("abacus")


def test_xor8():
    assert vn100.xor8(b"VNRRG,01") == 0x72
