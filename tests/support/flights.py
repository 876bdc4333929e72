"""Made-up recordings: the nominal vehicle, or one drawn from its [uncertainty], flown with noise and disturbance.

The flight is the diagnosis' kernels' own (nothing here checks the equations); what is added is what a recording has:
sensors with bias and noise, a disturbance held 0.1 s, motion capture with dropouts. Everything follows from the seed.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler
from glider.firmware.core.maths.steps import RK4
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.core.step import propagate

STEP = 0.02  # s


@dataclass
class World:
    """What the simulated recordings share. Factors scale what the vehicle file says: 0 switches it off."""

    vehicle: Vehicle = field(default_factory=lambda: load_vehicle("roughie"))
    noise: float = 1.0
    bias: float = 1.0
    disturbance: float = 1.0
    uncertainty: float = 1.0
    rate_hz: float = 10.0
    seconds: float = 60.0
    mocap: bool = False
    commands: bool = True
    start_speed: float = 0.2  # m/s
    water: tuple[float, float] = (0.0, 0.0)  # m/s north, east
    changes: dict[int, float] = field(default_factory=dict)  # parameter -> what is added to it


@dataclass
class Flight:
    """A recording and the truth behind it: states (rows, N_XF) at the rows."""

    run: Run
    truth: np.ndarray


def manoeuvres(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Commands (rows, 3): dives and climbs in turn, the slider helping, the servo to one side for a while."""
    commands = np.zeros((len(t), 3))
    begin, sign = 0.0, 1.0
    while begin <= t[-1]:
        end = begin + rng.uniform(12.0, 25.0)
        rows = (t >= begin - 1e-9) & (t < end - 1e-9)
        ballast = sign * rng.uniform(0.1, 0.2)
        commands[rows] = rng.choice([0.0, 0.0, -0.6, 0.4, 1.0]), -0.1 * ballast + rng.uniform(-0.01, 0.01), ballast
        begin, sign = end, -sign
    return commands


def drawn_vehicle(world: World, rng: np.random.Generator) -> np.ndarray:
    """The true parameter vector: drawn from [uncertainty], then changed."""
    P = world.vehicle.vector()
    P += world.uncertainty * parameter_sigma(P, world.vehicle.uncertainty) * rng.standard_normal(len(P))
    for index, change in world.changes.items():
        P[index] += change
    return P


def sensor_biases(world: World, rng: np.random.Generator) -> np.ndarray:
    """One bias for each measurement, (N_Z,), constant over a case."""
    sensors = world.vehicle.sensors
    sigma = [*3 * [sensors.attitude.bias], *3 * [sensors.gyro.bias], sensors.depth.bias]
    sigma += [sensors.slider.bias, sensors.ballast.bias, *6 * [0.0]]
    return world.bias * np.array(sigma) * rng.standard_normal(kf.N_Z)


def fly(
    world: World, seed: int, *, P: np.ndarray | None = None, name: str = "run00",
    effects: dict[int, float] | None = None,
) -> Flight:  # fmt: skip
    """One recording; the true vehicle is drawn by the seed unless P gives it; effects: entries of F."""
    rng = np.random.default_rng(seed)
    if P is None:
        P = drawn_vehicle(world, rng)
    biases = sensor_biases(world, rng)
    sensors, disturbance = world.vehicle.sensors, world.vehicle.disturbance
    t = np.round(np.arange(0.0, world.seconds - 1e-9, 1.0 / world.rate_hz), 6)
    commands = manoeuvres(rng, t)
    x, F = np.zeros(ef.N_XF), np.zeros(ef.N_F)
    x[2] = rng.uniform(1.0, 3.0)
    x[3:7] = quaternion_from_euler(0.0, rng.uniform(-0.3, 0.0), rng.uniform(-3.0, 3.0))
    x[7] = world.start_speed
    F[ef.CURRENT_N], F[ef.CURRENT_E] = world.water
    for entry, value in (effects or {}).items():
        F[entry] = value
    truth, table = np.empty((len(t), ef.N_XF)), np.empty((len(t), len(ROUGHIE_MEASURES.columns)))
    zero, work, kept, acc = np.zeros(3), np.zeros((4, ef.N_XF)), np.empty(ef.N_XF), np.zeros(6)
    steps = max(1, round(1.0 / world.rate_hz / STEP))
    moments = np.array([0.0, 1.0 / world.rate_hz / steps])
    held, strength = -np.inf, world.disturbance * np.repeat([disturbance.linear, disturbance.angular], 3)
    for i, now in enumerate(t):
        inputs = np.array([commands[i], commands[i]])
        truth[i] = x
        table[i] = *euler_from_quaternion(*x[3:7]), *x[10:13], x[2], *x[14:16], *x[:2]
        for k in range(steps):
            moment = now + k / world.rate_hz / steps
            if moment - held >= 0.1 - 1e-6:
                held = moment
                acc[:] = strength * rng.standard_normal(6)
            propagate(P, F, x, kf.COMMANDED, moments, inputs, 1, 0, acc, zero, work, kept, RK4)
    sigma = [*3 * [sensors.attitude.noise], *3 * [sensors.gyro.noise], sensors.depth.noise]
    sigma += [sensors.slider.noise, sensors.ballast.noise]
    onboard = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES)
    columns = {names.TIME: t}
    if world.commands:
        columns |= dict(zip(names.COMMANDS, commands.T, strict=True))
    for i, column in enumerate(onboard):
        columns[column] = table[:, i] + biases[i] + world.noise * sigma[i] * rng.standard_normal(len(t))
    if world.mocap:
        pose = np.column_stack([truth[:, 0:3], table[:, 0:3]])
        seen = rng.random(len(t)) > 0.02
        for i, column in enumerate(names.MOCAP):
            sigma_i = (sensors.mocap_position if i < 3 else sensors.mocap_attitude).noise
            values = pose[:, i] + world.noise * sigma_i * rng.standard_normal(len(t))
            columns[column] = np.where(seen, values, np.nan)
    return Flight(Run(name=name, path=None, columns=columns), truth)


def case_of(world: World, runs: list[Run]) -> Case:
    """A case around runs, of the nominal vehicle, nowhere on disk."""
    return Case(
        folder=Path("made-up"),
        vehicle=world.vehicle,
        vehicle_name="roughie",
        site="nowhere",
        log_rate_hz=world.rate_hz,
        water_density_kg_m3=998.0,
        motion_capture=world.mocap,
        runs=runs,
        sensors=world.vehicle.sensors,
        disturbance=world.vehicle.disturbance,
    )


def fly_case(world: World, seed: int, runs: int = 3) -> tuple[Case, list[Flight]]:
    """A case of flights of one drawn vehicle."""
    P = drawn_vehicle(world, np.random.default_rng(seed))
    flights = [fly(world, 1000 * seed + n, P=P, name=f"run{n:02d}") for n in range(runs)]
    return case_of(world, [flight.run for flight in flights]), flights
