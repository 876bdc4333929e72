"""What of an MCAP file can be trusted: its records up to a cut, past damage, and never one whose checksum fails.

Chunks and attachments carry MCAP's checksums, metadata the one that the recorder adds; records under none (messages
outside chunks, indexes) are not delivered. After damage the next whole chunk is searched for, so that a flipped bit
costs the chunk it is in and not the rest of the flight.
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

from hal.recorder.logfile import CRC_KEY, metadata_crc

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")  # start, end, size unpacked, checksum, length of the compression's name
_MESSAGE = struct.Struct("<HIQQ")
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
# A chunk as the recorder writes it: uncompressed, under 16 MB.
_CHUNK_START = re.compile(rb"\x06.{3}\x00{5}.{16}.{3}\x00{5}.{4}\x00{4}.{3}\x00{5}", re.DOTALL)


@dataclass(frozen=True)
class Damage:
    """Bytes that are not delivered, and why."""

    offset: int
    length: int
    what: str


class Scan:
    """One pass over a file's bytes. `complete`, `end` and `damages` are right once `records` has come to its end."""

    def __init__(self, data: bytes | mmap):
        self._data, self._size = data, len(data)
        self.complete = False  # closed by its writer, down to the last byte
        self.end = 0  # bytes understood; what lies behind is the torn rest of a cut
        self.damages: list[Damage] = []

    @property
    def recognised(self) -> bool:
        """Whether the bytes begin as MCAP does, or are the beginning of such a beginning."""
        start = self._data[: len(MCAP0_MAGIC)]
        return MCAP0_MAGIC.startswith(start)

    def records(self) -> Iterator[bytes | Attachment | Metadata]:
        """Contents of chunks, attachments and metadata, in order, each with its checksum proved. Never raises."""
        place = len(MCAP0_MAGIC)
        if not self.recognised:
            found = self._next_chunk(0)
            if found is None:
                return
            self._damage(0, found, "the file's first bytes")
            place = found
        while place + _RECORD.size <= self._size:
            opcode, length = _RECORD.unpack(self._data[place : place + _RECORD.size])
            after = place + _RECORD.size + length
            if opcode not in _OPCODES or after > self._size:
                found = self._next_chunk(place + 1)
                if found is None:
                    break
                self._damage(place, found - place, "records that make no sense")
                place = found
                continue
            if opcode == Opcode.DATA_END:
                self._finish(place, after)
                return
            body = self._data[place + _RECORD.size : after]
            item, wrong = _checked(opcode, body)
            if wrong:
                after = self._after_damage(place, after)
                self._damage(place, after - place, wrong)
            elif item is not None:
                yield item
            place = after
        self.end = min(place, self._size)

    def _damage(self, offset: int, length: int, what: str) -> None:
        self.damages.append(Damage(offset, length, what))

    def _after_damage(self, place: int, after: int) -> int:
        """Where to go on behind a damaged record: its length may be what is damaged."""
        found = self._next_chunk(place + 1)
        plausible = after == self._size
        if after + _RECORD.size <= self._size:
            opcode, length = _RECORD.unpack(self._data[after : after + _RECORD.size])
            plausible = opcode in _OPCODES and after + _RECORD.size + length <= self._size
        if found is not None and (found < after or not plausible):
            return found
        return after

    def _next_chunk(self, place: int) -> int | None:
        """The first whole chunk from a place on."""
        while match := _CHUNK_START.search(self._data, place):
            start = match.start()
            _, length = _RECORD.unpack(self._data[start : start + _RECORD.size])
            body = self._data[start + _RECORD.size : start + _RECORD.size + length]
            if len(body) == length and not _chunk(body)[1]:
                return start
            place = start + 1
        return None

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


def _checked(opcode: int, body: bytes) -> tuple[bytes | Attachment | Metadata | None, str]:
    """A record's content if its checksum proves it, and else what is wrong; neither for records that carry no data."""
    try:
        if opcode == Opcode.CHUNK:
            return _chunk(body)
        if opcode == Opcode.ATTACHMENT:
            if struct.unpack("<I", body[-4:]) != (zlib.crc32(body[:-4]),):
                return None, "an attachment"
            return Attachment.read(ReadDataStream(BytesIO(body))), ""
        if opcode == Opcode.METADATA:
            metadata = Metadata.read(ReadDataStream(BytesIO(body)))
            if metadata.metadata.get(CRC_KEY) != metadata_crc(metadata.name, metadata.metadata):
                return None, "metadata"
            return metadata, ""
        if opcode == Opcode.MESSAGE:
            return None, "a message outside a chunk, under no checksum"
    except (struct.error, EndOfFile, UnicodeDecodeError, MemoryError, OverflowError):
        return None, "a record that makes no sense"
    return None, ""


def _chunk(body: bytes) -> tuple[bytes | None, str]:
    if len(body) < _CHUNK.size + 8:
        return None, "a chunk too short to be one"
    _, _, size, crc, name_length = _CHUNK.unpack_from(body)
    name = body[_CHUNK.size : _CHUNK.size + name_length]
    if name in (b"lz4", b"zstd"):
        return None, f"a chunk compressed with {name.decode()}, as no recorder of ours writes it"
    start = _CHUNK.size + 8
    content = body[start:]
    if name or struct.unpack_from("<Q", body, _CHUNK.size) != (size,) or len(content) != size:
        return None, "a chunk's head"
    if zlib.crc32(content) != crc:
        return None, "a chunk (its checksum fails)"
    return content, ""


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
