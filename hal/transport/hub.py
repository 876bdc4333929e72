"""All lines served in the time that the loop has left: one `select`, bounded work, nothing ever waits for a device.

A Link is a port with the handler that speaks its protocol: it reconnects by itself, and takes no more bytes than twice
what its speed can bring in the time. The Hub serves all links until a deadline.
"""

import contextlib
import math
import select
from collections.abc import Callable, Sequence
from typing import Protocol

from glider.hal.transport.port import SerialPort, Unplugged

RETRY_S = 0.5  # between two tries to open a lost port
OUT_LIMIT = 1024  # bytes on their way out, past which a line takes no more
STALE_INPUT_S = 0.2  # a hub that nobody ran for so long finds old bytes, and drops them
SPARE = 256  # bytes a link may take beside twice its line rate


class LineHandler(Protocol):
    """What speaks a protocol on a line."""

    def attach(self, send: Callable[[bytes], bool]) -> None:
        """Take the way out: send(data) is False where the line takes nothing."""

    def connected(self, now: float) -> None:
        """The port is open, for the first time or again."""

    def lost(self, now: float) -> None:
        """The port is gone."""

    def feed(self, data: bytes, now: float) -> None:
        """Bytes have come."""

    def service(self, now: float) -> float:
        """Do what is due; the time at which something will be."""


class SerialLink:
    """A port and its handler."""

    def __init__(self, name: str, port: SerialPort, handler: LineHandler):
        self.name, self.port, self.handler = name, port, handler
        self.connections = 0
        self.bytes_in = 0
        self.trouble = "not opened yet"
        self.spent = 0  # bytes taken since the last tick
        self._out = bytearray()
        self._retry_at = -math.inf
        handler.attach(self.send)

    @property
    def up(self) -> bool:
        return self.port.fd >= 0

    @property
    def waits_to_write(self) -> bool:
        return bool(self._out)

    def open(self, now: float) -> None:
        """Open the port; Unplugged where it cannot be."""
        self.port.open()
        self.trouble = ""
        self.connections += 1
        self._out.clear()
        self.handler.connected(now)

    def send(self, data: bytes) -> bool:
        """Put bytes on the line as far as it takes them; the rest follows as it does."""
        if not self.up or len(self._out) + len(data) > OUT_LIMIT:
            return False
        self._out += data
        self.flush()
        return True

    def flush(self) -> None:
        """Hand over what waits; a port that is gone is noticed in `service`."""
        try:
            del self._out[: self.port.write(bytes(self._out))]
        except Unplugged as error:
            self.trouble = str(error)

    def receive(self, now: float) -> None:
        """The port is readable: take a chunk of what there is."""
        try:
            data = self.port.read()
        except Unplugged as error:
            self.trouble = str(error)
            return
        self.spent += len(data)
        self.bytes_in += len(data)
        self.handler.feed(data, now)

    def discard(self) -> None:
        """Drop what has piled up unread: its time of arrival is not known."""
        with contextlib.suppress(Unplugged):
            for _ in range(8):
                if not self.up or not select.select([self.port.fd], [], [], 0.0)[0]:
                    return
                self.port.read()

    def service(self, now: float) -> float:
        """Reconnect or do what is due; the time of the next thing."""
        if self.up and self.trouble:
            self.drop(now)
        if not self.up:
            if now < self._retry_at:
                return self._retry_at
            try:
                self.open(now)
            except Unplugged as error:
                self.trouble = str(error)
                self._retry_at = now + RETRY_S
                return self._retry_at
        return self.handler.service(now)

    def drop(self, now: float) -> None:
        """Give the port up, for now."""
        self.port.close()
        self._out.clear()
        self._retry_at = now + RETRY_S
        self.handler.lost(now)


class Hub:
    """Serves links. `now` is the board's clock."""

    def __init__(self, links: Sequence[SerialLink], now: Callable[[], float]):
        self.links = tuple(links)
        self._now = now
        self._period = 0.0
        self._begun = 0.0
        self._served = math.inf

    def set_period(self, period: float) -> None:
        """The time between two ticks, s, in which bytes may have piled up."""
        self._period = period

    def serve(self, until: float) -> None:
        """Serve all links until `until` (s on the board's clock), and once at least."""
        self._begun = self._now()
        absent = self._begun - self._served > STALE_INPUT_S
        for link in self.links:
            link.spent = 0
            if absent:
                link.discard()
        self._serve(until)
        self._served = self._now()

    def _serve(self, until: float) -> None:
        """Read, then judge, then wait; `service` judges by a time before the reading, so that a reply which had come by
        that time is never missed, however long the loop was away."""
        while True:
            now = self._now()
            self._wait(0.0)
            due = until
            for link in self.links:
                due = min(due, link.service(now))
            self._wait(max(due - self._now(), 0.0))
            if now >= until:
                return

    def _wait(self, seconds: float) -> None:
        """Wait for bytes or room for them, and take or send them."""
        passed = self._now() - self._begun + self._period
        readers = [link for link in self.links if link.up and link.spent < SPARE + 0.2 * link.port.baud * passed]
        writers = [link for link in self.links if link.up and link.waits_to_write]
        try:
            readable, writable, _ = select.select(
                [link.port.fd for link in readers], [link.port.fd for link in writers], [], seconds
            )
        except (OSError, ValueError):  # a descriptor that went away between: `service` finds out which
            return
        now = self._now()
        for link in readers:
            if link.port.fd in readable:
                link.receive(now)
        for link in writers:
            if link.port.fd in writable:
                link.flush()
