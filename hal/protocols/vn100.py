"""VectorNav VN-100: text messages and binary output, bytes in, events out; no port, no clock.

Text: `$HEADER,field,...*CC` CRLF; CC is the XOR of the bytes between $ and * in two hex digits, or their CRC-16
(XMODEM) in four. `*XX`, with which a device can be set to skip the check, is never taken. Binary: FA, group byte, a
mask of fields (u16), payload (little-endian), CRC-16 over all after FA, high byte first. Only group 1 is known here;
VN-100 user manual, sections 3.1 and 5.
"""

import re
from binascii import crc_hqx
from functools import lru_cache, reduce
from operator import xor
from struct import Struct
from typing import NamedTuple

SYNC = 0xFA
MAX_FRAME_BYTES = 256  # bytes; no text message or group 1 frame is longer
TIME_STARTUP, YAW_PITCH_ROLL, ANGULAR_RATE, ACCEL = 0, 3, 5, 8  # bits of group 1
# name, struct code, of the fields of group 1 by bit
FIELDS = (
    ("time_startup", "Q"), ("time_gps", "Q"), ("time_sync_in", "Q"), ("yaw_pitch_roll", "3f"), ("quaternion", "4f"),
    ("angular_rate", "3f"), ("position", "3d"), ("velocity", "3f"), ("accel", "3f"), ("imu", "6f"), ("mag_pres", "5f"),
    ("delta_theta", "7f"), ("ins_status", "H"), ("sync_in_count", "I"), ("time_gps_pps", "Q"),
)  # fmt: skip
FLIGHT_MASK = 1 << TIME_STARTUP | 1 << YAW_PITCH_ROLL | 1 << ANGULAR_RATE | 1 << ACCEL

_SIZES = [Struct("<" + code).size for _, code in FIELDS]
_LOW = [sum(size for bit, size in enumerate(_SIZES[:8]) if mask >> bit & 1) for mask in range(256)]
_HIGH = [sum(size for bit, size in enumerate(_SIZES[8:]) if mask >> bit & 1) for mask in range(128)]
_START = re.compile(rb"[$\xfa]")
_TEXT = re.compile(rb"\$([\x20-\x23\x25-\x29\x2b-\x7e]{1,240})\*([0-9A-Fa-f]{4}|[0-9A-Fa-f]{2})\r?\n")
_LINE = re.compile(rb"\$[\x20-\x23\x25-\x7e]*\r?\n")  # whole, whatever it says; how far the bytes came does not matter
_TEXT_SO_FAR = re.compile(rb"\$[\x20-\x23\x25-\x7e]*\r?\Z")
_NUMBER = re.compile(r"[+-]?\d{1,12}(\.\d{0,12})?([eE][+-]?\d{1,3})?\Z")


class TextMessage(NamedTuple):
    """A text message that passed its check: `VNYMR` and its fields."""

    header: str
    fields: tuple[str, ...]

    def numbers(self) -> tuple[float, ...] | None:
        """The fields as numbers; None where one is none."""
        if not all(_NUMBER.match(field) for field in self.fields):
            return None
        return tuple(float(field) for field in self.fields)


class BinaryMessage(NamedTuple):
    """A frame of group 1 that passed its check: the mask of its fields and their bytes."""

    mask: int
    payload: bytes

    def values(self) -> tuple[float, ...]:
        """All numbers of the payload in the order of the bits."""
        return layout(self.mask).unpack(self.payload)


@lru_cache(maxsize=64)
def layout(mask: int) -> Struct:
    """The payload of group 1 under a mask."""
    return Struct("<" + "".join(code for bit, (_, code) in enumerate(FIELDS) if mask >> bit & 1))


def payload_size(mask: int) -> int:
    """Bytes of a payload; 0 for a mask that no frame has."""
    return 0 if mask & 0x8000 else _LOW[mask & 0xFF] + _HIGH[mask >> 8]


def xor8(data: bytes) -> int:
    """All bytes exclusive-ored: the check sum of a text message, of what stands between $ and *."""
    return reduce(xor, data, 0)


def encode_text(body: str) -> bytes:
    """`VNRRG,01` as `$VNRRG,01*72` CRLF."""
    data = body.encode("ascii")
    return b"$%s*%02X\r\n" % (data, xor8(data))


def encode_binary(mask: int, *values: float) -> bytes:
    """A frame of group 1 with these values, in the order of the bits."""
    body = bytes((0x01,)) + mask.to_bytes(2, "little") + layout(mask).pack(*values)
    return bytes((SYNC,)) + body + crc_hqx(body, 0).to_bytes(2, "big")


class Vn100Decoder:
    """Finds messages in whatever comes: any chunks, any garbage. What passed no check is counted and skipped."""

    crc = staticmethod(crc_hqx)  # of a frame's bytes with its check sum behind: 0

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.good = self.bad = self.skipped = 0

    def reset(self) -> None:
        """Forget what is unfinished."""
        self.skipped += len(self._buffer)
        self._buffer.clear()

    @property
    def pending(self) -> int:
        """Bytes kept for a message that is not whole yet, fewer than MAX_FRAME_BYTES."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[TextMessage | BinaryMessage]:
        """Take bytes; the messages that they complete."""
        self._buffer += data
        buffer, at, events = bytes(self._buffer), 0, []
        while True:
            start = _START.search(buffer, at)
            if start is None:
                self.skipped += len(buffer) - at
                at = len(buffer)
                break
            self.skipped += start.start() - at
            at = start.start()
            taken, event = self._binary(buffer, at) if buffer[at] == SYNC else self._text(buffer, at)
            if event is not None:
                self.good += 1
                events.append(event)
            elif taken:
                self.skipped += taken
            else:
                break
            at += taken
        del self._buffer[:at]
        return events

    def _binary(self, buffer: bytes, at: int) -> tuple[int, BinaryMessage | None]:
        """Bytes taken and the message; (1, None): none starts here; (0, None): it is not whole."""
        left = len(buffer) - at
        if left > 1 and buffer[at + 1] != 0x01:
            return 1, None
        if left < 4:
            return 0, None
        mask = buffer[at + 2] | buffer[at + 3] << 8
        size = payload_size(mask)
        if size == 0:
            return 1, None
        if left < size + 6:
            return 0, None
        if self.crc(buffer[at + 1 : at + size + 6], 0) != 0:
            self.bad += 1
            return 1, None
        return size + 6, BinaryMessage(mask, buffer[at + 4 : at + 4 + size])

    def _text(self, buffer: bytes, at: int) -> tuple[int, TextMessage | None]:
        """As _binary."""
        window = buffer[at : at + MAX_FRAME_BYTES]
        found = _TEXT.match(window)
        if found is None:
            unfinished = len(window) < MAX_FRAME_BYTES and _TEXT_SO_FAR.match(window)
            if _LINE.match(window):
                self.bad += 1
            return (0, None) if unfinished else (1, None)
        body, check = found.groups()
        if int(check, 16) != (xor8(body) if len(check) == 2 else self.crc(body, 0)):
            self.bad += 1
            return 1, None
        header, *fields = body.decode("ascii").split(",")
        return found.end(), TextMessage(header, tuple(fields))
