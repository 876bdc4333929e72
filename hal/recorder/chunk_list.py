"""The index of a long log's chunks in a seventh of the memory: a list for an MCAP writer, kept as packed bytes.

The writer appends one index a chunk, several a second, and walks over them once, at its end.
"""

import struct
from collections.abc import Iterator
from typing import Any

from mcap.records import ChunkIndex

_HEAD = struct.Struct("<6QB")
_CHANNEL = struct.Struct("<HQ")
_LIST = "_Writer__chunk_indices"  # where mcap 1.2 to 1.6 keep them


class ChunkList:
    """`append` and iteration, as of a list of ChunkIndex of uncompressed chunks."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._count = 0

    def append(self, index: ChunkIndex) -> None:
        """Keep one."""
        places = index.message_index_offsets
        self._data += _HEAD.pack(
            index.message_start_time, index.message_end_time, index.chunk_start_offset, index.chunk_length,
            index.message_index_length, index.uncompressed_size, len(places),
        )  # fmt: skip
        for channel, offset in places.items():
            self._data += _CHANNEL.pack(channel, offset)
        self._count += 1

    def __len__(self) -> int:
        return self._count

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return len(self._data)

    def __iter__(self) -> Iterator[ChunkIndex]:
        place = 0
        while place < len(self._data):
            start, end, offset, length, index_length, size, channels = _HEAD.unpack_from(self._data, place)
            place += _HEAD.size
            places = {}
            for _ in range(channels):
                channel, where = _CHANNEL.unpack_from(self._data, place)
                places[channel] = where
                place += _CHANNEL.size
            yield ChunkIndex(
                message_start_time=start, message_end_time=end, chunk_start_offset=offset, chunk_length=length,
                message_index_offsets=places, message_index_length=index_length, compression="", compressed_size=size,
                uncompressed_size=size,
            )  # fmt: skip


def use_packed_index(writer: Any) -> bool:
    """Have a fresh writer keep its chunks' index so; False where it keeps it somewhere else, and then as it does."""
    if getattr(writer, _LIST, None) != []:
        return False
    setattr(writer, _LIST, ChunkList())
    return True
