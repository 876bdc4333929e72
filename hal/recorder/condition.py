"""How a recording goes, as plain numbers: what the flight looks at once a second, and restarts a recording that
died.
"""

from enum import IntEnum

HUNG_S = 15.0  # without a sign of life; an SD card may take seconds over an fsync, and the ring holds twenty
FIRST_RETRY_S, LONGEST_RETRY_S = 1.0, 64.0


class RecorderLevel(IntEnum):
    """The worse, the larger."""

    OK = 0
    DROPPING = 1  # the disk refuses (records are kept in memory), or records found no room since the last look
    FAILED = 2  # nobody records: the process died or hangs, and its successor is not there yet


class RecorderCondition:
    """Updated in place by Recorder.watch; numbers only."""

    __slots__ = ("beat_ns", "damaged", "disk_errors", "dropped", "errno", "level", "pending", "restarts", "written")

    def __init__(self) -> None:
        self.level = int(RecorderLevel.OK)
        self.pending = 0  # handed over and not yet taken
        self.written = self.dropped = self.damaged = 0
        self.disk_errors = 0
        self.errno = 0  # 0 while the disk is well
        self.restarts = 0  # recording processes that had to be replaced
        self.beat_ns = 0  # the recording process's last sign of life, ns of the monotonic clock
