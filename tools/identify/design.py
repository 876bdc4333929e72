"""The paper's 45 gliding runs (section 4.1), flown by the project's plant and seen by draw-wires and motion capture.

Ballast at 1, 0.6 and 0.2 times its largest value, slider at 1, 0.5 and 0.1, servo at 1, 0.8, 0.6, 0.4 and 0.2, about
900 samples each, starting with a small forward speed. Beyond the paper: dives and climbs take turns, sides are drawn,
and half-way the servo turns over and the slider comes back by a quarter of its largest value: a flight held at one
setting says little about damping.
"""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.core.maths.rotations import quaternion_from_euler, wrap
from glider.firmware.core.vehicle import layout
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import COEFFICIENTS, SensorTable, Vehicle
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.open_loop import fly_open_loop_many
from glider.sim_backend.uncertainty import deviates
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import SensorsPart, write_case
from glider.tools.data.runs.run import Run
from glider.tools.inference.vehicle_parameters import coefficient_sizes

BALLAST, SLIDER, SERVO = (1.0, 0.6, 0.2), (1.0, 0.5, 0.1), (1.0, 0.8, 0.6, 0.4, 0.2)
RANGE_SHARES = (
    0.9,
    0.75,
    1.0,
)  # of the ranges of servo, slider and ballast: with all of the slider it would stand on end
BACK = 0.25  # of the largest slider position, by which it comes back half-way
RATE, ROWS, STEP = 50.0, 900, 0.01  # Hz, samples a run, s of the plant
SHALLOW, DEEP = 0.7, 5.3  # m
START_SPEED = 0.15  # m/s
COEFFICIENTS_OFF = 0.25  # of their size, evenly drawn, that a vehicle's coefficients are from its file's
CAPTURE = SensorsPart(
    mocap_position=SensorTable(noise=0.0005, bias=0.0), mocap_attitude=SensorTable(noise=0.0009, bias=0.0)
)
DECIMALS = {name: 4 for name in names.ALL} | {name: 5 for name in (*names.COMMANDS, *names.DRAW_WIRES)}
BLANKS = 0.002  # of the samples at which the capture loses the vehicle, for up to 0.2 s


@dataclass(frozen=True)
class DesignWorld:
    """What is flown: the true vehicle and how its capture sees it."""

    P: np.ndarray  # (N_P,)
    bias: np.ndarray  # (2,) of slider and ballast readings
    frame: np.ndarray  # (6,) turn (rad) and offset (m) of the capture's body
    delay: float  # s, capture behind the onboard clock

    def coefficients(self) -> dict[str, float]:
        return {name: float(self.P[getattr(layout, name.upper())]) for name in COEFFICIENTS}


def draw_world(vehicle: Vehicle, rng: np.random.Generator) -> DesignWorld:
    """A vehicle whose coefficients are off by up to COEFFICIENTS_OFF, the rest as [uncertainty] and [sensors] say."""
    P = vehicle.vector()
    sigma = parameter_sigma(P, vehicle.uncertainty)
    sizes = coefficient_sizes(P)
    P = P + sigma * deviates(rng)
    for name, size in zip(COEFFICIENTS, sizes, strict=True):
        entry = getattr(layout, name.upper())
        P[entry] = vehicle.vector()[entry] + COEFFICIENTS_OFF * size * rng.uniform(-1.0, 1.0)
    bias = np.array([vehicle.sensors.slider.bias, vehicle.sensors.ballast.bias]) * rng.standard_normal(2)
    frame = np.concatenate([0.005 * rng.standard_normal(3), 0.005 * rng.standard_normal(3)])
    return DesignWorld(P, bias, frame, float(rng.uniform(0.0, 0.02)))


def grid() -> list[tuple[float, float, float]]:
    """The 45 combinations (ballast, slider, servo), shares of the largest."""
    return list(itertools.product(BALLAST, SLIDER, SERVO))


def commands(vehicle: Vehicle, rng: np.random.Generator, picked: list[int], rows: int = ROWS) -> np.ndarray:
    """Commands (runs, rows, 3) of the picked combinations, by their numbers in the grid."""
    a = vehicle.actuators
    largest = [
        share * table.range[1] for share, table in zip(RANGE_SHARES, (a.servo, a.slider, a.ballast), strict=True)
    ]
    out = np.empty((len(picked), rows, 3))
    for n, number in enumerate(picked):
        ballast, slider, servo = grid()[number]
        dive = 1.0 if number % 2 == 0 else -1.0
        turn = servo * largest[0] * rng.choice([-1.0, 1.0])
        change = int(rows * rng.uniform(0.4, 0.6))
        out[n, :, 0], out[n, change:, 0] = turn, -turn * rng.choice([1.0, 0.3])
        out[n, :, 1] = -dive * slider * largest[1]
        out[n, change:, 1] += dive * BACK * largest[1]
        out[n, :, 2] = dive * ballast * largest[2]
    return out


