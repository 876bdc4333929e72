"""Kernels compiled ahead, at installation: no start of a flight waits for a compiler, and no flight ever does."""

import time
from typing import Any

TICKS = 200


def compile_all() -> dict[str, Any]:
    """Fly a moment with every controller on the simulated board: `folder`, `kernels` compiled, `seconds` it took."""
    import msgspec

    from firmware.autopilot import Autopilot, configuration
    from firmware.control.gains import Control
    from firmware.core.control.controllers import CONTROLLERS
    from firmware.core.jit import CACHE_DIR, compiled_signatures
    from hal.recorder.recorder import NullRecorder
    from tools.flight.compose import build_flight, build_runtime, record_specs

    begin = time.monotonic()
    for controller in CONTROLLERS:
        flight = build_flight(mission="sawtooth")
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
    return {
        "folder": None if CACHE_DIR is None else str(CACHE_DIR),
        "kernels": compiled_signatures(),
        "seconds": time.monotonic() - begin,
    }
