"""A simulated world: a vehicle that may differ from its file, an environment, sensors with noise, rate and delay."""

import copy
import math
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.layout import N_P, X_ACT, X_NU, X_POS, X_QUAT
from glider.firmware.core.vehicle.seawater import STANDARD_PRESSURE, water_density
from glider.firmware.model.vehicle import Vehicle
from glider.hal.ports import empty_frame
from glider.hal.strict import Table
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core import world as core
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import apply_effects
from glider.sim_backend.core.environment import wave_row
from glider.sim_backend.uncertainty import sensor_errors

PLANT_STEP = 0.01  # s
SpeedPair = tuple[float, float]


class Wave(Table):
    """One component of the sea: height crest to trough (m), period (s), the direction it runs to (deg from north)."""

    height_m: Annotated[float, msgspec.Meta(ge=0.0, le=20.0)]
    period_s: Annotated[float, msgspec.Meta(gt=0.5, le=60.0)]
    direction_deg: float = 0.0
    phase_deg: float = 0.0


class Environment(Table):
    """[environment] of a simulated board. The disturbance is the vehicle file's unless one is given."""

    current_m_s: SpeedPair = (0.0, 0.0)  # north, east, at the surface
    shear_1_s: SpeedPair = (0.0, 0.0)  # change with depth
    wave: list[Wave] = msgspec.field(default_factory=list)
    surface: bool = True
    floor_m: Annotated[float, msgspec.Meta(ge=0.0, le=12000.0)] = 0.0  # 0: none
    temperature_c: Annotated[float, msgspec.Meta(ge=-2.0, le=40.0)] = 20.0
    salinity: Annotated[float, msgspec.Meta(ge=0.0, le=42.0)] = 0.0
    disturbance_linear: Annotated[float, msgspec.Meta(ge=0.0)] | None = None
    disturbance_angular: Annotated[float, msgspec.Meta(ge=0.0)] | None = None


class SampledSensor(Table):
    """Rate (Hz) and delay (s) with which a sensor's samples arrive."""

    rate_hz: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
    delay_s: Annotated[float, msgspec.Meta(ge=0.0, le=0.5)] = 0.0


class SampledSensors(Table):
    """[sensors] of a simulated board."""

    imu: SampledSensor = SampledSensor(rate_hz=100.0, delay_s=0.01)
    beacon: SampledSensor = SampledSensor(rate_hz=25.0, delay_s=0.02)
    slider_wire: SampledSensor = SampledSensor(rate_hz=25.0, delay_s=0.02)
    plunger_wire: SampledSensor = SampledSensor(rate_hz=25.0, delay_s=0.02)
    biases: Annotated[int, msgspec.Meta(ge=0, le=2**31)] | None = None  # their seed; without one, the flight's own

    @property
    def periods(self) -> dict[str, float]:
        """Seconds between two samples, as glider.hal.ports.Board has them."""
        wires = min(self.slider_wire.rate_hz, self.plunger_wire.rate_hz)
        return {"imu": 1.0 / self.imu.rate_hz, "beacon": 1.0 / self.beacon.rate_hz, "wires": 1.0 / wires}


class Start(Table):
    """[start]: where the simulated vehicle begins. Depth m, angles deg, surge m/s."""

    depth_m: Annotated[float, msgspec.Meta(ge=0.0, le=10000.0)] = 0.3
    pitch_deg: Annotated[float, msgspec.Meta(ge=-80.0, le=80.0)] = 0.0
    heading_deg: float = 0.0
    surge_m_s: float = 0.0


def _wave_rows(waves: list[Wave]) -> np.ndarray:
    rows = np.zeros((len(waves), wl.N_WAVE))
    for row, wave in zip(rows, waves, strict=True):
        direction, phase = math.radians(wave.direction_deg), math.radians(wave.phase_deg)
        row[:] = wave_row(0.5 * wave.height_m, 2.0 * math.pi / wave.period_s, direction, phase)
    return rows


