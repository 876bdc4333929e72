"""The most probable parameters of a case's flights, the noise's levels, and the runs that do not belong."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.gate import LeftOut
from glider.tools.data.runs.run import Run
from glider.tools.identify.flight_likelihood import Linear, TrajectoryLikelihood
from glider.tools.identify.predict import flown_gap
from glider.tools.identify.statistics import Quadratic, collect, inflation
from glider.tools.inference import levels as noise
from glider.tools.inference.model import Model
from glider.tools.inference.prediction_error import Fitted, PredictionError
from glider.tools.inference.problem import Problem, problem_of
from glider.tools.inference.vehicle_parameters import FRAME, Parameters, first_effects, listed, parameters

LEVELS = 0.0  # in a schedule: the noise's levels are estimated
# Times the disturbance in the filter's process noise, one step at each: less and less as the model comes closer.
SCHEDULE = (100.0, 10.0, 3.0, 1.0, LEVELS)
FROM_START = (10.0, 1.0, LEVELS)  # where the accelerations have given first values
UNSEEN = (100.0, 30.0, LEVELS, 10.0, LEVELS, 3.0, 1.0, LEVELS, 1.0, 1.0, LEVELS, 1.0, 1.0)  # without motion capture
AGAIN = (1.0, LEVELS, 1.0)  # where the noise is not what the case says
# Without motion capture a model may predict every next row and yet fly elsewhere: of the points that the steps pass,
# from this process-noise scale on, the one is kept from which the fitted runs themselves are flown best, window by
# window.
WATCHED = 30.0
LOOK = 10.0  # of them, the one at which runs that do not belong are looked for
MOST_STEPS = 6  # with all runs
CORRELATED = (
    1.5  # variance inflation, from which the priors weigh more than they did in the first fit: a few steps more
)
LEAST_LEVEL_CHANGE = 0.3  # logarithm of a level
FIRST_ROWS, LEVEL_ROWS, MOST_ROWS = 9_000, 5_000, 90_000
WINDOW_ROWS = 9_000  # that are flown window by window
OUTLIER_RUN_FACTOR = 3.0  # times the runs' median of squared innovations, beyond which a run does not belong
BLOCK = 3.0  # s, stretches of runs whose slopes are compared for the variance inflation
REFIT_SIGMA = 8.0  # posterior sigma; a first fit to some of the runs that is farther off is followed by another step


@dataclass
class IdentificationFit:
    """What the sampler and the report need."""

    problem: Problem  # of the runs kept, noise at its levels
    free: Parameters
    at: Linear | None  # None: by prediction error
    quadratic: Quadratic
    levels: noise.Levels
    left_out: list[LeftOut]
    notes: list[str]

    @property
    def best(self) -> np.ndarray:
        """The posterior's mode within its limits, in units of the priors, (n,): what files hold."""
        return np.maximum(self.quadratic.mode, self.quadratic.low)


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
    for n in np.flatnonzero(squares > OUTLIER_RUN_FACTOR * max(usual, 1.0)):
        run = problem.runs[n]
        reason = f"misses every model that fits the others: squared innovations {squares[n] / usual:.3g} times theirs"
        found.append(LeftOut(run.name, run.path, "", reason))
    return found


@dataclass
class First:
    """First values, from some of the runs."""

    problem: Problem  # as the case has it
    free: Parameters
    values: np.ndarray
    levels: noise.Levels
    left_out: list[LeftOut]


def flights(first: First, problem: Problem | None = None) -> TrajectoryLikelihood:
    """Its flights with noise at its levels; of another problem of the same vehicle, if one is given."""
    return TrajectoryLikelihood(first.levels.applied(first.problem if problem is None else problem), first.free)


def level(case: Case, first: First) -> noise.Levels:
    """The noise's levels with the model at its present values, from as many runs as that takes."""
    runs = first.problem.runs
    part = problem_of(case, first.problem.model, [runs[n] for n in some(runs, LEVEL_ROWS)])
    return noise.estimate(part, lambda p: flights(first).filter(first.values, problem=p), first.levels)


