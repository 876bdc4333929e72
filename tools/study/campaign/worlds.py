"""The worlds of a campaign: drawn from the seed and the mission's name alone, the same for every controller."""

import math
import zlib
from dataclasses import dataclass

import msgspec
import numpy as np

from glider.sim_backend.core.effects.catalogue import apply_effects
from glider.sim_backend.uncertainty import draw_parameters
from glider.sim_backend.world import Wave, World, build_world
from glider.tools.study.campaign.plan import CampaignPlan


@dataclass(frozen=True)
class DrawnWorld:
    """A world and what was drawn for it."""

    world: World
    current: float  # m/s
    wave_height: float  # m
    wave_period: float  # s
    disturbance: float  # m/s2
    start_depth: float  # m


def draw_world(plan: CampaignPlan, mission: int, seed: int) -> DrawnWorld:
    """The world of a seed in a mission (by its number).

    Everything is drawn whether or not it counts: a limit of zero does not move the draws behind it, so that campaigns
    that differ in one thing fly the same worlds otherwise.
    """
    campaign, the_mission = plan.campaign, plan.missions[mission]
    water = campaign.environment
    rng = np.random.default_rng([seed, zlib.crc32(the_mission.name.encode())])
    world_seed = int(rng.integers(2**63))
    current, towards = water.current_m_s * rng.random(), 2.0 * math.pi * rng.random()
    height, period = water.wave_height_m * rng.random(), rng.uniform(*water.wave_period_s)
    direction, phase = 360.0 * rng.random(), 360.0 * rng.random()
    depth, share = rng.uniform(*campaign.start.depth_m), rng.random()
    environment = msgspec.structs.replace(
        plan.board.environment,
        current_m_s=(current * math.cos(towards), current * math.sin(towards)),
        wave=[Wave(height_m=height, period_s=period, direction_deg=direction, phase_deg=phase)],
        floor_m=plan.board.environment.floor_m or the_mission.site.depth_m,
        salinity=plan.board.environment.salinity or the_mission.site.salinity,
    )
    if water.disturbance is None:
        own = environment.disturbance_linear
        disturbance = plan.vehicle.disturbance.linear if own is None else own
    else:
        low, high = water.disturbance
        disturbance = low + share * (high - low)
        environment = msgspec.structs.replace(
            environment, disturbance_linear=disturbance, disturbance_angular=disturbance
        )
    start = msgspec.structs.replace(plan.board.start, depth_m=depth)
    drawn = draw_parameters(plan.vehicle, rng, campaign.spread.parameters)
    world = build_world(plan.vehicle, environment, plan.board.sensors, start, world_seed)
    world.P[:] = drawn
    world.errors[0] *= campaign.spread.sensor_bias
    world.errors[1] *= campaign.spread.sensor_noise
    apply_effects(world, plan.board.effects)  # on top of the drawn vehicle
    return DrawnWorld(world, current, height, period, disturbance, depth)
