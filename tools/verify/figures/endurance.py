"""A long flight on twins at real time beside load: missed ticks, lateness, memory, descriptors.

All that flies on devices is there: drivers, wires, twins, recorder, heartbeat, state, out-of-band process. The load is
a process that never waits, on another core than the loop's.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.core.control.telemetry import REC_LATENESS
from glider.tools.cli.common import progress
from glider.tools.verify.figures.bare_loop import BareLoop, Punctuality, bare_loop_program, stolen_s

WARM_UP_S = 20.0
SAMPLE_S = 10.0
RSS_LIMIT_BYTES = 1_000_000
BLOCKS_A_TICK = 0.5  # gained over the whole flight, divided by its ticks: less than one block a tick is none
LATE_S, LATE_KEPT = 0.005, 20_000
PRIORITY = 50  # real-time, of the loop
PERIOD_S, WATCH_S = 0.02, 0.001  # of the loop and the bare loop beside it; of the one that watches the machine
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
    """Fly for so long, then give up and surface; the figures of the loop's process, and of bare loops on its core."""
    cores = sorted(os.sched_getaffinity(0))
    core = cores[-1]
    with tempfile.TemporaryDirectory() as place, bare_loop_program() as program:
        mission = Path(place, "endurance.toml")
        mission.write_text(mission_text(seconds))
        busy = _load(cores[0]) if load and len(cores) > 1 else None
        beside: list[BareLoop] = []

        def start_beside() -> None:
            about: dict[str, Any] = {"priority": PRIORITY + 1 if fifo else 0, "seconds": seconds, "late_s": WATCH_S}
            beside.append(BareLoop(program, core=core, period_s=PERIOD_S, **about))
            beside.extend(BareLoop(program, core=each, period_s=WATCH_S, **about) for each in cores)

        stolen = stolen_s(core)
        try:
            found, late = _fly(mission, Path(place), seconds, fifo, core, start_beside)
            bare, *watches = (loop.end() for loop in beside)
        finally:
            for loop in beside:
                loop.kill()
            if busy is not None:
                busy.kill()
                busy.wait()
    stolen = stolen_s(core) - stolen
    compared = {
        "bare": bare.summary(), "missed_ratio": found["missed"] / bare.missed if bare.missed else None,
        "late_ticks": reasons(late, watches.pop(), watches), "stolen_s": round(stolen, 2),
    }  # fmt: skip
    return {**found, **compared, "cores": len(cores), "load_on_other_core": busy is not None, "fifo": fifo}


def reasons(late: np.ndarray, here: Punctuality, elsewhere: list[Punctuality]) -> dict[str, Any]:
    """Late ticks by what made them so: how many, the deadlines missed by them, the worst.

    late (n, 3): when a tick began, how late, how far behind the one before ended, s (of the monotonic clock). here: a
    bare loop that wakes each millisecond on the flight's core; elsewhere: those of the other cores.
    machine: for at least half of the lateness the bare loop here was due and not woken either. other_core: the same of
    another core, on which twins, lines and recorder run. overrun: the tick before lasted past the deadline. waiting:
    late out of the wait for the deadline, in which the lines are served.
    """
    begin, end = late[:, 0] - late[:, 1] - PERIOD_S, late[:, 0]
    half = 0.5 * late[:, 1]
    left = np.ones(len(late), dtype=bool)
    found = {}
    kinds = {
        "machine": here.lost_s(begin, end) >= half,
        "other_core": np.any([loop.lost_s(begin, end) >= half for loop in elsewhere], axis=0),
        "overrun": late[:, 2] >= half,
        "waiting": np.ones(len(late), dtype=bool),
    }
    for name, which in kinds.items():
        of_kind = late[left & which, 1]
        missed = np.floor(of_kind / PERIOD_S).sum()
        found[name] = {"ticks": len(of_kind), "missed": int(missed), "worst_s": float(of_kind.max(initial=0.0))}
        left &= ~which
    return found


def _load(core: int) -> subprocess.Popen[bytes]:
    code = f"import os; os.sched_setaffinity(0, {{{core}}})\nwhile True: pass"
    return subprocess.Popen([sys.executable, "-c", code])


