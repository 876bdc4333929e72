"""A flight watched from the laptop: what its recording process passes on, in Foxglove's WebSocket protocol.

Onboard there is the socket of hal/recorder/live_stream.py and nothing else; the server is the laptop's own. Topics as
in the log (/tick, /events), beside them /view (angles in degrees, reaction and fault in words) and /pose for a 3D
panel.
"""

import json
import math
import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glider.firmware.autopilot import MODES
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.faults import FAULTS, Reaction
from glider.hal.recorder import live_stream, ring, schema
from glider.hal.recorder.logfile import encode_event
from glider.hal.recorder.schema import RecordSpec, specs_from_json
from glider.tools.data.errors import InputError

MAX_MESSAGE_BYTES = 1 << 20  # bytes of anything on this line
NAME = "live"  # the socket, beside the heartbeat
VIEW = {  # of /view, from /tick: degrees where the name says so
    "depth_m": "est_depth_m", "ref_depth_m": "ref_depth_m", "depth_rate_m_s": "est_depth_rate_m_s",
    "roll_deg": "est_roll_rad", "pitch_deg": "est_pitch_rad", "yaw_deg": "est_yaw_rad",
    "ref_pitch_deg": "ref_pitch_rad", "ref_roll_deg": "ref_roll_rad", "ballast_kg": "cmd_ballast_kg",
    "slider_m": "cmd_slider_m", "servo_deg": "cmd_servo_rad", "speed_m_s": "est_u_m_s",
}  # fmt: skip


@dataclass(frozen=True)
class LiveRecord:
    """A record of a flight under way: numbers by the spec of its topic; an event has a severity and a text instead."""

    spec: RecordSpec | None
    time_s: float
    numbers: Any  # a view of float64
    severity: int = 0
    text: str = ""
    data: bytes = b""  # the numbers as they came


class LogLine:
    """The connection to a recording process. InputError where there is none, or where something else answers."""

    def __init__(self, path: Path):
        self._line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._line.connect(str(path))
            greeting = json.loads(self._take() or b"null")
            self.specs = specs_from_json(json.dumps(greeting["specs"]))
            self.metadata = {str(name): str(text) for name, text in greeting["metadata"].items()}
        except OSError as error:
            raise InputError(f"{error.strerror or error}: no flight with --live here", source=path) from None
        except (ValueError, TypeError, KeyError, AttributeError):
            raise InputError("no recording process of a flight answers here", source=path) from None

    def _read(self, size: int) -> bytes:
        """So many bytes; fewer where the connection ends."""
        data = b""
        while len(data) < size and (piece := self._line.recv(size - len(data))):
            data += piece
        return data

    def _take(self) -> bytes:
        """What comes next; empty at the end."""
        head = self._read(live_stream.HEAD.size)
        if len(head) < live_stream.HEAD.size:
            return b""
        (size,) = live_stream.HEAD.unpack(head)
        if size > MAX_MESSAGE_BYTES:
            raise ValueError("no line of a flight")
        data = self._read(size)
        return data if len(data) == size else b""

    def records(self) -> Iterator[LiveRecord]:
        """Until the flight ends. ValueError where what comes is no record."""
        while data := self._take():
            channel, time_s = live_stream.RECORD.unpack_from(data)
            body = data[live_stream.RECORD.size :]
            if channel == ring.EVENT_CHANNEL and body:
                yield LiveRecord(None, time_s, memoryview(b""), body[0], body[1:].decode("utf-8", "replace"))
            elif 0 <= channel < len(self.specs) and len(body) == 8 * self.specs[channel].width:
                yield LiveRecord(self.specs[channel], time_s, memoryview(body).cast("d"), data=body)
            else:
                raise ValueError("no record of a flight")

    def close(self) -> None:
        self._line.close()


