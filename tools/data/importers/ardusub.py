"""Logs of ArduSub (and other vehicles of ArduPilot) into samples, by pymavlink: DataFlash .BIN and telemetry .tlog.

A topic is a message's name; `IMU[1]` asks for one instance where a message has several (field I). A field is a field of
the message: `ATT`, `Roll`. Times are the vehicle's: TimeUS in a .BIN, time_boot_ms in a .tlog.
"""

import contextlib
import io
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file
from glider.tools.data.importers.streams import Samples, Stream, StreamMap

HEAD, FMT, FMT_LENGTH = b"\xa3\x95", 0x80, 89
STATION = 255  # system of a ground station
DATAFLASH, TELEMETRY = (".bin", ".log_bin"), (".tlog",)
_TOPIC = re.compile(r"(\w+)(?:\[(\d+)\])?")


def read_ardusub(path: Path, mapping: StreamMap, partial: bool = False) -> Stream:
    """Take the samples that a mapping asks for out of a .BIN or .tlog.

    partial: take what is readable of a file that is cut or damaged; else InputError names file, byte and message.
    """
    kind = path.suffix.lower()
    if kind not in DATAFLASH + TELEMETRY:
        raise InputError("expected a file .BIN (DataFlash) or .tlog (telemetry)", source=path)
    require_file(path)
    data = path.read_bytes()
    end, messages, wrong = dataflash_end(data) if kind in DATAFLASH else telemetry_end(data)
    if messages == 0:
        raise InputError(f"holds no message: not a {path.suffix} log", source=path)
    if wrong is not None and not partial:
        raise InputError(f"{wrong} (--partial imports what can be read)", source=path)
    notes = [] if wrong is None else [wrong]
    wanted: dict[tuple[str, int | None], list[tuple[str, Samples]]] = {}
    samples: dict[tuple[str, str], Samples] = {}
    for column in {**mapping.columns, **mapping.extra}.values():
        found = _TOPIC.fullmatch(column.topic)
        if found is None:
            raise InputError(f"not a message's name: '{column.topic}'", source=path)
        key = (found[1], None if found[2] is None else int(found[2]))
        samples[column.topic, column.field] = Samples()
        wanted.setdefault(key, []).append((column.field, samples[column.topic, column.field]))
    read = _dataflash if kind in DATAFLASH else _telemetry
    epoch: float | None = None
    topics: set[str] = set()
    with tempfile.TemporaryDirectory(prefix="glider-") as folder:
        readable = path
        if end < len(data):
            readable = Path(folder) / path.name
            readable.write_bytes(data[:end])
        for name, instance, t, start, message in read(readable, {name for name, _ in wanted}, topics):
            epoch = start if epoch is None else epoch
            for key in ((name, None), (name, instance)) if instance is not None else ((name, None),):
                for field, into in wanted.get(key, []):
                    value = getattr(message, field, None)
                    if not isinstance(value, int | float):
                        raise InputError(f"message {name} has no number '{field}'", source=path)
                    into.t.append(t)
                    into.values.append(float(value))
    return Stream(samples, epoch, notes, tuple(sorted(topics)))


Taken = tuple[str, int | None, float, float | None, Any]  # name, instance, t s, Unix time of t = 0, the message


def _dataflash(path: Path, names: set[str], topics: set[str]) -> Iterator[Taken]:
    """Messages of a DataFlash log with times by its own clock, s since boot."""
    from pymavlink import DFReader

    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        reader = DFReader.DFReader_binary(str(path))
    topics |= {name for name in reader.name_to_id if name not in ("FMT", "FMTU", "UNIT", "MULT", "PARM")}
    while True:
        with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
            message = reader.recv_match(type=sorted(names))
        if message is None:
            return
        t = 1e-6 * message.TimeUS if hasattr(message, "TimeUS") else float(message._timestamp)
        start = message._timestamp - t
        field = message.fmt.instance_field or "I"  # older logs do not say which field it is
        instance = int(getattr(message, field)) if field in message.fmt.columns else None
        yield message.get_type(), instance, t, start if start > 1e9 else None, message


def _telemetry(path: Path, names: set[str], topics: set[str]) -> Iterator[Taken]:
    """Messages of a telemetry log with times by the vehicle's clock, s since boot; by their receipt without one."""
    from pymavlink import mavutil

    found, offset = [], None
    link = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    try:
        while (message := link.recv_match()) is not None:
            name = message.get_type()
            if name == "BAD_DATA" or message.get_srcSystem() == STATION:
                continue
            topics.add(name)
            boot = getattr(message, "time_boot_ms", None)
            if boot is not None:
                delay = message._timestamp - 1e-3 * boot
                offset = delay if offset is None else min(offset, delay)
            if name in names:
                found.append((name, boot, message))
    finally:
        link.close()
    offset = offset or 0.0  # receipt less boot, by the message that came through fastest
    for name, boot, message in found:
        t = message._timestamp - offset if boot is None else 1e-3 * boot
        yield name, None, t, offset, message


def dataflash_end(data: bytes) -> tuple[int, int, str | None]:
    """The end of the last whole message, the number of messages, and what is wrong, None where nothing is.

    Zeros or ones that fill the last page are no damage.
    """
    lengths = {FMT: FMT_LENGTH}
    place = end = messages = 0
    while place + 3 <= len(data):
        kind = data[place + 2]
        if data[place : place + 2] != HEAD or kind not in lengths:
            if data[place:].strip(b"\0") == b"" or data[place:].strip(b"\xff") == b"":
                return place, messages, None
            return place, messages, f"damaged at byte {place}: no message begins there ({messages} before it)"
        after = place + lengths[kind]
        if after > len(data):
            return place, messages, f"cut at byte {len(data)}, in message {messages + 1}, which begins at byte {place}"
        if kind == FMT:
            lengths[data[place + 3]] = data[place + 4]
        place = end = after
        messages += 1
    wrong = None if place == len(data) else f"cut at byte {len(data)}, in message {messages + 1} (byte {place})"
    return end, messages, wrong


def telemetry_end(data: bytes) -> tuple[int, int, str | None]:
    """The same of a .tlog: eight bytes of time, then a MAVLink packet (version 1 or 2)."""
    place = messages = 0
    while place < len(data):
        head = data[place + 8 : place + 11]
        cut = f"cut at byte {len(data)}, in message {messages + 1}, which begins at byte {place}"
        if len(head) < 3:
            return place, messages, cut
        if head[0] == 0xFE:
            length = 8 + head[1]
        elif head[0] == 0xFD:
            length = 12 + head[1] + 13 * (head[2] & 1)
        else:
            return place, messages, f"damaged at byte {place}: no packet of MAVLink ({messages} before it)"
        if place + 8 + length > len(data):
            return place, messages, cut
        place += 8 + length
        messages += 1
    return place, messages, None
