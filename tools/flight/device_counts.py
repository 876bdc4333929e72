"""The error counts of a flight's devices in its log: every change as an event, all of them at the end."""

import json
from typing import Any

from glider.hal.ports import Board
from glider.hal.recorder.schema import WARN

COUNTS = ("timeouts", "exceptions", "damaged", "unfit")  # of a device's health that count errors


def errors_text(health: dict[str, Any], before: dict[str, Any] | None = None) -> str:
    """Describe a device's error counts that are not `before`'s (default: not 0) and a change of its present error.

    Empty where nothing has changed.
    """
    earlier = before or {}
    grown = [(name, health[name], earlier.get(name, 0)) for name in COUNTS if health[name] != earlier.get(name, 0)]
    words = [f"{name} {count}{f' (+{count - was})' if was else ''}" for name, count, was in grown]
    if health["error"] != earlier.get("error", ""):
        words.append(health["error"] or "well again")
    return ", ".join(words)


class DeviceCounts:
    """Watches the error counts of a board's devices."""

    def __init__(self, board: Board, recorder: Any):
        self._board, self._recorder = board, recorder
        self._before = board.health()

    def look(self, t: float) -> None:
        """Record the devices whose error counts have changed since the last call; once a second, between two ticks."""
        health = self._board.health()
        changed = [
            f"{name}: {text}" for name, now in health.items() if (text := errors_text(now, self._before.get(name)))
        ]
        if changed:
            self._recorder.event(t, WARN, "; ".join(changed))
        self._before = health

    def ending(self) -> dict[str, str]:
        """Return the log's closing entry: every device's health, JSON; none on a board without devices."""
        health = self._board.health()
        return {"devices": json.dumps(health)} if health else {}
