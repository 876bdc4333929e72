"""The real clock: monotonic, so a wall clock that is set an hour back changes nothing."""

import time


class MonotonicClock:
    """Seconds since it was made, by the operating system's monotonic clock; waits for absolute deadlines."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        return time.monotonic() - self._start

    def sleep_until(self, deadline: float) -> None:
        wait = deadline - (time.monotonic() - self._start)
        if wait > 0.0:
            time.sleep(wait)
