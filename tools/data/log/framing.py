"""What of an MCAP file can be trusted: its records up to a cut, past damage, and never one whose checksum fails.

Chunks and attachments carry MCAP's checksums, metadata the one that the recorder adds; records under none (messages
outside chunks, indexes) are not delivered, and their lengths not relied on: where the next record makes no sense, the
search for one that can be proved starts behind the last one that was. So a flipped bit costs the chunk it is in and not
the rest of the flight.
"""

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from mmap import mmap

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Footer, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from glider.hal.recorder.logfile import CRC_KEY, metadata_crc

_RECORD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, size unpacked, checksum, length of the compression's name
_MESSAGE = struct.Struct("<HIQQ")
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
# How a record under a checksum begins: a chunk, an attachment or metadata of less than 16 MB.
_START = re.compile(rb"[\x06\x09\x0c].{3}\x00{5}", re.DOTALL)


@dataclass(frozen=True)
class Damage:
    """Bytes that are not delivered, and why."""

    offset: int
    length: int
    what: str


def _lengths_fit(body: bytes, skipped: int, strings: int, size_bytes: int, behind: int) -> bool:
    """Whether a body is as long as it says: `skipped` bytes, strings, one block with its size ahead, `behind` bytes."""
    place = skipped
    for _ in range(strings):
        place += 4 + int.from_bytes(body[place : place + 4], "little")
    place += size_bytes + int.from_bytes(body[place : place + size_bytes], "little")
    return place + behind == len(body)


def chunk_content(body: bytes) -> tuple[bytes | None, str]:
    """What a chunk holds if its checksum proves it, and else what is wrong."""
    if len(body) < CHUNK_HEAD.size + 8:
        return None, "a chunk too short to be one"
    _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(body)
    name = body[CHUNK_HEAD.size : CHUNK_HEAD.size + name_length]
    if name in (b"lz4", b"zstd"):
        return None, f"a chunk compressed with {name.decode()}, as no recorder of ours writes it"
    start = CHUNK_HEAD.size + 8
    content = body[start:]
    if name or struct.unpack_from("<Q", body, CHUNK_HEAD.size) != (size,) or len(content) != size:
        return None, "a chunk's head"
    if zlib.crc32(content) != crc:
        return None, "a chunk (its checksum fails)"
    return content, ""


