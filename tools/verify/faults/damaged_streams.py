"""Damaged bytes through every codec, and what comes of them.

Each round feeds damage (random bytes; good frames with bits flipped, bytes lost, put in, doubled; frames cut short), in
chunks of any size, then good frames back to back. A codec is back in step if every good frame that starts one longest
frame or more behind the damage comes out. No exception may leave a codec, and it may never keep more than a longest
frame.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from glider.hal.protocols import maestro, modbus, vn100
from glider.hal.protocols.registers import preset

ROUND = 4096  # bytes of damage a round


@dataclass
class Codec:
    """A decoder, frames that it must find, and the longest there are."""

    name: str
    make: Callable[[], Any]
    frames: list[bytes]
    longest: int


@dataclass
class StreamOutcome:
    """Outcome of one codec's bytes."""

    codec: str
    bytes: int = 0
    rounds: int = 0
    good: int = 0
    bad: int = 0
    skipped: int = 0
    exceptions: int = 0
    most_kept: int = 0
    out_of_step: int = 0  # good frames lost a longest frame or more behind the damage
    first_exception: str = field(default="")

    @property
    def passed(self) -> bool:
        return self.exceptions == 0 and self.out_of_step == 0


def codecs(
    imu: type[vn100.Vn100Decoder] = vn100.Vn100Decoder, rtu: type[modbus.RtuDecoder] = modbus.RtuDecoder
) -> list[Codec]:
    """Every decoder of hal/protocols, with frames as the devices send them; others may stand in for two of them."""
    text = "VNYMR,+010.071,+000.278,-002.026,-01.0208,-01.0110,+02.4580,+00.040,+00.322,-09.802,-0.0012,-0.0004,-0.0012"
    binary = vn100.encode_binary(vn100.FLIGHT_MASK, 123456789, *(0.25 * i - 1.0 for i in range(9)))
    requests = [
        preset("keller-33x").read(1, "all"), preset("waveshare-8ai").read(2, "all"),
        preset("leadshine-cs2rs").read(7, "position"), modbus.write_one(7, 0x6002, 0x40),
        modbus.write_many(7, 0x6200, [1, 0, 10_000, 300, 100, 100, 0, 0x10]),
    ]  # fmt: skip
    replies = [
        modbus.with_check_sum(bytes((1, 3, 8)) + bytes(range(8))), modbus.with_check_sum(bytes((2, 4, 16)) + bytes(16)),
        modbus.with_check_sum(bytes((7, 0x83, 2))), modbus.with_check_sum(bytes((7, 16, 0x62, 0, 0, 8))),
    ]  # fmt: skip
    commands = [maestro.set_target(0, 6000, crc=True), maestro.encode(maestro.GET_ERRORS, crc=True)]
    return [
        Codec("vn100", imu, [vn100.encode_text(text), vn100.encode_text("VNERR,03"), binary], 256),
        Codec("modbus replies", rtu, replies, modbus.MAX_FRAME_BYTES),
        Codec("modbus requests", lambda: rtu(requests=True), [r.frame for r in requests], modbus.MAX_FRAME_BYTES),
        Codec("modbus expected reply", lambda: _expecting(rtu), [replies[0]], modbus.MAX_FRAME_BYTES),
        Codec("maestro commands", lambda: maestro.CommandDecoder(crc=True), commands, maestro.MAX_FRAME_BYTES),
        Codec("maestro replies", _MaestroReplies, [b"\x28\x00"], maestro.MAX_FRAME_BYTES),
    ]


def _expecting(rtu: type[modbus.RtuDecoder]) -> modbus.RtuDecoder:
    decoder = rtu()
    decoder.expect(preset("keller-33x").read(1, "all"))
    return decoder


class _MaestroReplies(maestro.ReplyDecoder):
    """Asked again before every chunk, as the driver does on its period: replies have no frame of their own."""

    def feed(self, data: bytes) -> Any:
        self.expect(maestro.GET_ERRORS)
        found = super().feed(data)
        return [] if found is None else [found]


def damage(rng: random.Random, frames: list[bytes], size: int) -> bytes:
    """`size` bytes or a few more: noise and mutated frames, mixed."""
    out = bytearray()
    while len(out) < size:
        kind = rng.randrange(6)
        frame = bytearray(rng.choice(frames))
        place = rng.randrange(len(frame))
        if kind == 0:
            frame = bytearray(rng.randbytes(rng.randrange(1, 300)))
        elif kind == 1:
            frame[place] ^= 1 << rng.randrange(8)
        elif kind == 2:
            del frame[place]
        elif kind == 3:
            frame.insert(place, rng.randrange(256))
        elif kind == 4:
            frame[place:place] = frame[: rng.randrange(len(frame))]
        else:
            del frame[place:]
        out += frame
    return bytes(out)


def run_codec(codec: Codec, total: int, rng: random.Random, advance: Callable[[int], None]) -> StreamOutcome:
    """Feed `total` bytes of damage, and good frames behind every ROUND of it."""
    outcome, decoder = StreamOutcome(codec.name), codec.make()
    while outcome.bytes < total:
        bad = damage(rng, codec.frames, min(ROUND, total - outcome.bytes))
        _feed(decoder, bad, codec, outcome, rng)
        tail = bytearray()
        while len(tail) < codec.longest:
            tail += rng.choice(codec.frames)
        _feed(decoder, bytes(tail), codec, outcome, rng)
        for _ in range(5):  # every one of these has to come out
            found = _feed(decoder, rng.choice(codec.frames), codec, outcome, rng, whole=True)
            outcome.out_of_step += found < 1
        outcome.bytes += len(bad)
        outcome.rounds += 1
        advance(len(bad))
    outcome.good, outcome.bad, outcome.skipped = decoder.good, decoder.bad, decoder.skipped
    return outcome


def _feed(
    decoder: Any, data: bytes, codec: Codec, outcome: StreamOutcome, rng: random.Random, *, whole: bool = False
) -> int:
    """Feed data in chunks of any size; how many events came."""
    at = found = 0
    while at < len(data):
        size = len(data) if whole else rng.choice((1, 2, 7, 16, 64, 255, 1000))
        try:
            found += len(decoder.feed(data[at : at + size]))
        except Exception as error:
            outcome.exceptions += 1
            outcome.first_exception = outcome.first_exception or repr(error)
        outcome.most_kept = max(outcome.most_kept, decoder.pending)
        at += size
    return found
