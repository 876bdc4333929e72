"""Faults for which no flight is needed: wire, files, ports, processes. Each does the real thing (shown/), in simulated
time where there is a wire.

`disabled` takes away what notices the fault: a check sum, the memory of missing replies, strictness, a lock. Then the
row has to fail, which shows that it is this that notices.
"""

import signal

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.tools.verify.faults.cases import Show
from glider.tools.verify.faults.shown import console, ends, loading, ports, processes, records, wire


def shows() -> list[Show]:
    """Every fault that needs no flight."""
    never = "never delivered"
    return [
        Show(sup.FAULT_CHECKSUM, "damaged IMU frames", wire.damaged_imu, "device in error", 60.0),
        Show(sup.FAULT_CHECKSUM, "damaged Modbus replies", wire.damaged_beacon, "device in error", 60.0),
        Show(sup.FAULT_REPLY, "late and lost replies", wire.late_replies, never, 0.1),
        Show(sup.FAULT_REPLY, "reply in another's name", wire.foreign_reply(wire.wrong_id), never, 0.1),
        Show(sup.FAULT_REPLY, "reply of another function", wire.foreign_reply(wire.wrong_function), never, 0.1),
        Show(sup.FAULT_REPLY, "reply of another length", wire.foreign_reply(wire.wrong_length), never, 0.1),
        *(Show(sup.FAULT_EXCEPTION, f"exception {code}", wire.exception(code), "device in error",
             0.1 if code <= 3 else 1.0)
          for code in range(1, 7)),
        *(Show(sup.FAULT_NOT_ARMED, kind, loading.arming(kind), "refuse to arm", 1.0)
          for kind in loading.UNFIT),
        Show(sup.FAULT_NO_ASCENT, "out of band", processes.no_rise, "pump again, then HW", 30.0),
        Show(sup.FAULT_LOOP_HUNG, "process killed", processes.loop_ends(signal.SIGKILL), "OOB", 2.0),
        Show(sup.FAULT_LOOP_HUNG, "loop hung", processes.loop_ends(signal.SIGSTOP), "OOB", 2.0),
        Show(sup.FAULT_LOOP_HUNG, "disk slow at the end", ends.slow_disk, "waited for", 0.0),
        Show(sup.FAULT_LOOP_HUNG, "out-of-band process breaks off", ends.watch_breaks_off, "watchdog runs on", 0.0),
        Show(sup.FAULT_LOOP_HUNG, "restart", processes.restart, "ascent only", 2.0),
        Show(sup.FAULT_WALL_CLOCK, "an hour on and back", processes.wall_clock, "no effect", 0.0),
        Show(sup.FAULT_DISK, "disk full", records.full_disk, "LOG", 1.0),
        Show(sup.FAULT_POWER_CUT, "torn at 300 places", records.cut_log, "valid prefix", 0.0),
        Show(sup.FAULT_STATE_FILE, "torn at every seventh byte", records.torn_state, "the worse wins", 0.0),
        Show(sup.FAULT_FILE, "files", loading.bad_files, "refused", 0.0),
        Show(sup.FAULT_SERIAL, "random and mutated bytes", wire.hostile_bytes, "back in step", 1.0),
        Show(sup.FAULT_CONSOLE, "garbage", console.console, "no effect", 0.0),
        *(Show(sup.FAULT_ACKNOWLEDGED, f"in {name}", ends.acknowledged(ascending), "refused", 0.0)
          for name, ascending in (("a flight", False), ("an ascent out of band", True))),
        Show(sup.FAULT_PORT, "a second program", ports.two_programs, "refused", 0.0),
    ]  # fmt: skip
