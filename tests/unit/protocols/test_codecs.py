"""What each codec takes and what it must refuse."""

import pytest

from glider.hal.protocols import maestro, modbus, vn100

YMR = (
    "VNYMR,+010.071,+000.278,-002.026,-01.0208,-01.0110,+02.4580,+00.040,+00.322,-09.802,-0.001222,-0.000450,-0.001218"
)


def test_vn100_text_message():
    (message,) = vn100.Vn100Decoder().feed(vn100.encode_text(YMR))
    assert message.header == "VNYMR"
    assert message.numbers()[:3] == (10.071, 0.278, -2.026)
    assert len(message.fields) == 12


def test_vn100_text_with_a_16_bit_check():
    from binascii import crc_hqx

    (message,) = vn100.Vn100Decoder().feed(b"$%s*%04X\r\n" % (YMR.encode(), crc_hqx(YMR.encode(), 0)))
    assert message.header == "VNYMR"


@pytest.mark.parametrize("check", ["XX", "xx", "00", "ZZ", "", "0", "123", "+7"])
def test_vn100_text_without_a_good_check_is_never_taken(check):
    decoder = vn100.Vn100Decoder()
    assert decoder.feed(f"${YMR}*{check}\r\n".encode()) == []
    assert (decoder.good, decoder.bad) == (0, 1)
    assert decoder.feed(vn100.encode_text(YMR))


def test_vn100_numbers_refuse_what_only_python_reads_as_a_number():
    for field in ("nan", "inf", "1_0", "0x10", "", " 1", "1e99999"):
        assert vn100.TextMessage("VNYMR", (field,)).numbers() is None
    assert vn100.TextMessage("VNYMR", ("+007.2", "-1e-3")).numbers() == (7.2, -0.001)


def test_vn100_binary_of_another_group_is_skipped():
    frame = vn100.encode_binary(vn100.FLIGHT_MASK, 7, *([0.0] * 9))
    decoder = vn100.Vn100Decoder()
    other = bytes((0xFA, 0x03)) + frame[2:]
    (message,) = decoder.feed(other + frame)
    assert message.values()[0] == 7
    assert decoder.skipped == len(other)


def test_vn100_finds_a_frame_inside_a_false_start():
    """A false FA 01 with the longest mask claims 204 bytes; the true frames behind it all come out once it is whole."""
    frame = vn100.encode_binary(vn100.FLIGHT_MASK, 7, *([0.0] * 9))
    decoder = vn100.Vn100Decoder()
    messages = decoder.feed(b"\xfa\x01\xff\x7f" + 5 * frame)
    assert len(messages) == 5
    assert decoder.bad == 1


def test_maestro_replies_need_their_command():
    decoder = maestro.ReplyDecoder()
    assert decoder.feed(b"\x12\x34") is None
    assert decoder.skipped == 2
    decoder.expect(maestro.GET_POSITION)
    assert decoder.feed(b"\x70") is None
    assert decoder.feed(b"\x17\xff") == 6000
    assert decoder.skipped == 3


def test_maestro_error_word_with_unknown_bits_is_refused():
    decoder = maestro.ReplyDecoder()
    decoder.expect(maestro.GET_ERRORS)
    assert decoder.feed(b"\x00\x40") is None
    assert decoder.bad == 1
    decoder.expect(maestro.GET_ERRORS)
    assert maestro.MaestroError(decoder.feed(b"\x28\x00")) == maestro.MaestroError.TIMEOUT | maestro.MaestroError.CRC


def test_maestro_board_sets_error_bits():
    board = maestro.CommandDecoder(crc=True)
    good = maestro.set_target(0, 6000, crc=True)
    assert board.feed(good[:-1] + b"\x00") == []
    assert board.errors == maestro.MaestroError.CRC
    assert board.feed(good[:3] + good)[0].value == 6000
    assert board.errors == maestro.MaestroError.CRC | maestro.MaestroError.PROTOCOL


def test_maestro_refuses_what_does_not_fit_seven_bits():
    with pytest.raises(ValueError, match="target"):
        maestro.set_target(0, 1 << 14)
    with pytest.raises(ValueError, match="command"):
        maestro.encode(maestro.SET_TARGET, 0, 200, 1)


def reply(device=1, function=3, registers=(1, 2)):
    data = b"".join(register.to_bytes(2, "big") for register in registers)
    return modbus.with_check_sum(bytes((device, function, len(data))) + data)


REQUEST = modbus.read(1, 3, 0x0100, 2)


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param(reply(device=2), id="wrong id"),
        pytest.param(reply(function=4), id="wrong function"),
        pytest.param(reply(registers=(1, 2, 3)), id="wrong length"),
        pytest.param(reply()[:-1] + bytes((reply()[-1] ^ 1,)), id="bad check sum"),
        pytest.param(reply()[:-1], id="cut"),
    ],
)
def test_a_reply_that_does_not_answer_the_request_is_never_taken(wrong):
    decoder = modbus.RtuDecoder()
    decoder.expect(REQUEST)
    assert decoder.feed(wrong) == []


def test_the_reply_is_found_behind_garbage_that_looks_like_one():
    decoder = modbus.RtuDecoder()
    decoder.expect(REQUEST)
    (frame,) = decoder.feed(bytes((1, 3, 200, 1, 1, 3)) + reply())
    assert frame.registers == [1, 2]


def test_an_exception_is_an_event():
    decoder = modbus.RtuDecoder()
    decoder.expect(REQUEST)
    (frame,) = decoder.feed(modbus.with_check_sum(bytes((1, 0x83, 2))))
    assert frame.exception == 2


def test_a_write_is_answered_by_its_own_echo_only():
    decoder = modbus.RtuDecoder()
    decoder.expect(modbus.write_one(1, 0x6002, 0x40))
    assert decoder.feed(modbus.write_one(1, 0x6002, 0x10).frame) == []
    assert len(decoder.feed(modbus.write_one(1, 0x6002, 0x40).frame)) == 1


@pytest.mark.parametrize(
    ("device", "address", "count"), [(0, 0, 1), (248, 0, 1), (1, -1, 1), (1, 0, 0), (1, 0, 126), (1, 0xFFFF, 2)]
)
def test_requests_that_no_device_could_answer_are_refused(device, address, count):
    with pytest.raises(ValueError, match="expected"):
        modbus.read(device, 3, address, count)
