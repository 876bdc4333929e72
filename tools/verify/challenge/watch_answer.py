"""A watch.json as a scorer reads it (docs/reference/gap.md, What changed): what is scored is checked, the rest is let
be."""

from pathlib import Path
from typing import Literal

import msgspec

from glider.tools.data.plain import read_json
from glider.tools.verify.challenge.diagnosis import MAX_BYTES, Probability

WATCH_FILE = "watch.json"
REFERENCE = "reference"  # the folder of the runs before anything changed
IDENTIFIED, VELOCITY = "identified", "velocity"  # folders of an identified vehicle and of a mission's velocity
VEHICLE_FILE = "identified.toml"  # in IDENTIFIED
MEANS = "velocity.json"  # in that: each dive's mean


class AnsweredRunCause(msgspec.Struct):
    label: str
    probability: Probability
    group: list[str] = msgspec.field(default_factory=list)


class RunSaid(msgspec.Struct):
    run: str
    verdict: Literal["none", "cause", "unknown"]
    causes: list[AnsweredRunCause]
    skipped: str | None = None


class EventSaid(msgspec.Struct):
    label: str | None
    group: list[str]
    from_run: str
    to_run: str | None
    probability: Probability
    size: float | None = None
    ci90: tuple[float, float] | None = None


class WatchSaid(msgspec.Struct):
    """A verdict for every run, and the events, the main one first."""

    runs: list[RunSaid]
    events: list[EventSaid]

    def span(self, event: EventSaid) -> tuple[int, int | None]:
        """First and last run of an event by their numbers, None where it is still there."""
        numbers = {run.run: n for n, run in enumerate(self.runs)}
        return numbers.get(event.from_run, -1), None if event.to_run is None else numbers.get(event.to_run, -1)


def read_watch(path: Path) -> WatchSaid:
    """A watch's answer; InputError with the place in the file where it is not one."""
    return read_json(path, WatchSaid, MAX_BYTES)
