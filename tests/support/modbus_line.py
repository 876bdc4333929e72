"""A Modbus line in simulated time: slaves that answer late, or not at all, or in someone else's name."""

import heapq
import math
import random
from collections.abc import Callable

from hal.protocols import modbus
from hal.protocols.modbus_master import ModbusBus


class SimulatedLine:
    """Carries a master's frames to a slave function and its replies back after `delay` seconds (inf: lost).

    slave(frame) gives the reply's bytes; delay() the seconds between the request's end and the reply's first byte.
    Bytes that overlap on the line damage each other. `now` moves only by run().
    """

    def __init__(self, bus: ModbusBus, slave: Callable[[bytes], bytes], delay: Callable[[], float], rng: random.Random):
        self.bus, self._slave, self._delay, self._rng = bus, slave, delay, rng
        self.now = 0.0
        self.requests = 0
        self._coming: list[tuple[float, int, bytes]] = []
        self._count = 0
        bus.attach(self._sent)
        bus.connected(0.0)

    def _sent(self, frame: bytes) -> bool:
        self.requests += 1
        wait = self._delay()
        if wait < math.inf:
            at = self.now + len(frame) * self.bus.byte_s + wait
            reply = self._slave(frame)
            cut = self._rng.randrange(1, len(reply)) if self._rng.random() < 0.3 else len(reply)
            for piece, first in ((reply[:cut], 0), (reply[cut:], cut)):
                if piece:
                    self._count += 1
                    done = at + (first + len(piece)) * self.bus.byte_s
                    heapq.heappush(self._coming, (done, self._count, piece))
        return True

    def run(self, done: Callable[[], bool]) -> None:
        """Let time pass until done()."""
        due = self.bus.service(self.now)
        while not done():
            next_bytes = self._coming[0][0] if self._coming else math.inf
            self.now = max(self.now, min(due, next_bytes))
            assert self.now < math.inf
            while self._coming and self._coming[0][0] <= self.now:
                self.bus.feed(heapq.heappop(self._coming)[2], self.now)
            due = self.bus.service(self.now)


def stamp_reply(frame: bytes, stamp: int) -> bytes:
    """The reply to a read, its first two registers holding the request's number (32 bits), the rest zeros."""
    count = frame[5]
    data = stamp.to_bytes(4, "big") + bytes(2 * count)
    return modbus.with_check_sum(frame[:2] + bytes((2 * count,)) + data[: 2 * count])
