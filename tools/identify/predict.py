"""Runs flown by an identified model, window by window, as they are measured (docs/reference/gap.md, Measures)."""

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import RunGap, root_mean_square, run_gap
from glider.tools.inference.model import Model
from glider.tools.inference.predict import fly
from glider.tools.inference.problem import cut, problem_of
from glider.tools.inference.vehicle_parameters import Parameters


def predicted(
    case: Case, model: Model, run: Run, P: np.ndarray, F: np.ndarray, own_filter: bool = False
) -> tuple[RunGap, np.ndarray]:
    """The gap of one run under (P, F), and the prediction; own_filter as in `fly`."""
    problem = problem_of(case, model, [run])
    Y = fly(problem, P, F, own_filter)
    return run_gap(problem.kind.measures, run, Y, cut(problem).listed[0]), Y


def model_of(model: Model, free: Parameters, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P and F at values, without the sensors' constant errors of this case."""
    P, F, _ = free.place(model, values)
    F[ef.BIAS : ef.BIAS + ef.N_BIASES] = 0.0
    return P, F


def flown_gap(case: Case, model: Model, runs: list[Run], free: Parameters, values: np.ndarray) -> float:
    """Total gap of the runs under the model at `values`, in tolerances, by its own filter; infinite where it fails."""
    P, F = model_of(model, free, values)
    found = root_mean_square([predicted(case, model, run, P, F, own_filter=True)[0].total for run in runs])
    return found if np.isfinite(found) else float("inf")
