"""The whole loop in simulation, compiled: plant, sensors, autopilot and limits, ticks a second on one core."""

import time
from typing import Any

import numpy as np

from sim_backend.core.closed_loop import N_END, N_TRACE, fly
from tools.benchmark.registry import Settings
from tools.benchmark.timing import median
from tools.compose import build_flight

MISSION = "sawtooth"
LONGEST = 50_000  # ticks


def one_flight(seed: int) -> tuple[int, float]:
    """Ticks of one flight and the seconds they took; two Runge-Kutta steps of 0.01 s a tick."""
    flight = build_flight(mission=MISSION, seed=seed)
    world, pilot = flight.board.world, flight.autopilot
    trace, end = np.zeros((1, N_TRACE)), np.zeros(N_END)
    before = time.perf_counter()
    ticks = fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.waves, world.sensors, world.errors, world.seed,
        world.x, world.dt, LONGEST, LONGEST, trace, end,
    )  # fmt: skip
    return ticks, time.perf_counter() - before


def measure(settings: Settings) -> dict[str, Any]:
    """ticks_per_s, the median over whole flights; plant_steps_per_tick; ticks of the last flight."""
    one_flight(0)
    flights = [one_flight(seed) for seed in range(4 * settings.repeats)]
    return {
        "ticks_per_s": median([ticks / seconds for ticks, seconds in flights]),
        "plant_steps_per_tick": 2,
        "ticks": flights[-1][0],
    }