def starts(rng: np.random.Generator, commanded: np.ndarray) -> np.ndarray:
    """States (runs, N_XF) at the beginning: level, slow, headed anywhere; dives from above, climbs from below."""
    x = np.zeros((len(commanded), ef.N_XF))
    x[:, layout.X_POS : layout.X_POS + 2] = rng.uniform(-3.0, 3.0, (len(x), 2))
    x[:, layout.X_POS + 2] = np.where(commanded[:, 0, 2] > 0.0, SHALLOW, DEEP)
    x[:, layout.X_QUAT : layout.X_QUAT + 4] = [quaternion_from_euler(0.0, 0.0, y) for y in rng.uniform(-3, 3, len(x))]
    x[:, layout.X_NU] = START_SPEED
    return x


def fly(vehicle: Vehicle, world: DesignWorld, rng: np.random.Generator, commanded: np.ndarray) -> np.ndarray:
    """True states (runs, rows, N_X) under commands, with the vehicle file's disturbance, far from surface and floor."""
    count = len(commanded)
    E = np.zeros((count, wl.N_ENV))
    E[:, wl.ENV_ACC_LINEAR], E[:, wl.ENV_ACC_ANGULAR] = vehicle.disturbance.linear, vehicle.disturbance.angular
    X = np.empty((*commanded.shape[:2], layout.N_X))
    seeds = rng.integers(0, 2**63, count, dtype=np.uint64)
    fly_open_loop_many(
        np.tile(world.P, (count, 1)), E, np.zeros((count, ef.N_F)), np.zeros((0, wl.N_WAVE)), seeds,
        starts(rng, commanded), commanded, STEP, round(1.0 / RATE / STEP), X,
    )  # fmt: skip
    return X


def captured(X: np.ndarray, world: DesignWorld, sensors: SensorsPart, rng: np.random.Generator) -> np.ndarray:
    """Poses (rows, 6) of states (rows, N_X): the capture's body, late, noisy, now and then lost."""
    from scipy.spatial.transform import Rotation

    t = np.arange(len(X)) / RATE
    attitude = Rotation.from_quat(np.roll(X[:, layout.X_QUAT : layout.X_NU], -1, axis=1))  # scalar last
    position = X[:, layout.X_POS : layout.X_QUAT] + attitude.apply(world.frame[3:])
    pose = np.column_stack([position, (attitude * Rotation.from_rotvec(world.frame[:3])).as_euler("ZYX")[:, ::-1]])
    pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
    pose = np.column_stack([np.interp(t - world.delay, t, column) for column in pose.T])
    assert sensors.mocap_position is not None
    assert sensors.mocap_attitude is not None
    pose[:, :3] += sensors.mocap_position.noise * rng.standard_normal((len(X), 3))
    pose[:, 3:] += sensors.mocap_attitude.noise * rng.standard_normal((len(X), 3))
    pose[:, 3:] = wrap(pose[:, 3:])
    for first in np.flatnonzero(rng.random(len(X)) < BLANKS):
        pose[first : first + int(rng.integers(1, round(0.2 * RATE)))] = np.nan
    return pose


def make_runs(
    vehicle: Vehicle, seed: int, picked: list[int] | None = None, square: bool = False
) -> tuple[list[Run], DesignWorld]:
    """Runs of a vehicle drawn with `seed` (all 45, or some by number), as recorded, and the truth.

    square: the capture's body sits on the vehicle's axes and its clock is the onboard one.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 45]))
    world = draw_world(vehicle, rng)
    if square:
        world = replace(world, frame=np.zeros(6), delay=0.0)
    commanded = commands(vehicle, rng, list(range(len(grid()))) if picked is None else picked)
    X = fly(vehicle, world, rng, commanded)
    runs = []
    for n in range(len(X)):
        columns = {names.TIME: np.arange(X.shape[1]) / RATE}
        columns |= dict(zip(names.COMMANDS, commanded[n].T, strict=True))
        noise = [vehicle.sensors.slider.noise, vehicle.sensors.ballast.noise]
        wires = X[n, :, layout.X_ACT + 1 : layout.X_ACT + 3] + world.bias
        wires = wires + noise * rng.standard_normal(wires.shape)
        columns |= dict(zip(names.DRAW_WIRES, wires.T, strict=True))
        columns |= dict(zip(names.MOCAP, captured(X[n], world, CAPTURE, rng).T, strict=True))
        runs.append(Run(f"run{n:02d}", None, columns))
    return runs, world


def write_design(
    folder: Path, vehicle_name: str, vehicle: Vehicle, seed: int, picked: list[int] | None = None
) -> DesignWorld:
    """The design as a case in `folder`; the truth is returned, not written."""
    runs, world = make_runs(vehicle, seed, picked)
    own = Path(vehicle_name)
    text = own.read_text(encoding="utf-8") if own.is_file() else None  # a file of the user's goes with the case
    write_case(
        folder, runs, vehicle=vehicle_name, vehicle_text=text, site="pool", log_rate_hz=RATE,
        water_density_kg_m3=998.0, motion_capture=True, sensors=CAPTURE, suffix=".csv.gz", decimals=DECIMALS,
    )  # fmt: skip
    return world


def truth(world: DesignWorld) -> dict[str, Any]:
    """The truth as JSON: coefficients, and how the capture sees the vehicle."""
    return {
        **world.coefficients(),
        "capture": {"turn_rad": world.frame[:3].tolist(), "offset_m": world.frame[3:].tolist(), "delay_s": world.delay},
    }
