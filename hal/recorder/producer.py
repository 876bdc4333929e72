"""The flight's side of the shared memory: preallocated records, a commit of a few microseconds that allocates nothing.

`channel.values` is filled by index, `channel.commit(t)` hands it over. Where there is no room the record is dropped and
counted; nothing ever waits. One thread only.
"""

import mmap
import zlib
from typing import Any

import numpy as np

from glider.hal.recorder import ring
from glider.hal.recorder.schema import RecordSpec


class RecordChannel:
    """A kind of record on its way to the log. `values`, shape (spec.width,), is the caller's to fill, in spec order."""

    __slots__ = ("_buffer", "_bytes", "_limit", "_numbers", "_ring", "_sequence", "_slots", "spec", "values")

    def __init__(self, producer: "Producer", spec: RecordSpec, number: int, limit: int):
        self.spec = spec
        self._ring, self._limit = producer, limit
        # One buffer, seen three ways: as an array to copy from, as scalars to write, as bytes to sum over.
        self._buffer = np.zeros(ring.RECORD_HEAD + spec.width)
        self._numbers: Any = memoryview(self._buffer.data)
        self._bytes = memoryview(self._buffer.data).cast("B")
        self._buffer[ring.CHANNEL] = number
        self.values = self._buffer[ring.RECORD_HEAD :]
        self.values[:] = np.nan
        self._slots = producer.slot_views(len(self._buffer))
        self._sequence = 0

    def commit(self, time_s: float) -> bool:
        """Hand `values` over with their time, s; False where there was no room. Allocates a few boxed numbers only."""
        producer = self._ring
        number = producer.head
        self._sequence += 1  # counts the dropped ones too, so that the log shows where they are missing
        if number - producer.control[ring.TAIL] >= self._limit:
            producer.dropped += 1
            producer.control[ring.DROPPED] = producer.dropped
            return False
        numbers = self._numbers
        numbers[ring.NUMBER] = number
        numbers[ring.SEQUENCE] = self._sequence
        numbers[ring.TIME] = time_s
        place = number & producer.mask
        self._slots[place][...] = self._buffer
        producer.crcs[place] = zlib.crc32(self._bytes)
        producer.head = number + 1
        producer.control[ring.HEAD] = producer.head
        return True


class Producer:
    """The ring's writing end. Spare channels may fill half of it, the others nearly all; events may use the rest."""

    def __init__(self, fd: int, layout: ring.Layout, specs: tuple[RecordSpec, ...]):
        self._layout = layout
        self._map = mmap.mmap(fd, layout.size)
        whole = memoryview(self._map)
        self.control = whole[: layout.crc_offset].cast("Q")
        self.crcs = whole[layout.crc_offset : layout.slots_offset].cast("Q")
        self._slots = np.frombuffer(self._map, dtype=np.float64, offset=layout.slots_offset).reshape(layout.slots, -1)
        self._slots[:] = -1.0  # touched now, so that no page is missing later; -1 is no record's number
        self.mask = layout.slots - 1
        self.head = 0
        self.dropped = 0
        self._event_sequence = 0
        reserve = layout.slots // 16
        self.channels = {
            spec.topic: RecordChannel(self, spec, number, layout.slots // 2 if spec.spare else layout.slots - reserve)
            for number, spec in enumerate(specs)
        }

    def slot_views(self, width: int) -> list[np.ndarray]:
        """The first `width` numbers of every slot, as views made once."""
        return [slot[:width] for slot in self._slots]

    def event(self, time_s: float, severity: int, text: str) -> bool:
        """Hand over a line of text (cut to EVENT_BYTES); rare, so it may allocate. False where there was no room."""
        self._event_sequence += 1
        number = self.head
        if number - self.control[ring.TAIL] >= self._layout.slots:
            self.dropped += 1
            self.control[ring.DROPPED] = self.dropped
            return False
        data = text.encode("utf-8", "replace")[: ring.EVENT_BYTES]
        record = np.zeros(ring.RECORD_HEAD + ring.MIN_PAYLOAD)
        record[: ring.RECORD_HEAD] = (number, ring.EVENT_CHANNEL, self._event_sequence, time_s)
        record[ring.RECORD_HEAD : ring.RECORD_HEAD + ring.EVENT_HEAD] = (severity, len(data))
        start = 8 * (ring.RECORD_HEAD + ring.EVENT_HEAD)
        record.view(np.uint8)[start : start + len(data)] = np.frombuffer(data, dtype=np.uint8)
        place = number & self.mask
        self._slots[place, : len(record)] = record
        self.crcs[place] = zlib.crc32(record.tobytes())
        self.head = number + 1
        self.control[ring.HEAD] = self.head
        return True
