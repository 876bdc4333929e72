"""Velocity of an ocean glider through the water, row by row, with its standard deviation.

See docs/explanation/ocean.md, Velocity.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.vehicle import OceanVehicle
from glider.tools.data.errors import InputError
from glider.tools.data.files import write_bytes
from glider.tools.data.intervals import NINETY
from glider.tools.data.plain import as_plain
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run, run_name, write_run
from glider.tools.inference.model import Model, effect_vector
from glider.tools.inference.ocean_inputs import missing_input
from glider.tools.inference.problem import Problem, problem_of

# Of a row's speed, 1 sigma, and of one where speed was measured: laws of drag and lift are not nature's. Of a dive's
# mean nothing: by how much a law is off in all dives alike is in an identified vehicle's covariance
# (docs/explanation/ocean.md,
# Velocity).
FORM, MEASURED = 0.03, 0.005
PITCH_NOISE = 0.005  # rad, 1 sigma from row to row
HEADING = 0.035  # rad, 1 sigma of a compass that was looked after
MEANS = "velocity.json"
OUT_OF_MODEL = 0.15  # m/s, 1 sigma where the vehicle does not fly steadily
COLUMNS = (
    "u_m_s", "w_m_s", "vn_m_s", "ve_m_s", "water_w_m_s", "sd_u_m_s", "sd_w_m_s", "sd_vn_m_s", "sd_ve_m_s",
    "sd_water_w_m_s",
)  # fmt: skip


@dataclass
class Velocity:
    """Of one run, rows as recorded; m/s.

    u horizontal speed, w vertical velocity, vn and ve north and east, all of the vehicle through the water, down
    positive; water_w the vertical velocity of the water itself.
    """

    run: Run
    steady: np.ndarray  # (rows,) bool: where the model holds
    columns: dict[str, np.ndarray]  # (rows,) each, COLUMNS
    sd_mean_u: float  # m/s, 1 sigma of the mean of u over the steady rows


def velocities(case: Case, model: Model) -> list[Velocity]:
    """Every run's; InputError for another kind of vehicle, or where a run lacks what the model is driven by."""
    case.of(OceanVehicle)
    for run in case.runs:
        missing = missing_input(run)
        if missing is not None:
            raise InputError("an ocean glider's run needs it", source=run.path or run.name, column=missing)
    problem = problem_of(case, model)
    F = effect_vector(model)
    moved = [(model.P + direction, F) for direction in directions(model)]
    return [of_run(problem.part(n), (model.P, F), moved) for n in range(len(problem.runs))]


def of_run(
    part: Problem, model: tuple[np.ndarray, np.ndarray], moved: Iterable[tuple[np.ndarray, np.ndarray]]
) -> Velocity:
    """The velocity of a problem's only run by a model (P, F); `moved`: models 1 sigma off, each its own way."""
    P, F = model
    gains = part.filter(P, F)
    u, w = components(gains.X)
    unsteady = part.recording.inputs[:, at.U_UNSTEADY] > 0.0
    averaged = averaged_rows(~unsteady)
    form = MEASURED if part.seen[at.Y_SPEED] else FORM
    var_u, var_w, var_mean = np.square(form * u), np.square(form * w), 0.0
    for other in moved:
        moved_u, moved_w = components(part.filter(*other).X)
        var_u, var_w = var_u + (moved_u - u) ** 2, var_w + (moved_w - w) ** 2
        var_mean += float((moved_u - u)[averaged].mean()) ** 2
    path = gains.X[:, at.X_GLIDE]
    var_u = var_u + (gains.path[:, 0] * np.cos(path)) ** 2 + (w * PITCH_NOISE) ** 2
    var_w = var_w + (gains.path[:, 0] * np.sin(path)) ** 2 + (u * PITCH_NOISE) ** 2
    var_u[unsteady] += OUT_OF_MODEL**2
    var_w[unsteady] += OUT_OF_MODEL**2
    yaw = part.recording.inputs[:, at.U_YAW]
    along, across = var_u, (u * HEADING) ** 2
    water = gains.X[:, at.X_WATER]
    return Velocity(part.runs[0], ~unsteady, {
        "u_m_s": u, "w_m_s": w, "vn_m_s": u * np.cos(yaw), "ve_m_s": u * np.sin(yaw), "water_w_m_s": water,
        "sd_u_m_s": np.sqrt(var_u), "sd_w_m_s": np.sqrt(var_w),
        "sd_vn_m_s": np.sqrt(along * np.cos(yaw) ** 2 + across * np.sin(yaw) ** 2),
        "sd_ve_m_s": np.sqrt(along * np.sin(yaw) ** 2 + across * np.cos(yaw) ** 2),
        "sd_water_w_m_s": gains.path[:, 1],
    }, OUT_OF_MODEL if unsteady.all() else float(np.sqrt(var_mean)))  # fmt: skip