def initial_fit(case: Case, model: Model, runs: list[Run], begin: dict[str, float] | None) -> First:
    """First values from these runs, the filter's process noise less and less; names runs that do not belong."""
    problem = problem_of(case, model, runs)
    free = parameters(problem)
    first = First(problem, free, np.zeros(len(free.free)), noise.named(problem), [])
    if begin is not None:
        first.values = free.values(begin)
    mocap = bool(problem.seen[ef.Y_MOCAP_X])
    stages = list((FROM_START if begin is not None else SCHEDULE) if mocap else UNSEEN)
    passed: list[tuple[float, np.ndarray, noise.Levels]] = []
    while stages:
        process_noise_scale = stages.pop(0)
        if process_noise_scale == LEVELS:
            before, first.levels = first.levels, level(case, first)
            if not stages and np.abs(first.levels.log - before.log).max() > LEAST_LEVEL_CHANGE:
                stages = list(AGAIN)
            continue
        flown = flights(first)
        at = flown.linear(first.values, process_noise_scale)
        first.values = flown.step(at)
        if not mocap and process_noise_scale <= WATCHED:
            passed.append((flown_gap(case, model, runs, free, first.values), first.values, first.levels))
        if process_noise_scale != LOOK or len(runs) < 4 or first.left_out:
            continue
        odd = odd_runs(problem, flown.follow([first.values], at.gains)[0])
        if odd and len(odd) <= len(runs) // 2:
            gone = {one.run for one in odd}
            again = initial_fit(case, model, [run for run in runs if run.name not in gone], None)
            again.left_out += odd
            return again
    if passed:
        _, first.values, first.levels = min(passed, key=lambda one: one[0])
    return first


