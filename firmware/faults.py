"""The fault table: what can go wrong, by row, and the reactions. Who sees a row, how soon, what is done about it and
what clears it stands in docs/SUPERVISOR.md, "The fault table".

Rows of the supervisor's own are asked for by the kernels of core/supervision; the others by whoever stands nearest.
From ABORT on a reaction is latched.
"""

from enum import IntEnum

from firmware.core.layouts import supervisor_layout as sup


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


FAULTS = {
    sup.FAULT_IMU_LOST: "IMU unplugged or frozen",
    sup.FAULT_PRESSURE_LOST: "pressure unplugged",
    sup.FAULT_BUS_LOST: "drive or pump bus lost",
    sup.FAULT_WIRE_LOST: "draw-wire lost or broken",
    sup.FAULT_SERVO_LOST: "servo lost",
    sup.FAULT_SAMPLE_TIME: "sample too old, time repeats or runs back",
    sup.FAULT_CHECKSUM: "CRC errors",
    sup.FAULT_REPLY: "late, wrong-id, wrong-function, wrong-length reply",
    sup.FAULT_EXCEPTION: "Modbus exception",
    sup.FAULT_IMPLAUSIBLE: "NaN, Inf, out of range, impossible jump",
    sup.FAULT_STUCK_SENSOR: "stuck sensor while moving",
    sup.FAULT_NOT_ARMED: "not fit to arm",
    sup.FAULT_DISAGREE: "pitch and depth rate disagree",
    sup.FAULT_STALL: "actuator stalls or runs the wrong way",
    sup.FAULT_SOFT_LIMIT: "soft limit",
    sup.FAULT_DRIVE_ALARM: "drive alarm",
    sup.FAULT_TOO_DEEP: "too deep",
    sup.FAULT_NO_ASCENT: "no ascent after ABORT",
    sup.FAULT_OVERTIME: "same depth too long, mission overtime",
    sup.FAULT_LEAK: "leak",
    sup.FAULT_STEEP: "steeper than 60 deg, rolling over",
    sup.FAULT_NO_ANSWER: "no answer from the control law",
    sup.FAULT_VOLTAGE: "under-voltage",
    sup.FAULT_OVERRUN: "overrun",
    sup.FAULT_LOOP_HUNG: "loop hung, process killed",
    sup.FAULT_WALL_CLOCK: "wall clock stepped",
    sup.FAULT_DISK: "disk full, read-only, I/O error",
    sup.FAULT_POWER_CUT: "power cut in a write",
    sup.FAULT_STATE_FILE: "state file torn",
    sup.FAULT_FILE: "file: unknown key, wrong type, NaN, too deep",
    sup.FAULT_SERIAL: "hostile or random serial bytes",
    sup.FAULT_CONSOLE: "console garbage",
    sup.FAULT_GROWTH: "memory or file handles grow",
    sup.FAULT_PORT: "two programs open one port",
    sup.FAULT_ESTIMATE: "estimate not finite",
}

assert len(FAULTS) == sup.N_ROWS - 1
