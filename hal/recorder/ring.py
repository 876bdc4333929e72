"""The shared memory between the flight and the process that records it: layout, and the recording side.

One producer, one consumer, slots of one size. The producer numbers its records; record n lies in slot n mod slots and
carries n inside, and its CRC stands apart. Nothing here relies on the order in which one processor sees another's
stores: a record is delivered only if its number is the awaited one and its CRC fits, so a slot half written, half
visible or left over from the last lap is at worst waited for, never delivered. The consumer copies a slot before it
judges it and frees it only afterwards.

This file needs the standard library alone: it is what the recording process loads. The flight's side is producer.py.
"""

import mmap
import os
import struct
import tempfile
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass

# Control words, unsigned 64 bits: first what the producer writes, on a cache line of its own what the consumer writes.
HEAD = 0  # records handed over so far
DROPPED = 1  # records that found no room
TAIL = 8  # records taken out so far
WRITTEN = 9  # records given to the log file
DAMAGED = 10  # records that never became whole
DISK_ERRORS = 11
LAST_ERRNO = 12  # 0 while the disk is well
BEAT = 13  # when it last looked at the ring, ns of the monotonic clock
CONTROL_WORDS = 16

# The head of a record, float64 like the rest (whole numbers are exact up to 2**53).
NUMBER, CHANNEL, SEQUENCE, TIME = range(4)
RECORD_HEAD = 4
# A text event: channel -1, then severity, length in bytes, and the text.
EVENT_CHANNEL = -1
EVENT_HEAD = 2
EVENT_BYTES = 400
MIN_PAYLOAD = EVENT_HEAD + EVENT_BYTES // 8

TORN_PATIENCE_S = 0.2  # a handed-over record that is not whole after this never will be
_HEAD = struct.Struct("<4d")


@dataclass(frozen=True)
class Layout:
    """Where things lie: `slots` (a power of two) records of up to `payload` numbers."""

    slots: int
    payload: int

    def __post_init__(self):
        if self.slots < 16 or self.slots & (self.slots - 1):
            raise ValueError(f"slots: expected a power of two, at least 16, got {self.slots}")
        if self.payload < MIN_PAYLOAD:
            raise ValueError(f"payload: expected at least {MIN_PAYLOAD}, got {self.payload}")

    @property
    def crc_offset(self) -> int:
        return 8 * CONTROL_WORDS

    @property
    def slots_offset(self) -> int:
        return self.crc_offset + 8 * self.slots

    @property
    def slot_bytes(self) -> int:
        return 8 * (RECORD_HEAD + self.payload)

    @property
    def size(self) -> int:
        return self.slots_offset + self.slots * self.slot_bytes


def create_shared(size: int) -> int:
    """A file descriptor of `size` bytes of memory that two processes can map.

    It has no name, so nothing is left behind by a process that is killed; multiprocessing's shared memory has one, and
    keeps a further process to clean it up.
    """
    if hasattr(os, "memfd_create"):
        fd = os.memfd_create("glider-recorder")
    else:
        with tempfile.TemporaryFile() as file:
            fd = os.dup(file.fileno())
    os.truncate(fd, size)
    return fd


@dataclass(frozen=True)
class RingRecord:
    """A record out of the ring."""

    channel: int
    sequence: int
    time_s: float
    payload: memoryview  # the slot's numbers as bytes, longer than the channel's records


class RingReader:
    """The consumer. `widths[i]` is the payload length of channel i in numbers."""

    def __init__(self, fd: int, layout: Layout, widths: list[int], clock: Callable[[], float] = time.monotonic):
        self._layout, self._widths, self._clock = layout, widths, clock
        self._map = mmap.mmap(fd, layout.size)
        whole = memoryview(self._map)
        self.control = whole[: layout.crc_offset].cast("Q")
        self._crcs = whole[layout.crc_offset : layout.slots_offset].cast("Q")
        self._slots = whole[layout.slots_offset :]
        self._waiting_since: float | None = None

    @property
    def pending(self) -> int:
        """Records handed over and not yet taken."""
        return self.control[HEAD] - self.control[TAIL]

    def take(self) -> RingRecord | None:
        """The next record, or None where none is ready. One that stays damaged is counted and passed over."""
        number = self.control[TAIL]
        if self.control[HEAD] <= number:
            return None
        place = number % self._layout.slots
        start = place * self._layout.slot_bytes
        copy = bytes(self._slots[start : start + self._layout.slot_bytes])
        taken = self._judge(copy, number, self._crcs[place])
        if taken is None and not self._give_up():
            return None
        self._waiting_since = None
        if taken is None:
            self.control[DAMAGED] += 1
        self.control[TAIL] = number + 1
        return taken if taken is not None else self.take()

    def _judge(self, copy: bytes, number: int, crc: int) -> RingRecord | None:
        found, channel, sequence, time_s = _HEAD.unpack_from(copy)
        if found != number:
            return None
        if channel == EVENT_CHANNEL:
            width = MIN_PAYLOAD
        elif channel in range(len(self._widths)):
            width = self._widths[int(channel)]
        else:
            return None
        if zlib.crc32(memoryview(copy)[: 8 * (RECORD_HEAD + width)]) != crc:
            return None
        payload = memoryview(copy)[8 * RECORD_HEAD : 8 * (RECORD_HEAD + width)]
        return RingRecord(int(channel), int(sequence), time_s, payload)

    def _give_up(self) -> bool:
        now = self._clock()
        if self._waiting_since is None:
            self._waiting_since = now
        return now - self._waiting_since > TORN_PATIENCE_S