class Scan:
    """One pass over a file's bytes. `complete`, `end` and `damages` are right once `records` has come to its end."""

    chunk_content = staticmethod(chunk_content)

    def __init__(self, data: bytes | mmap):
        self._data, self._size = data, len(data)
        self.complete = False  # closed by its writer, down to the last byte
        self.end = 0  # bytes understood; what lies behind is the torn rest of a cut
        self.damages: list[Damage] = []
        # The last search and what it found: a file of damage alone is still searched once.
        self._searched: tuple[int, int | None] = (self._size + 1, None)

    @property
    def recognised(self) -> bool:
        """Whether the bytes begin as MCAP does, or are the beginning of such a beginning."""
        start = self._data[: len(MCAP0_MAGIC)]
        return MCAP0_MAGIC.startswith(start)

    def records(self) -> Iterator[bytes | Attachment | Metadata]:
        """Contents of chunks, attachments and metadata, in order, each with its checksum proved. Never raises."""
        place = proved = len(MCAP0_MAGIC)  # `proved`: the end of what is certain
        if not self.recognised:
            found = self._next_proved(0)
            if found is None:
                return
            self._damage(0, found, "the file's first bytes")
            place = found
        while True:
            head = self._head(place)
            if head is None:
                found = self._next_proved(proved)
                if found is None:
                    break
                self._damage(proved, found - proved, "records that make no sense")
                place = proved = found
                continue
            opcode, after = head
            if opcode == Opcode.DATA_END:
                self._finish(place, after)
                return
            item, wrong = self._checked(opcode, self._data[place + _RECORD.size : after])
            if wrong:
                after = self._after_damage(place, after)
                self._damage(place, after - place, wrong)
            elif item is not None:
                yield item
                proved = after
            place = after
        self.end = min(place, self._size)

    def _head(self, place: int) -> tuple[int, int] | None:
        """Opcode and end of the record at a place; None where there is no record that could be one."""
        if place + _RECORD.size > self._size:
            return None
        opcode, length = _RECORD.unpack(self._data[place : place + _RECORD.size])
        after = place + _RECORD.size + length
        return (opcode, after) if opcode in _OPCODES and after <= self._size else None

    def _damage(self, offset: int, length: int, what: str) -> None:
        self.damages.append(Damage(offset, length, what))

    def _after_damage(self, place: int, after: int) -> int:
        """Where to go on behind a damaged record: its length may be what is damaged."""
        found = self._next_proved(place + 1)
        if found is not None and (found < after or self._head(after) is None):
            return found
        return after

    def _next_proved(self, place: int) -> int | None:
        """The first record from a place on that its checksum proves."""
        searched, found = self._searched
        if searched > place or (found is not None and found < place):
            found = self._search(place)
            self._searched = (place, found)
        return found

    def _search(self, place: int) -> int | None:
        while match := _START.search(self._data, place):
            start = match.start()
            head = self._head(start)
            if head is not None and self._checked(head[0], self._data[start + _RECORD.size : head[1]])[0] is not None:
                return start
            place = start + 1
        return None

    def _checked(self, opcode: int, body: bytes) -> tuple[bytes | Attachment | Metadata | None, str]:
        """A record's content if its checksum proves it, and else what is wrong; neither for what carries no data."""
        try:
            if opcode == Opcode.CHUNK:
                return self.chunk_content(body)
            if opcode == Opcode.ATTACHMENT:
                if not _lengths_fit(body, 16, 2, 8, 4):
                    return None, "an attachment's head"
                if struct.unpack("<I", body[-4:]) != (zlib.crc32(body[:-4]),):
                    return None, "an attachment"
                return Attachment.read(ReadDataStream(BytesIO(body))), ""
            if opcode == Opcode.METADATA:
                if not _lengths_fit(body, 0, 1, 4, 0):
                    return None, "metadata"
                metadata = Metadata.read(ReadDataStream(BytesIO(body)))
                if metadata.metadata.get(CRC_KEY) != metadata_crc(metadata.name, metadata.metadata):
                    return None, "metadata"
                return metadata, ""
            if opcode == Opcode.MESSAGE:
                return None, "a message outside a chunk, under no checksum"
        except (struct.error, EndOfFile, UnicodeDecodeError, MemoryError, OverflowError):
            return None, "a record that makes no sense"
        return None, ""

    def _finish(self, place: int, after: int) -> None:
        """Check the closing records: the checksum over all data, the summary's, the last magic."""
        self.end = after
        (crc,) = struct.unpack("<I", self._data[after - 4 : after]) if after - place == 13 else (0,)
        if crc and not self.damages and crc != _crc(self._data, 0, place):
            self._damage(0, place, "somewhere in parts that hold no data (the checksum over all of it fails)")
        tail = 9 + 20 + len(MCAP0_MAGIC)
        footer_at = self._size - tail
        if footer_at < after:
            return
        end = self._data[footer_at:]
        opcode, length = _RECORD.unpack(end[:9])
        if opcode != Opcode.FOOTER or length != 20 or end[29:] != MCAP0_MAGIC:
            return
        self.complete, self.end = True, self._size
        footer = Footer.read(ReadDataStream(BytesIO(end[9:29])))
        summary_crc = _crc(self._data, footer.summary_start, footer_at + 9 + 16)
        if footer.summary_crc and footer.summary_crc != summary_crc:
            self._damage(footer_at, tail, "in the index at the end, which holds no data")


def _crc(data: bytes | mmap, start: int, end: int) -> int:
    crc = 0
    for place in range(start, end, 1 << 20):
        crc = zlib.crc32(data[place : min(place + (1 << 20), end)], crc)
    return crc


def chunk_records(content: bytes) -> Iterator[Schema | Channel | Message]:
    """The records in a chunk's content; ends early where they make no sense (a foreign writer's doing)."""
    place = 0
    while place + _RECORD.size <= len(content):
        opcode, length = _RECORD.unpack_from(content, place)
        start = place + _RECORD.size
        place = start + length
        if place > len(content):
            return
        if opcode == Opcode.MESSAGE:  # by far the most frequent, so without mcap's reader
            if length < _MESSAGE.size:
                return
            channel_id, sequence, log_time, publish_time = _MESSAGE.unpack_from(content, start)
            data = content[start + _MESSAGE.size : place]
            yield Message(
                channel_id=channel_id, log_time=log_time, data=data, publish_time=publish_time, sequence=sequence
            )
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            kind = Schema if opcode == Opcode.SCHEMA else Channel
            try:
                yield kind.read(ReadDataStream(BytesIO(content[start:place])))
            except (struct.error, EndOfFile, UnicodeDecodeError):
                return
