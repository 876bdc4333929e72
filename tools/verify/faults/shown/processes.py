"""Faults of processes and clocks: a flight that is killed or hangs, a start after it, a wall clock that is set."""

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from glider.tools.verify.faults.cases import GroundOutcome, observed

BEATING = """
import sys, time
from glider.hal import heartbeat as hb
pulse = hb.Heartbeat.create(sys.argv[1], 0.02, "faults")
pulse.beat(0.0)
pulse.publish(hb.SortieState.DIVING)
print("flying", flush=True)
while True:
    pulse.beat(0.0)
    time.sleep(0.02)
"""


@contextlib.contextmanager
def beating(folder: Path) -> Iterator[subprocess.Popen]:
    """A process that beats as a flight under way."""
    flight = subprocess.Popen([sys.executable, "-c", BEATING, str(folder)], stdout=subprocess.PIPE)
    assert flight.stdout is not None
    flight.stdout.readline()
    try:
        yield flight
    finally:
        flight.kill()
        flight.wait()
        flight.stdout.close()


def loop_ends(how: signal.Signals) -> Callable[[bool, Path], GroundOutcome]:
    """A process that flies is killed, or hangs; the out-of-band process watches its heartbeat, in real time."""

    def show(disabled: bool, folder: Path) -> GroundOutcome:
        from glider.hal.outofband.guard import GuardWatch

        with beating(folder) as flight:
            watch = GuardWatch(folder, folder, service=False)
            watch.start()
            end = time.monotonic() + 0.5
            while time.monotonic() < end:
                watch.step()
                time.sleep(0.02)
            begin = time.monotonic()
            flight.send_signal(how)
            noticed = None
            while time.monotonic() - begin < 3.0 and noticed is None:
                if not disabled:
                    watch.step()
                noticed = time.monotonic() - begin if watch._ascent is not None else None
                time.sleep(0.02)
            watch.close(in_order=True)
        return observed(noticed is not None, "OOB", "none", after=noticed or 0.0)

    return show


def no_rise(disabled: bool, folder: Path) -> GroundOutcome:
    """On the way up out of band the vehicle stays at its depth; in simulated time, the depth read twice a second."""
    from glider.hal.outofband.guard import STEP_S
    from glider.hal.outofband.rise import AscentStage, Rise

    rise = Rise(patience_s=30.0, step_m=0.3, surface_m=0.4)
    seen: dict[AscentStage, float] = {}
    for i in range(200):
        seen.setdefault(rise.look(STEP_S * i, None if disabled else 10.0), STEP_S * i)
    both = AscentStage.AGAIN in seen and AscentStage.HARDWARE in seen
    return observed(both, "pump again, then HW", "none", after=seen.get(AscentStage.AGAIN, 0.0))


def restart(disabled: bool, folder: Path) -> GroundOutcome:
    """Killed in every state after arming: the next start only ascends."""
    from glider.hal.sortie import Facts, SortieState
    from glider.hal.state_file import StateFile
    from glider.tools.flight.sortie import Journal

    resumed = 0
    for state in (state for state in SortieState if state.must_ascend):
        StateFile(folder).write(state, flight="before")
        journal = Journal(folder, "after")
        journal.arm(Facts())
        ascends = journal.recovering and journal.state == SortieState.ASCENDING
        resumed += disabled or not ascends
    return observed(not resumed, "ascent only", "resumed")


@contextlib.contextmanager
def _wall_set_on(shift: float) -> Iterator[None]:
    """The wall clock as this process reads it, so many seconds on: the machine's own is not ours to set."""
    honest = time.time
    time.time = lambda: honest() + shift
    try:
        yield
    finally:
        time.time = honest


def wall_clock(disabled: bool, folder: Path) -> GroundOutcome:
    """The wall clock is set an hour on and back while the board's clock runs."""
    from glider.hal.clocks import MonotonicClock

    class WallClock(MonotonicClock):
        def __init__(self) -> None:
            self._start = time.time()

        def now(self) -> float:
            return time.time() - self._start

        def sleep_until(self, deadline: float) -> None:
            time.sleep(min(max(deadline - self.now(), 0.0), 0.05))

    clock = WallClock() if disabled else MonotonicClock()
    worst = 0.0
    for shift in (3600.0, -3600.0, 0.0):
        before = clock.now()
        with _wall_set_on(shift):
            begin = time.monotonic()
            clock.sleep_until(before + 0.01)
            worst = max(worst, abs(clock.now() - before - (time.monotonic() - begin)))
    return observed(worst < 0.5, "no effect", f"{worst:.0f} s")
