"""A Modbus line in simulated time: slaves that answer the real master late, or not at all, or in another's name."""

import heapq
import math
import random
from collections.abc import Callable
from typing import Any

from glider.hal.drivers.poll import Poll
from glider.hal.drivers.samples import Health
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus_master import ModbusBus


class WireLine:
    """slave(frame, number of the request) gives a reply's bytes; delay(rng) the seconds before it, inf: never.

    Replies come whole or in two pieces, and damage each other where they overlap. Time moves only by `run`.
    """

    def __init__(
        self, slave: Callable[[bytes, int], bytes], delay: Callable[[random.Random], float], seed: int, *,
        timeout_s: float = 0.05, longest_s: float = 0.1, forget_s: float = 0.5,
        decoder: type[modbus.RtuDecoder] = modbus.RtuDecoder,
    ):  # fmt: skip
        self.bus = ModbusBus(115_200, timeout_s=timeout_s, longest_s=longest_s, forget_s=forget_s, decoder=decoder)
        self.now, self.requests = 0.0, 0
        self._slave, self._delay, self._rng = slave, delay, random.Random(seed)
        self._coming: list[tuple[float, int, bytes]] = []
        self._pieces = 0
        self.bus.attach(self._sent)
        self.bus.connected(0.0)

    def _sent(self, frame: bytes) -> bool:
        self.requests += 1
        wait = self._delay(self._rng)
        if wait < math.inf:
            reply = self._slave(frame, self.requests)
            cut = self._rng.randrange(1, len(reply)) if self._rng.random() < 0.3 else len(reply)
            for piece, end in ((reply[:cut], cut), (reply[cut:], len(reply))):
                if piece:
                    self._pieces += 1
                    done = self.now + (len(frame) + end) * self.bus.byte_s + wait
                    heapq.heappush(self._coming, (done, self._pieces, piece))
        return True

    def run(self, until: float) -> None:
        """Let time pass."""
        due = self.bus.service(self.now)
        while True:
            coming = self._coming[0][0] if self._coming else math.inf
            at = min(due, coming)
            if at > until:
                self.now = until
                return
            self.now = max(self.now, at)
            while self._coming and self._coming[0][0] <= self.now:
                self.bus.feed(heapq.heappop(self._coming)[2], self.now)
            due = self.bus.service(self.now)


class Stamped(Poll):
    """A poll that compares the number in what it is given with that of the request on the line."""

    def __init__(self, line: WireLine, device: int, period: float, run_batch: int | None = None):
        counts = (4, 2, 3) if run_batch is None else (run_batch,)
        variants = [modbus.read(device, 3, 0x0100, count) for count in counts]
        super().__init__(variants, period, self._check, Health("stamped"))
        self._line, self.delivered, self.misdelivered = line, 0, 0
        line.bus.add(self)

    def _check(self, request: Any, registers: list[int], asked_at: float, now: float) -> None:
        self.delivered += 1
        self.misdelivered += registers[0] << 16 | registers[1] != self._line.requests


def stamp_reply(frame: bytes, number: int) -> bytes:
    """The reply to a read, its first two registers the request's number, the rest zeros."""
    count = frame[5]
    data = number.to_bytes(4, "big") + bytes(2 * count)
    return modbus.with_check_sum(frame[:2] + bytes((2 * count,)) + data[: 2 * count])
