"""Faults at a flight's end and around it: who acknowledges what, a disk that is slow, a watch that breaks off."""

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from glider.tools.verify.faults.cases import GroundOutcome, observed
from glider.tools.verify.faults.shown.processes import beating

CLOSING = """
import sys, time
from glider.hal import heartbeat as hb
from glider.hal.state_file import StateFile
pulse = hb.Heartbeat.create(sys.argv[1], 0.02, "faults")
pulse.publish(hb.SortieState.DIVING)
for _ in range(25):
    pulse.beat(0.0)
    time.sleep(0.02)
pulse.publish(hb.SortieState[sys.argv[2]])
time.sleep(3.0)
StateFile(sys.argv[1]).write(hb.SortieState.ENDED)
pulse.publish(hb.SortieState.ENDED)
"""
BREAKING = """
import sys
from pathlib import Path
from glider.hal.outofband import guard
folder, in_order = Path(sys.argv[1]), sys.argv[2] == "True"
steps = [0]
def step(self):
    steps[0] += 1
    self.feeder.feed(str(folder / "watchdog"))
    if steps[0] == 3:
        raise RuntimeError("a defect")
    return True
guard.GuardWatch.step = step
if in_order:
    close = guard.GuardWatch.close
    guard.GuardWatch.close = lambda self, in_order: close(self, in_order=True)
sys.argv[1:] = ["--run", str(folder), "--state", str(folder)]
guard.main()
"""


def slow_disk(disabled: bool, folder: Path) -> GroundOutcome:
    """A flight at the surface takes 3 s to bring its state to the disk, without a beat; `disabled`: it still says that
    it dives."""
    from glider.hal.outofband.guard import GuardWatch

    said = "DIVING" if disabled else "SURFACED"
    command = [sys.executable, "-c", CLOSING, str(folder), said]
    with subprocess.Popen(command) as flight:
        watch, taken = GuardWatch(folder, folder, service=False), False
        watch.start()
        begin = time.monotonic()
        while flight.poll() is None and not taken and time.monotonic() - begin < 20.0:
            watch.step()
            taken = watch._ascent is not None
            time.sleep(0.02)
        flight.kill()
        watch.close(in_order=True)
    return observed(not taken, "waited for", "taken for lost")


def watch_breaks_off(disabled: bool, folder: Path) -> GroundOutcome:
    """The out-of-band process ends by a defect: the hardware watchdog, a file here, is not stopped by the magic close.

    `disabled`: it closes as at an end in order.
    """
    (folder / "watchdog").write_bytes(b"")
    command = [sys.executable, "-c", BREAKING, str(folder), str(disabled)]
    broke = subprocess.run(command, stderr=subprocess.DEVNULL, check=False).returncode
    written = (folder / "watchdog").read_bytes()
    return observed(broke != 0 and bool(written) and b"V" not in written, "watchdog runs on", "watchdog stopped")


def acknowledged(ascending: bool) -> Callable[[bool, Path], GroundOutcome]:
    """An operator acknowledges while a flight, or an ascent out of band, is under way. `disabled`: nobody looks."""

    def show(disabled: bool, folder: Path) -> GroundOutcome:
        from glider.hal import heartbeat as hb
        from glider.hal.outofband.rise import AscentStage
        from glider.hal.sortie import Facts, SortieRefused, SortieState
        from glider.hal.state_file import StateFile
        from glider.tools.flight.keeper import acknowledge, watch_facts

        StateFile(folder).write(SortieState.ABORTED if ascending else SortieState.DIVING)
        with beating(folder) as flight:
            if ascending:
                flight.kill()
                flight.wait()
                words = hb.Heartbeat.open(folder).words
                words[hb.W_GUARD_STATUS], words[hb.W_GUARD_STAGE] = hb.Guard.ASCENDING, AscentStage.RISING
                words[hb.W_GUARD_NS] = time.monotonic_ns()
            with contextlib.suppress(SortieRefused):
                acknowledge(folder, Facts() if disabled else watch_facts(folder))
        return observed(not StateFile(folder).read().state.may_arm, "refused", "state set back")

    return show
