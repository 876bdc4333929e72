"""A cut or damaged log made into a complete one: what can be trusted is written anew, the original stays.

The parts of one flight become one log.
"""

import os
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import Writer

from glider.hal.recorder import disk, logfile
from glider.tools.data.errors import InputError
from glider.tools.data.log.framing import Damage, Scan, chunk_records
from glider.tools.data.log.parts import FlightLog, later_parts, read_flight
from glider.tools.data.log.reader import Definitions, opened

REPAIR = "glider_repair"  # metadata record of a repaired log


@dataclass
class RepairReport:
    """What a repair kept and what it lost. `out` is None where there was nothing to repair."""

    out: Path | None
    messages: int
    torn_bytes: int  # behind the last whole record of a cut file
    was_complete: bool  # closed by its writer; of parts, the last one
    damages: list[Damage]
    parts: list[Path] = field(default_factory=list)  # files it was written from, in order
    absent: list[Path] = field(default_factory=list)  # parts that are not there
    left_out: list[str] = field(default_factory=list)  # files with a part's name that are none, and why


class _Copy:
    """Writes trusted records into a new log, under numbers of its own; one file after the other."""

    def __init__(self, writer: Writer):
        self._writer = writer
        self._known: dict[tuple, int] = {}  # what a channel is, to its number here
        self._numbers: dict[int, int] = {}  # a channel's number in the present file, to that
        self._attached: set[str] = set()
        self._started = False
        self.definitions = Definitions()
        self.messages = 0

    def next_file(self) -> None:
        """Numbers of channels are a file's own."""
        self._numbers, self.definitions = {}, Definitions()

    def message(self, message: Message) -> None:
        if message.channel_id not in self.definitions.channels:
            return
        if message.channel_id not in self._numbers:
            self._numbers[message.channel_id] = self._number(*self.definitions.channels[message.channel_id])
        self._writer.add_message(
            self._numbers[message.channel_id], message.log_time, message.data, message.publish_time, message.sequence
        )
        self.messages += 1

    def _number(self, channel: Channel, schema: Schema) -> int:
        what = (channel.topic, channel.message_encoding, *sorted(channel.metadata.items()))
        key = (what, schema.name, schema.encoding, schema.data)
        if key not in self._known:
            schema_id = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._known[key] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        return self._known[key]

    def attachment(self, item: Attachment, *, joining: bool) -> None:
        if item.name == logfile.SCHEMAS_ATTACHMENT:
            # Its numbers are those of the first writing; here the channels may come in another order.
            self.definitions.learn_from(item)
        elif not (joining and item.name in self._attached):  # every part carries all of them
            self._attached.add(item.name)
            self._writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)

    def metadata(self, item: Metadata, *, joining: bool) -> None:
        """A metadata record; of parts that are joined, what the first that has any says at its start."""
        entries = item.metadata
        if joining and item.name == logfile.START:
            if self._started:
                return
            self._started = True
            kept = {key: text for key, text in entries.items() if key not in (logfile.PART, logfile.CRC_KEY)}
            entries = {**kept, logfile.CRC_KEY: logfile.metadata_crc(item.name, kept)}
        self._writer.add_metadata(item.name, entries)


def repair(path: Path | str, out: Path | str | None = None) -> RepairReport:
    """Write what can be trusted of `path` as a complete log beside it (NAME.repaired.mcap) or to `out`.

    Where it goes on in further parts, they become one log. Nothing is written where the log is whole. InputError where
    the file is no log; FileExistsError rather than writing over a file.
    """
    path = Path(path)
    out = path.with_name(f"{path.name.removesuffix('.mcap')}.repaired.mcap") if out is None else Path(out)
    report = _look(path)
    if report.was_complete and not report.damages and len(report.parts) == 1:
        return report
    with ExitStack() as stack:
        scans = [Scan(stack.enter_context(opened(file))) for file in report.parts]
        fd = disk.create(str(out))
        try:
            report.messages = _write(scans, fd, report)
            report.out = out
        finally:
            disk.close(fd, str(out), keep=report.out is not None)
    return report


def _look(path: Path) -> RepairReport:
    """What is wrong with a log, and which files it is in; nothing written."""
    flight = read_flight(path) if later_parts(path) else None
    if isinstance(flight, FlightLog):
        report = RepairReport(None, 0, flight.size - flight.end, flight.complete, flight.damages)
        report.parts = [part.log.path for part in flight.parts]
        report.absent, report.left_out = list(flight.absent.values()), flight.left_out
        return report
    with opened(path) as data:
        check = Scan(data)
        for _ in check.records():
            pass
        if not check.recognised and not check.damages:
            raise InputError("not an MCAP file", source=path)
        return RepairReport(None, 0, len(data) - check.end, check.complete, check.damages, [path])


def _write(scans: list[Scan], fd: int, report: RepairReport) -> int:
    stream = disk.DiskFile(fd)
    writer = logfile.start_writer(stream)
    copy = _Copy(writer)
    joining = len(scans) > 1
    for scan in scans:
        copy.next_file()
        for item in scan.records():
            if isinstance(item, Metadata):
                copy.metadata(item, joining=joining)
            elif isinstance(item, Attachment):
                copy.attachment(item, joining=joining)
            else:
                _copy_chunk(copy, item)
            _sync(stream, full_only=True)
    entries = {
        "repaired_from": ", ".join(file.name for file in report.parts),
        "was_complete": str(report.was_complete).lower(),
        "torn_bytes": str(report.torn_bytes),
        "damaged_places": str(len(report.damages)),
    }
    if report.absent:
        entries["absent"] = ", ".join(file.name for file in report.absent)
    writer.add_metadata(REPAIR, {**entries, logfile.CRC_KEY: logfile.metadata_crc(REPAIR, entries)})
    writer.finish()
    _sync(stream, full_only=False)
    return copy.messages


def _copy_chunk(copy: _Copy, content: bytes) -> None:
    for record in chunk_records(content):
        if isinstance(record, Message):
            copy.message(record)
        else:
            copy.definitions.learn(record)


def _sync(stream: disk.DiskFile, *, full_only: bool) -> None:
    if (stream.full or not full_only) and not stream.sync():
        raise OSError(stream.last_errno, os.strerror(stream.last_errno))
