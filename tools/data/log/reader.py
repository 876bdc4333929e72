"""An onboard log, read: complete or cut, whole or damaged, as arrays."""

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata, Schema

from glider.hal.recorder import logfile
from glider.hal.recorder.schema import (
    CDR_HEADER,
    EVENTS_TOPIC,
    LOG_SCHEMA_NAME,
    MESSAGE_ENCODING,
    SCHEMA_ENCODING,
    Field,
    parse_fields,
    specs_from_json,
)
from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file
from glider.tools.data.log.framing import Damage, Scan, chunk_records

_LAST_NS = 2**63 - 1


@dataclass
class Topic:
    """The records of one topic, in the order of the file. `data` is None where they are not float64 records."""

    name: str
    schema_name: str
    fields: tuple[Field, ...]
    times_ns: np.ndarray  # int64, log time, shape (count,)
    sequences: np.ndarray  # int64, number among its kind, from 1
    data: np.ndarray | None  # float64, shape (count, width)
    first: int = 1  # number of the first record that belongs here; in a log that goes on, the first there is

    @property
    def count(self) -> int:
        return len(self.times_ns)

    @property
    def missing(self) -> int:
        """Records before the last one that are not there: dropped in flight, or damaged since."""
        return int(self.sequences[-1]) - self.first + 1 - self.count if self.count else 0

    def column(self, name: str) -> np.ndarray:
        """A field's values, shape (count,) or, for an array field, (count, n); KeyError if there is none."""
        if self.data is None:
            raise KeyError(name)
        place = 0
        for item in self.fields:
            if item.name == name:
                return self.data[:, place : place + item.count] if item.count else self.data[:, place]
            place += item.width
        raise KeyError(name)


@dataclass(frozen=True)
class LogEvent:
    """A line of text, time in s since the log's epoch."""

    time_s: float
    severity: int
    text: str


@dataclass
class Log:
    """All that a log file holds and can be trusted."""

    path: Path
    size: int
    complete: bool  # closed by its writer
    end: int  # bytes read; a cut file's torn rest lies behind
    damages: list[Damage]
    topics: dict[str, Topic]
    events: list[LogEvent]
    attachments: dict[str, str]
    metadata: dict[str, str]  # written at the start
    ending: dict[str, str]  # written at the end; empty in a cut file
    attached_ns: int = 0  # log time of the attachments, which is the epoch's

    @property
    def epoch_ns(self) -> int:
        """Unix time of the flight's t = 0, ns; 0 where the log gives no date."""
        try:
            epoch = int(self.metadata.get("epoch_ns", self.attached_ns))
        except ValueError:
            return 0
        return epoch if abs(epoch) <= _LAST_NS else 0

    @property
    def began(self) -> str:
        """Date and time of the first record, ISO 8601, UTC; empty where the log gives no date."""
        firsts = [int(topic.times_ns.min()) for topic in self.topics.values() if topic.count]
        if self.epoch_ns <= 0 or not firsts:
            return ""
        try:
            return datetime.fromtimestamp(min(firsts) // 10**9, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        except (ValueError, OverflowError, OSError):
            return ""

    @property
    def whole(self) -> bool:
        """Nothing is missing that the recorder had written."""
        return self.complete and not self.damages

    @property
    def duration_s(self) -> float:
        """From the first record to the last."""
        spans = [topic.times_ns for topic in self.topics.values() if topic.count]
        return (max(int(t.max()) for t in spans) - min(int(t.min()) for t in spans)) / 1e9 if spans else 0.0


@dataclass
class _Gathered:
    schema_name: str
    fields: tuple[Field, ...] | None
    topic: str
    times: list[int] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)


@contextmanager
def opened(path: Path) -> Iterator[bytes | mmap.mmap]:
    """A file's bytes without reading them all; InputError where it cannot be opened or is no file."""
    require_file(path)
    try:
        file = path.open("rb")
    except OSError as error:
        raise InputError(error.strerror or str(error), source=path) from None
    with file:
        if path.stat().st_size == 0:
            yield b""
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            yield data


