"""What all sensor drivers share: the newest sample, what makes one unfit, and how old it may get."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from glider.hal.ports import MAX_AGE_PERIODS, Condition, Slot, Validity

FAULTY_AFTER = 5  # unfit samples running, past which the device is in error
DAMAGES = 5  # damaged frames in DAMAGE_S, past which the device is in error, until there were fewer
DAMAGE_S = 60.0


@dataclass
class Health:
    """How a device does."""

    name: str
    samples: int = 0
    unfit: int = 0  # not finite or out of range
    timeouts: int = 0
    exceptions: int = 0
    damaged: int = 0
    error: str = ""  # what is wrong now; empty: nothing
    notes: deque = field(default_factory=lambda: deque(maxlen=20))

    def plain(self) -> dict[str, Any]:
        """Counts, what is wrong now, and what has changed, in plain types."""
        return {**asdict(self), "notes": [note for _, note in self.notes]}

    def say(self, now: float, text: str) -> None:
        """A change in the device's state, for logs and the bench."""
        self.error = text
        self.notes.append((now, text or "well again"))


class SampleState:
    """How an actuator does, in a slot of its own: when it last answered, and its Condition."""

    def __init__(self, slot: Slot):
        self._slot = np.full(2 + len(slot.names), np.nan)
        self._slot[1] = Validity.MISSING
        self._answered_at = -math.inf
        self.epoch = 0.0

    def start(self, epoch: float) -> None:
        """The board's time begins."""
        self.epoch = epoch
        self.answered(max(self._answered_at, epoch), Condition.WELL)

    def answered(self, at: float, condition: Condition) -> None:
        """The actuator said something at this time of the monotonic clock."""
        self._answered_at = at
        self._slot[0], self._slot[1], self._slot[2] = at - self.epoch, Validity.VALID, condition

    def say(self, condition: Condition) -> None:
        """It does otherwise, whether it answers or not."""
        self._slot[2] = condition

    def read(self, out: np.ndarray) -> None:
        """Copy [time, validity, condition] into `out`."""
        out[...] = self._slot


class Sensor:
    """A sensor port: the newest sample in a slot of its own, copied out by `read` without allocation."""

    def __init__(self, name: str, slot: Slot, period: float, ranges: Sequence[tuple[float, float]]):
        self.name, self.period = name, period
        self.health = Health(name)
        self.model = ""  # as the device names itself, where it does
        self._ranges = tuple(ranges)
        self._slot = np.full(2 + len(slot.names), np.nan)
        self._slot[1] = Validity.MISSING
        self._running_unfit = 0
        self._taken_at = -math.inf
        self._damages: deque[float] = deque(maxlen=DAMAGES + 1)
        self.epoch = 0.0  # s, when the board's time began, on the clock that `accept` is given

    def start(self, epoch: float) -> None:
        """The board's time begins: what was read before is forgotten."""
        self.epoch, self._taken_at = epoch, max(self._taken_at, epoch)
        self._slot[:] = np.nan
        self._slot[1] = Validity.MISSING

    def reset_damage_count(self) -> None:
        """Damaged frames until now are forgotten: somebody has looked at the line."""
        self._damages.clear()

    def read(self, out: np.ndarray) -> None:
        """Copy [time, validity, values ...] into `out`."""
        out[...] = self._slot

    @property
    def time(self) -> float:
        """When the newest sample was taken, s of the board's time; NaN before the first."""
        return float(self._slot[0])

    @property
    def values(self) -> tuple[float, ...]:
        return tuple(self._slot[2:].tolist())

    @property
    def validity(self) -> Validity:
        return Validity(int(self._slot[1]))

    def accept(self, taken_at: float, values: Sequence[float], now: float) -> bool:
        """Take a sample, if it is finite, in range and newer than the last; False if it is not fit."""
        health = self.health
        for value, (low, high) in zip(values, self._ranges, strict=True):
            if not (math.isfinite(value) and low <= value <= high):
                health.unfit += 1
                self._running_unfit += 1
                if self._running_unfit >= FAULTY_AFTER and self._slot[1] != Validity.FAULT:
                    self._slot[1] = Validity.FAULT
                    health.say(now, f"reads {value:g}, outside {low:g} to {high:g}")
                return False
        if taken_at <= self._taken_at:
            return True
        if self._too_many_crc_errors(now):
            return False
        self._running_unfit = 0
        if health.error:
            health.say(now, "")
        health.samples += 1
        self._taken_at = taken_at
        self._slot[0], self._slot[1] = taken_at - self.epoch, Validity.VALID
        self._slot[2:] = values
        return True

    def fail(self, now: float, what: str) -> None:
        """The device is in error, until it has a fit sample again."""
        self._slot[1] = Validity.FAULT
        if self.health.error != what:
            self.health.say(now, what)

    def damage(self, now: float, frames: int = 1) -> None:
        """So many frames failed their check sum: dropped and counted; too many in a minute are an error."""
        self.health.damaged += frames
        for _ in range(min(frames, DAMAGES + 1)):
            self._damages.append(now)
        if self._too_many_crc_errors(now):
            self.fail(now, f"more than {DAMAGES} damaged frames in {DAMAGE_S:g} s")

    def _too_many_crc_errors(self, now: float) -> bool:
        return len(self._damages) > DAMAGES and now - self._damages[0] <= DAMAGE_S

    def age(self, now: float) -> None:
        """Say that the sample is stale once it is older than MAX_AGE_PERIODS of its periods."""
        if self._slot[1] == Validity.VALID and now - self._taken_at > MAX_AGE_PERIODS * self.period:
            self._slot[1] = Validity.STALE
            self.health.say(now, f"no sample for {MAX_AGE_PERIODS:g} periods")
