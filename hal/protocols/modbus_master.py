"""The master of one Modbus RTU line: who asks next, whose reply this is, and when the line has to be left alone.

One request is on the line at a time. Modbus has no transaction number, so a late reply looks like the answer to the
next request; against that stand four things. A reply counts only if device, function, length and echo are those asked
for. After a timeout the line is kept quiet until the slave's longest delay is over, and drained. For a while after
that (`forget_s`) nothing is asked whose reply would look like the missing one; jobs bring variants of their requests
for that. And an exception counts only where no missing request could have raised it.

No port and no clock: time is an argument, `send` the way out.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from glider.hal.protocols.modbus import ERROR, READ_HOLDING, READ_INPUT, Frame, Request, RtuDecoder
from glider.hal.units import BITS

GIVE_UP_AFTER = 3  # timeouts running, past which a device is asked seldom
BACK_OFF_S = 0.25
BABBLE_S = 0.25  # a line that is not quiet for so long is asked all the same
WINDOW = 512  # bytes of an exchange kept to say what was wrong with it


class Failure(Enum):
    """Why a request was not answered."""

    TIMEOUT = "no answer"
    DAMAGED = "damaged answer"  # as a timeout, but something came whose check sum failed
    EXCEPTION = "exception"
    DISCONNECTED = "line lost"


class PollJob(Protocol):
    """Someone who asks a device again and again."""

    device: int
    due: float

    def requests(self, now: float) -> Sequence[Request]:
        """What to ask now, the best first, the others for when its reply might be mistaken; `due` has moved on."""

    def answered(self, request: Request, reply: Frame, asked_at: float, now: float) -> None:
        """The reply; asked_at is when the request had left."""

    def failed(self, request: Request | None, failure: Failure, exception: int, now: float) -> None:
        """No reply, or an exception (its code)."""


@dataclass
class BusCounts:
    """What a line has seen."""

    requests: int = 0
    replies: int = 0
    timeouts: int = 0
    exceptions: int = 0
    late: int = 0  # good frames that nobody waited for any more
    wrong: int = 0  # good frames that answer something else, while waiting
    damaged: int = 0  # frames with a bad check sum


class OneShot:
    """One request, once; for setting up and for the bench."""

    def __init__(self, request: Request, done: Callable[[Frame | None, int], None]):
        self.device, self.due = request.device, -math.inf
        self._request, self._done = request, done

    def requests(self, now: float) -> Sequence[Request]:
        return (self._request,)

    def answered(self, request: Request, reply: Frame, asked_at: float, now: float) -> None:
        self._done(reply, 0)

    def failed(self, request: Request | None, failure: Failure, exception: int, now: float) -> None:
        self._done(None, exception)


def signature_of(frame: Frame) -> tuple[int, int, int, bytes]:
    """As Request.reply_signature, of a reply."""
    echo = b"" if frame.function in (READ_HOLDING, READ_INPUT) else frame.raw[2:6]
    return frame.device, frame.function, len(frame.raw), echo


class ModbusBus:
    """A master. timeout_s runs from the end of the request to the reply's first byte; longest_s is the longest a
    slave's reply may take to begin, and how long the line is kept quiet after a timeout. decoder finds the frames."""

    def __init__(
        self, baud: int, *, timeout_s: float, longest_s: float, forget_s: float = 0.5,
        decoder: type[RtuDecoder] = RtuDecoder,
    ):  # fmt: skip
        self.byte_s = BITS / baud
        self.gap_s = max(3.5 * self.byte_s, 0.00175)  # Modbus over serial line, section 2.5.1.1
        self.timeout_s, self.longest_s, self.forget_s = timeout_s, max(longest_s, timeout_s), forget_s
        self.jobs: list[PollJob] = []
        self.counts = BusCounts()
        self.silent: dict[int, int] = {}  # timeouts running, by device
        self._one_shots: deque[OneShot] = deque(maxlen=32)
        self._send: Callable[[bytes], bool] = lambda data: False
        self._new_decoder = decoder
        self._decoder, self._strays = decoder(), decoder()
        self._window = bytearray()
        self._missing: dict[tuple, float] = {}  # signature of replies that may still come, until when
        self._job: PollJob | None = None
        self._request: Request | None = None
        self._asked_at = self._deadline = 0.0
        self._idle_until = self._last_byte = -math.inf
        self._up = False

    def attach(self, send: Callable[[bytes], bool]) -> None:
        self._send = send

    def add(self, job: PollJob) -> None:
        self.jobs.append(job)

    def ask(self, request: Request, done: Callable[[Frame | None, int], None]) -> None:
        """One request before all jobs; done(reply or None, exception code)."""
        self._one_shots.append(OneShot(request, done))

    def connected(self, now: float) -> None:
        self._up = True
        self._idle_until = now + self.longest_s  # whoever used the line before may still be answered

    def lost(self, now: float) -> None:
        self._up = False
        self._end(Failure.DISCONNECTED, 0, now)
        while self._one_shots:
            self._one_shots.popleft().failed(None, Failure.DISCONNECTED, 0, now)

    # --- receiving --------------------------------------------------------------------------------------------------
    def feed(self, data: bytes, now: float) -> None:
        """Bytes from the line."""
        self._last_byte = now
        if self._request is None:
            self._drain(data)
            return
        self._window += data[: WINDOW - len(self._window)]
        for frame in self._decoder.feed(data):
            if self._request is None:
                self.counts.late += 1
            elif not frame.exception:
                self._answer(frame, now)
            elif any(signature[:2] == (frame.device, frame.function & ~ERROR) for signature in self._missing):
                self.counts.late += 1
            else:
                self.counts.exceptions += 1
                self.silent[frame.device] = 0
                self._end(Failure.EXCEPTION, frame.exception, now)

    def _drain(self, data: bytes) -> None:
        """Bytes that nobody waits for; a reply that was missing is not missing any more."""
        for frame in self._strays.feed(data):
            self.counts.late += 1
            self._missing.pop(signature_of(frame), None)

    def _answer(self, frame: Frame, now: float) -> None:
        job, request = self._job, self._request
        assert job is not None
        assert request is not None
        self.counts.replies += 1
        self.counts.damaged += self._decoder.bad > 0
        self.silent[request.device] = 0
        self._clear()
        job.answered(request, frame, self._asked_at, now)

    def _clear(self) -> None:
        self._job = self._request = None
        self._window.clear()
        self._strays.reset()
        self._decoder.expect(None)

    def _end(self, failure: Failure, exception: int, now: float) -> None:
        job, request = self._job, self._request
        self._clear()
        if job is not None and request is not None:
            job.failed(request, failure, exception, now)

    def _give_up(self, now: float) -> None:
        """The time is over: say what came instead, remember what may still come, leave the line alone."""
        request = self._request
        assert request is not None
        self.counts.timeouts += 1
        listener = self._new_decoder()
        for frame in listener.feed(bytes(self._window)):
            self.counts.wrong += 1
            self._missing.pop(signature_of(frame), None)
        damaged = self._decoder.bad > 0
        self.counts.damaged += damaged
        self._missing[request.reply_signature] = now + self.forget_s
        self.silent[request.device] = self.silent.get(request.device, 0) + 1
        self._idle_until = max(now, self._asked_at + self.longest_s + request.reply_size * self.byte_s)
        self._end(Failure.DAMAGED if damaged else Failure.TIMEOUT, 0, now)

    # --- asking -----------------------------------------------------------------------------------------------------
    def service(self, now: float) -> float:
        """Give up on what is late, ask what is due; the time of the next thing."""
        if not self._up:
            return math.inf
        if self._request is not None:
            if now < self._deadline:
                return self._deadline
            self._give_up(now)
        free = self._free_at(now)
        if now < free:
            return free
        for _ in range(len(self.jobs) + 1):
            job = self._next_job()
            if job is None:
                return math.inf
            if job.due > now:
                return job.due
            if self._try(job, now):
                return self._deadline
        return now + self.gap_s

    def _free_at(self, now: float) -> float:
        """When the line may be used: no reply is expected, and it has been silent for a gap (or never will be)."""
        silent = self._last_byte + self.gap_s
        if self._idle_until > -math.inf and now > self._idle_until + BABBLE_S:
            return self._idle_until
        return max(self._idle_until, silent)

    def _next_job(self) -> PollJob | None:
        if self._one_shots:
            return self._one_shots[0]
        return min(self.jobs, key=_due, default=None)

    def _try(self, job: PollJob, now: float) -> bool:
        """Ask for a job, unless it has nothing to ask or all its replies could be mistaken."""
        for signature in [signature for signature, until in self._missing.items() if until <= now]:
            del self._missing[signature]
        requests = job.requests(now)
        if not requests:
            job.due = max(job.due, now + self.gap_s)  # whatever the job says: no endless loop
            return False
        for request in requests:
            if request.reply_signature not in self._missing:
                self._ask(job, request, now)
                return True
        job.due = min(self._missing[request.reply_signature] for request in requests)
        return False

    def _ask(self, job: PollJob, request: Request, now: float) -> None:
        if self._one_shots and job is self._one_shots[0]:
            self._one_shots.popleft()
        elif self.silent.get(job.device, 0) >= GIVE_UP_AFTER:
            job.due = max(job.due, now + BACK_OFF_S)
        self._job, self._request = job, request
        self._decoder.expect(request)
        self._decoder.bad = 0
        self.counts.requests += 1
        self._asked_at = now + len(request.frame) * self.byte_s
        self._idle_until = self._asked_at
        self._deadline = self._asked_at + self.timeout_s + request.reply_size * self.byte_s
        if not self._send(request.frame):
            self._end(Failure.DISCONNECTED, 0, now)


def _due(job: PollJob) -> float:
    return job.due