def components(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal speed and vertical velocity (down positive) of states (rows, N_X), m/s."""
    return X[:, at.X_SPEED] * np.cos(X[:, at.X_GLIDE]), -X[:, at.X_SPEED] * np.sin(X[:, at.X_GLIDE])


def directions(model: Model) -> list[np.ndarray]:
    """Independent directions of the vehicle's numbers, each of 1 sigma, (N_P,)."""
    spread = model.spread if model.sure is None else model.sure
    found = [] if spread is None else list(spread)
    sigma = model.sigma.copy()
    if spread is not None:
        sigma[np.abs(spread).max(axis=0) > 0.0] = 0.0
    return [*found, *(np.where(np.arange(len(sigma)) == n, sigma, 0.0) for n in np.flatnonzero(sigma > 0.0))]


def averaged_rows(steady: np.ndarray) -> np.ndarray:
    """The rows (bool) that a run's mean is of: those flown steadily, all where there is none."""
    return steady if steady.any() else np.ones_like(steady)


def mean_level(part: Problem, model: tuple[np.ndarray, np.ndarray]) -> float:
    """Mean horizontal speed of a problem's only run by a model (P, F) as mean_speed has it, m/s."""
    averaged = averaged_rows(part.recording.inputs[:, at.U_UNSTEADY] == 0.0)
    return float(components(part.filter(*model).X)[0][averaged].mean())


def mean_speed(found: Velocity, moves: Sequence[float] = (0.0,)) -> dict[str, Any]:
    """Mean horizontal speed `u_m_s` of the rows flown steadily with its 90 % interval `ci90`, and of the water
    `water_w_m_s`, rms, m/s; all rows where none is steady.

    Errors of the model are the same in all rows, but for their sign: a weight makes the way down faster and the way up
    slower, and is next to none of their mean. The interval is therefore not that of the rows.

    moves: by how much models that are as likely as each other move that mean, its own among them, m/s.
    """
    rows = averaged_rows(found.steady)
    means = float(found.columns["u_m_s"][rows].mean()) + np.array(moves, dtype=float)
    water = float(np.sqrt(np.mean(found.columns["water_w_m_s"][rows] ** 2)))
    return {"u_m_s": float(means.mean()), "ci90": interval_over(means, found.sd_mean_u), "water_w_m_s": water}


def interval_over(means: np.ndarray, sigma: float) -> list[float]:
    """The middle 90 % of normal distributions about means (n,), each as likely, of one standard deviation."""
    if np.ptp(means) == 0.0:
        return [float(means[0]) - NINETY * sigma, float(means[0]) + NINETY * sigma]
    from scipy.optimize import brentq
    from scipy.special import ndtr

    ends = float(means.min()) - 9.0 * sigma, float(means.max()) + 9.0 * sigma
    tails = ndtr(-NINETY), ndtr(NINETY)
    return [float(brentq(lambda x, tail=tail: float(ndtr((x - means) / sigma).mean()) - tail, *ends)) for tail in tails]


def write(found: list[Velocity], out: Path, heading: dict[str, Any] | None = None) -> list[Path]:
    """A CSV a run into a folder, runNNN.csv with t_s and COLUMNS, whose paths come back; MEANS: mean_speed by run.

    heading: what heading_test said of them, into MEANS too.
    """
    out.mkdir(parents=True, exist_ok=True)
    files, means = [], {}
    for one in found:
        name = one.run.name if one.run.path is None else run_name(one.run.path)
        files.append(out / f"{name}.csv")
        columns = {names.TIME: one.run.t, **one.columns}
        write_run(files[-1], replace(one.run, columns=columns, extra={}, path=None), decimals=dict.fromkeys(COLUMNS, 5))
        means[name] = mean_speed(one)
    answer = {"runs": means} if heading is None else {"runs": means, "heading": heading}
    write_bytes(out / MEANS, (json.dumps(as_plain(answer), indent=1) + "\n").encode())
    return files
