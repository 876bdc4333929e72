"""Many flights at once from one compiled call: flights a second on all cores, and against one."""

import time
from typing import Any

import numba

from sim_backend.fleet import fly_fleet
from tools.benchmark.registry import Settings
from tools.benchmark.timing import alternate, median
from tools.compose import build_flight

MISSION = "sawtooth"
FLIGHTS = 200
LONGEST = 600.0  # s


def fly_all(threads: int) -> float:
    """Fly FLIGHTS seeds on a number of threads; flights a second."""
    flights = [build_flight(mission=MISSION, seed=seed) for seed in range(FLIGHTS)]
    worlds, pilots = [flight.board.world for flight in flights], [flight.autopilot for flight in flights]
    before_threads = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        before = time.perf_counter()
        fly_fleet(worlds, pilots, max_seconds=LONGEST)
        return FLIGHTS / (time.perf_counter() - before)
    finally:
        numba.set_num_threads(before_threads)


def measure(settings: Settings) -> dict[str, Any]:
    """flights_per_s on all cores, speedup against one core in the same run, cores, flights."""
    cores = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # made at run time
    fly_all(cores)
    alone, together = alternate(settings.repeats, lambda: fly_all(1), lambda: fly_all(cores))
    return {
        "flights_per_s": median(together),
        "speedup": median([many / one for one, many in zip(alone, together, strict=True)]),
        "cores": cores,
        "flights": FLIGHTS,
    }
