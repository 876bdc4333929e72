"""Frames for the pump's way up, written a second time: nothing here is shared with the flight's own drivers.

Modbus RTU (functions 3, 4, 6, 16) and the Maestro's set-target command; a port that waits: nothing else runs here.
"""

import contextlib
import struct
import time

import serial

from glider.hal.outofband.plan import CODES, NumberPlan, PathPlan, ReadPlan

ANSWER_S = 0.25  # a reply's longest delay, its own length beside it


def crc16(data: bytes) -> int:
    """CRC-16 of Modbus over serial line, section 6.2.2: 0xA001 reflected, from 0xFFFF; sent low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def _closed(body: bytes) -> bytes:
    return body + struct.pack("<H", crc16(body))


def read_frame(device: int, function: int, address: int, count: int) -> bytes:
    """Ask for `count` registers."""
    return _closed(struct.pack(">BBHH", device, function, address, count))


def write_one_frame(device: int, address: int, word: int) -> bytes:
    """Write a register (function 6); the reply is the same frame."""
    return _closed(struct.pack(">BBHH", device, 6, address, word))


def write_many_frame(device: int, address: int, words: list[int]) -> bytes:
    """Write registers (function 16); the reply repeats the first six bytes."""
    return _closed(struct.pack(f">BBHHB{len(words)}H", device, 16, address, len(words), 2 * len(words), *words))


def number_of(number: NumberPlan, registers: list[int]) -> float:
    """The number among registers that were read, high word first."""
    words = [registers[place] for place in number.places]
    return struct.unpack(f">{CODES[number.kind]}", struct.pack(f">{len(words)}H", *words))[0] * number.step


def words_of(number: NumberPlan, value: float) -> list[int]:
    """The registers of a number to write, high word first; an integer is rounded, and held within its type."""
    value /= number.step
    if number.kind != "f32":
        bits = 16 * len(number.places)
        low = -(1 << bits - 1) if number.kind[0] == "i" else 0
        value = round(min(max(value, low), low + (1 << bits) - 1))
    data = struct.pack(f">{CODES[number.kind]}", value)
    return list(struct.unpack(f">{len(data) // 2}H", data))


def path_words(path: PathPlan, *, absolute: int, counts: float, rpm: int, ramp_ms: int, trigger: int) -> list[int]:
    """The registers of a drive's path."""
    words = [0] * path.words
    for number, value in (
        (path.mode, absolute), (path.position, counts), (path.speed, rpm), (path.acceleration, ramp_ms),
        (path.deceleration, ramp_ms), (path.pause, 0), (path.trigger, trigger),
    ):  # fmt: skip
        words[number.places.start : number.places.stop] = words_of(number, value)
    return words


def servo_frame(channel: int, quarter_us: int, number: int | None, crc: bool) -> bytes:
    """The Maestro's set target, with its CRC-7 (0x91 reflected) if that is on."""
    head = [0x84] if number is None else [0xAA, number, 0x04]
    frame = bytes([*head, channel, quarter_us & 0x7F, quarter_us >> 7 & 0x7F])
    if not crc:
        return frame
    total = 0
    for byte in frame:
        total ^= byte
        for _ in range(8):
            total = (total ^ 0x91) >> 1 if total & 1 else total >> 1
    return frame + bytes([total])


def registers_of(reply: bytes, device: int, function: int, count: int) -> list[int] | None:
    """The registers in a reply to a read; None unless it is just that reply."""
    if len(reply) != 5 + 2 * count or reply[:3] != bytes((device, function, 2 * count)):
        return None
    if crc16(reply[:-2]) != struct.unpack("<H", reply[-2:])[0]:
        return None
    return list(struct.unpack(f">{count}H", reply[3:-2]))


class Port:
    """A serial port that may not be there, or be somebody else's for a moment."""

    def __init__(self, path: str, baud: int):
        self.path, self.baud = path, baud
        self.trouble = ""
        self._serial: serial.Serial | None = None

    def open(self, exclusive: bool) -> bool:
        """Open it if it is not; without `exclusive` also where a process that cannot be ended still holds it."""
        if self._serial is not None:
            return True
        try:
            self._serial = serial.Serial(
                self.path, self.baud, timeout=ANSWER_S, write_timeout=ANSWER_S, exclusive=exclusive or None
            )
        except Exception as error:  # pyserial raises what the system gives it, of several families
            self.trouble = str(error)
            return False
        self.trouble = ""
        time.sleep(0.1)  # whoever used the line before may still be answered
        return True

    def send(self, data: bytes) -> bool:
        """Put bytes on the line."""
        return self._talk(data, 0) is not None

    def registers(self, device: int, reading: ReadPlan) -> list[int] | None:
        """What stands in the registers that a number is read with; None where the device does not answer."""
        request = read_frame(device, reading.function, reading.address, reading.words)
        return registers_of(self.exchange(request, 5 + 2 * reading.words), device, reading.function, reading.words)

    def exchange(self, request: bytes, size: int) -> bytes:
        """A request and its reply of `size` bytes; empty where none came."""
        return self._talk(request, size) or b""

    def _talk(self, data: bytes, size: int) -> bytes | None:
        if self._serial is None:
            return None
        try:
            self._serial.reset_input_buffer()
            self._serial.write(data)
            reply = self._serial.read(size) if size else b""
        except Exception as error:
            self.trouble = str(error)
            self.close()
            return None
        if len(reply) < size:
            time.sleep(0.05)  # a late reply is drained before the next request
        return reply

    def close(self) -> None:
        """Give it back."""
        if self._serial is not None:
            with contextlib.suppress(Exception):
                self._serial.close()
        self._serial = None
