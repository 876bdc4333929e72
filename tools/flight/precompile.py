"""Kernels compiled ahead, at installation or before the first flight: no flight ever waits for a compiler.

A stamp in the cache of compiled kernels says that all of a flight are there. The cache's folder is named by a hash over
every kernel, so a changed kernel has no stamp. Processes that start at once wait for the first of them.
"""

import contextlib
import fcntl
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from numba import __version__ as numba_version
from numba.core import event

from firmware.core import jit

TICKS = 200
EFFECTS: dict[str, dict[str, float]] = {"drag": {"scale": 0.1}}  # any: one plant flies them all

Progress = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


class _Compiled(event.Listener):
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


def _stamp() -> Path | None:
    """The file that says that all kernels of a flight are in the cache; None without a compiler (GLIDER_JIT=0)."""
    return None if jit.CACHE_DIR is None else jit.CACHE_DIR / f"flight-numba-{numba_version}"


def ensure_compiled(say: Callable[[str], None], progress: Progress) -> None:
    """Compile what a flight needs unless it is there, with a word and a bar; once, however many ask at once."""
    stamp = _stamp()
    if stamp is None or stamp.exists():
        return
    with _alone(stamp.parent, lambda: say("another process is compiling the kernels: waiting for it")):
        if stamp.exists():
            return
        say("compiling the kernels, once for this version: about a minute")
        with progress("compiling", count_kernels()) as advance:
            done = compile_all(advance)
        say(f"compiled in {done['seconds']:.0f} s, kept in {done['folder']}")


@contextlib.contextmanager
def _alone(folder: Path, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold the folder's lock; `waiting` is called where somebody else has it. A process that ends lets go of it."""
    with open(folder / "compiling.lock", "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            waiting()
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def count_kernels() -> int:
    """How many kernels a flight on the simulated board knows: nearly all of them are called."""
    from tools.flight.compose import build_flight

    build_flight(mission="sawtooth", effects=EFFECTS)
    return jit.kernel_count()


def compile_all(advance: Callable[[int], None] = lambda n: None) -> dict[str, Any]:
    """Fly a moment with every controller on the simulated board, once with effects: `folder`, `kernels`, `seconds`.

    `advance(1)` is called for every kernel that had to be compiled.
    """
    from firmware.core.control.controllers import CONTROLLERS

    begin = time.monotonic()
    with event.install_listener("numba:compile", _Compiled(advance)):
        for controller in CONTROLLERS:
            _fly_a_moment(controller, {})
        _fly_a_moment("pid", EFFECTS)
    stamp = _stamp()
    if stamp is not None:
        stamp.touch()
    return {
        "folder": None if jit.CACHE_DIR is None else str(jit.CACHE_DIR),
        "kernels": jit.compiled_signatures(),
        "seconds": time.monotonic() - begin,
    }


def _fly_a_moment(controller: str, effects: dict[str, dict[str, float]]) -> None:
    """TICKS of a mission, recording nothing."""
    import msgspec

    from firmware.autopilot import Autopilot, configuration
    from firmware.model.gains import Control
    from hal.recorder.recorder import NullRecorder
    from tools.flight.compose import build_flight, build_runtime, record_specs

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
