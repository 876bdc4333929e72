"""Many flights at once from one compiled call: flights a second on all cores, and against one."""

import time
from typing import Any

import numba
import numpy as np

from sim_backend.core.closed_loop import N_END, N_TRACE, fly_many
from tools.benchmark.registry import Settings
from tools.benchmark.timing import alternate, median
from tools.compose import build_flight

MISSION = "sawtooth"
FLIGHTS = 200
LONGEST = 50_000  # ticks


def fly_all(threads: int) -> tuple[float, int]:
    """Fly FLIGHTS seeds on a number of threads; flights a second, and ticks in all."""
    flights = [build_flight(mission=MISSION, seed=seed) for seed in range(FLIGHTS)]
    worlds, pilot = [flight.board.world for flight in flights], flights[0].autopilot
    stacked = {name: np.array([getattr(world, name) for world in worlds]) for name in ("P", "E", "errors", "seed", "x")}
    Cs, legs = (np.array([getattr(flight.autopilot, name) for flight in flights]) for name in ("C", "legs"))
    ticks = np.zeros(FLIGHTS, dtype=np.int64)
    before_threads = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        before = time.perf_counter()
        fly_many(
            stacked["P"], pilot.P, Cs, legs, pilot.nav, stacked["E"], worlds[0].waves, worlds[0].sensors,
            stacked["errors"], stacked["seed"], stacked["x"], worlds[0].dt, LONGEST, LONGEST,
            np.zeros((FLIGHTS, 1, N_TRACE)), np.zeros((FLIGHTS, N_END)), ticks,
        )  # fmt: skip
        return FLIGHTS / (time.perf_counter() - before), int(ticks.sum())
    finally:
        numba.set_num_threads(before_threads)


def measure(settings: Settings) -> dict[str, Any]:
    """flights_per_s on all cores, speedup against one core in the same run, cores, flights."""
    cores = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # made at run time
    fly_all(cores)
    alone, together = alternate(settings.repeats, lambda: fly_all(1), lambda: fly_all(cores))
    ratios = [many[0] / one[0] for one, many in zip(alone, together, strict=True)]
    return {
        "flights_per_s": median([rate for rate, _ in together]),
        "speedup": median(ratios),
        "cores": cores,
        "flights": FLIGHTS,
    }