def fit(
    case: Case,
    model: Model,
    runs: list[Run],
    begin: dict[str, float] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> IdentificationFit:
    """Fit a case's runs: coefficients, everything else that is free, and the levels of the noise.

    begin: first values of the coefficients, SI by name, if something is known of them.
    """
    notes: list[str] = []
    if sum(run.rows for run in runs) > MOST_ROWS:
        runs = [runs[n] for n in some(runs, MOST_ROWS)]
        notes.append(f"{len(runs)} of the runs were fitted, evenly chosen: more rows would tell little and cost time")
    say("first values and noise")
    first = initial_fit(case, model, [runs[n] for n in some(runs, FIRST_ROWS)], begin)
    gone = {one.run for one in first.left_out}
    runs = [run for run in runs if run.name not in gone]
    say(f"{len(runs)} runs")
    whole = flights(first, problem_of(case, model, runs))
    at = whole.linear(first.values)
    left_out, more = first.left_out, odd_runs(whole.problem, at.e) if len(runs) >= 4 else []
    if more and len(more) <= len(runs) // 2:
        left_out, gone = left_out + more, {one.run for one in more}
        whole = flights(first, problem_of(case, model, [run for run in runs if run.name not in gone]))
        at = whole.linear(whole.step(whole.linear(first.values)))
    statistics = gather(whole, at)
    mocap = bool(whole.problem.seen[ef.Y_MOCAP_X])
    for _ in range(MOST_STEPS if mocap else 0):
        away = np.abs((statistics.mode - at.values) / np.sqrt(np.diag(statistics.covariance))).max()
        near = REFIT_SIGMA if statistics.inflation < CORRELATED else 1.0
        if away < near and foresees(whole, at, statistics):
            break
        say("a further step")
        at = whole.linear(whole.step(at, statistics.inflation))
        statistics = gather(whole, at)
    if not mocap:
        notes.append("without motion capture: the point that flies the fitted runs best stands for the mode")
        statistics = statistics.centred()
    elif not foresees(whole, at, statistics):
        notes.append("the misfit is no parabola about its least: the best values found stand for the mode")
        statistics = statistics.centred()
    return IdentificationFit(whole.problem, first.free, at, statistics, first.levels, left_out, notes)


def fitting_of(case: Case, model: Model, runs: list[Run], without: Sequence[tuple[str, ...]] = ()) -> PredictionError:
    """The fit by prediction error to some of these runs, with all that a vehicle may have that nobody identified.

    But for terms (names of their parameters) that it is without.
    """
    problem = problem_of(case, model, [runs[n] for n in some(runs, WINDOW_ROWS)])
    gone = {name for term in without for name in term}
    free = [*parameters(problem, first=True).free, *first_effects(problem)]
    # what the capture's frame is off the observer takes as it is
    return PredictionError(problem, listed(problem, [f for f in free if f.vector != FRAME and f.name not in gone]))


def by_prediction(
    case: Case, model: Model, likelihood: IdentificationFit, begin: dict[str, float] | None, say: Callable[[str], None]
) -> Fitted:
    """The fit by prediction error, from the file's values, the likelihood's and first values of the coefficients."""
    fitting = fitting_of(case, model, likelihood.problem.runs)
    starts = [dict(zip(likelihood.free.names, likelihood.free.si(likelihood.best), strict=True))]
    if begin is not None:
        starts.append(begin)
    drawn = fitting.draws() if begin is None else []
    return fitting.best_of([*(fitting.clipped(fitting.free.values(start)) for start in starts), *drawn], say)


def as_fit(fitting: PredictionError, found: Fitted, likelihood: IdentificationFit) -> IdentificationFit:
    """What was fitted by prediction error to the likelihood's runs; noise stays as the case has it."""
    n, low = len(found.values), np.array([f.low for f in fitting.free.free])
    statistics = Quadratic(
        found.values, low, (found.normal - np.eye(n))[None], -found.values[None], np.array([found.independent]),
        np.array([found.independent]), ("windows",),
    )  # fmt: skip
    note = "identified by prediction error, window by window (docs/explanation/identification.md, Of another form)"
    return IdentificationFit(
        likelihood.problem, fitting.free, None, statistics, noise.named(fitting.problem), likelihood.left_out, [note]
    )  # fmt: skip


def foresees(flown: TrajectoryLikelihood, at: Linear, statistics: Quadratic) -> bool:
    """Whether the step to the linearised mode brings half at least of the fall in misfit that it foresees."""
    foreseen = float(statistics.slope @ np.linalg.solve(statistics.normal, statistics.slope))
    if foreseen < 1.0:
        return True
    mode = np.maximum(statistics.mode, flown.low)
    e = flown.follow([mode], at.gains)[0]
    before = float(at.e @ at.e) / statistics.inflation + float(at.values @ at.values)
    after = float(e @ e) / statistics.inflation + float(mode @ mode)
    return before - after > 0.5 * foreseen


def gather(flown: TrajectoryLikelihood, at: Linear) -> Quadratic:
    """Sufficient statistics at a point, tempered where errors along the runs are correlated."""
    problem = flown.problem
    group = np.broadcast_to(noise.group_of_reading(), problem.z.shape)[problem.valid]
    statistics = collect(at.values, flown.low, at.e, at.J, group, tuple(noise.SENSORS))
    e = at.e + (statistics.mode - at.values) @ at.J
    found = inflation(e, at.J, blocks(problem))
    return statistics.tempered(found) if found > 1.0 else statistics


def blocks(problem: Problem) -> np.ndarray:
    """The stretch of a run, BLOCK long, that each valid sample belongs to, (samples,)."""
    bounds = problem.recording.bounds
    since = problem.recording.t - np.repeat(problem.recording.t[bounds[:-1]], np.diff(bounds))
    _, number = np.unique(np.column_stack([problem.run_of, since // BLOCK]), axis=0, return_inverse=True)
    return np.broadcast_to(number.ravel()[:, None], problem.z.shape)[problem.valid]
