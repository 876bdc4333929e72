"""Pololu Maestro servo board: commands out, replies and, for its twin, commands in; no port, no clock.

Compact protocol (`84 ch lo hi`) or, with a device number, Pololu's (`AA dev 04 ch lo hi`); data bytes have seven
bits, so a byte of 0x80 and above always begins a command. With CRC on, every command ends in its CRC-7; replies carry
none. Targets are in quarter microseconds. Maestro user's guide, sections 5.c to 5.f.
"""

from enum import IntFlag
from typing import NamedTuple

SET_TARGET, SET_SPEED, SET_ACCELERATION = 0x84, 0x87, 0x89
GET_POSITION, GET_MOVING, GET_ERRORS, GO_HOME = 0x90, 0x93, 0xA1, 0xA2
POLOLU = 0xAA
# data bytes of each command, bytes of its reply
COMMANDS = {
    SET_TARGET: (3, 0), SET_SPEED: (3, 0), SET_ACCELERATION: (3, 0), GET_POSITION: (1, 2), GET_MOVING: (0, 1),
    GET_ERRORS: (0, 2), GO_HOME: (0, 0),
}  # fmt: skip
MAX_FRAME_BYTES = 7  # bytes: AA dev 04 ch lo hi crc


class MaestroError(IntFlag):
    """The error word; reading it clears it."""

    SIGNAL = 1
    OVERRUN = 2
    BUFFER_FULL = 4
    CRC = 8
    PROTOCOL = 16
    TIMEOUT = 32
    STACK = 64
    CALL_STACK = 128
    PROGRAM_COUNTER = 256


class Command(NamedTuple):
    """A command as the board sees it: code in its compact form, device number (None: compact), data bytes."""

    code: int
    device: int | None
    data: tuple[int, ...]

    @property
    def value(self) -> int:
        """The 14-bit number of SET_TARGET, SET_SPEED and SET_ACCELERATION."""
        return self.data[1] | self.data[2] << 7


def _crc7_table() -> bytes:
    """CRC-7 of every byte, polynomial 0x91 reflected (user's guide, section 5.d)."""
    table = bytearray(256)
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc ^ 0x91 if crc & 1 else crc) >> 1
        table[byte] = crc
    return bytes(table)


_CRC7 = _crc7_table()


def crc7(data: bytes) -> int:
    """CRC-7 of a command, 0-127."""
    crc = 0
    for byte in data:
        crc = _CRC7[crc ^ byte]
    return crc


def encode(code: int, *data: int, device: int | None = None, crc: bool = False) -> bytes:
    """A command; ValueError where a data byte has more than seven bits or their number is wrong."""
    if len(data) != COMMANDS[code][0] or not all(0 <= byte < 0x80 for byte in data):
        raise ValueError(f"command {code:#x} with data {data}")
    head = (code,) if device is None else (POLOLU, device, code & 0x7F)
    frame = bytes((*head, *data))
    return frame + bytes((crc7(frame),)) if crc else frame


def set_target(channel: int, quarter_us: int, *, device: int | None = None, crc: bool = False) -> bytes:
    """Move a channel's pulse; 0 switches the pulses off."""
    if not 0 <= quarter_us < 1 << 14:
        raise ValueError(f"target {quarter_us} quarter microseconds")
    return encode(SET_TARGET, channel, quarter_us & 0x7F, quarter_us >> 7, device=device, crc=crc)


class ReplyDecoder:
    """Replies have neither start nor check: as many bytes as were asked for, and for errors only known bits."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._wanted = 0
        self._code = 0
        self.good = self.bad = self.skipped = 0

    def expect(self, code: int) -> None:
        """A command that has a reply was sent; what was unfinished is dropped."""
        self.skipped += len(self._buffer)
        self._buffer.clear()
        self._code, self._wanted = code, COMMANDS[code][1]

    @property
    def pending(self) -> int:
        return len(self._buffer)

    def feed(self, data: bytes) -> int | None:
        """The reply's number once it is whole; bytes that nobody asked for are skipped."""
        take = data[: self._wanted - len(self._buffer)] if self._wanted else b""
        self.skipped += len(data) - len(take)
        self._buffer += take
        if not self._wanted or len(self._buffer) < self._wanted:
            return None
        value = int.from_bytes(self._buffer, "little")
        self._buffer.clear()
        self._wanted = 0
        if self._code == GET_ERRORS and value >= 2 * MaestroError.PROGRAM_COUNTER:
            self.bad += 1
            return None
        self.good += 1
        return value


class CommandDecoder:
    """The board's side: commands out of a stream. A bad CRC or an unfinished command sets a bit of `errors`."""

    def __init__(self, device: int = 12, crc: bool = False) -> None:
        self._buffer = bytearray()
        self._device, self._crc = device, crc
        self.errors = MaestroError(0)
        self.good = self.bad = self.skipped = 0

    @property
    def pending(self) -> int:
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Command]:
        """Take bytes; the commands that they complete."""
        events = []
        for byte in data:
            if byte >= 0x80:
                if self._buffer:
                    self._drop(MaestroError.PROTOCOL)
                self._buffer.append(byte)
            elif self._buffer:
                self._buffer.append(byte)
            else:
                self.skipped += 1
                continue
            event = self._take()
            if event is not None:
                events.append(event)
        return events

    def _drop(self, error: MaestroError) -> None:
        self.errors |= error
        self.bad += 1
        self.skipped += len(self._buffer)
        self._buffer.clear()

    def _take(self) -> Command | None:
        buffer = self._buffer
        head = 3 if buffer[0] == POLOLU else 1
        if len(buffer) < head:
            return None
        code = 0x80 | buffer[2] if head == 3 else buffer[0]
        if code not in COMMANDS:
            self._drop(MaestroError.PROTOCOL)
            return None
        size = head + COMMANDS[code][0] + self._crc
        if len(buffer) < size:
            return None
        if self._crc and crc7(bytes(buffer[:-1])) != buffer[-1]:
            self._drop(MaestroError.CRC)
            return None
        device = buffer[1] if head == 3 else None
        data = tuple(buffer[head : size - self._crc])
        self._buffer.clear()
        self.good += 1
        return Command(code, device, data) if device in (None, self._device) else None
