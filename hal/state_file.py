"""What a start has to know of the flight before it: kept in two checked copies, of which the worse one counts.

Each copy is a block of 512 bytes in a file of its own: JSON with a sequence number, under a CRC-32. A write brings the
first copy to the disk before it touches the second, so a cut of power tears one at most; whatever is torn, missing
beside the other, or unreadable counts as the worst. Standard library alone: the out-of-band process reads it too.
"""

import contextlib
import json
import os
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

BLOCK = 512  # bytes of a copy: one sector
NAMES = ("state.a", "state.b")
TEXT_BYTES = 160  # of the reason, and of the flight's name
_MAGIC = b"glider-state-1 "


class Phase(IntEnum):
    """How far a flight is; the worse, the larger."""

    ASHORE = 0  # nothing is under way
    HELD = 1  # a flight was given up and ended at the surface: a person looks before the next one
    ARMED = 2  # actuators are live
    DIVING = 3
    ABORTED = 4  # given up: only the way up is left
    UNKNOWN = 5  # a copy cannot be trusted


@dataclass(frozen=True)
class FlightState:
    """The last known phase, of which flight, and why. `trouble`: what is wrong with the copies, empty if nothing."""

    phase: Phase
    flight: str = ""
    reason: str = ""
    sequence: int = 0
    trouble: str = ""

    @property
    def may_start(self) -> bool:
        """Whether a mission may begin."""
        return self.phase == Phase.ASHORE

    @property
    def must_ascend(self) -> bool:
        """Whether the vehicle may be under water with nobody flying it: bring it up, whatever was planned."""
        return self.phase > Phase.HELD


def encode(state: FlightState) -> bytes:
    """A copy's block."""
    fields = [int(state.phase), state.sequence, state.flight, state.reason]
    body = _MAGIC + json.dumps(fields, separators=(",", ":")).encode()
    head = body.ljust(BLOCK - 9)
    if len(head) > BLOCK - 9:
        raise ValueError(f"a state of {len(body)} bytes")
    return head + f"{zlib.crc32(head):08x}\n".encode()


def decode(block: bytes) -> FlightState | str:
    """The state in a copy's block, or what is wrong with it."""
    if len(block) != BLOCK:
        return f"torn ({len(block)} of {BLOCK} bytes)"
    head, crc = block[: BLOCK - 9], block[BLOCK - 9 :]
    if crc != f"{zlib.crc32(head):08x}\n".encode() or not head.startswith(_MAGIC):
        return "torn (its check sum fails)"
    try:
        phase, sequence, flight, reason = json.loads(head[len(_MAGIC) :])
        return FlightState(Phase(phase), str(flight), str(reason), int(sequence))
    except (ValueError, TypeError):
        return "not understood"


class StateFile:
    """Two copies in `folder`, which is made if need be. OSError where it cannot be written."""

    decode = staticmethod(decode)

    def __init__(self, folder: Path | str):
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.paths = tuple(self.folder / name for name in NAMES)

    def read(self) -> FlightState:
        """The worse of both copies; ashore where there is neither. Never raises over what is in them."""
        copies = [_read_copy(path, self.decode) for path in self.paths]
        if copies == [None, None]:
            return FlightState(Phase.ASHORE)
        good = [copy for copy in copies if isinstance(copy, FlightState)]
        torn = [
            f"{path}: {copy or 'missing beside the other'}"
            for path, copy in zip(self.paths, copies, strict=True)
            if not isinstance(copy, FlightState)
        ]
        if not good:
            return FlightState(Phase.UNKNOWN, trouble="; ".join(torn))
        worst = max(good, key=_worseness)
        last = max(state.sequence for state in good)
        if torn:
            # What the torn copy said is not known; only a phase that means 'ascend' anyway can stand without it.
            phase = worst.phase if worst.must_ascend else Phase.UNKNOWN
            return FlightState(phase, worst.flight, worst.reason, last, "; ".join(torn))
        return FlightState(worst.phase, worst.flight, worst.reason, last)

    def write(self, phase: Phase, *, flight: str = "", reason: str = "") -> FlightState:
        """Bring a phase to the disk, both copies; returns once it is there (an fsync or two: not for the tick)."""
        state = FlightState(phase, _cut(flight), _cut(reason), self.read().sequence + 1)
        block = encode(state)
        for path in self.paths:
            _write_copy(path, block)
        return state


def _worseness(state: FlightState) -> tuple[int, int]:
    return state.phase, state.sequence


def _cut(text: str) -> str:
    plain = "".join(letter if " " <= letter <= "~" and letter not in '"\\' else "?" for letter in text)
    return plain[:TEXT_BYTES]


def _read_copy(path: Path, decode: Callable[[bytes], FlightState | str]) -> FlightState | str | None:
    """A copy's state, what is wrong with it, or None where there is no such file."""
    try:
        with path.open("rb") as file:
            return decode(file.read(BLOCK + 1))
    except FileNotFoundError:
        return None
    except OSError as error:
        return error.strerror or str(error)


def _write_copy(path: Path, block: bytes) -> None:
    """In place, in one piece, and onto the disk; the name too where it is new."""
    fresh = not path.exists()
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o644)
    try:
        if os.pwrite(fd, block, 0) != BLOCK:
            raise OSError(28, os.strerror(28), str(path))
        os.ftruncate(fd, BLOCK)
        os.fsync(fd)
    finally:
        os.close(fd)
    if fresh:
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            with contextlib.suppress(OSError):  # not every file system lets a folder be synchronised
                os.fsync(folder)
        finally:
            os.close(folder)
