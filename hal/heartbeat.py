"""The loop's pulse in shared memory: stamped once a tick, watched by other processes on the same monotonic clock.

A file of one page (on a memory file system, if there is one), mapped by both sides: 64-bit words, then float64 values
for whoever looks on. Stamping is two stores; nothing is allocated that outlives the tick. Standard library alone.
"""

import contextlib
import fcntl
import mmap
import os
import tempfile
import time
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from glider.hal.sortie import SortieState

SIZE = 4096
NAME = "heartbeat"
MAGIC = 0x676C_6964_6572_0002

# Words, unsigned 64 bits.
W_MAGIC, W_PID, W_STATE, W_PERIOD_NS, W_BORN_NS = range(5)
W_BEAT_NS, W_TICKS = 8, 9  # the loop's, each tick
W_MISSED, W_WORST_NS, W_MODE, W_LEG, W_LEGS = 10, 11, 14, 15, 16  # the loop's, each second
W_RECORDER_NS, W_RECORDER_LEVEL, W_WRITTEN, W_DROPPED, W_DISK_ERRORS, W_RECORDER_EXPECTED = range(17, 23)
W_RSS_BYTES, W_FILES = 23, 24
W_GUARD_NS, W_GUARD_PID, W_GUARD_STATUS, W_GUARD_STAGE = 32, 33, 34, 35  # the out-of-band process's
WORDS = 64
# Values, float64, the loop's, each second.
V_TIME_S, V_DEPTH_M, V_PITCH_RAD, V_ROLL_RAD, V_BALLAST_KG, V_SLIDER_M, V_BATTERY_V = range(7)
V_GUARD_DEPTH_M = 7  # the out-of-band process's, on the way up
VALUES = 16
_VALUES_AT = 8 * WORDS
_TEXT_AT, TEXT_BYTES = 1024, 256


class Guard(IntEnum):
    """What the out-of-band process does."""

    ABSENT = 0
    WATCHING = 1
    ASCENDING = 2


class HeartbeatHeld(RuntimeError):
    """Another flight holds this heartbeat; str() says which process."""


@dataclass(frozen=True)
class Pulse:
    """A look at a heartbeat. Ages in s on the monotonic clock; inf where never stamped."""

    pid: int
    state: SortieState
    period_s: float
    age_s: float
    ticks: int
    recorder_age_s: float
    recorder_expected: bool
    guard: Guard
    guard_age_s: float


