"""The whole loop in simulation, compiled: plant, sensors, autopilot and limits, ticks a second of one core's time.

Beside it what the autopilot alone takes of a tick: estimator, guidance, controller, limits; no plant, no recorder.
"""

import time
from typing import Any

import numpy as np

from firmware.core.control.controller_rows import CONTROLLERS
from firmware.core.layouts.control_layout import CONTROLLER
from sim_backend.board import world_of
from sim_backend.core.closed_loop import N_END, N_TRACE, fly
from tools.flight.compose import build_flight
from tools.measure.benchmark.registry import Settings
from tools.measure.benchmark.timing import median

MISSION = "sawtooth"
LONGEST = 50_000  # ticks


def one_flight(seed: int, controller: str = "pid") -> tuple[int, float]:
    """Ticks of one flight and the processor's seconds they took; two Runge-Kutta steps of 0.01 s a tick."""
    flight = build_flight(mission=MISSION, seed=seed)
    world, pilot = world_of(flight.board), flight.autopilot
    pilot.C[CONTROLLER] = CONTROLLERS[controller].number
    trace, end = np.zeros((1, N_TRACE)), np.zeros(N_END)
    before = time.thread_time()
    ticks = fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
        world.errors, world.seed, world.x, world.dt, LONGEST, LONGEST, trace, end,
    )  # fmt: skip
    return ticks, time.thread_time() - before


def autopilot_us(controller: str, ticks: int = 6000) -> tuple[float, float]:
    """Median and 99th percentile of the autopilot's own tick, us, the call from Python in it."""
    flight = build_flight(mission=MISSION)
    world, pilot, clock = world_of(flight.board), flight.autopilot, time.perf_counter
    pilot.C[CONTROLLER] = CONTROLLERS[controller].number
    took = np.zeros(ticks)
    for number in range(ticks):
        world.advance(0.02 * number)
        pilot.frame[...] = world.frame
        before = clock()
        pilot.tick(0.02 * number)
        took[number] = clock() - before
        world.cmd[...] = pilot.commands
    took *= 1e6
    return float(np.median(took[100:])), float(np.percentile(took[100:], 99))


def measure(settings: Settings) -> dict[str, Any]:
    """ticks_per_s by controller, medians over whole flights; what the autopilot takes of a tick."""
    result: dict[str, Any] = {"plant_steps_per_tick": 2}
    for controller in CONTROLLERS:
        name = "ticks_per_s" if controller == "pid" else f"ticks_per_s_{controller.replace('+', '_plus')}"
        one_flight(0, controller)
        flights = [one_flight(seed, controller) for seed in range(4 * settings.repeats)]
        result[name] = median([ticks / seconds for ticks, seconds in flights])
        result["ticks"] = flights[-1][0]
    result["autopilot_us"] = {
        name: dict(zip(("median", "p99"), autopilot_us(name), strict=True)) for name in CONTROLLERS
    }
    return result
