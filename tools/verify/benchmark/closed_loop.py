"""The whole loop in simulation, compiled: plant, sensors, autopilot and limits, ticks a second of one core's time.

One flight after the other, and the same flights side by side in lanes (closed_loop_lanes), in turns.
Beside it what the autopilot alone takes of a tick: estimator, guidance, controller, limits; no plant, no recorder.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from glider.firmware.autopilot import Autopilot
from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.core.layouts.control_layout import CONTROLLER
from glider.firmware.core.maths.wide import LANES
from glider.sim_backend.board import world_of
from glider.sim_backend.core.closed_loop import N_END, N_TRACE, fly
from glider.sim_backend.fleet import fly_group
from glider.sim_backend.world import World
from glider.tools.flight.compose import build_flight
from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.timing import median

MISSION = "sawtooth"
MAX_TICKS = 50_000  # ticks


Flight = tuple[World, Autopilot]


def made(seed: int, controller: str) -> Flight:
    """A world and what flies in it."""
    flight = build_flight(mission=MISSION, seed=seed)
    flight.autopilot.C[CONTROLLER] = CONTROLLERS[controller].number
    return world_of(flight.board), flight.autopilot


def one_by_one(flights: Sequence[Flight]) -> tuple[int, float]:
    """Ticks of flights one after the other and the processor's seconds they took; two Runge-Kutta steps a tick."""
    trace, end, ticks = np.zeros((1, N_TRACE)), np.zeros(N_END), 0
    states = [world.x.copy() for world, _ in flights]
    before = time.thread_time()
    for (world, pilot), x in zip(flights, states, strict=True):
        ticks += fly(
            world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
            world.errors, world.seed, x, world.dt, MAX_TICKS, MAX_TICKS, trace, end,
        )  # fmt: skip
    return ticks, time.thread_time() - before


def side_by_side(flights: Sequence[Flight]) -> tuple[int, float]:
    """The same of the same flights in lanes."""
    worlds, pilots = zip(*flights, strict=True)
    trace = np.zeros((len(flights), 1, N_TRACE))
    before = time.thread_time()
    _, ticks = fly_group(worlds, pilots, MAX_TICKS, MAX_TICKS, trace)
    return int(ticks.sum()), time.thread_time() - before


def speeds(controller: str, repeats: int) -> dict[str, Any]:
    """Ticks a second of a core's time one by one and side by side, in turns, and the ratio: medians."""
    first = [made(seed, controller) for seed in range(LANES)]
    one_by_one(first[:1]), side_by_side(first)  # compiles, or reads what is compiled
    alone: list[float] = []
    together: list[float] = []
    for number in range(repeats):
        flights = [made(LANES * number + lane, controller) for lane in range(LANES)]
        for speed, (ticks, seconds) in ((alone, one_by_one(flights)), (together, side_by_side(flights))):
            speed.append(ticks / seconds)
    return {
        "ticks_per_s": median(alone),
        "batch_ticks_per_s": median(together),
        "batch_ratio": median([many / one for one, many in zip(alone, together, strict=True)]),
    }


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
    """ticks_per_s by controller, medians over whole flights, one by one and (`batch_`) LANES side by side; what the
    autopilot takes of a tick."""
    result: dict[str, Any] = {"plant_steps_per_tick": 2, "lanes": LANES}
    for controller in CONTROLLERS:
        name = "" if controller == "pid" else f"_{controller.replace('+', '_plus')}"
        found = speeds(controller, settings.repeats)
        result.update({f"{figure}{name}": value for figure, value in found.items()})
    result["autopilot_us"] = {
        name: dict(zip(("median", "p99"), autopilot_us(name), strict=True)) for name in CONTROLLERS
    }
    return result
