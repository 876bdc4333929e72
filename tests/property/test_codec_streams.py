"""What holds for every codec and every stream: chunks do not matter, damage is survived, memory is bounded."""

import itertools
import random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from glider.hal.protocols import modbus, vn100
from glider.hal.protocols.registers import CODES, from_registers, to_registers
from glider.tools.verify.faults.damaged_streams import codecs, run_codec
from tests.support.examples import examples

CODECS = {codec.name: codec for codec in codecs()}
FRAMED = [name for name in CODECS if name != "maestro replies"]  # which have no frames to find


@st.composite
def streams(draw):
    """A codec, a stream of its frames and garbage, and where to cut it."""
    codec = CODECS[draw(st.sampled_from(FRAMED))]
    pieces = draw(st.lists(st.one_of(st.sampled_from(codec.frames), st.binary(max_size=80)), max_size=8))
    data = b"".join(pieces)
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=12)))
    return codec, data, [0, *cuts, len(data)]


DOUBLED_DOLLAR = b"$" + CODECS["vn100"].frames[0]  # a line behind a stray byte, cut before its end


@given(streams())
@example((CODECS["vn100"], DOUBLED_DOLLAR, [0, len(DOUBLED_DOLLAR) - 2, len(DOUBLED_DOLLAR)]))
@examples(200)
def test_chunks_do_not_matter(case):
    codec, data, cuts = case
    whole, cut = codec.make(), codec.make()
    at_once = whole.feed(data)
    piecewise = [event for a, b in itertools.pairwise(cuts) for event in cut.feed(data[a:b])]
    assert [getattr(event, "raw", event) for event in piecewise] == [getattr(event, "raw", event) for event in at_once]
    assert (cut.good, cut.bad, cut.skipped, cut.pending) == (whole.good, whole.bad, whole.skipped, whole.pending)


@given(streams(), st.binary(max_size=2000))
@examples()
def test_what_is_kept_is_less_than_a_longest_frame(case, noise):
    codec, data, _ = case
    decoder = codec.make()
    decoder.feed(noise + data)
    assert decoder.pending < codec.longest


@pytest.mark.parametrize("name", CODECS)
def test_damage_is_survived(name):
    outcome = run_codec(CODECS[name], 60_000, random.Random(f"tests {name}"), lambda n: None)
    assert outcome.first_exception == ""
    assert outcome.out_of_step == 0
    assert outcome.good > outcome.rounds
    assert outcome.most_kept < CODECS[name].longest


floats = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(st.integers(1, 0x7FFF), st.data())
@examples()
def test_vn100_binary_round_trip(mask, data):
    codes = [code for bit, (_, code) in enumerate(vn100.FIELDS) if mask >> bit & 1]
    values = []
    for code in codes:
        kind, count = code[-1], int(code[:-1] or 1)
        sizes = {"Q": st.integers(0, 2**64 - 1), "I": st.integers(0, 2**32 - 1), "H": st.integers(0, 2**16 - 1)}
        values += [data.draw(sizes.get(kind, floats)) for _ in range(count)]
    (message,) = vn100.Vn100Decoder().feed(vn100.encode_binary(mask, *values))
    assert message.mask == mask
    assert list(message.values()) == values


@given(st.sampled_from(sorted(CODES)), st.data())
def test_registers_round_trip(kind, data):
    bits = int(kind[1:])
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if kind[0] == "i" else (0, 2**bits - 1)
    number = data.draw(floats if kind == "f32" else st.integers(low, high))
    assert from_registers(kind, to_registers(kind, number)) == number


@given(st.integers(1, 247), st.integers(0, 0xFFFF - 20), st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=20))
@examples()
def test_modbus_requests_are_read_back(device, address, values):
    twin = modbus.RtuDecoder(requests=True)
    requests = [
        modbus.read(device, 3, address, len(values)), modbus.read(device, 4, address, len(values)),
        modbus.write_one(device, address, values[0]), modbus.write_many(device, address, values),
    ]  # fmt: skip
    frames = twin.feed(b"".join(request.frame for request in requests))
    assert [(f.device, f.function, f.pdu.address) for f in frames] == [(device, f, address) for f in (3, 4, 6, 16)]
    assert frames[3].registers == values
