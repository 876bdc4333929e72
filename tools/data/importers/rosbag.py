"""ROS 2 bags (SQLite and MCAP) into samples, by the reader of the `rosbags` library: no ROS installation is needed.

A field is a path into the message: `angular_velocity.x`, `pose.pose.position.z`, `position[NAME]` for the joint NAME of
a JointState, `data[0]` for an element. A quaternion has the further fields `roll`, `pitch` and `yaw`, rad:
`orientation.pitch`. They are those of a body x forward, y starboard, z down in a frame north, east, down, whatever the
frame of the bag (`frame` of the mapping).
"""

import math
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from glider.firmware.core.maths.rotations import euler_from_quaternion, wrap_angle
from glider.tools.data.errors import InputError
from glider.tools.data.importers.streams import EULER, Samples, Stream, StreamMap

SUFFIXES = (".db3", ".mcap")
MAGIC = b"\x89MCAP0\r\n"
SQLITE = b"SQLite format 3\0"
_STEP = re.compile(r"([A-Za-z_]\w*)(?:\[([^\]]+)\])?")


def read_rosbag(path: Path, mapping: StreamMap, partial: bool = False) -> Stream:
    """Take the samples that a mapping asks for out of a bag: its folder, or one of its files.

    InputError where the bag is no bag, is cut (file and byte), holds a message that cannot be read (its number), or has
    no such field. A cut bag is refused, `partial` or not: other programs put it right.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.highlevel.anyreader import AnyReaderError
    from rosbags.rosbag2 import ReaderError
    from rosbags.typesys import Stores, get_typestore

    for file in storage_files(path):
        whole(file)
    wanted: dict[str, dict[str, Callable[[Any], float]]] = {}
    for column in {**mapping.columns, **mapping.extra}.values():
        wanted.setdefault(column.topic, {})[column.field] = getter(column.field, mapping.frame, path)
    samples = {(topic, field): Samples() for topic, fields in wanted.items() for field in fields}
    number = 0
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
            topics = tuple(sorted(bag.topics))
            taken = [one for one in bag.connections if one.topic in wanted]
            for connection, receipt_ns, data in bag.messages(taken):
                number += 1
                where = f"message {number} of the mapped topics, {connection.topic} ({connection.msgtype})"
                try:
                    message = bag.deserialize(data, connection.msgtype)
                except (AnyReaderError, ValueError, IndexError, AssertionError, struct.error) as error:
                    raise InputError(f"{where}: cannot be read: {error or type(error).__name__}", source=path) from None
                t = _time(message, receipt_ns, mapping.time)
                for field, get in wanted[connection.topic].items():
                    try:
                        value = get(message)
                    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
                        raise InputError(f"{where}: has no number '{field}'", source=path) from None
                    samples[connection.topic, field].t.append(t)
                    samples[connection.topic, field].values.append(value)
    except (ReaderError, AnyReaderError) as error:
        raise InputError(f"not a readable bag: {error}", source=path) from None
    return Stream(samples, 0.0, [], topics)


def storage_files(path: Path) -> list[Path]:
    """The files in which a bag's messages are; InputError where there is none, or a folder without its metadata."""
    if path.is_file():
        if path.suffix not in SUFFIXES:
            raise InputError(f"expected a bag's folder or a file {' or '.join(SUFFIXES)}", source=path)
        return [path]
    if not path.is_dir():
        raise InputError("no such file or folder", source=path)
    found = sorted(file for file in path.iterdir() if file.suffix in SUFFIXES)
    if not (path / "metadata.yaml").is_file():
        raise InputError("no metadata.yaml: not a bag, or never closed (ros2 bag reindex writes one)", source=path)
    if not found and not any(file.name.endswith((".db3.zstd", ".mcap.zstd")) for file in path.iterdir()):
        raise InputError(f"no file {' or '.join(SUFFIXES)}", source=path)
    return found


def whole(file: Path) -> None:
    """InputError, with the byte, for a storage file that is cut or is none."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(100)
        if file.suffix == ".db3":
            if not head.startswith(SQLITE) or len(head) < 100:
                raise InputError(f"cut at byte {size}, or not SQLite", source=file)
            page, pages = struct.unpack_from(">H", head, 16)[0], struct.unpack_from(">I", head, 28)[0]
            expected = (65536 if page == 1 else page) * pages
            if size < expected:
                raise InputError(f"cut at byte {size} of {expected}", source=file)
            return
        if not head.startswith(MAGIC):
            raise InputError("not MCAP: its first bytes are others", source=file)
        place, records = len(MAGIC), 0
        while place + 9 <= size:
            stream.seek(place)
            opcode, length = struct.unpack("<BQ", stream.read(9))
            if place + 9 + length > size:
                break
            place, records = place + 9 + length, records + 1
            if opcode == 2:  # the footer; the magic follows
                stream.seek(place)
                if stream.read() == MAGIC:
                    return
                break
        way = "`mcap recover` writes a file of what is left"
        raise InputError(f"cut at byte {size}, in the record at byte {place} ({records} before it); {way}", source=file)


def _time(message: Any, receipt_ns: int, kind: str) -> float:
    """Time of a message, s since 1970: its header's stamp, where it has one that is set, or when it was recorded."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if kind == "header" and stamp is not None and (stamp.sec or stamp.nanosec):
        return float(stamp.sec + 1e-9 * stamp.nanosec)
    return 1e-9 * receipt_ns


def getter(field: str, frame: str, source: object) -> Callable[[Any], float]:
    """The function that takes a field out of a message."""
    steps = field.split(".")
    angle = steps.pop() if steps[-1] in EULER and len(steps) > 1 else None
    parsed = []
    for step in steps:
        found = _STEP.fullmatch(step)
        if found is None:
            raise InputError(f"not a field: '{field}'", source=source)
        parsed.append(found.groups())

    def get(message: Any) -> float:
        for name, index in parsed:
            owner, message = message, getattr(message, name)
            if index is not None:
                message = message[int(index) if index.isdigit() else list(owner.name).index(index)]
        return float(message) if angle is None else euler_angle(message, EULER.index(angle), frame)

    return get


def euler_angle(q: Any, which: int, frame: str) -> float:
    """Roll, pitch or yaw (0, 1, 2), rad, in NED axes, of a quaternion message x, y, z, w; ValueError for a null one.

    From ENU and a body with z up: roll stays, pitch turns its sign, yaw = pi/2 - yaw.
    """
    norm = math.sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
    if norm < 1e-6:
        raise ValueError("a quaternion of length 0")
    angle = euler_from_quaternion(q.w / norm, q.x / norm, q.y / norm, q.z / norm)[which]
    if frame == "ned" or which == 0:
        return float(angle)
    return float(-angle if which == 1 else wrap_angle(0.5 * math.pi - angle))
