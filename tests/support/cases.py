"""Small cases of the project's own making: a design flown by the plant with effects, seen with sensor noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.uncertainty import deviates
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case, load_case, write_case
from glider.tools.data.runs.run import Run
from glider.tools.inference.problem import Problem, problem_of

RATE = 10.0  # Hz
SECONDS = 45.0
COLUMNS = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES, *names.MOCAP_POSITION, *names.MOCAP_ATTITUDE)


def design(rng: np.random.Generator) -> np.ndarray:
    """Commands (rows, 3): two dives and climbs with turns, every value drawn."""
    t = np.arange(int(SECONDS * RATE)) / RATE
    turn = rng.uniform(15.0, 25.0)
    diving = t < turn
    ballast = np.where(diving, rng.uniform(0.08, 0.2), -rng.uniform(0.08, 0.2))
    slider = np.where(diving, rng.uniform(-0.01, 0.004), rng.uniform(-0.004, 0.01)) - 0.5 * 0.35 * ballast
    servo = np.where(t < rng.uniform(5.0, 30.0), rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6))
    return np.stack([servo, np.clip(slider, -0.055, 0.055), ballast], axis=1)


def _blank(rng: np.random.Generator, name: str, mocap: bool) -> Run:
    commands = design(rng)
    columns = {names.TIME: np.arange(len(commands)) / RATE}
    columns |= {column: commands[:, i] for i, column in enumerate(names.COMMANDS)}
    wanted = COLUMNS if mocap else COLUMNS[: ef.Y_ONBOARD]
    columns |= {column: np.zeros(len(commands)) for column in wanted}
    return Run(name, None, columns)


def make_case(
    folder: Path, F: np.ndarray, *, seed: int, runs: int = 3, mocap: bool = False, rough: float = 1.0, late=None,
    moved=None,
) -> Case:  # fmt: skip
    """A case in `folder` whose vehicle has the effects F (N_F), its parameters and biases drawn as allowed.

    rough: times the disturbance; late(t): by how many seconds motion capture's clock is late, with mocap; moved(t): by
    how many metres (rows, 3) water moves the vehicle.
    """
    rng = np.random.default_rng(seed)
    blank = [_blank(rng, f"run{n:02d}", mocap) for n in range(runs)]
    about = dict(vehicle="roughie", site="made", log_rate_hz=RATE, water_density_kg_m3=998.0, motion_capture=mocap)
    write_case(folder / "blank", blank, **about)
    problem = problem_of(load_case(folder / "blank"))
    problem.spectral[:6] *= rough**2
    Z = problem.simulated(*drawn(problem, F, rng), begins(problem, rng), rng)
    bounds = problem.recording.bounds
    if moved is not None:
        away = moved(problem.recording.t)
        Z[:, ef.Y_MOCAP_X : ef.Y_MOCAP_ROLL] += away
        Z[:, ef.Y_DEPTH] += away[:, 2]
    made = []
    for n, run in enumerate(blank):
        columns = dict(run.columns)
        for m, column in enumerate(COLUMNS):
            if column in columns:
                columns[column] = Z[bounds[n] : bounds[n + 1], m]
            if column in columns and late is not None and m >= ef.Y_ONBOARD:
                t = columns[names.TIME]
                columns[column] = np.interp(t - late(t), t, np.unwrap(columns[column]))
        made.append(replace(run, columns=columns))
    write_case(folder / "case", made, **about)
    return load_case(folder / "case")


def drawn(problem: Problem, F: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A vehicle as [uncertainty] and [sensors] allow, with effects F."""
    P = problem.model.P + problem.model.sigma * deviates(rng)
    s = problem.case.sensors
    bias = np.array([*3 * [s.attitude.bias], *3 * [s.gyro.bias], s.depth.bias, s.slider.bias, s.ballast.bias])
    F = F.copy()
    F[ef.BIAS : ef.BIAS + 9] += bias * rng.standard_normal(9)
    return P, F


def begins(problem: Problem, rng: np.random.Generator) -> np.ndarray:
    """Starts (runs, N_XF): under way, level, a metre or two down."""
    starts = np.zeros_like(problem.starts)
    starts[:, 2] = rng.uniform(1.0, 2.0, len(starts))
    starts[:, 3], starts[:, 7] = 1.0, 0.2
    return starts
