"""The tick of the real runtime on the simulated board: how long it takes, and that it allocates nothing.

One place for the measurement: the command prints it, the test holds it to its limits.
"""

import gc
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.core.jit import compiled_signatures
from glider.firmware.runtime import Runtime
from glider.tools.verify.benchmark.allocations import blocks_asked_for
from glider.tools.verify.benchmark.registry import Settings

WARM_UP = 2000
TICKS = 100_000
TRACED = 500
ROOM = 512  # records on their way to the disk, past which the measurement waits (simulated time is quicker)

ENDLESS = (
    """
format = 1
name = "endless"
time_limit_s = 86400.0
[site]
name = "deep water"
depth_m = 900.0
"""
    + 100
    * """
[[leg]]
depth_m = 30.0
pitch_deg = -15.0
roll_deg = 20.0
time_limit_s = 600.0
[[leg]]
depth_m = 3.0
pitch_deg = 15.0
time_limit_s = 600.0
"""
)


@dataclass
class TickFigures:
    """What 100,000 ticks cost."""

    ticks: int
    median_us: float
    p99_us: float
    allocated_blocks: int  # gained over all ticks
    collections: int
    compiled: int  # kernels compiled after arming
    peak_bytes: int  # largest trace of memory taken inside one tick
    largest_block_bytes: int  # asked for inside a tick
    blocks_by_size: dict[int, float]


class Harness:
    """A runtime on the simulated board with a real recorder, armed, and stepped tick by tick."""

    def __init__(self, runtime: Runtime, recorder):
        self.runtime, self.recorder = runtime, recorder

    def wait_for_room(self) -> None:
        while self.recorder.health().pending > ROOM:
            time.sleep(0.001)

    def run(self, ticks: int, each: int = 250) -> None:
        tick = self.runtime.tick
        for number in range(ticks):
            tick()
            if number % each == 0:
                self.wait_for_room()

    def time_ticks(self, ticks: int) -> np.ndarray:
        """Seconds that each tick took, the simulated plant's two steps in it, shape (ticks,)."""
        took = np.zeros(ticks)
        tick, clock = self.runtime.tick, time.perf_counter
        for number in range(ticks):
            if number % 250 == 0:
                self.wait_for_room()
            before = clock()
            tick()
            took[number] = clock() - before
        return took

    def peak_bytes(self, ticks: int = TRACED) -> int:
        """Largest growth of traced memory inside one tick, bytes; the simulated plant is moved before it."""
        tick, move_plant = self.runtime.tick, self.runtime.board.clock.sleep_until
        worst = 0
        tracemalloc.start()
        try:
            self.run(50)
            for _ in range(ticks):
                self.wait_for_room()
                move_plant(self.runtime.deadline)
                before = tracemalloc.get_traced_memory()[0]
                tracemalloc.reset_peak()
                tick()
                worst = max(worst, tracemalloc.get_traced_memory()[1] - before)
        finally:
            tracemalloc.stop()
        return worst


@contextmanager
def harness(mission: str = ENDLESS) -> Iterator[Harness]:
    """An armed runtime on the simulated board, recording to a temporary file."""
    from glider.hal.recorder.recorder import Recorder
    from glider.tools.flight.compose import build_flight, build_runtime, record_specs

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mission.toml")
        path.write_text(mission)
        flight = build_flight(mission=str(path))
        with Recorder(Path(folder, "tick.mcap"), record_specs(flight)) as recorder:
            flight.board.open()
            runtime = build_runtime(flight, recorder)
            runtime.arm()
            try:
                yield Harness(runtime, recorder)
            finally:
                runtime.disarm()


def _collections() -> int:
    return sum(generation["collections"] for generation in gc.get_stats())


def _blocks_gained(flown: Harness, ticks: int) -> int:
    blocks = sys.getallocatedblocks()
    flown.run(ticks)
    return sys.getallocatedblocks() - blocks


def measure_tick(ticks: int = TICKS) -> TickFigures:
    """Fly `ticks` ticks and count; the counting itself stands outside the ticks."""
    with harness() as flown:
        flown.run(WARM_UP)
        took = flown.time_ticks(min(ticks, 20_000))
        collections, compiled = _collections(), compiled_signatures()
        blocks = _blocks_gained(flown, ticks) - _blocks_gained(flown, 0)
        collections, compiled = _collections() - collections, compiled_signatures() - compiled
        peak = flown.peak_bytes()
        flown.wait_for_room()
        asked = blocks_asked_for(flown.runtime.tick)
    return TickFigures(
        ticks=ticks,
        median_us=1e6 * float(np.median(took)),
        p99_us=1e6 * float(np.percentile(took, 99)),
        allocated_blocks=blocks,
        collections=collections,
        compiled=compiled,
        peak_bytes=peak,
        largest_block_bytes=max(asked, default=0),
        blocks_by_size=asked,
    )


def measure(settings: Settings) -> dict[str, Any]:
    """TickFigures as JSON: median_us, p99_us, allocated_blocks, collections, compiled, peak_bytes, ..."""
    return asdict(measure_tick())
