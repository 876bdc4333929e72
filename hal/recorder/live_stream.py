"""Who looks on while a flight records: a local socket of the recording process, there only where it was asked for.

The flight knows nothing of it: what it hands to the log anyway is copied, a few times a second, to whoever is
connected. Nobody is waited for: an onlooker that does not read misses records, and beyond a bound its connection ends.
Standard library alone.

On the wire, a length (uint32, little-endian) before each: first a JSON text (`specs`, `metadata`), then records:
channel (int32; -1 an event), time in s (float64), the record's numbers, or an event's severity (a byte) and text.
"""

import contextlib
import json
import os
import socket
import struct

from glider.hal.recorder import ring

HEAD = struct.Struct("<I")
RECORD = struct.Struct("<id")
PERIOD_S = 0.1  # between two records of a channel; events all go
MAX_CONNECTIONS = 4  # onlookers at once
BACKLOG = 1 << 18  # bytes that wait for one of them


class LiveStream:
    """`serve` now and then, `offer` each record. OSError where the socket cannot be made."""

    def __init__(self, path: str, specs: list[dict], metadata: dict[str, str]):
        self.path = path
        text = json.dumps({"specs": specs, "metadata": metadata}).encode()
        self._greeting = HEAD.pack(len(text)) + text
        self._next: dict[int, float] = {}
        self._connected: dict[socket.socket, bytearray] = {}
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)  # of a recording process before this one
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)
        mask = os.umask(0o117)  # the vehicle's user and group
        try:
            self._listener.bind(path)
        finally:
            os.umask(mask)
        self._listener.listen(MAX_CONNECTIONS)

    def serve(self) -> None:
        """Accept waiting connections and forward what is queued."""
        with contextlib.suppress(OSError):
            line, _ = self._listener.accept()
            line.setblocking(False)
            if len(self._connected) < MAX_CONNECTIONS:
                self._connected[line] = bytearray(self._greeting)
            else:
                line.close()
        for line, waiting in list(self._connected.items()):
            try:
                if waiting:
                    del waiting[: line.send(waiting)]
            except BlockingIOError:
                continue
            except OSError:
                self._leave(line)

    def offer(self, taken: ring.RingRecord) -> None:
        """A record on its way to the log."""
        if not self._connected:
            return
        if taken.channel == ring.EVENT_CHANNEL:
            severity, length = taken.payload[: 8 * ring.EVENT_HEAD].cast("d")
            start = 8 * ring.EVENT_HEAD
            body = bytes([int(severity) & 0xFF]) + bytes(taken.payload[start : start + int(length)])
        elif taken.time_s < self._next.get(taken.channel, -1.0):
            return
        else:
            self._next[taken.channel] = taken.time_s + PERIOD_S - 1e-6
            body = bytes(taken.payload)
        record = RECORD.pack(taken.channel, taken.time_s) + body
        for line, waiting in list(self._connected.items()):
            if len(waiting) > BACKLOG:
                self._leave(line)
            else:
                waiting += HEAD.pack(len(record)) + record

    def _leave(self, line: socket.socket) -> None:
        line.close()
        del self._connected[line]

    def close(self) -> None:
        """Send everybody away."""
        self.serve()
        for line in list(self._connected):
            self._leave(line)
        self._listener.close()
        with contextlib.suppress(OSError):
            os.unlink(self.path)