class Heartbeat:
    """The map of one heartbeat file, for either side: `words` (64-bit) and `values` (float64) by the places above."""

    def __init__(self, fd: int, path: Path):
        self.path, self._fd = path, fd
        self._map = mmap.mmap(fd, SIZE)
        whole = memoryview(self._map)
        self.words = whole[: 8 * WORDS].cast("Q")
        self.values = whole[_VALUES_AT : _VALUES_AT + 8 * VALUES].cast("d")
        self._text = whole[_TEXT_AT : _TEXT_AT + TEXT_BYTES]

    @classmethod
    def create(cls, folder: Path | str, period_s: float, flight: str = "") -> "Heartbeat":
        """The flight's side, zeroed, held until `close` or the process's end; Held where another process has it."""
        path = Path(folder) / NAME
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o750)
        if path.parent.stat().st_uid not in (0, os.getuid()):  # under /tmp anybody may have made it
            raise PermissionError(1, "belongs to somebody else", str(path.parent))
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o640)
        for _ in range(5):  # a watcher's look takes the lock for microseconds
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.02)
        else:
            os.close(fd)
            with contextlib.suppress(OSError, ValueError):
                raise HeartbeatHeld(
                    f"{path}: a flight is under way (process {cls.open(folder).words[W_PID]})"
                ) from None
            raise HeartbeatHeld(f"{path}: a flight is under way") from None
        os.ftruncate(fd, SIZE)
        pulse = cls(fd, path)
        guard = pulse.words[W_GUARD_NS : W_GUARD_STAGE + 1].tolist()  # its own; it may be there before the flight
        pulse.words[:] = memoryview(bytes(8 * WORDS)).cast("Q")
        pulse.values[:] = memoryview(bytes(8 * VALUES)).cast("d")
        for place, word in enumerate(guard, W_GUARD_NS):
            pulse.words[place] = word
        pulse._text[:] = flight.encode("utf-8", "replace")[:TEXT_BYTES].ljust(TEXT_BYTES, b"\0")
        pulse.words[W_PID] = os.getpid()
        pulse.words[W_PERIOD_NS] = round(1e9 * period_s)
        pulse.words[W_BORN_NS] = time.monotonic_ns()
        pulse.words[W_MAGIC] = MAGIC
        return pulse

    @classmethod
    def open(cls, folder: Path | str) -> "Heartbeat":
        """The watching side; OSError where there is none, ValueError where the file is no heartbeat."""
        path = Path(folder) / NAME
        fd = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
        if os.fstat(fd).st_size != SIZE:
            os.close(fd)
            raise ValueError(f"{path}: not a heartbeat")
        pulse = cls(fd, path)
        if pulse.words[W_MAGIC] != MAGIC:
            pulse.close()
            raise ValueError(f"{path}: not a heartbeat")
        return pulse

    # --- the loop ---------------------------------------------------------------------------------------------------
    def beat(self, t: float) -> None:
        """Stamp: one of the runtime's extras, called once a tick. t, the board's time in s, is kept for onlookers."""
        self.words[W_BEAT_NS] = time.monotonic_ns()
        self.words[W_TICKS] += 1
        self.values[V_TIME_S] = t

    def publish(self, state: SortieState) -> None:
        """Set the sortie's state."""
        self.words[W_STATE] = state

    # --- whoever looks on -------------------------------------------------------------------------------------------
    @property
    def flight(self) -> str:
        """The flight's name."""
        return bytes(self._text).rstrip(b"\0").decode("utf-8", "replace")

    def held(self) -> bool:
        """For the watching side: whether a flight's process holds this heartbeat. A dead one does not, however it died;
        one that is stopped or hangs does."""
        try:
            fcntl.flock(self._fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        fcntl.flock(self._fd, fcntl.LOCK_UN)
        return False

    def look(self) -> Pulse:
        """The pulse now. Words that make no sense read as the worst they could mean."""
        words, now = self.words, time.monotonic_ns()
        return Pulse(
            pid=words[W_PID],
            state=SortieState(words[W_STATE]) if words[W_STATE] in list(SortieState) else SortieState.ABORTED,
            period_s=words[W_PERIOD_NS] / 1e9,
            age_s=_age(words[W_BEAT_NS], now),
            ticks=words[W_TICKS],
            recorder_age_s=_age(words[W_RECORDER_NS], now),
            recorder_expected=bool(words[W_RECORDER_EXPECTED]),
            guard=Guard(words[W_GUARD_STATUS]) if words[W_GUARD_STATUS] in list(Guard) else Guard.ABSENT,
            guard_age_s=_age(words[W_GUARD_NS], now),
        )

    def close(self) -> None:
        """Unmap and let go."""
        self.words.release()
        self.values.release()
        self._text.release()
        with contextlib.suppress(BufferError):
            self._map.close()
        os.close(self._fd)


def _age(stamp_ns: int, now_ns: int) -> float:
    return (now_ns - stamp_ns) / 1e9 if stamp_ns else float("inf")


def _folder(variable: str, system: str) -> Path | None:
    """The folder that a variable names, or the system's where it may be written to; None: the user's own."""
    wanted = os.environ.get(variable, "")
    return Path(wanted or system) if wanted or os.access(system, os.W_OK) else None


def run_folder() -> Path:
    """Where the heartbeat of the vehicle's one flight lies: GLIDER_RUN_DIR, /run/glider, or the user's own folder."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    own = Path(base) / "glider" if base else Path(tempfile.gettempdir()) / f"glider-run-{os.getuid()}"
    return _folder("GLIDER_RUN_DIR", "/run/glider") or own


def state_folder() -> Path:
    """Where the state outlives a restart: GLIDER_STATE_DIR, /var/lib/glider, or the user's own folder."""
    base = os.environ.get("XDG_STATE_HOME")
    own = (Path(base) if base else Path.home() / ".local" / "state") / "glider"
    return _folder("GLIDER_STATE_DIR", "/var/lib/glider") or own
