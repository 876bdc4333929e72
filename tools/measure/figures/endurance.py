"""A long flight on twins at real time beside load: missed ticks, lateness, memory, descriptors.

All that flies on devices is there: drivers, wires, twins, recorder, heartbeat, state, out-of-band process. The load is
a process that never waits, on another core than the loop's.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from firmware.core.control.telemetry import REC_LATENESS
from tools.cli.common import progress

WARM_UP_S = 20.0
SAMPLE_S = 10.0
RSS_LIMIT_BYTES = 1_000_000
BLOCKS_A_TICK = 0.5  # gained over the whole flight, divided by its ticks: less than one block a tick is none
LATE_S, LATE_KEPT = 0.005, 200
LEG_S = 45.0  # about what one leg takes


def mission_text(seconds: float) -> str:
    """A sawtooth for so long."""
    legs = 2 * (int(seconds / (2 * LEG_S)) + 4)
    head = f"""
format = 1
name = "endurance"
time_limit_s = {seconds + 3600.0}
[site]
name = "pool"
depth_m = 6.0
"""
    leg = "[[leg]]\ndepth_m = {}\npitch_deg = {}\ntime_limit_s = 120.0\n"
    return head + "".join(leg.format(*((4.0, -20.0), (1.0, 20.0))[number % 2]) for number in range(legs))


def measure(seconds: float, *, fifo: bool, load: bool) -> dict[str, Any]:
    """Fly for so long, then give up and surface; the figures of the loop's process."""
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as place:
        mission = Path(place, "endurance.toml")
        mission.write_text(mission_text(seconds))
        busy = _load(cores[0]) if load and len(cores) > 1 else None
        asleep = _sleeper(cores[-1], seconds, fifo)
        try:
            found = _fly(mission, Path(place), seconds, fifo, cores[-1])
            machine = json.loads(asleep.communicate(timeout=60.0)[0])
        finally:
            for process in (busy, asleep):
                if process is not None:
                    process.kill()
                    process.wait()
    return {**found, "machine": machine, "cores": len(cores), "load_on_other_core": busy is not None, "fifo": fifo}


SLEEPER = """
import contextlib, ctypes, json, os, sys, time
core, seconds, fifo = int(sys.argv[1]), float(sys.argv[2]), sys.argv[3] == "True"
os.sched_setaffinity(0, {core})
if fifo:
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(51))
    ctypes.CDLL(None).mlockall(3)
ticks = missed = 0
worst, due, end = 0.0, time.monotonic(), time.monotonic() + seconds
while due < end:
    time.sleep(max(0.0, due - time.monotonic()))
    late = time.monotonic() - due
    ticks, worst, due = ticks + 1, max(worst, late), due + 0.02
    while due < time.monotonic():
        missed, due = missed + 1, due + 0.02
print(json.dumps({"ticks": ticks, "missed": missed, "worst_late_s": worst}))
"""


def _sleeper(core: int, seconds: float, fifo: bool) -> subprocess.Popen[bytes]:
    """What the machine itself can keep: a process on the loop's core that only sleeps, above its priority, as often."""
    command = [sys.executable, "-c", SLEEPER, str(core), str(seconds), str(fifo)]
    return subprocess.Popen(command, stdout=subprocess.PIPE)


def _load(core: int) -> subprocess.Popen[bytes]:
    code = f"import os; os.sched_setaffinity(0, {{{core}}})\nwhile True: pass"
    return subprocess.Popen([sys.executable, "-c", code])


