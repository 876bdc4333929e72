"""The fault table, as data: what can go wrong, who detects it, how soon, what is done about it and what clears it.

The rows of the supervisor have levels: the reactions that they request, mildest first. The supervisor's settings carry
them into its vector (core/layouts/supervisor_layout, REACTION and CLEAR_AFTER), where its kernels look them up. Other
rows are handled by whoever stands nearest. `markdown_rows` renders the table of docs/explanation/supervisor.md.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from glider.firmware.core.layouts import supervisor_layout as sup


class Reaction(IntEnum):
    """Mildest first; the highest requested wins."""

    NOTHING = int(sup.NOTHING)
    LOG = int(sup.LOG)
    WARN = int(sup.WARN)
    HOLD = int(sup.HOLD)  # actuators stay where they were sent
    ABORT = int(sup.ABORT)  # ballast out, mass aft, servo centred; latched
    OOB = int(sup.OOB)  # the out-of-band process drives the ascent
    HW = int(sup.HW)  # hardware watchdog, drop weight


NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = Reaction
AT_ONCE, NEVER = 0.0, math.inf  # s


@dataclass(frozen=True)
class Level:
    """A reaction that a row requests. when: its case, where the row has several.

    clear: time (s) for which the request stands after its condition has ended, or the key of [supervisor] that has it.
    """

    reaction: Reaction
    when: str = ""
    clear: float | str = AT_ONCE

    @property
    def clear_after(self) -> float | str:
        """The clear time in force: from ABORT on a reaction is latched for the flight."""
        return NEVER if self.reaction >= ABORT else self.clear


@dataclass(frozen=True)
class Fault:
    """A row. within_s: from the fault to its notice, s; None: judged as it comes.

    levels: what the supervisor does, mildest first; measure: what else is done, or by somebody else; well: what ends
    the condition, where it can end.
    """

    name: str
    seen_by: str
    within_s: float | None
    levels: tuple[Level, ...] = ()
    measure: str = ""
    well: str = ""


SUPERVISOR = "supervisor"
FAULT_TABLE = {
    sup.FAULT_IMU_LOST: Fault(
        "IMU unplugged or frozen", SUPERVISOR, 0.2, (Level(HOLD), Level(ABORT, "after `hold_s`")),
        "open loop", "a fit sample",
    ),
    sup.FAULT_PRESSURE_LOST: Fault(
        "pressure unplugged", SUPERVISOR, 0.5, (Level(ABORT),), "ballast to its light end, by time",
    ),
    sup.FAULT_BUS_LOST: Fault(
        "drive or pump bus lost", SUPERVISOR, 0.5, (Level(ABORT),), "reconnect, go on with what is left",
    ),
    sup.FAULT_WIRE_LOST: Fault(
        "draw-wire lost or broken", SUPERVISOR, 0.5, (Level(WARN, "for the slider's"), Level(ABORT, "for the pump's")),
        "dead reckoning", "a fit sample",
    ),
    sup.FAULT_SERVO_LOST: Fault(
        "servo lost", SUPERVISOR, 0.5, (Level(WARN),), "servo centred, finish level", "an answer",
    ),
    sup.FAULT_SAMPLE_TIME: Fault(
        "sample too old, time repeats or runs back", SUPERVISOR, 0.04, (Level(LOG),),
        "sample not used, then as 1 to 5", "a fit sample",
    ),
    sup.FAULT_CHECKSUM: Fault(
        "CRC errors", "driver", 60.0, (), "drop and count; more than 5 a minute: device in error",
        "a minute without",
    ),
    sup.FAULT_REPLY: Fault(
        "late, wrong-id, wrong-function, wrong-length reply", "bus", 0.1, (), "never delivered", "the next reply",
    ),
    sup.FAULT_EXCEPTION: Fault(
        "Modbus exception", "driver", 0.1, (Level(ABORT, "if an actuator is in error"),),
        "1-3: device in error; 4-6: back off, 3 tries, device in error", "an answer",
    ),
    sup.FAULT_IMPLAUSIBLE: Fault(
        "NaN, Inf, out of range, impossible jump", SUPERVISOR, 0.04,
        (Level(LOG), Level(WARN, "at `unfit_run` running, device in error")), "sample not used", "a fit sample",
    ),
    sup.FAULT_STUCK_SENSOR: Fault(
        "stuck sensor while moving", SUPERVISOR, 2.0, (Level(WARN),), "device in error", "another value",
    ),
    sup.FAULT_NOT_ARMED: Fault("not fit to arm", "arming", None, (), "refuse to arm", "set right"),
    sup.FAULT_DISAGREE: Fault(
        "pitch and depth rate disagree", SUPERVISOR, 5.0, (Level(WARN),), "cautious controller", "they agree",
    ),
    sup.FAULT_STALL: Fault(
        "actuator stalls or runs the wrong way", SUPERVISOR, 0.3,
        (Level(WARN, "while it rests, to be tried again"), Level(ABORT, "after `stall_tries`, or for the wrong way")),
        "stopped", "it moves",
    ),
    sup.FAULT_SOFT_LIMIT: Fault("soft limit", SUPERVISOR, 0.0, (Level(LOG),), "clamped", "asked for less"),
    sup.FAULT_DRIVE_ALARM: Fault(
        "drive alarm", SUPERVISOR, 0.2, (Level(WARN, "if it can be cleared, once"), Level(ABORT, "if not")),
        well="cleared",
    ),
    sup.FAULT_TOO_DEEP: Fault(
        "too deep", SUPERVISOR, 1.0, (Level(ABORT, "below the working depth"), Level(OOB, "below the at-risk depth")),
    ),
    sup.FAULT_NO_ASCENT: Fault(
        "no ascent after ABORT", f"{SUPERVISOR}; on the way up out of band that process", 30.0,
        (Level(OOB), Level(HW, "if there is still none")),
    ),
    sup.FAULT_OVERTIME: Fault("same depth too long, mission overtime", SUPERVISOR, 120.0, (Level(ABORT),)),
    sup.FAULT_LEAK: Fault(
        "leak", SUPERVISOR, 1.0, (Level(WARN, "at one wet sample", NEVER), Level(ABORT, "at `leak_samples`")),
    ),
    sup.FAULT_STEEP: Fault(
        "steeper than 60 deg, rolling over", SUPERVISOR, 2.0,
        (Level(WARN), Level(ABORT, "after `steep_s`")), "the PID flies", "upright",
    ),
    sup.FAULT_NO_ANSWER: Fault(
        "no answer from the control law", SUPERVISOR, 0.0,
        (Level(WARN, clear="law_rest_s"), Level(ABORT, "at `law_tries` running")),
        "last good command, the PID flies", "an answer",
    ),
    sup.FAULT_VOLTAGE: Fault(
        "under-voltage", SUPERVISOR, 10.0, (Level(WARN, "below `low_voltage`"), Level(ABORT, "below `least_voltage`")),
        well="voltage, or no sample",
    ),
    sup.FAULT_OVERRUN: Fault(
        "overrun", SUPERVISOR, 60.0,
        (Level(LOG), Level(HOLD, "at `overruns` running, or `overrun_share` of a minute, log less"),
         Level(ABORT, "if that lasts `hold_s`")),
        well="a punctual tick",
    ),
    sup.FAULT_LOOP_HUNG: Fault(
        "loop hung, process killed", "out-of-band process", 2.0, (Level(ABORT, "after a restart"),),
        "the out-of-band process drives the ascent",
    ),
    sup.FAULT_WALL_CLOCK: Fault("wall clock stepped", "nobody", None, (), "no effect"),
    sup.FAULT_DISK: Fault(
        "disk full, read-only, I/O error", "recorder", 1.0, (Level(LOG), Level(WARN, "if it failed")),
        "drop by priority, fly on; refuse to arm", "the disk",
    ),
    sup.FAULT_POWER_CUT: Fault(
        "power cut in a write", "log reader", None, (),
        "valid prefix read; at most 1 s lost, nothing damaged returned",
    ),
    sup.FAULT_STATE_FILE: Fault(
        "state file torn", "state file", None, (), "two copies, checked; the worse wins", "a person looked",
    ),
    sup.FAULT_FILE: Fault(
        "file: unknown key, wrong type, NaN, too deep", "loading", None, (), "refused, key and line named", "set right",
    ),
    sup.FAULT_SERIAL: Fault(
        "hostile or random serial bytes", "codecs, hub", 1.0, (), "back in step within a frame; bounded work",
        "their end",
    ),
    sup.FAULT_CONSOLE: Fault("console garbage", "console", None, (), "no effect; arm and abort want confirmation"),
    sup.FAULT_GROWTH: Fault(
        "memory or file handles grow", SUPERVISOR, 60.0,
        (Level(WARN, "at half of `memory_mb` or `handles`"), Level(ABORT, "at all of it")), well="less of it",
    ),
    sup.FAULT_PORT: Fault("two programs open one port", "port", None, (), "refused", "the other leaves"),
    sup.FAULT_ESTIMATE: Fault(
        "estimate not finite", SUPERVISOR, 0.0, (Level(WARN), Level(ABORT, "at `filter_restarts` in a flight")),
        "measured values, filter restarted", "a finite estimate",
    ),
    sup.FAULT_ACKNOWLEDGED: Fault(
        "acknowledged while under way", "command line", None, (), "refused", "afloat, by the out-of-band process",
    ),
}  # fmt: skip
FAULTS = {number: fault.name for number, fault in FAULT_TABLE.items()}

assert list(FAULT_TABLE) == list(range(1, sup.N_ROWS))


def reaction_words(fault: Fault) -> str:
    """Return what is done about a fault: the reactions of the supervisor, then the measure."""
    levels = [f"{level.reaction.name} {level.when}".rstrip() for level in fault.levels]
    return "; ".join([*levels, *([fault.measure] if fault.measure else [])])


def clear_words(fault: Fault) -> str:
    """Return what clears a fault; a latched reaction lasts for the flight."""
    latched = [level for level in fault.levels if level.clear_after == NEVER]
    if fault.levels and len(latched) == len(fault.levels):
        return "never in this flight"
    words = [fault.well]
    words += [f"{level.reaction.name} `{level.clear}` later" for level in fault.levels if isinstance(level.clear, str)]
    words += [f"after {latched[0].reaction.name}: never in this flight"] if latched else []
    return "; ".join(words)


def markdown_rows() -> list[str]:
    """Render the rows of the fault table in docs/explanation/supervisor.md."""
    return [
        f"| {number} | {fault.name} | {fault.seen_by} | {'' if fault.within_s is None else f'{fault.within_s:g}'} | "
        f"{reaction_words(fault)} | {clear_words(fault)} |"
        for number, fault in FAULT_TABLE.items()
    ]
