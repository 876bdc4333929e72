"""Noise of an ocean glider's mission, found with the model at hand: depth sensor, vertical water, roll, speed.

Vertical water is coloured; how long it remembers itself is found with how strong it is. Depth and roll are separate
in the likelihood, so they are searched one after the other (Nelder and Mead, over logarithms).
"""

from dataclasses import replace

import msgspec
import numpy as np
from scipy.optimize import minimize

from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.vehicle import OceanVehicle
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.inference.levels import as_said
from glider.tools.inference.problem import Problem

LEVEL_RUNS = 6  # of a mission: their noise is all dives'
WIDTH = 2.0  # e-folds, prior 1 sigma of each
STEP = 0.4  # e-folds, of the first simplex
TRIES = 90  # filters of a search
DEPTH = ("depth", "walk", "water", "water_time")
ROLL = ("roll_noise", "roll", "roll_time")
SPEED = ("speed_noise", "velocity_noise", "speed")
# Waves within the water move it for minutes (a buoyancy period is 5 to 20): what stays longer is an error of the model,
# and taken for water would hide it.
BOUNDS = {"water": (0.001, 0.02), "water_time": (60.0, 600.0), "roll_time": (10.0, 3600.0)}
READING = {"depth": "depth", "roll_noise": "roll", "speed_noise": "speed", "velocity_noise": "velocity"}


def some_runs(runs: list[Run]) -> list[Run]:
    """Those of a mission's runs from which its noise is found."""
    return [runs[k] for k in np.unique(np.linspace(0, len(runs) - 1, LEVEL_RUNS).astype(int))]


def with_levels(case: Case, logs: dict[str, float]) -> Case:
    """The case with levels e^log times its own."""
    vehicle = case.of(OceanVehicle)
    sensors, disturbance = vehicle.sensors, vehicle.disturbance
    for name, log in logs.items():
        factor = float(np.exp(log))
        if name in READING:
            old = getattr(sensors, READING[name])
            new = msgspec.structs.replace(old, noise=old.noise * factor)
            sensors = msgspec.structs.replace(sensors, **{READING[name]: new})
        else:
            value = getattr(disturbance, name) * factor
            if name in BOUNDS:
                value = float(np.clip(value, *BOUNDS[name]))
            disturbance = msgspec.structs.replace(disturbance, **{name: value})
    vehicle = msgspec.structs.replace(vehicle, sensors=sensors, disturbance=disturbance)
    return replace(case, vehicle=vehicle, sensors=sensors, disturbance=disturbance)


def find_levels(case: Case, problem: Problem, P: np.ndarray, F: np.ndarray) -> Case:
    """The case with the levels that its runs (those of the problem) ask for, the model (P, F) at hand."""
    seen = problem.seen
    groups: list[tuple[str, ...]] = [DEPTH]
    if seen[at.Y_ROLL]:
        groups.append(ROLL)
    if seen[at.Y_SPEED] or seen[at.Y_NORTH]:
        groups.append(tuple(n for n in SPEED if (n != "speed_noise" or seen[at.Y_SPEED])
                            and (n != "velocity_noise" or seen[at.Y_NORTH])))  # fmt: skip
    for names in groups:
        found = minimize(
            cost, np.zeros(len(names)), args=(case, problem, P, F, names), method="Nelder-Mead",
            options={"initial_simplex": STEP * np.vstack([np.zeros(len(names)), np.eye(len(names))]),
                     "maxfev": TRIES, "xatol": 0.02, "fatol": 0.5},
        )  # fmt: skip
        case = with_levels(case, dict(zip(names, found.x.tolist(), strict=True)))
    return case


def cost(logs: np.ndarray, case: Case, problem: Problem, P: np.ndarray, F: np.ndarray, names: tuple[str, ...]) -> float:
    """-2 log likelihood of levels, and their prior's."""
    levelled = with_levels(case, dict(zip(names, logs.tolist(), strict=True)))
    own = as_said(replace(problem, case=levelled))
    Pw = P.copy()
    Pw[at.WATER_TIME], Pw[at.ROLL_TIME] = levelled.disturbance.water_time, levelled.disturbance.roll_time
    value = float(own.filter(Pw, F).misfit.sum())
    return value + float(logs @ logs) / WIDTH**2 if np.isfinite(value) else 1e300
