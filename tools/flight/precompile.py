"""Kernels compiled ahead, at installation or before they are first called: no flight ever waits for a compiler.

A stamp in the cache of compiled kernels says that all of one kind of work are there (FLIGHT;
tools/diagnose/precompile has another). The cache's folder is named by a hash over every kernel, so a changed kernel
has no stamp. Processes that start at once wait for the first of them.
"""

import contextlib
import fcntl
import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numba import __version__ as numba_version
from numba.core import event

from glider.firmware.core import jit

TICKS = 200
EFFECTS: dict[str, dict[str, float]] = {"drag": {"scale": 0.1}}  # any: one plant flies them all

Progress = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


class Compiled(event.Listener):
    """Calls `advance(1)` for every kernel that is compiled for the first time."""

    def __init__(self, advance: Callable[[int], None]):
        self._advance, self._seen = advance, set[int]()

    def on_start(self, event: event.Event) -> None:
        pass

    def on_end(self, event: event.Event) -> None:
        kernel = id(event.data["dispatcher"])
        if kernel not in self._seen:
            self._seen.add(kernel)
            self._advance(1)


@dataclass(frozen=True)
class Work:
    """What calls kernels, and has them compiled once."""

    name: str  # of its stamp
    count: Callable[[], int]  # how many kernels it knows: nearly all of them are called
    call: Callable[[], None]  # every kernel, as it will be called

    def stamp(self) -> Path | None:
        """The file that says that all of them are in the cache; None without a compiler (GLIDER_JIT=0).

        Numba's cache knows kernels by where their source stands: another checkout has a stamp of its own.
        """
        if jit.CACHE_DIR is None:
            return None
        place = hashlib.sha256(str(jit.PACKAGES_DIR).encode()).hexdigest()[:8]
        return jit.CACHE_DIR / f"{self.name}-{place}-numba-{numba_version}"

    def compile(self, advance: Callable[[int], None] = lambda n: None) -> dict[str, Any]:
        """Call every kernel: `folder`, `kernels`, `seconds`. `advance(1)` hears of each that had to be compiled."""
        begin = time.monotonic()
        with event.install_listener("numba:compile", Compiled(advance)):
            self.call()
        stamp = self.stamp()
        if stamp is not None:
            stamp.touch()
        return {
            "folder": None if jit.CACHE_DIR is None else str(jit.CACHE_DIR),
            "kernels": jit.compiled_signatures(),
            "seconds": time.monotonic() - begin,
        }


def ensure_compiled(work: Work, say: Callable[[str], None], progress: Progress) -> None:
    """Compile what some work calls unless it is there, with a word and a bar; once, however many ask at once."""
    stamp = work.stamp()
    if stamp is None or stamp.exists():
        return
    with _alone(work, stamp.parent, lambda: say("another process is compiling the kernels: waiting for it")):
        if stamp.exists():
            return
        say(f"compiling the kernels of a {work.name}, once for this version: up to 4 minutes")
        with progress("compiling", work.count()) as advance:
            done = work.compile(advance)
        say(f"compiled in {done['seconds']:.0f} s, kept in {done['folder']}")


@contextlib.contextmanager
def _alone(work: Work, folder: Path, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold the folder's lock; `waiting` is called where somebody else has it. A process that ends lets go of it."""
    with open(folder / f"compiling-{work.name}.lock", "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            waiting()
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _count() -> int:
    from glider.tools.flight.compose import build_flight

    build_flight(mission="sawtooth", effects=EFFECTS)
    return jit.kernel_count()


def _fly() -> None:
    """Fly a moment with every controller on the simulated board, once with effects."""
    from glider.firmware.core.control.controller_rows import CONTROLLERS

    for controller in CONTROLLERS:
        _fly_a_moment(controller, {})
    _fly_a_moment("pid", EFFECTS)


def _fly_a_moment(controller: str, effects: dict[str, dict[str, float]]) -> None:
    """TICKS of a mission, recording nothing."""
    import msgspec

    from glider.firmware.autopilot import Autopilot, configuration
    from glider.firmware.model.gains import Control
    from glider.hal.recorder.recorder import NullRecorder
    from glider.tools.flight.compose import build_flight, build_runtime, record_specs

    flight = build_flight(mission="sawtooth", effects=effects)
    control = msgspec.structs.replace(flight.vehicle.control or Control(), controller=controller)
    mission = msgspec.structs.replace(flight.mission, control=control)
    C = configuration(flight.vehicle, mission, dt=1.0 / flight.board.loop_hz, periods=flight.board.periods)
    flight.autopilot.C[:] = Autopilot(flight.vehicle, mission, C).C
    flight.board.open()
    runtime = build_runtime(flight, NullRecorder(record_specs(flight)))
    runtime.arm()
    try:
        for _ in range(TICKS):
            runtime.tick()
    finally:
        runtime.disarm()


FLIGHT = Work("flight", _count, _fly)
