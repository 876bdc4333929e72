"""The most probable parameters of a case's flights, the noise's levels, and the runs that do not belong."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.gap.model import Model
from tools.gap.problem import Problem, pose
from tools.identify import levels as noise
from tools.identify.flights import Flights, Linear
from tools.identify.parameters import Parameters, parameters
from tools.identify.screen import LeftOut
from tools.identify.statistics import Quadratic, collect, heat
from tools.runs.case import Case
from tools.runs.run import Run

ROUGHNESS = (100.0, 10.0, 3.0, 1.0)  # the filter is told of so many times the disturbance, one step at each
FROM_START = (10.0, 1.0)  # where the accelerations have given first values
LOOK = 10.0  # of them, the one at which runs that do not belong are looked for
FIRST_ROWS, LEVEL_ROWS, MOST_ROWS = 9_000, 5_000, 90_000
ODD = 3.0  # times the runs' median of squared innovations, beyond which a run does not belong
BLOCK = 3.0  # s, stretches of runs whose slopes are compared for the heat
FAR = 8.0  # posterior sigma; a first fit to some of the runs that is farther off is followed by another step


@dataclass
class Fit:
    """What the sampler and the report need."""

    problem: Problem  # of the runs kept, noise at its levels
    free: Parameters
    at: Linear
    quadratic: Quadratic
    levels: noise.Levels
    left_out: list[LeftOut]
    notes: list[str]


def some(runs: list[Run], rows: int, seed: int = 1) -> list[int]:
    """Numbers of runs, chosen evenly at random, that come to about `rows` rows; at least 4, or all."""
    order, total = np.random.default_rng(seed).permutation(len(runs)), 0
    chosen: list[int] = []
    for n in order:
        if total >= rows and len(chosen) >= 4:
            break
        chosen.append(int(n))
        total += runs[n].rows
    return sorted(chosen)


def squared_by_run(problem: Problem, e: np.ndarray) -> np.ndarray:
    """Mean squared innovation of each run, (runs,)."""
    of = np.broadcast_to(problem.run_of[:, None], problem.z.shape)[problem.valid]
    return np.bincount(of, e * e, len(problem.runs)) / np.maximum(np.bincount(of, minlength=len(problem.runs)), 1)


def odd_runs(problem: Problem, e: np.ndarray) -> list[LeftOut]:
    """Runs whose innovations are far larger than the others', and the reading in which most."""
    squares = squared_by_run(problem, e)
    usual = float(np.median(squares))
    found = []
    for n in np.flatnonzero(squares > ODD * max(usual, 1.0)):
        run = problem.runs[n]
        reason = f"misses every model that fits the others: squared innovations {squares[n] / usual:.3g} times theirs"
        found.append(LeftOut(run.name, run.path, "", reason))
    return found


def settle(
    case: Case, model: Model, runs: list[Run], values: np.ndarray | None = None
) -> tuple[Flights, np.ndarray, list]:
    """First values from some runs, the filter told to doubt the model less and less; runs that do not belong."""
    problem = pose(case, model, runs)
    flights = Flights(problem, parameters(problem))
    stages = ROUGHNESS if values is None else FROM_START
    begin = np.zeros(len(flights.free.free))
    if values is not None:
        begin[: len(values)] = values
    at, values, out = None, begin, []
    for roughness in stages:
        at = flights.linear(values, roughness)
        values = flights.step(at)
        if roughness != LOOK or len(runs) < 4:
            continue
        out = odd_runs(problem, flights.follow([values], at.gains)[0])
        if out and len(out) <= len(runs) // 2:
            gone = {one.run for one in out}
            kept = [run for run in runs if run.name not in gone]
            again, values, more = settle(case, model, kept, None)
            return again, values, out + more
    return flights, values, out if len(out) <= len(runs) // 2 else []


def fit(
    case: Case,
    model: Model,
    runs: list[Run],
    begin: np.ndarray | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Fit:
    """Fit a case's runs: coefficients, everything else that is free, and the levels of the noise.

    begin: first values of the coefficients in units of their priors, if something is known of them.
    """
    notes: list[str] = []
    if sum(run.rows for run in runs) > MOST_ROWS:
        runs = [runs[n] for n in some(runs, MOST_ROWS)]
        notes.append(f"{len(runs)} of the runs were fitted, evenly chosen: more rows would tell little and cost time")
    say("first values")
    first, values, left_out = settle(case, model, [runs[n] for n in some(runs, FIRST_ROWS)], begin)
    say("noise")
    part = pose(case, model, [first.problem.runs[n] for n in some(first.problem.runs, LEVEL_ROWS)])
    levels = noise.estimate(part, lambda p: first.filter(values, problem=p), noise.named(part))
    gone = {one.run for one in left_out}
    runs = [run for run in runs if run.name not in gone]
    say(f"{len(runs)} runs")
    flights = Flights(levels.applied(pose(case, model, runs)), first.free)
    at = flights.linear(values)
    more = odd_runs(flights.problem, at.e) if len(runs) >= 4 else []
    if more and len(more) <= len(runs) // 2:
        left_out, gone = left_out + more, {one.run for one in more}
        runs = [run for run in runs if run.name not in gone]
        flights = Flights(levels.applied(pose(case, model, runs)), first.free)
        at = flights.linear(flights.step(flights.linear(values)))
    statistics = gather(flights, at)
    if np.abs((statistics.mode - at.values) / np.sqrt(np.diag(statistics.covariance))).max() > FAR:
        say("a last step")
        at = flights.linear(flights.step(at))
        statistics = gather(flights, at)
    return Fit(flights.problem, first.free, at, statistics, levels, left_out, notes)


def gather(flights: Flights, at: Linear) -> Quadratic:
    """Sufficient statistics at a point, cooled where errors along the runs are correlated."""
    problem = flights.problem
    group = np.broadcast_to(noise.group_of_reading(), problem.z.shape)[problem.valid]
    statistics = collect(at.values, flights.low, at.e, at.J, group, tuple(noise.SENSORS))
    e = at.e + (statistics.mode - at.values) @ at.J
    found = heat(e, at.J, blocks(problem))
    return statistics.cooled(found) if found > 1.0 else statistics


def blocks(problem: Problem) -> np.ndarray:
    """The stretch of a run, BLOCK long, that each valid sample belongs to, (samples,)."""
    bounds = problem.recording.bounds
    since = problem.recording.t - np.repeat(problem.recording.t[bounds[:-1]], np.diff(bounds))
    _, number = np.unique(np.column_stack([problem.run_of, since // BLOCK]), axis=0, return_inverse=True)
    return np.broadcast_to(number.ravel()[:, None], problem.z.shape)[problem.valid]
