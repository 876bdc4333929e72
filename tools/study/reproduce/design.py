"""The paper's simulations (section 4.2) as fleets: targets, controllers, noise strengths, seeds.

Every flight starts 30 m deep in still water at rest and lasts 60 s. The plant is drawn from [uncertainty]; the noise is
the paper's: white acceleration held 0.1 s (10 Hz) on all six axes, the same number in m/s2 and rad/s2.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.guidance.mission import Leg, Mission, Site
from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.fleet import FleetResult, fly_fleet
from glider.sim_backend.uncertainty import draw_parameters
from glider.sim_backend.world import Environment, SampledSensors, Start, World, build_world

SECONDS = 60.0
START_DEPTH = 30.0
STEP = 0.02  # s
TRACE_EVERY = 1.0  # s
LAST = 5  # lines of the trace over which the final error is taken: 5 s
PERIODS = {"imu": 0.02, "beacon": 0.04, "wires": 0.04}

PITCH_TARGETS = (10.0, -10.0, 30.0, -30.0, 45.0, -45.0)  # deg
PITCH_BALLAST = 0.15  # kg held: heavy where the nose goes down, light where it goes up
DEPTH_TARGETS = (0.0, 2.0, -2.0, 4.0, -4.0, 5.0, -5.0)  # m, down positive; an ascent is a negative one
DEPTH_PITCH = 25.0  # deg, nose towards the target; level where the depth is held


@dataclass(frozen=True)
class Variant:
    """A controller as it is flown: its name in the results, and its [control] table."""

    name: str
    control: Control


@dataclass
class Batch:
    """Flights of one design: what each was (keys), and its outcome."""

    keys: list[dict[str, Any]] = field(default_factory=list)
    result: FleetResult | None = None


def pitch_leg(target_deg: float) -> Leg:
    """Fig. 5: a pitch target for the whole flight, ballast held by the stated schedule."""
    return Leg(pitch_deg=target_deg, duration_s=SECONDS, ballast_kg=-math.copysign(PITCH_BALLAST, target_deg))


def depth_leg(change: float) -> Leg:
    """Fig. 6: a depth target, the depth loop commanding the ballast, the pitch towards it."""
    pitch = 0.0 if change == 0.0 else -math.copysign(DEPTH_PITCH, change)
    return Leg(pitch_deg=pitch, depth_m=START_DEPTH + change, time_limit_s=10 * SECONDS, hold_s=10 * SECONDS)


def mission_of(name: str, leg: Leg) -> Mission:
    """A mission of one leg in deep water."""
    return Mission(format=1, name=name, time_limit_s=3600.0, site=Site(name="deep water", depth_m=500.0), leg=[leg])


def given(control: Control, state: str) -> Control:
    """The same controller on estimated states, or on the plant's own (`true`)."""
    return control if state == "estimated" else msgspec.structs.replace(control, estimator="given")


def drawn_world(vehicle: Vehicle, strength: float, seed: int, depth: float = START_DEPTH) -> World:
    """A world with the noise's strength and a vehicle drawn from [uncertainty], the same for the same seed."""
    environment = Environment(surface=False, disturbance_linear=strength, disturbance_angular=strength)
    world = build_world(vehicle, environment, SampledSensors(), Start(depth_m=depth), seed)
    world.P[:] = draw_parameters(vehicle, np.random.default_rng([seed, 2]))
    return world


def fly_design(
    vehicle: Vehicle,
    legs: dict[float, Leg],
    variants: list[Variant],
    strengths: list[float],
    seeds: range,
    states: tuple[str, ...] = ("estimated",),
    trace_every: float = TRACE_EVERY,
) -> Batch:
    """Fly every target with every controller at every strength and seed, all in one fleet.

    A seed draws the same vehicle, sensors and noise for all controllers: they are compared in pairs.
    """
    batch, worlds, pilots = Batch(), [], []
    for state in states:
        for variant in variants:
            flown = msgspec.structs.replace(vehicle, control=given(variant.control, state))
            for target, leg in legs.items():
                mission = mission_of(variant.name, leg)
                C = configuration(flown, mission, dt=STEP, periods=PERIODS)
                for strength in strengths:
                    for seed in seeds:
                        worlds.append(drawn_world(vehicle, strength, seed))
                        pilots.append(Autopilot(vehicle, mission, C))
                        key = {"controller": variant.name, "target": target, "noise": strength, "seed": seed}
                        batch.keys.append({**key, "state": state})
    batch.result = fly_fleet(worlds, pilots, max_seconds=SECONDS, trace_every=trace_every)
    return batch
