"""A mission of an ocean glider drawn: a vehicle about its shipped file, a sea, what its pilot asks of every dive."""

from dataclasses import dataclass, replace

import numpy as np

from glider.sim_backend.foreign import ocean as at
from glider.sim_backend.ocean.vehicle import OceanVehicle

CC = 1e-6  # m3
THRUSTER = 0.4  # of the depth of its dives, down to which a thruster helps, where there is one
WATER, WATER_TIME = (0.005, 0.02), (120.0, 600.0)  # m/s, s: of vertical water, drawn log-uniformly
DIVE_WATER = 0.15  # 1 sigma of its logarithm, from dive to dive
PITCH_VARIES, OIL_VARIES, DEPTH_VARIES = 0.02, 0.03, 0.05  # 1 sigma, from dive to dive: rad, shares
NEUTRAL = (0.35, 0.65)  # share of the depth at which the vehicle is trimmed
ZERO = 60.0 * CC  # 1 sigma of the engine's volume there
SPEED_NOISE, SPEED_BIAS = 0.015, 0.005  # m/s
DENSITY_ERROR = 0.03  # kg/m3, 1 sigma, of a cell that is looked after


@dataclass(frozen=True)
class VehicleClass:
    """What a make of ocean glider is flown like; ranges are drawn from uniformly."""

    amplitude: tuple[float, float]  # m3 either way of neutral
    pitch: tuple[float, float]  # rad
    depth: tuple[float, float]  # m
    pump: float  # m3/s at the surface
    valve: float
    droop: float  # share of the pump's rate lost a metre
    rows: tuple[float, float, float]  # s shallow, s deep, m
    pitch_time: float  # s
    roll: float  # rad, 1 sigma of its wander
    warm: tuple[float, float]  # degC of the mixed layer
    below: tuple[float, float]  # K colder under the thermocline
    cold: tuple[float, float]  # degC far down
    steps: tuple[float, float, float]  # m of depth, m3 of oil, rad of attitude: what is logged is rounded to
    depth_noise: float  # m


CRAFTS = {
    "slocum": VehicleClass(
        (180 * CC, 220 * CC), (0.38, 0.47), (110.0, 190.0), 10 * CC, 10 * CC, 0.0, (4.0, 4.0, 0.0), 12.0, 0.02,
        (16.0, 27.0), (3.0, 8.0), (8.0, 11.0), (0.001, 0.1 * CC, 0.0017), 0.03,
    ),
    "seaglider": VehicleClass(
        (170 * CC, 240 * CC), (0.32, 0.52), (600.0, 990.0), 2 * CC, 5 * CC, 4e-4, (10.0, 20.0, 250.0), 20.0, 0.06,
        (9.0, 14.0), (1.0, 4.0), (2.5, 4.5), (0.001, 0.1 * CC, 0.0009), 0.03,
    ),
    "seaexplorer": VehicleClass(
        (280 * CC, 450 * CC), (0.30, 0.42), (300.0, 690.0), 5 * CC, 10 * CC, 3e-4, (20.0, 20.0, 0.0), 15.0, 0.06,
        (11.0, 16.0), (1.5, 5.0), (4.0, 7.0), (0.1, 0.1 * CC, 0.0009), 0.03,
    ),
}  # fmt: skip


@dataclass
class MissionDesign:
    """Everything that its dives share, and each dive's own."""

    vehicle_class: VehicleClass
    V: np.ndarray  # (N_V,)
    dives: list[np.ndarray]  # (N_D,) each
    seas: list[np.ndarray]  # (N_S,) each
    speed_bias: float
    seed: int

    def calm(self, dive: int) -> np.ndarray:
        """The sea of a dive without its motion."""
        S = self.seas[dive].copy()
        S[at.WATER] = 0.0
        return S

    def changed(self, V: np.ndarray) -> "MissionDesign":
        """The same mission with another vehicle."""
        return replace(self, V=V)


def draw_mission(
    rng: np.random.Generator, vehicle_class: VehicleClass, vehicle: OceanVehicle, dives: int
) -> MissionDesign:
    """A mission of so many dives; the volume is such that the vehicle is neutral in these waters."""
    seas = draw_seas(rng, vehicle_class, dives)
    V = draw_vehicle(rng, vehicle_class, vehicle)
    depth, pitch = rng.uniform(*vehicle_class.depth), rng.uniform(*vehicle_class.pitch)
    amplitude, zero = rng.uniform(*vehicle_class.amplitude), ZERO * rng.standard_normal()
    level = depth * rng.uniform(*NEUTRAL)
    S = seas[0]
    V[at.VOLUME], V[at.THRUST_DEPTH] = vehicle.buoyancy.volume, THRUSTER * depth
    for _ in range(3):  # the strain goes with the volume: to rounding
        V[at.VOLUME] += at.net_weight(V, S, level, zero) / (V[at.GRAVITY] * at.potential_density(S, level))
    heading = rng.uniform(-np.pi, np.pi)
    asked = []
    for _ in range(dives):
        D = np.zeros(at.N_D)
        D[at.DEPTH] = depth * np.clip(1.0 + DEPTH_VARIES * rng.standard_normal(), 0.85, 1.05)
        D[at.PITCH_DOWN] = -(pitch + PITCH_VARIES * rng.standard_normal())
        D[at.PITCH_UP] = pitch + PITCH_VARIES * rng.standard_normal()
        D[at.PITCH_APOGEE] = -0.08
        D[at.OIL_DOWN] = zero - amplitude * (1.0 + OIL_VARIES * rng.standard_normal())
        D[at.OIL_UP] = zero + amplitude * (1.0 + OIL_VARIES * rng.standard_normal())
        D[at.OIL_SURFACE] = zero + 1.15 * amplitude
        heading += 0.3 * rng.standard_normal()
        D[at.HEADING] = heading
        asked.append(D)
    return MissionDesign(vehicle_class, V, asked, seas, SPEED_BIAS * rng.standard_normal(), int(rng.integers(0, 2**31)))


