"""Asking a Modbus device for its registers, again and again."""

from collections.abc import Callable, Sequence

from glider.hal.drivers.samples import Health
from glider.hal.protocols.modbus import Frame, Request
from glider.hal.protocols.modbus_master import Failure

CONFIGURATION_FAULTS = (1, 2, 3)  # illegal function, address, value: asking again does not help
TRIES = 3  # after which other exceptions running are an error too
WAIT_AFTER_FAULT_S = 1.0
EXCEPTIONS = {
    1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure", 5: "acknowledge",
    6: "device busy", 8: "memory parity", 10: "gateway path", 11: "gateway no response",
}  # fmt: skip


def exception_text(code: int) -> str:
    return f"exception {code} ({EXCEPTIONS.get(code, 'unknown')})"


class ExceptionCounter:
    """Exceptions of one device: 1 to 3 are an error at once, others at the third try running."""

    def __init__(self) -> None:
        self.running = 0

    def refused(self, code: int) -> bool:
        """One more; True where the device counts as in error."""
        self.running += 1
        return code in CONFIGURATION_FAULTS or self.running >= TRIES


class Poll:
    """A periodic read. `variants` are requests of different lengths for the same thing, the best first.

    in_error(now, text): the device refuses for good; damaged(now): its reply failed the check sum.
    """

    def __init__(
        self, variants: Sequence[Request], period: float, taken: Callable[[Request, list[int], float, float], None],
        health: Health, *, in_error: Callable[[float, str], None] | None = None,
        damaged: Callable[[float], None] | None = None,
    ):  # fmt: skip
        self.device, self.period, self.due = variants[0].device, period, 0.0
        self._variants, self._taken, self._health = tuple(variants), taken, health
        self._in_error, self._damaged = in_error, damaged
        self._refusals = ExceptionCounter()

    def requests(self, now: float) -> Sequence[Request]:
        self.due = max(self.due + self.period, now)
        return self._variants

    def answered(self, request: Request, reply: Frame, asked_at: float, now: float) -> None:
        self._refusals.running = 0
        self._taken(request, reply.registers, asked_at, now)

    def failed(self, request: Request | None, failure: Failure, exception: int, now: float) -> None:
        health = self._health
        if failure is Failure.EXCEPTION:
            health.exceptions += 1
            health.say(now, exception_text(exception))
            wait = WAIT_AFTER_FAULT_S if exception in CONFIGURATION_FAULTS else 4.0 * self.period
            self.due = max(self.due, now + wait)
            if self._refusals.refused(exception) and self._in_error is not None:
                self._in_error(now, exception_text(exception))
        elif failure in (Failure.TIMEOUT, Failure.DAMAGED):
            health.timeouts += 1
            if failure is Failure.DAMAGED and self._damaged is not None:
                self._damaged(now)