def viewed(record: LiveRecord) -> dict[str, Any]:
    """/view of a tick; a number that is not there is null."""
    assert record.spec is not None
    found: dict[str, Any] = {"time_s": record.time_s}
    for name, source in VIEW.items():
        number = record.numbers[record.spec.index(source)]
        found[name] = None if math.isnan(number) else math.degrees(number) if name.endswith("_deg") else number
    at = {name: record.numbers[record.spec.index(name)] for name in ("mode", "reaction", "fault", "leg")}
    reaction, fault = int(at["reaction"]), int(at["fault"])
    found["mode"] = MODES.get(at["mode"], "?")
    found["leg"] = int(at["leg"]) + 1
    found["reaction"] = Reaction(reaction).name if reaction in list(Reaction) else "?"
    found["fault"] = f"{fault}: {FAULTS[fault]}" if fault in FAULTS else ""
    return found


class View:
    """Foxglove's server and its channels. OSError-like errors of its own where the port is taken."""

    def __init__(self, line: LogLine, port: int):
        import foxglove

        self._fg = foxglove
        self._context = foxglove.Context()
        self._channels = {spec.topic: self._channel(spec.topic, spec.schema_name, spec.text()) for spec in line.specs}
        self._events = self._channel(schema.EVENTS_TOPIC, schema.LOG_SCHEMA_NAME, schema.LOG_SCHEMA)
        self._view = foxglove.Channel("/view", context=self._context)
        self._pose = foxglove.channels.FrameTransformChannel("/pose", context=self._context)
        name = f"glider: {line.metadata.get('mission', '?')}"
        try:
            self.server = foxglove.start_server(name=name, host="127.0.0.1", port=port, context=self._context)
        except Exception as error:  # the library's own
            raise InputError(f"port {port}: {error}") from None

    def _channel(self, topic: str, name: str, text: str) -> Any:
        kind = self._fg.Schema(name=name, encoding=schema.SCHEMA_ENCODING, data=text.encode())
        return self._fg.Channel(topic, schema=kind, message_encoding=schema.MESSAGE_ENCODING, context=self._context)

    def show(self, record: LiveRecord) -> None:
        """Pass a record on, stamped with the laptop's time."""
        now = time.time_ns()
        if record.spec is None:
            self._events.log(encode_event(now, record.severity, record.text), log_time=now)
            return
        self._channels[record.spec.topic].log(schema.CDR_HEADER + record.data, log_time=now)
        if record.spec.topic == "/tick":
            self._view.log(viewed(record), log_time=now)
            self._pose.log(self._transform(record, now), log_time=now)

    def _transform(self, record: LiveRecord, now: int) -> Any:
        """Body in the world for a 3D panel: x north, y west, z up, from north, east, down."""
        spec = record.spec
        assert spec is not None
        pose = (
            0.0 if math.isnan(number) else number
            for number in (
                record.numbers[spec.index(name)]
                for name in ("est_x_m", "est_y_m", "est_depth_m", "est_roll_rad", "est_pitch_rad", "est_yaw_rad")
            )
        )
        return body_in_world(now, "glider", *pose)

    def close(self) -> None:
        self.server.stop()


def body_in_world(
    ns: int, name: str, north: float, east: float, depth: float, roll: float, pitch: float, yaw: float
) -> Any:
    """A body at a time (ns) as Foxglove's FrameTransform, in the frame `world`: x north, y west, z up; m, rad."""
    from foxglove import messages

    w, i, j, k = quaternion_from_euler(roll, -pitch, -yaw)
    return messages.FrameTransform(
        timestamp=messages.Timestamp(ns // 1_000_000_000, ns % 1_000_000_000), parent_frame_id="world",
        child_frame_id=name, translation=messages.Vector3(x=north, y=-east, z=-depth),
        rotation=messages.Quaternion(x=i, y=j, z=k, w=w),
    )  # fmt: skip


def layout() -> str:
    """Foxglove's layout file for these topics, as text: depth, attitude, references, faults, events, pose."""
    from importlib.resources import files

    return files("glider.tools.flight").joinpath("live_layout.json").read_text(encoding="utf-8")
