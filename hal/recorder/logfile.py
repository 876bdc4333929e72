"""An onboard log as MCAP: small uncompressed chunks with checksums, texts as attachments, one topic a kind of record.

Everything a reader needs stands under a checksum: chunks and attachments under MCAP's own; metadata, which MCAP gives
none, under an entry of its own (`crc32`). The schemas stand in an attachment too, so that the loss of the first chunk,
where MCAP puts them, is not the loss of the flight.
"""

import json
import math
import struct
import sys
import zlib
from collections.abc import Mapping
from typing import Any

from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from glider.hal.recorder import schema
from glider.hal.recorder.schema import RecordSpec

CHUNK_BYTES = 16_384
START, END = "glider", "glider_end"  # metadata records
SCHEMAS_ATTACHMENT = "glider_schemas.json"
CRC_KEY = "crc32"
PART = "part"  # metadata entry of a log that goes on where another one broke off: its number, from 2
_LAST_NS = 2**63 - 1


def metadata_crc(name: str, entries: Mapping[str, str]) -> str:
    """The checksum of a metadata record: of its name and its other entries."""
    rest = sorted((key, value) for key, value in entries.items() if key != CRC_KEY)
    return f"{zlib.crc32(json.dumps([name, rest]).encode()):08x}"


def encode_event(log_ns: int, severity: int, text: str) -> bytes:
    """A rcl_interfaces/msg/Log message, CDR."""
    data = text.encode("utf-8", "replace")
    body = struct.pack("<iIB3x", min(log_ns // 10**9, 2**31 - 1), log_ns % 10**9, severity)
    for string in (b"glider", data, b"", b""):
        body += struct.pack("<I", len(string) + 1) + string + b"\0"
        body += b"\0" * (-len(body) % 4)
    return schema.CDR_HEADER + body + struct.pack("<I", 0)


def decode_event(data: bytes) -> tuple[int, str]:
    """Severity and text of such a message; struct.error or ValueError where it is none."""
    severity = data[4 + 8]
    place = 4 + 12
    (length,) = struct.unpack_from("<I", data, place)
    place += 4 + length
    place += -(place - 4) % 4
    (length,) = struct.unpack_from("<I", data, place)
    text = bytes(data[place + 4 : place + 4 + length - 1])
    return severity, text.decode("utf-8")


def start_writer(stream: Any, profile: str = "ros2") -> Writer:
    """An MCAP writer with all its checksums, its head written; `stream` takes write, tell and flush."""
    writer = Writer(
        stream, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE, enable_crcs=True, enable_data_crcs=True
    )
    writer.start(profile=profile, library=f"glider; {LIBRARY_IDENTIFIER}")
    return writer


class LogFile:
    """Writes one log. `stream` is a DiskFile or the like; nothing is on the disk before its owner sees to it."""

    def __init__(
        self,
        stream: Any,
        specs: list[RecordSpec] | tuple[RecordSpec, ...],
        *,
        attachments: Mapping[str, str],
        metadata: Mapping[str, str],
        epoch_ns: int = 0,
    ):
        if sys.byteorder != "little":
            raise RuntimeError("logs are written as the numbers lie in memory, and this machine's are big-endian")
        self._epoch_ns = epoch_ns
        self._last_ns = epoch_ns
        self._writer = start_writer(stream)
        self._metadata(START, {**metadata, "epoch_ns": str(epoch_ns)})
        for name, text in {**attachments, SCHEMAS_ATTACHMENT: schema.specs_to_json(specs)}.items():
            kind = "application/json" if name.endswith(".json") else "text/plain"
            self._writer.add_attachment(epoch_ns, epoch_ns, name, kind, text.encode("utf-8"))
        self._channels = [
            self._writer.register_channel(
                spec.topic,
                schema.MESSAGE_ENCODING,
                self._writer.register_schema(spec.schema_name, schema.SCHEMA_ENCODING, spec.text().encode("utf-8")),
            )
            for spec in specs
        ]
        events = self._writer.register_schema(
            schema.LOG_SCHEMA_NAME, schema.SCHEMA_ENCODING, schema.LOG_SCHEMA.encode("utf-8")
        )
        self._events = self._writer.register_channel(schema.EVENTS_TOPIC, schema.MESSAGE_ENCODING, events)

    def _metadata(self, name: str, entries: Mapping[str, str]) -> None:
        texts = {str(key): str(value) for key, value in entries.items()}
        self._writer.add_metadata(name, {**texts, CRC_KEY: metadata_crc(name, texts)})

    def _log_ns(self, time_s: float) -> int:
        # A record with a time that is none is still a record; it keeps its neighbour's place.
        if math.isfinite(time_s):
            self._last_ns = min(max(self._epoch_ns + round(time_s * 1e9), 0), _LAST_NS)
        return self._last_ns

    def record(self, channel: int, sequence: int, time_s: float, payload: bytes | memoryview) -> None:
        """A record of specs[channel]: its number among its kind, its time, its float64s as they lie in memory."""
        log_ns = self._log_ns(time_s)
        data = b"".join((schema.CDR_HEADER, payload))
        self._writer.add_message(self._channels[channel], log_ns, data, log_ns, sequence & 0xFFFFFFFF)

    def event(self, sequence: int, time_s: float, severity: int, text: str) -> None:
        """A line of text."""
        log_ns = self._log_ns(time_s)
        data = encode_event(log_ns, severity, text)
        self._writer.add_message(self._events, log_ns, data, log_ns, sequence & 0xFFFFFFFF)

    def flush(self) -> None:
        """Give everything so far to the stream, as a chunk of its own."""
        self._writer.flush()

    def finish(self, ending: Mapping[str, str]) -> None:
        """Close the log, with what is known only at its end."""
        self._writer.flush()
        self._metadata(END, ending)
        self._writer.finish()