def _fly(
    mission: Path, folder: Path, seconds: float, fifo: bool, core: int, start_beside: Callable[[], None]
) -> tuple[dict[str, Any], np.ndarray]:
    from glider.firmware.runtime import Ending, Runtime
    from glider.hal import realtime
    from glider.hal.recorder.recorder import Recorder
    from glider.tools.flight import sortie
    from glider.tools.flight.compose import build_flight, build_recorder
    from glider.tools.flight.keeper import FlightSupervision

    flight = build_flight(mission=str(mission), board="twin")
    made: list[Recorder] = []
    said: list[str] = []
    samples, mode = Samples(seconds), ""
    figures: dict[str, Any] = {}

    class Enduring(FlightSupervision):
        def prepare(self) -> None:
            if fifo:  # before the twins start: they follow, ten below
                said.append(realtime.take_priority(PRIORITY))
            super().prepare()

    def make_recorder() -> Recorder:
        made.append(build_recorder(flight, folder / "log.mcap"))
        return made[0]

    def before_loop() -> None:
        said.extend([realtime.pin_to_core(core)] + ([realtime.lock_memory()] if fifo else []))

    def loop(runtime: Runtime) -> Ending:
        nonlocal figures, mode
        start_beside()
        _ticks(runtime, keeper, made[0], samples, seconds)
        realtime.unlock_memory()
        figures, mode = _figures(runtime, samples, seconds), flight.autopilot.mode
        flight.autopilot.give_up()
        return runtime.run()

    keeper = Enduring(flight, name="endurance", folder=folder / "state", twin=True)
    keeper.claim()
    report = sortie.fly(flight, keeper, make_recorder, loop=loop, before_loop=before_loop).report
    figures["pass"] = figures["pass"] and mode == "flying"
    records = {"written": report.written, "dropped": report.dropped, "complete": report.complete}
    described = {"real_time": said, "mode_at_the_end": mode, "records": records}
    return {**figures, **described}, samples.late[: min(samples.late_count, LATE_KEPT)]


class Samples:
    """What is looked at now and then, in memory that is there from the start: time (s), blocks, resident bytes,
    descriptors, the recording process's resident bytes."""

    def __init__(self, seconds: float):
        self.rows = np.zeros((int(seconds / SAMPLE_S) + 8, 5))
        self.count = 0
        self.late = np.zeros((LATE_KEPT, 3))  # as `reasons` takes them
        self.late_count = 0

    def note_late(self, woken: float, lateness: float, behind: float) -> None:
        """A tick that was late enough to ask why."""
        if self.late_count < LATE_KEPT:
            self.late[self.late_count] = woken, lateness, behind
        self.late_count += 1

    def take(self, t: float, recorder_pid: int) -> None:
        """One row; the interpreter's blocks first, so that the looking itself is not in them."""
        from glider.hal.usage import open_files, resident_bytes

        blocks = sys.getallocatedblocks()
        self.rows[self.count] = (t, blocks, resident_bytes(), open_files(), resident_bytes(recorder_pid))
        self.count += 1


def _ticks(runtime: Any, keeper: Any, recorder: Any, samples: Samples, seconds: float) -> None:
    """Tick for so long; once a second what a flight does then, and samples after the warm-up."""
    pid, values = recorder.pid, runtime.channel.values
    begin, next_second, next_sample = runtime.deadline, 0.0, min(WARM_UP_S, seconds / 4)
    now, since = runtime.board.clock.now, time.monotonic() - runtime.board.clock.now()
    with progress("minutes", max(1, round(seconds / 60.0))) as advance:
        minute = 60.0
        while (passed := runtime.deadline - begin) < seconds:
            deadline, behind = runtime.deadline, now() - runtime.deadline
            runtime.tick()
            lateness = values[REC_LATENESS]
            if lateness > LATE_S:
                samples.note_late(since + deadline + lateness, lateness, behind)
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
        "measured_from_s": float(first[0]),
        "pass": timing.missed == 0 and abs(blocks) < BLOCKS_A_TICK and grown < RSS_LIMIT_BYTES and last[3] <= first[3],
    }
