"""Figure 7: a full circle out of two dives and two climbs, then an S; flown by the hybrid from estimated states."""

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.fleet import FleetResult, fly_fleet
from glider.tools.data.sources import load_mission
from glider.tools.study.reproduce.design import PERIODS, STEP, drawn_world

MISSION = "circle_to_s"
CIRCLE_LEGS = range(1, 5)  # the first leg gets the glide going
HULL = 1.2  # m
START = 1.0  # m deep
MAX_FLIGHT_S = 400.0  # s
TRACE_EVERY = 0.2  # s
STRENGTHS = (0.0, 0.003, 0.03, 0.1)


@dataclass
class Circles:
    """Flights of the manoeuvre: strength and seed of each, and their outcomes."""

    strengths: np.ndarray
    seeds: np.ndarray
    result: FleetResult


def fly_circles(vehicle: Vehicle, controller: str, strengths: tuple[float, ...], seeds: int) -> Circles:
    """Fly the manoeuvre at every strength with every seed."""
    _, source, mission = load_mission(MISSION)
    control = msgspec.structs.replace(vehicle.control or Control(), controller=controller)
    C = configuration(msgspec.structs.replace(vehicle, control=control), mission, dt=STEP, periods=PERIODS)
    pairs = [(strength, seed) for strength in strengths for seed in range(seeds)]
    worlds = [drawn_world(vehicle, strength, seed, START) for strength, seed in pairs]
    pilots = [Autopilot(vehicle, mission, C, source) for _ in pairs]
    result = fly_fleet(worlds, pilots, max_seconds=MAX_FLIGHT_S, trace_every=TRACE_EVERY)
    return Circles(np.array([s for s, _ in pairs]), np.array([n for _, n in pairs]), result)


def closure(result: FleetResult, flight: int) -> float:
    """Horizontal distance (m) between the circle's first point and its last; NaN where it was not finished."""
    leg = result.column("leg")[flight]
    rows = np.flatnonzero((leg >= CIRCLE_LEGS.start) & (leg < CIRCLE_LEGS.stop))
    if not rows.size or not (leg >= CIRCLE_LEGS.stop).any():
        return float("nan")
    end = rows[-1] + 1  # the first point of the S closes the circle
    x, y = result.column("true_x")[flight], result.column("true_y")[flight]
    return float(np.hypot(x[end] - x[rows[0]], y[end] - y[rows[0]]))


def turned_one_way(result: FleetResult, flight: int) -> bool:
    """True where every leg of the circle turned to the same side."""
    leg, yaw = result.column("leg")[flight], result.column("true_yaw")[flight]
    turns = []
    for n in CIRCLE_LEGS:
        rows = np.flatnonzero(leg == n)
        if rows.size < 2:
            return False
        turns.append(np.sum(np.angle(np.exp(1j * np.diff(yaw[rows])))))
    return bool(np.all(np.sign(turns) == np.sign(turns[0])))


def summary(circles: Circles, controller: str) -> list[dict[str, Any]]:
    """One entry a strength: completed, closure of the circle, and whether it turned one way throughout."""
    rows = []
    for strength in np.unique(circles.strengths):
        flights = np.flatnonzero(circles.strengths == strength).tolist()
        gaps = np.array([closure(circles.result, i) for i in flights])
        finished = gaps[np.isfinite(gaps)]
        rows.append(
            {
                "target": 360.0,
                "controller": controller,
                "noise": float(strength),
                "state": "estimated",
                "completed": float(circles.result.completed[flights].mean()),
                "closure_m": float(np.median(finished)) if finished.size else None,
                "closure_p90_m": float(np.percentile(finished, 90)) if finished.size else None,
                "one_way": float(np.mean([turned_one_way(circles.result, i) for i in flights])),
                "within_hull_length": float(np.mean(gaps <= HULL)),
                "seeds": len(flights),
            }
        )
    return rows
