"""The loop allocates nothing: over 100,000 ticks of the real runtime with the real recorder, and the proof can fail."""

import numpy as np
import pytest
from numba import njit
from numba.core.runtime import _nrt_python, rtsys

from glider.firmware.core.control import autopilot as core
from glider.firmware.core.control.telemetry import N_RECORD, fill_record
from glider.firmware.core.layouts import control_layout as ctl
from glider.tools.verify.benchmark.allocations import BOXED, blocks_asked_for
from glider.tools.verify.benchmark.tick import harness, measure_tick

pytestmark = pytest.mark.computes(seconds=20)

# Seven arrays go into the autopilot's kernel, and each costs a 48-byte handle while the call lasts: 336 bytes, and
# nothing else of size is alive then. See docs/reference/figures.md, Speed.
PEAK_LIMIT = 400


@pytest.fixture(scope="module")
def figures():
    return measure_tick()


def test_no_block_is_gained_over_100000_ticks(figures):
    assert figures.ticks == 100_000
    assert figures.allocated_blocks == 0


def test_no_collection_runs_and_nothing_compiles(figures):
    assert figures.collections == 0
    assert figures.compiled == 0


def test_memory_traced_inside_a_tick_is_a_few_boxed_numbers(figures):
    assert 0 < figures.peak_bytes <= PEAK_LIMIT


def test_no_array_list_or_tuple_is_made_inside_a_tick(figures):
    assert 0 < figures.largest_block_bytes <= BOXED


@pytest.mark.parametrize(
    "wasteful",
    [
        pytest.param(lambda: np.zeros(3), id="small array"),
        pytest.param(lambda: np.zeros(4)[1:], id="view"),
        pytest.param(lambda: list(range(20)), id="list"),
        pytest.param(lambda: f"leg {np.pi:.60f}", id="text"),
    ],
)
def test_an_object_made_and_freed_inside_the_tick_is_caught(wasteful, monkeypatch):
    """The proof can fail: whatever is made inside the autopilot's tick, however small and short-lived, is seen."""
    with harness() as flown:
        autopilot = flown.runtime.autopilot
        honest = autopilot.tick
        flown.run(200)
        assert max(blocks_asked_for(flown.runtime.tick, 200), default=0) <= BOXED

        def tick(t):
            wasteful()
            return honest(t)

        monkeypatch.setattr(autopilot, "tick", tick)
        flown.wait_for_room()
        assert max(blocks_asked_for(flown.runtime.tick, 200), default=0) > BOXED


def test_an_object_made_every_fiftieth_tick_is_caught(monkeypatch):
    with harness() as flown:
        autopilot, count = flown.runtime.autopilot, [0]
        honest = autopilot.tick

        def tick(t):
            count[0] += 1
            if count[0] % 50 == 0:
                np.zeros(3)
            return honest(t)

        monkeypatch.setattr(autopilot, "tick", tick)
        flown.run(200)
        assert max(blocks_asked_for(flown.runtime.tick, 200), default=0) > BOXED


@njit
def _many_ticks(n, P, C, legs, frame, est, ap, nav, G, cmd, out):
    for i in range(n):
        t = 0.02 * i
        core.tick(P, C, legs, frame, est, ap, nav, cmd, t)
        fill_record(frame, est, ap, G, cmd, t, 0.0, 0.0, out)


@njit
def _many_wasteful(n, cmd):
    for _ in range(n):
        cmd[0] = np.full(3, cmd[0]).sum()


def _allocations(function) -> int:
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats().alloc
    function()
    return rtsys.get_allocation_stats().alloc - before


LAW_FLIES = """
format = 1
name = "deep"
time_limit_s = 86400.0
[site]
name = "deep water"
depth_m = 900.0
[[leg]]
depth_m = 800.0
pitch_deg = -25.0
time_limit_s = 80000.0
[control]
controller = "{}"
"""


@pytest.mark.parametrize("controller", ["pid", "law", "law+", "hybrid"])
def test_the_compiled_tick_allocates_nothing(controller):
    """Numba's own counter: a thousand ticks inside one compiled call cost what one does (the call's own arguments)."""
    with harness(LAW_FLIES.format(controller)) as flown:
        flown.run(50)
        pilot = flown.runtime.autopilot
        law_at_work = pilot.ap[ctl.LAW_RAN] == 1.0 and np.isfinite(pilot.ap[ctl.MARGIN_DEPTH])
        assert law_at_work == (controller != "pid")
        arguments = (pilot.P, pilot.C, pilot.legs, pilot.frame, pilot.est, pilot.ap)
        arguments += (pilot.nav, flown.runtime.supervisor.G, pilot.commands, np.zeros(N_RECORD))
        _many_ticks(1, *arguments)
        assert _allocations(lambda: _many_ticks(1000, *arguments)) == _allocations(lambda: _many_ticks(1, *arguments))


def test_numbas_counter_sees_an_allocation():
    cmd = np.zeros(3)
    _many_wasteful(1, cmd)
    assert _allocations(lambda: _many_wasteful(1000, cmd)) > _allocations(lambda: _many_wasteful(1, cmd)) + 900