@dataclass
class World:
    """Arrays of one world; `advance` moves them. Everything random comes from `seed`, by counting.

    P (N_P,) and F (N_F,): the vehicle and what is wrong with it, to be set before the world moves.
    """

    P: np.ndarray
    E: np.ndarray
    waves: np.ndarray
    sensors: np.ndarray
    errors: np.ndarray
    seed: np.uint64
    x: np.ndarray
    dt: float = PLANT_STEP
    F: np.ndarray = field(default_factory=lambda: np.zeros(ef.N_F))
    cmd: np.ndarray = field(default_factory=lambda: np.zeros(3))
    acc: np.ndarray = field(default_factory=lambda: np.zeros(6))
    counters: np.ndarray = field(default_factory=lambda: np.zeros(wl.N_COUNTERS, dtype=np.int64))
    ring: np.ndarray = field(default_factory=lambda: np.zeros((wl.N_SAMPLED, wl.DELAY_SLOTS, wl.DELAY_WIDTH)))
    frame: np.ndarray = field(default_factory=empty_frame)
    effective: np.ndarray = field(default_factory=lambda: np.zeros(N_P))
    work: np.ndarray = field(default_factory=lambda: np.zeros((wl.N_WORK, wl.WORK_WIDTH)))

    def __post_init__(self):
        self.counters[wl.C_HOLD] = -1
        self.queue = np.zeros((math.ceil(wl.LONGEST_DELAY / self.dt) + 2, 3))  # commands of the past

    @property
    def time(self) -> float:
        return float(self.counters[wl.C_STEP]) * self.dt

    def truth(self) -> dict[str, float]:
        """Where the vehicle is and its actuators are, for people and tests."""
        names = ("x_m", "y_m", "z_m", "servo_rad", "slider_m", "ballast_kg")
        values = (*self.x[X_POS : X_POS + 3], *self.x[X_ACT : X_ACT + 3])
        return dict(zip(names, map(float, values), strict=True))

    def adrift(self, seconds: float) -> float:
        """Depth (m) so long from now with nobody at the controls, the actuators where they were sent last. This world
        itself stays where it is."""
        later = copy.deepcopy(self)
        later.advance(self.time + seconds)
        return float(later.x[X_POS + 2])

    def advance(self, t_end: float) -> float:
        """Move to t_end (s), under the commands in self.cmd; samples that have arrived are in self.frame."""
        return core.advance(
            self.P, self.F, self.E, self.waves, self.sensors, self.errors, self.seed, self.x, self.cmd, self.acc,
            self.counters, self.ring, self.queue, self.frame, self.effective, self.work, self.dt, t_end,
        )  # fmt: skip


def start_state(start: Start) -> np.ndarray:
    """State (N_XF,) of a vehicle at rest or gliding ahead, actuators neutral, plays centred, no reading behind."""
    x = np.zeros(ef.N_XF)
    x[X_POS + 2] = start.depth_m
    x[X_QUAT : X_QUAT + 4] = quaternion_from_euler(0.0, math.radians(start.pitch_deg), math.radians(start.heading_deg))
    x[X_NU] = start.surge_m_s
    x[X_ACT : X_ACT + 3] = 0.0
    return x


def build_world(
    vehicle: Vehicle,
    environment: Environment,
    sensors: SampledSensors,
    start: Start,
    seed: int,
    effects: dict[str, dict[str, float]] | None = None,
) -> World:
    """A world from its description; the same arguments give the same flight, bit for bit on one machine."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 1]))
    E = np.zeros(wl.N_ENV)
    E[wl.ENV_CURRENT_N], E[wl.ENV_CURRENT_E] = environment.current_m_s
    E[wl.ENV_SHEAR_N], E[wl.ENV_SHEAR_E] = environment.shear_1_s
    E[wl.ENV_SURFACE_HEIGHT] = wl.HULL_HEIGHT if environment.surface else 0.0
    E[wl.ENV_FLOOR_DEPTH] = environment.floor_m
    linear, angular = environment.disturbance_linear, environment.disturbance_angular
    E[wl.ENV_ACC_LINEAR] = vehicle.disturbance.linear if linear is None else linear
    E[wl.ENV_ACC_ANGULAR] = vehicle.disturbance.angular if angular is None else angular
    E[wl.ENV_TEMPERATURE_C], E[wl.ENV_SALINITY] = environment.temperature_c, environment.salinity
    E[wl.ENV_SURFACE_PRESSURE] = STANDARD_PRESSURE
    E[wl.ENV_WATER_DENSITY] = water_density(0.0, environment.temperature_c, environment.salinity)
    table = np.zeros((wl.N_SAMPLED, wl.N_SENSOR_FIELDS))
    for row, name in ((sup.SENSOR_IMU, "imu"), (sup.SENSOR_BEACON, "beacon"), (sup.SENSOR_SLIDER, "slider_wire"),
                      (sup.SENSOR_PLUNGER, "plunger_wire")):  # fmt: skip
        sensor = getattr(sensors, name)
        table[row] = 1.0 / sensor.rate_hz, sensor.delay_s
    errors = sensor_errors(vehicle, rng)
    if sensors.biases is not None:
        errors = sensor_errors(vehicle, np.random.default_rng(np.random.SeedSequence([sensors.biases, 2])))
    world = World(
        P=vehicle.vector(), E=E, waves=_wave_rows(environment.wave), sensors=table, errors=errors,
        seed=np.uint64(rng.integers(0, 2**63)), x=start_state(start),
    )  # fmt: skip
    apply_effects(world, effects or {})
    return world
