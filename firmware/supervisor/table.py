"""The fault table as data: what can go wrong, where it is seen, how soon, and what is done about it.

Rows of the supervisor's own are asked for by the kernels of core/detectors; the others by whoever stands nearest:
drivers and the bus, arming, the readers of files, recorder and out-of-band process. From ABORT on a reaction is
latched.
"""

from dataclasses import dataclass
from enum import IntEnum

from firmware.core.supervision import supervisor_layout as sup


class Reaction(IntEnum):
    """Mildest first; the highest asked for wins."""

    NOTHING = 0
    LOG = 1
    WARN = 2
    HOLD = 3  # actuators stay where they were sent
    ABORT = 4  # ballast out, mass aft, servo centred; latched
    OOB = 5  # the out-of-band process drives the ascent
    HW = 6  # hardware watchdog, drop weight


assert [float(reaction) for reaction in Reaction] == [
    sup.NOTHING,
    sup.LOG,
    sup.WARN,
    sup.HOLD,
    sup.ABORT,
    sup.OOB,
    sup.HW,
]


@dataclass(frozen=True)
class Row:
    """A row. `within_s`: noticed so soon, None where it is judged as it comes (loading, arming, a start)."""

    number: int
    name: str
    seen_by: str
    within_s: float | None
    reaction: str
    clears: str


_LATCHED = "never in this flight"
_ROWS = (
    ("IMU unplugged or frozen", "supervisor", 0.2, "WARN, HOLD 1 s, ABORT open loop", "a fit sample, before ABORT"),
    ("pressure unplugged", "supervisor", 0.5, "ABORT by time, ballast to its light end", _LATCHED),
    ("drive or pump bus lost", "supervisor", 0.5, "reconnect; ABORT with what is left", _LATCHED),
    ("draw-wire lost or broken", "supervisor", 0.5, "WARN, dead reckoning; ABORT if the pump's",
     "a fit sample; the pump's: " + _LATCHED),
    ("servo lost", "supervisor", 0.5, "WARN, finish level", "an answer"),
    ("sample too old, time repeats or runs back", "supervisor", 0.04, "LOG, sample not used, then as 1 to 5",
     "a fit sample"),
    ("CRC errors", "driver", 60.0, "drop and count; more than 5 a minute: device in error", "a minute without"),
    ("late, wrong-id, wrong-function, wrong-length reply", "bus", 0.1, "never delivered", "the next reply"),
    ("Modbus exception", "driver", 0.1, "1-3: device in error; 4-6: back off, 3 tries, device in error", "an answer"),
    ("NaN, Inf, out of range, impossible jump", "supervisor", 0.04, "LOG, rejected; 5 running: WARN, device in error",
     "a fit sample"),
    ("stuck sensor while moving", "supervisor", 2.0, "WARN, device in error", "another value"),
    ("not fit to arm", "arming", None, "refuse to arm", "set right"),
    ("pitch and depth rate disagree", "supervisor", 5.0, "WARN, cautious controller", "they agree"),
    ("actuator stalls or runs the wrong way", "supervisor", 0.3, "2 tries, then ABORT; wrong way: stopped, ABORT",
     "it moves; after ABORT: " + _LATCHED),
    ("soft limit", "supervisor", 0.0, "LOG, clamped", "asked for less"),
    ("drive alarm", "supervisor", 0.2, "WARN, cleared once; then ABORT", "cleared; after ABORT: " + _LATCHED),
    ("too deep", "supervisor", 1.0, "working depth: ABORT; at-risk depth: OOB", _LATCHED),
    ("no ascent after ABORT", "supervisor", 30.0, "OOB, then HW", _LATCHED),
    ("same depth too long, mission overtime", "supervisor", 120.0, "ABORT", _LATCHED),
    ("leak", "supervisor", 1.0, "one sample: WARN; three: ABORT", _LATCHED),
    ("steeper than 60 deg, rolling over", "supervisor", 2.0, "PID; then ABORT", "upright; after ABORT: " + _LATCHED),
    ("no answer from the control law", "supervisor", 0.0, "last good command, PID; 3 running: ABORT",
     "an answer; after ABORT: " + _LATCHED),
    ("under-voltage", "supervisor", 10.0, "WARN; then ABORT", "voltage; after ABORT: " + _LATCHED),
    ("overrun", "supervisor", 60.0, "LOG; 10 running or 1 % of a minute: log less, HOLD, ABORT",
     "a punctual tick; after ABORT: " + _LATCHED),
    ("loop hung, process killed", "out-of-band process", 2.0, "OOB; a restart goes into ABORT", _LATCHED),
    ("wall clock stepped", "nobody", None, "no effect", ""),
    ("disk full, read-only, I/O error", "recorder", 1.0, "LOG, drop by priority, fly on; refuse to arm", "the disk"),
    ("power cut in a write", "log reader", None, "valid prefix read; at most 1 s lost, nothing damaged returned", ""),
    ("state file torn", "state file", None, "two copies, checked; the worse wins", "a person looked"),
    ("file: unknown key, wrong type, NaN, too deep", "loading", None, "refused, key and line named", "set right"),
    ("hostile or random serial bytes", "codecs, hub", 1.0, "back in step within a frame; bounded work", "their end"),
    ("console garbage", "console", None, "no effect; arm and abort want confirmation", ""),
    ("memory or file handles grow", "supervisor", 60.0, "WARN; at the limit ABORT", "less of it"),
    ("two programs open one port", "port", None, "refused", "the other leaves"),
)  # fmt: skip
FAULTS = {number: Row(number, *row) for number, row in enumerate(_ROWS, start=1)}

assert len(FAULTS) == sup.N_ROWS - 1
