"""The sortie's state on the disk, for the next start: two checked copies, of which the worse one counts.

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
from pathlib import Path

from glider.hal.sortie import SortieState

BLOCK = 512  # bytes of a copy: one sector
NAMES = ("state.a", "state.b")
TEXT_BYTES = 160  # of the reason, and of the flight's name
_MAGIC = b"glider-state-2 "
# Files written before states had names: a number, in this order.
_MAGIC_1 = b"glider-state-1 "
_STATES_1 = (
    SortieState.ASHORE, SortieState.HELD, SortieState.ARMED, SortieState.DIVING, SortieState.ABORTED,
    SortieState.UNKNOWN,
)  # fmt: skip
_WORDS = {
    SortieState.ASHORE: "ashore",
    SortieState.ENDED: "ended at the surface",
    SortieState.HELD: "ended at the surface after a fault",
    SortieState.SURFACED: "broke off at the surface",
    SortieState.ARMED: "broke off after arming",
    SortieState.DIVING: "broke off under way",
    SortieState.ASCENDING: "broke off in an ascent",
    SortieState.ABORTED: "given up, and not known to have surfaced",
    SortieState.UNKNOWN: "state not known",
}


@dataclass(frozen=True)
class StateRecord:
    """The last known state, of which flight, and why. `trouble`: what is wrong with the copies, empty if nothing."""

    state: SortieState
    flight: str = ""
    reason: str = ""
    sequence: int = 0
    trouble: str = ""

    def describe(self) -> str:
        """The record in words, with the flight, the reason and what is wrong with the copies."""
        flight = f" ({self.flight})" if self.flight else ""
        parts = [f"the flight before{flight}: {_WORDS[self.state]}", self.reason, self.trouble]
        return "; ".join(filter(None, parts))


def encode(record: StateRecord) -> bytes:
    """A copy's block."""
    fields = [record.state.name, record.sequence, record.flight, record.reason]
    body = _MAGIC + json.dumps(fields, separators=(",", ":")).encode()
    head = body.ljust(BLOCK - 9)
    if len(head) > BLOCK - 9:
        raise ValueError(f"a state of {len(body)} bytes")
    return head + f"{zlib.crc32(head):08x}\n".encode()


def decode(block: bytes) -> StateRecord | str:
    """The state in a copy's block, or what is wrong with it."""
    if len(block) != BLOCK:
        return f"torn ({len(block)} of {BLOCK} bytes)"
    head, crc = block[: BLOCK - 9], block[BLOCK - 9 :]
    if crc != f"{zlib.crc32(head):08x}\n".encode() or not head.startswith((_MAGIC, _MAGIC_1)):
        return "torn (its check sum fails)"
    try:
        state, sequence, flight, reason = json.loads(head[len(_MAGIC) :])
        known = SortieState[state] if head.startswith(_MAGIC) else _STATES_1[state]
        return StateRecord(known, str(flight), str(reason), int(sequence))
    except (ValueError, TypeError, LookupError):
        return "not understood"


class StateFile:
    """Two copies in `folder`, which is made if need be. OSError where it cannot be written."""

    decode = staticmethod(decode)
    unwritten = StateRecord(SortieState.ASHORE)  # what is read where there is neither copy

    def __init__(self, folder: Path | str):
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.paths = tuple(self.folder / name for name in NAMES)

    def read(self) -> StateRecord:
        """The worse of both copies; ashore where there is neither. Never raises over what is in them."""
        copies = [_read_copy(path, self.decode) for path in self.paths]
        if copies == [None, None]:
            return self.unwritten
        good = [copy for copy in copies if isinstance(copy, StateRecord)]
        torn = [
            f"{path}: {copy or 'missing beside the other'}"
            for path, copy in zip(self.paths, copies, strict=True)
            if not isinstance(copy, StateRecord)
        ]
        if not good:
            return StateRecord(SortieState.UNKNOWN, trouble="; ".join(torn))
        worst = max(good, key=_worseness)
        last = max(record.sequence for record in good)
        if torn:
            # What the torn copy said is not known; only a state that means 'ascend' anyway can stand without it.
            state = worst.state if worst.state.must_ascend else SortieState.UNKNOWN
            return StateRecord(state, worst.flight, worst.reason, last, "; ".join(torn))
        return StateRecord(worst.state, worst.flight, worst.reason, last)

    def write(self, state: SortieState, *, flight: str = "", reason: str = "") -> StateRecord:
        """Bring a state to the disk, both copies; returns once it is there (an fsync or two: not for the tick)."""
        record = StateRecord(state, _cut(flight), _cut(reason), self.read().sequence + 1)
        block = encode(record)
        for path in self.paths:
            _write_copy(path, block)
        return record


def _worseness(record: StateRecord) -> tuple[int, int]:
    return record.state, record.sequence


def _cut(text: str) -> str:
    plain = "".join(letter if " " <= letter <= "~" and letter not in '"\\' else "?" for letter in text)
    return plain[:TEXT_BYTES]


def _read_copy(path: Path, decode: Callable[[bytes], StateRecord | str]) -> StateRecord | str | None:
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
