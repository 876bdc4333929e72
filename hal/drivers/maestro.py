"""Servo: a channel of a Pololu Maestro on a port of its own.

The board repeats the commanded pulse and knows nothing of the shaft. What is asked of it is whether it is there and
what errors it counts. Its serial timeout is the dead-man: the target is sent ten times a second even if it stands.
"""

import math
from collections.abc import Callable
from typing import Any

from glider.hal.boardfile import PortTable, ServoTable
from glider.hal.drivers.samples import Health, SampleState
from glider.hal.ports import SLOTS, Condition
from glider.hal.protocols import maestro

RESEND_S = 0.1
SHORTEST_S = 0.005  # between two targets
ASK_S = 0.2
ANSWER_S = 0.08
LOST_AFTER = 2  # unanswered questions
EXPECTED = maestro.MaestroError.TIMEOUT | maestro.MaestroError.SIGNAL  # left over from before, or a reset


def build(table: ServoTable, port: PortTable, vehicle: Any) -> "Servo":
    """The driver of a board file's [servo], within the vehicle's range."""
    return Servo(table, vehicle.actuators.servo.range)


class Servo:
    """Actuator port (rad) and line handler in one."""

    def __init__(self, table: ServoTable, vehicle_range: tuple[float, float]):
        self.name = "servo"
        self.table, self.health = table, Health("servo")
        ends = sorted((limit - table.zero_us) / table.us_per_rad for limit in table.limits_us)
        self.limits = (max(ends[0], vehicle_range[0]), min(ends[1], vehicle_range[1]))
        self.target: float | None = None  # rad; None: not commanded, the pulses as they are
        self.enabled = False
        self.errors = maestro.MaestroError(0)
        self.replies = maestro.ReplyDecoder()
        self.answers = 0
        self._send: Callable[[bytes], bool] = lambda data: False
        self._sent = -1
        self._sent_at = self._asked_at = -math.inf
        self._waiting = False
        self._unanswered = 0
        state = SampleState(SLOTS["servo"])
        self.start, self.read, self._answered = state.start, state.read, state.answered

    def command(self, value: float) -> float:
        """Ask for an angle (rad); returns what is sent after limits. NaN changes nothing."""
        low, high = self.limits
        if value != value:
            return self.target if self.target is not None else 0.0
        value = low if value < low else high if value > high else value
        self.target = value
        return value

    def quarter_us(self, angle: float) -> int:
        """The pulse for an angle, quarter microseconds, within the file's limits."""
        low, high = self.table.limits_us
        return round(4.0 * min(max(self.table.zero_us + self.table.us_per_rad * angle, low), high))

    def stop(self) -> None:
        """Stay where the servo was last sent; nothing more is sent, so that the board's dead-man runs."""
        self.target = None

    def reset(self) -> None:
        """Forget an error, after someone has looked."""
        self.errors = maestro.MaestroError(0)

    def answering(self, now: float) -> bool:
        return self.answers > 0 and self._unanswered < LOST_AFTER

    def attach(self, send: Callable[[bytes], bool]) -> None:
        self._send = send

    def connected(self, now: float) -> None:
        self._sent, self._waiting, self._unanswered = -1, False, 0
        self._sent_at = self._asked_at = -math.inf

    def lost(self, now: float) -> None:
        self._unanswered = LOST_AFTER
        self.health.say(now, "port lost")

    def service(self, now: float) -> float:
        if self._waiting and now - self._asked_at > ANSWER_S:
            self._waiting = False
            self._unanswered += 1
            self.health.timeouts += 1
            if self._unanswered == LOST_AFTER:
                self.health.say(now, "does not answer")
        if self.enabled and self.target is not None:
            self._send_target(now)
        if now - self._asked_at >= ASK_S:
            self._asked_at, self._waiting = now, True
            self.replies.expect(maestro.GET_ERRORS)
            self._send(self._encode(maestro.GET_ERRORS))
        return min(
            self._asked_at + (ANSWER_S if self._waiting else ASK_S) + 1e-4,
            self._sent_at + RESEND_S if self.enabled and self.target is not None else math.inf,
        )

    def _send_target(self, now: float) -> None:
        assert self.target is not None
        wanted = self.quarter_us(self.target)
        since = now - self._sent_at
        if since < SHORTEST_S or (wanted == self._sent and since < RESEND_S):
            return
        table = self.table
        self._send(maestro.set_target(table.channel, wanted, device=table.number, crc=table.crc))
        self._sent, self._sent_at = wanted, now

    def _encode(self, code: int) -> bytes:
        return maestro.encode(code, device=self.table.number, crc=self.table.crc)

    def feed(self, data: bytes, now: float) -> None:
        word = self.replies.feed(data)
        self.health.damaged = self.replies.bad
        if word is None or not self._waiting:
            return
        self._waiting = False
        if self.answers and self._unanswered >= LOST_AFTER:
            self.health.say(now, "")
        self.answers += 1
        self._answered(now, Condition.WELL)
        self._unanswered = 0
        errors = maestro.MaestroError(word) & ~EXPECTED
        if errors & ~self.errors:
            self.health.say(now, f"reports {errors.name}")
        self.errors |= errors