def _fly(mission: Path, folder: Path, seconds: float, fifo: bool, core: int) -> dict[str, Any]:
    from hal import realtime
    from hal.recorder.recorder import Recorder
    from tools.flight.compose import build_flight, build_runtime, log_metadata, record_specs
    from tools.flight.keeper import Keeper

    flight = build_flight(mission=str(mission), board="twin")
    metadata = log_metadata(flight, seed=0, effects={})
    recorder = Recorder(folder / "log.mcap", record_specs(flight), attachments=flight.texts, metadata=metadata)
    keeper = Keeper(flight, recorder, name="endurance", folder=folder / "state", twin=True)
    keeper.claim()
    with keeper:
        if fifo:  # before the twins start: they follow, ten below
            realtime.take_priority(50)
        keeper.prepare()
        flight.board.open()
        try:
            with recorder:
                runtime = build_runtime(flight, recorder)
                keeper.begin()
                runtime.extras = (*runtime.extras, keeper.beat)
                said = [realtime.pin_to_core(core)] + ([realtime.lock_memory()] if fifo else [])
                try:
                    runtime.arm()
                    keeper.flying()
                    samples = Samples(seconds)
                    _ticks(runtime, keeper, recorder, samples, seconds)
                finally:
                    runtime.disarm()
                    realtime.unlock_memory()
                report = recorder.close({"reason": "long enough"})
        finally:
            flight.board.close()
        autopilot = flight.autopilot
        keeper.end(surfaced=autopilot.surfaced, orderly=True, reason="long enough")
    figures = _figures(runtime, samples, seconds)
    figures["pass"] = figures["pass"] and autopilot.mode == "flying"
    return {**figures, "real_time": said, "mode_at_the_end": autopilot.mode,
            "reason": autopilot.reason,
            "records": {"written": report.written, "dropped": report.dropped, "complete": report.complete}}  # fmt: skip


class Samples:
    """What is looked at now and then, in memory that is there from the start: time (s), blocks, resident bytes,
    descriptors, the recording process's resident bytes."""

    def __init__(self, seconds: float):
        self.rows = np.zeros((int(seconds / SAMPLE_S) + 8, 5))
        self.count = 0
        self.late = np.zeros((LATE_KEPT, 2))  # when and by how much, s
        self.late_count = 0

    def note_late(self, t: float, lateness: float) -> None:
        """A tick that was late enough to ask why."""
        if self.late_count < LATE_KEPT:
            self.late[self.late_count] = t, lateness
        self.late_count += 1

    def take(self, t: float, recorder_pid: int) -> None:
        """One row; the interpreter's blocks first, so that the looking itself is not in them."""
        from tools.flight.keeper import open_files, resident_bytes

        blocks = sys.getallocatedblocks()
        self.rows[self.count] = (t, blocks, resident_bytes(), open_files(), resident_bytes(recorder_pid))
        self.count += 1


def _ticks(runtime: Any, keeper: Any, recorder: Any, samples: Samples, seconds: float) -> None:
    """Tick for so long; once a second what a flight does then, and samples after the warm-up."""
    pid, values = recorder.pid, runtime.channel.values
    begin, next_second, next_sample = runtime.deadline, 0.0, min(WARM_UP_S, seconds / 4)
    with progress("minutes", max(1, round(seconds / 60.0))) as advance:
        minute = 60.0
        while (passed := runtime.deadline - begin) < seconds:
            runtime.tick()
            lateness = values[REC_LATENESS]
            if lateness > LATE_S:
                samples.note_late(passed, lateness)
            if passed >= next_second:
                keeper.second(runtime.timing)
                next_second = passed + 1.0
            elif passed >= next_sample:
                runtime.look_at_resources(passed)
                samples.take(passed, pid)
                next_sample += min(SAMPLE_S, seconds / 10)
            elif passed >= minute:
                advance(1)
                minute += 60.0
    samples.take(seconds, pid)


def _figures(runtime: Any, samples: Samples, seconds: float) -> dict[str, Any]:
    rows, timing = samples.rows[: samples.count], runtime.timing
    first, last = rows[0], rows[-1]
    ticks = (last[0] - first[0]) / runtime.dt
    blocks = (last[1] - first[1]) / ticks
    grown = last[2] - first[2]
    return {
        "seconds": seconds,
        "ticks": timing.ticks,
        "missed": timing.missed,
        "worst_late_s": timing.worst_s,
        "lateness": timing.histogram(),
        "blocks_gained": int(last[1] - first[1]),
        "blocks_a_tick": round(blocks),
        "resident_bytes": int(last[2]),
        "resident_growth_bytes": int(grown),
        "descriptors": [int(first[3]), int(rows[:, 3].max()), int(last[3])],
        "recorder_growth_bytes": int(last[4] - first[4]),
        "late_at_s": [[round(float(t), 2), round(float(late), 4)] for t, late in samples.late[: samples.late_count]],
        "measured_from_s": float(first[0]),
        "pass": timing.missed == 0 and abs(blocks) < BLOCKS_A_TICK and grown < RSS_LIMIT_BYTES and last[3] <= first[3],
    }