class Definitions:
    """Channels by number: from the chunks, or from the recorder's own list where the chunk with them is lost."""

    def __init__(self) -> None:
        self._schemas: dict[int, Schema] = {}
        self.channels: dict[int, tuple[Channel, Schema]] = {}

    def learn(self, record: Schema | Channel) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif record.schema_id in self._schemas:
            self.channels[record.id] = (record, self._schemas[record.schema_id])

    def learn_from(self, attachment: Attachment) -> None:
        """The list among the attachments; the recorder numbers channels in its order, the events last."""
        try:
            specs = specs_from_json(attachment.data.decode("utf-8"))
        except (ValueError, KeyError, TypeError):
            return
        texts = [(spec.topic, spec.schema_name, spec.text()) for spec in specs]
        texts.append((EVENTS_TOPIC, LOG_SCHEMA_NAME, logfile.schema.LOG_SCHEMA))
        for number, (topic, name, text) in enumerate(texts, start=1):
            schema = Schema(id=number, name=name, encoding=SCHEMA_ENCODING, data=text.encode())
            channel = Channel(id=number, topic=topic, message_encoding=MESSAGE_ENCODING, schema_id=number, metadata={})
            self.channels[number] = (channel, schema)


def read_log(path: Path | str, scan_by: type[Scan] = Scan) -> Log:
    """Everything in a log up to where it was cut; InputError only where the file is no log at all."""
    path = Path(path)
    with opened(path) as data:
        scan = scan_by(data)
        log = Log(path, len(data), False, 0, [], {}, [], {}, {}, {})
        found = _gather(scan, log)
        if not scan.recognised and not scan.damages:
            raise InputError("not an MCAP file", source=path)
    log.complete, log.end, log.damages = scan.complete, scan.end, scan.damages
    for gathered in found.values():
        topic = log.topics.get(gathered.topic)
        if topic is None:
            log.topics[gathered.topic] = _topic(gathered)
            if logfile.PART in log.metadata and gathered.sequences:
                log.topics[gathered.topic].first = gathered.sequences[0]
    return log


def _gather(scan: Scan, log: Log) -> dict[int, _Gathered]:
    definitions = Definitions()
    found: dict[int, _Gathered] = {}
    for item in scan.records():
        if isinstance(item, Attachment):
            log.attached_ns = min(item.log_time, _LAST_NS)
            if item.name == logfile.SCHEMAS_ATTACHMENT:
                definitions.learn_from(item)
            else:
                log.attachments[item.name] = item.data.decode("utf-8", "replace")
        elif isinstance(item, Metadata):
            entries = {key: value for key, value in item.metadata.items() if key != logfile.CRC_KEY}
            (log.ending if item.name == logfile.END else log.metadata).update(entries)
        else:
            for record in chunk_records(item):
                if not isinstance(record, Message):
                    definitions.learn(record)
                elif record.channel_id in definitions.channels:
                    _take(record, definitions, found, log)
    return found


def _take(message: Message, definitions: Definitions, found: dict[int, _Gathered], log: Log) -> None:
    gathered = found.get(message.channel_id)
    if gathered is None:
        channel, schema = definitions.channels[message.channel_id]
        float64s = schema.encoding == SCHEMA_ENCODING and channel.message_encoding == MESSAGE_ENCODING
        fields = parse_fields(schema.data.decode("utf-8", "replace")) if float64s else None
        gathered = found[message.channel_id] = _Gathered(schema.name, fields, channel.topic)
    gathered.times.append(min(message.log_time, _LAST_NS))
    gathered.sequences.append(message.sequence)
    if gathered.fields is not None:
        gathered.data.append(message.data)
    elif gathered.schema_name == LOG_SCHEMA_NAME:
        try:
            severity, text = logfile.decode_event(message.data)
        except (struct.error, ValueError, IndexError):
            return
        log.events.append(LogEvent((message.log_time - log.epoch_ns) / 1e9, severity, text))


def _topic(gathered: _Gathered) -> Topic:
    data = None
    if gathered.fields is not None:
        width = sum(item.width for item in gathered.fields)
        size = len(CDR_HEADER) + 8 * width
        if all(len(message) == size and message.startswith(CDR_HEADER) for message in gathered.data):
            joined = b"".join([message[len(CDR_HEADER) :] for message in gathered.data])
            data = np.frombuffer(joined, dtype="<f8").reshape(-1, width)
    return Topic(
        name=gathered.topic,
        schema_name=gathered.schema_name,
        fields=gathered.fields or (),
        times_ns=np.array(gathered.times, dtype=np.int64),
        sequences=np.array(gathered.sequences, dtype=np.int64),
        data=data,
    )