def draw_vehicle(rng: np.random.Generator, vehicle_class: VehicleClass, vehicle: OceanVehicle) -> np.ndarray:
    """V (N_V,) about the vehicle's file by what it allows; all but the volume."""
    V, unsure = np.zeros(at.N_V), vehicle.uncertainty
    weight, water = vehicle.buoyancy, vehicle.hydrodynamics

    def about(value: float, sigma: float) -> float:
        return value + sigma * float(np.clip(rng.standard_normal(), -2.0, 2.0))

    V[at.MASS] = weight.mass
    V[at.COMPRESSION] = about(weight.compressibility, unsure.compressibility)
    V[at.STIFFENING] = rng.uniform(0.0, 1e-8)
    V[at.EXPANSION] = max(about(weight.thermal_expansion, unsure.thermal_expansion), 0.0)
    V[at.AREA] = water.area
    V[at.DRAG] = water.Cd0 * np.exp(about(0.0, unsure.Cd0))
    V[at.INDUCED] = water.Cd1 * np.exp(about(0.0, max(unsure.Cd1, 0.1)))
    V[at.DRAG_POWER] = about(2.0 * water.drag_exponent, 0.05)
    V[at.LIFT] = water.lift_slope * np.exp(about(0.0, unsure.lift_slope))
    V[at.LIFT_BEND], V[at.SIDE] = rng.uniform(0.0, 3.0), rng.uniform(3.0, 5.0)
    V[at.CLIMB_DRAG] = 0.02 * rng.standard_normal()
    V[at.ADDED_AHEAD] = weight.mass * rng.uniform(0.04, 0.12)
    V[at.ADDED_SIDE], V[at.ADDED_DOWN] = weight.mass * rng.uniform(0.8, 1.1, 2)
    V[at.OIL_SCALE] = about(weight.oil_scale, unsure.oil_scale)
    V[at.GRAVITY] = rng.uniform(9.79, 9.82)
    V[at.PITCH_SCALE] = about(vehicle.attitude.pitch_scale, unsure.pitch_scale)
    V[at.PITCH_OFFSET] = about(vehicle.attitude.pitch_offset, unsure.pitch_offset)
    V[at.ROLL_TRIM] = about(0.0, 0.02)
    V[at.PITCH_TIME], V[at.PITCH_WANDER] = vehicle_class.pitch_time, np.radians(rng.uniform(0.2, 0.5))
    V[at.ROLL_WANDER], V[at.YAW_WANDER] = vehicle_class.roll * rng.uniform(0.5, 1.5), 0.08
    V[at.PUMP_RATE], V[at.VALVE_RATE], V[at.PUMP_DROOP] = vehicle_class.pump, vehicle_class.valve, vehicle_class.droop
    V[at.WATER_LAG], V[at.DENSITY_BIAS] = rng.uniform(2.0, 8.0), DENSITY_ERROR * rng.standard_normal()
    V[at.ROW_SHALLOW], V[at.ROW_DEEP], V[at.DEEP] = vehicle_class.rows
    return V


def draw_seas(rng: np.random.Generator, vehicle_class: VehicleClass, dives: int) -> list[np.ndarray]:
    """The sea of every dive, (N_S,) each: layers that move and warm from dive to dive."""
    S = np.zeros(at.N_S)
    S[at.MIXED_LAYER_TEMPERATURE], S[at.DEEP_TEMPERATURE] = (
        rng.uniform(*vehicle_class.warm),
        rng.uniform(*vehicle_class.cold),
    )
    S[at.THERMOCLINE_TEMPERATURE] = max(
        S[at.MIXED_LAYER_TEMPERATURE] - rng.uniform(*vehicle_class.below), S[at.DEEP_TEMPERATURE] + 0.3
    )
    S[at.THERMOCLINE], S[at.THICKNESS], S[at.DECAY] = rng.uniform(25.0, 70.0), rng.uniform(6.0, 25.0), 450.0
    S[at.SALT], S[at.SALT_STEP] = rng.uniform(34.6, 35.4), rng.uniform(-0.2, 0.4)
    S[at.FINE], S[at.FINE_LENGTH] = rng.uniform(0.02, 0.12), rng.uniform(4.0, 12.0)
    S[at.WATER], S[at.WATER_TIME] = np.exp(rng.uniform(*np.log(WATER))), np.exp(rng.uniform(*np.log(WATER_TIME)))
    middle, seas = S.copy(), []
    for _ in range(dives):
        S = S.copy()
        S[at.THERMOCLINE] += 0.2 * (middle[at.THERMOCLINE] - S[at.THERMOCLINE]) + 4.0 * rng.standard_normal()
        S[at.MIXED_LAYER_TEMPERATURE] += (
            0.1 * (middle[at.MIXED_LAYER_TEMPERATURE] - S[at.MIXED_LAYER_TEMPERATURE]) + 0.1 * rng.standard_normal()
        )
        S[at.THERMOCLINE_TEMPERATURE] += (
            0.2 * (middle[at.THERMOCLINE_TEMPERATURE] - S[at.THERMOCLINE_TEMPERATURE]) + 0.05 * rng.standard_normal()
        )
        S[at.FINE_PHASE] = rng.uniform(0.0, 2.0 * np.pi)
        S[at.WATER] = np.clip(middle[at.WATER] * np.exp(DIVE_WATER * rng.standard_normal()), *WATER)
        seas.append(S)
    return seas
