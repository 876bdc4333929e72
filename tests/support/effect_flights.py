"""Flights for the tests of effects: a nominal vehicle in calm water under commands that work every actuator."""

import numpy as np

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.sim_backend.core.effects.effect_layout import N_XF
from glider.sim_backend.world import Environment, SampledSensors, Start, World, build_world
from glider.tools.data.sources import load_vehicle

VEHICLE = load_vehicle("roughie")
CALM = {"disturbance_linear": 0.0, "disturbance_angular": 0.0, "surface": False}
MOCAP = ("mocap_delay", "clock_skew")
FLOWN = tuple(label for label in catalogue() if label not in MOCAP)
TICK = 0.1  # s


def world(effects=None, seed=0, **environment) -> World:
    """A world without noise and bias, 8 m deep at 0.3 m/s; disturbance and surface only where asked for."""
    made = build_world(
        VEHICLE,
        Environment(**{**CALM, **environment}),
        SampledSensors(),
        Start(depth_m=8.0, surge_m_s=0.3),
        seed,
        effects,
    )
    made.errors[:] = 0.0
    return made


def at_spread(label: str) -> dict[str, float]:
    """An effect's parameters one spread from their defaults, or as far as their ranges go."""
    values = {}
    for p in catalogue()[label].parameters:
        values[p.name] = p.default + p.spread if p.default + p.spread <= p.high else p.default - p.spread
    return values


def manoeuvre(t: float) -> tuple[float, float, float]:
    """A dive and a climb, a turn to either side, the slider there and back: servo (rad), slider (m), ballast (kg)."""
    if t < 15.0:
        return 0.9 if t > 3.0 else 0.0, -0.02, 0.15
    return (-0.9 if t > 25.0 else 0.0), 0.02, -0.15


def flown(made: World, seconds: float = 40.0, command=manoeuvre) -> tuple[np.ndarray, np.ndarray]:
    """States (n, N_XF) and frames (n, FRAME_SIZE) every TICK, the commands set by time."""
    states, frames = [], []
    for k in range(round(seconds / TICK)):
        made.advance(k * TICK)
        made.cmd[:] = command(k * TICK)
        states.append(made.x.copy())
        frames.append(made.frame.copy())
    assert np.shape(states)[1] == N_XF
    return np.array(states), np.array(frames)


def quiet(effects=None, depth=8.0, pitch=0.0, **environment) -> World:
    """A world at rest."""
    made = world(effects, **environment)
    made.x[2], made.x[7] = depth, 0.0
    made.x[3:7] = quaternion_from_euler(0.0, pitch, 0.0)
    return made


def held(*command):
    """Commands that stay: servo (rad), slider (m), ballast (kg)."""
    return lambda t: command
