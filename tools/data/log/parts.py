"""The parts of one flight's log, taken together.

Where the recording process had to be replaced, NAME.mcap goes on in NAME-part2.mcap and so on (`Recorder.watch`).
Sequence numbers go on over the parts, so what was lost between two of them can be counted. A part given by name stands
alone; given the first file, all that are there are read as one log.
"""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from glider.hal.recorder import logfile, schema
from glider.hal.recorder.recorder import part_path
from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import Log, Topic, read_log


@dataclass(frozen=True)
class Part:
    """One file of a flight, and what is missing before it."""

    number: int
    log: Log  # as it reads alone
    lost: dict[str, int] = field(default_factory=dict)  # topic: records missing between the part before and this one
    gap_s: float = 0.0  # of log time, from the last record before to the first here


@dataclass
class FlightLog(Log):
    """Several parts as one log: topics and events one behind the other, sizes and damages of all."""

    parts: list[Part] = field(default_factory=list)
    absent: dict[int, Path] = field(default_factory=dict)  # of a number below the last one's, and not there
    left_out: list[str] = field(default_factory=list)  # files with a part's name that are none, and why

    @property
    def whole(self) -> bool:
        """Nothing is missing that the recorder was handed."""
        lost = any(count for part in self.parts for count in part.lost.values())
        return self.complete and not self.damages and not lost and not self.left_out


def read_flight(path: Path | str) -> Log:
    """A log with the parts it goes on in, as one; without any, or where `path` is itself a part, the file alone.

    InputError where the file is no log at all; a further part that cannot be read is left out, and said.
    """
    path = Path(path)
    later = later_parts(path)
    if later and not path.exists():
        raise InputError(f"no such file; there are {', '.join(part.name for part in later.values())}", source=path)
    first = read_log(path)
    if not later or logfile.PART in first.metadata:
        return first
    parts, left_out = [Part(1, first)], []
    for number, file in later.items():
        try:
            parts.append(_joined_to(parts, number, read_log(file)))
        except InputError as error:
            left_out.append(str(error))
    absent = {number: part_path(path, number) for number in range(2, max(later)) if number not in later}
    return _together(parts, absent, left_out)


def later_parts(path: Path) -> dict[int, Path]:
    """The files beside a log that are named as its further parts, by number, ascending."""
    name = re.compile(rf"{re.escape(path.stem)}-part([1-9]\d{{0,5}}){re.escape(path.suffix)}")
    try:
        found = [(match, file) for file in path.parent.iterdir() if (match := name.fullmatch(file.name))]
    except OSError:
        return {}
    return dict(sorted((int(match[1]), file) for match, file in found if int(match[1]) > 1))


def _joined_to(before: list[Part], number: int, log: Log) -> Part:
    """A log as the next part; InputError where it is not of the same flight."""
    facts = before[0].log.metadata
    for key, wanted in ((logfile.PART, str(number)), (schema.RECORDING, facts.get(schema.RECORDING))):
        found = log.metadata.get(key)  # metadata may be lost to damage, and older logs name no recording
        if log.metadata and wanted is not None and found is not None and found != wanted:
            raise InputError(f"left out: {key} is {found!r}, not {wanted!r}", source=log.path)
    if log.metadata and logfile.PART not in log.metadata:
        raise InputError("left out: a log of its own, not a part", source=log.path)
    lost: dict[str, int] = {}
    for name, topic in log.topics.items():
        earlier = [part.log.topics[name] for part in before if name in part.log.topics]
        if not topic.count:
            continue
        if any(item.fields != topic.fields or (item.data is None) != (topic.data is None) for item in earlier):
            raise InputError(f"left out: {name} holds other records than in the part before", source=log.path)
        last = max((int(item.sequences[-1]) for item in earlier if item.count), default=0)
        if topic.sequences[0] <= last:
            raise InputError(f"left out: {name} does not go on where the part before ended", source=log.path)
        lost[name] = int(topic.sequences[0]) - last - 1
    ends = [int(topic.times_ns.max()) for part in before for topic in part.log.topics.values() if topic.count]
    starts = [int(topic.times_ns.min()) for topic in log.topics.values() if topic.count]
    last_ns = max(ends, default=None)
    gap_s = max(0.0, (min(starts) - last_ns) / 1e9) if starts and last_ns is not None else 0.0
    return Part(number, log, lost, gap_s)


def _together(parts: list[Part], absent: dict[int, Path], left_out: list[str]) -> FlightLog:
    logs = [part.log for part in parts]
    facts = next((log.metadata for log in logs if log.metadata), {})
    joined = FlightLog(
        path=logs[0].path,
        size=sum(log.size for log in logs),
        complete=logs[-1].complete,
        end=sum(log.end for log in logs),
        damages=[replace(item, what=f"{log.path.name}: {item.what}") for log in logs for item in log.damages],
        topics={name: _chain(name, logs) for name in dict.fromkeys(name for log in logs for name in log.topics)},
        events=[event for log in logs for event in log.events],
        attachments={name: text for log in reversed(logs) for name, text in log.attachments.items()},
        metadata={key: value for key, value in facts.items() if key != logfile.PART},
        ending={key: value for log in logs for key, value in log.ending.items()},
        attached_ns=logs[0].attached_ns,
    )
    joined.parts, joined.absent, joined.left_out = parts, absent, left_out
    return joined


def _chain(name: str, logs: list[Log]) -> Topic:
    """A topic's records of all parts, in the order of the parts."""
    topics = [log.topics[name] for log in logs if name in log.topics]
    data = [topic.data for topic in topics if topic.data is not None]
    return replace(
        topics[0],
        times_ns=np.concatenate([topic.times_ns for topic in topics]),
        sequences=np.concatenate([topic.sequences for topic in topics]),
        data=np.concatenate(data) if len(data) == len(topics) else None,
        first=1,
    )
