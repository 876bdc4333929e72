"""A cut or damaged log made into a complete one: what can be trusted is written anew, the original stays."""

import os
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import Writer

from hal.recorder import disk, logfile
from tools.errors import InputError
from tools.log.framing import Damage, Scan, chunk_records
from tools.log.reader import Definitions, opened

REPAIR = "glider_repair"  # metadata record of a repaired log


@dataclass
class RepairReport:
    """What a repair kept and what it lost. `out` is None where there was nothing to repair."""

    out: Path | None
    messages: int
    torn_bytes: int  # behind the last whole record of a cut file
    was_complete: bool
    damages: list[Damage]


class _Copy:
    """Writes trusted records into a new log, under numbers of its own."""

    def __init__(self, writer: Writer):
        self._writer = writer
        self._numbers: dict[int, int] = {}
        self.definitions = Definitions()
        self.messages = 0

    def message(self, message: Message) -> None:
        if message.channel_id not in self.definitions.channels:
            return
        if message.channel_id not in self._numbers:
            channel, schema = self.definitions.channels[message.channel_id]
            schema_id = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._numbers[message.channel_id] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        self._writer.add_message(
            self._numbers[message.channel_id], message.log_time, message.data, message.publish_time, message.sequence
        )
        self.messages += 1

    def attachment(self, item: Attachment) -> None:
        if item.name == logfile.SCHEMAS_ATTACHMENT:
            # Its numbers are those of the first writing; here the channels may come in another order.
            self.definitions.learn_from(item)
        else:
            self._writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)


def repair(path: Path | str, out: Path | str | None = None) -> RepairReport:
    """Write what can be trusted of `path` as a complete log beside it (NAME.repaired.mcap) or to `out`.

    Nothing is written where the log is whole. InputError where the file is no log; FileExistsError rather than writing
    over a file.
    """
    path = Path(path)
    out = path.with_name(f"{path.name.removesuffix('.mcap')}.repaired.mcap") if out is None else Path(out)
    with opened(path) as data:
        check = Scan(data)
        for _ in check.records():
            pass
        if not check.recognised and not check.damages:
            raise InputError("not an MCAP file", source=path)
        report = RepairReport(None, 0, len(data) - check.end, check.complete, check.damages)
        if check.complete and not check.damages:
            return report
        fd = disk.create(str(out))
        try:
            report.messages = _write(Scan(data), fd, path, report)
            report.out = out
        finally:
            disk.close(fd, str(out), keep=report.out is not None)
    return report


def _write(scan: Scan, fd: int, path: Path, report: RepairReport) -> int:
    stream = disk.DiskFile(fd)
    writer = logfile.start_writer(stream)
    copy = _Copy(writer)
    for item in scan.records():
        if isinstance(item, Metadata):
            writer.add_metadata(item.name, item.metadata)
        elif isinstance(item, Attachment):
            copy.attachment(item)
        else:
            for record in chunk_records(item):
                if isinstance(record, Message):
                    copy.message(record)
                elif isinstance(record, Schema | Channel):
                    copy.definitions.learn(record)
        _sync(stream, full_only=True)
    entries = {
        "repaired_from": path.name,
        "was_complete": str(report.was_complete).lower(),
        "torn_bytes": str(report.torn_bytes),
        "damaged_places": str(len(report.damages)),
    }
    writer.add_metadata(REPAIR, {**entries, logfile.CRC_KEY: logfile.metadata_crc(REPAIR, entries)})
    writer.finish()
    _sync(stream, full_only=False)
    return copy.messages


def _sync(stream: disk.DiskFile, *, full_only: bool) -> None:
    if (stream.full or not full_only) and not stream.sync():
        raise OSError(stream.last_errno, os.strerror(stream.last_errno))
