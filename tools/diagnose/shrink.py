"""How far the gap shrinks: windows of runs left out of the fit, flown by four models.

See docs/reference/gap.md, Measures.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glider.tools.diagnose.as_read import begun_as_read
from glider.tools.diagnose.search import Search, without_extra_noise
from glider.tools.gap.measure import RunGap, case_channels, root_mean_square, run_gap
from glider.tools.inference.fit import NUISANCE_LIMIT, Hypothesis, bounded_step
from glider.tools.inference.model import nominal_model
from glider.tools.inference.parameters import model_at
from glider.tools.inference.predict import at_its_word, fly, fly_windows_from, predict
from glider.tools.inference.problem import Problem, cut

DRAWS = 2  # simulated repetitions that find the floor
SEED = 20261121
BOOTSTRAP = 2000
BEFORE, RECALIBRATED, AFTER, FLOOR = "before", "recalibrated", "after", "floor"


@dataclass
class Shrinkage:
    """Gaps by run of the four models, and what follows from them."""

    runs: dict[str, list[RunGap]]
    before: float
    recalibrated: float
    after: float
    floor: float
    shrinkage: float
    ci90: tuple[float, float]
    closed: float
    closed_ci90: tuple[float, float]
    predictions: dict[str, list[np.ndarray]]  # by model and run, (rows, N_Y); not of the floor

    def channels(self, which: str) -> dict[str, float]:
        """Each channel's rms over the runs, and the total."""
        return by_channel(self.runs[which])


def by_channel(runs: list[RunGap]) -> dict[str, float]:
    """Each channel's rms over the runs, and the total."""
    return case_channels(runs) | {"total": root_mean_square([gap.total for gap in runs])}


def left_out(search: Search, hypothesis: Hypothesis) -> list[tuple[np.ndarray, np.ndarray]]:
    """A candidate's models, each fitted without one run: the step that the other runs ask for, to first order.

    Of a single run nothing can be left out: its model is fitted to it.
    """
    if len(search.problem.runs) == 1:
        return [search.model(hypothesis)]
    fitter, problem = search.fitter, search.problem
    fitter.linearise([hypothesis])
    columns = np.vstack([fitter.J, hypothesis.columns]) if len(hypothesis.free) else fitter.J
    normal = hypothesis.normal
    run = np.broadcast_to(problem.run_of[:, None], problem.valid.shape)[problem.valid]
    at = np.concatenate([hypothesis.nuisance, hypothesis.values])
    low = np.concatenate([np.minimum(-NUISANCE_LIMIT, hypothesis.nuisance), hypothesis.low]) - at
    high = np.concatenate([np.maximum(NUISANCE_LIMIT, hypothesis.nuisance), hypothesis.high]) - at
    # A step that all runs together still ask for was tried and brought nothing: limits and kinks are not linear.
    still = bounded_step(normal, hypothesis.slope, low, high)
    models = []
    for n in range(len(problem.runs)):
        own = columns[:, run == n]
        slope = hypothesis.slope - own @ hypothesis.e[run == n]
        step = bounded_step(normal - own @ own.T, slope, low, high) - still
        models.append(model_at(problem, [*search.nuisance, *hypothesis.free], at + np.clip(step, low, high)))
    return models


def gaps(
    problem: Problem,
    models: list[tuple[np.ndarray, np.ndarray]],
    z: np.ndarray | None = None,
    own_filter: bool = False,
) -> tuple[list[RunGap], list[np.ndarray]]:
    """Each run's own model's gap and prediction (rows, N_Y); `z` (rows, N_Y) in the place of what was measured.

    own_filter: as in `fly`.
    """
    problem, found, flown = problem.as_recorded, [], []
    for n, (P, F) in enumerate(models):
        part = problem.part(n)
        table = None
        if z is not None:
            table = z[problem.recording.bounds[n] : problem.recording.bounds[n + 1]]
            part.z = table
        Y = fly(part, P, F, own_filter)
        found.append(run_gap(part.kind.measures, part.runs[0], Y, cut(part).listed[0], table))
        flown.append(Y)
    return found, flown


def floor(search: Search, hypothesis: Hypothesis, rng: np.random.Generator) -> list[RunGap]:
    """What noise and disturbance leave of a perfect model: the selected model's own flights, predicted by itself."""
    problem = search.problem.as_recorded
    model = search.model(hypothesis)
    starts = search.gains.X[problem.recording.bounds[:-1]]
    draws = []
    for _ in range(DRAWS):
        Z = problem.simulated(*model, starts, rng)
        draws.append(gaps(problem, [model] * len(problem.runs), Z)[0])
    mean = []
    for n, run in enumerate(problem.runs):
        names = draws[0][n].channels
        channels = {name: root_mean_square([draw[n].channels[name] for draw in draws]) for name in names}
        mean.append(RunGap(run.name, channels, root_mean_square(channels.values()), draws[0][n].windows))
    return mean


def case_noise_floor(search: Search, hypothesis: Hypothesis) -> dict[str, float]:
    """The floor by channel with the disturbance of the case alone, whatever disorder the search knows of."""
    return by_channel(floor(without_extra_noise(search), hypothesis, np.random.default_rng(SEED)))


def squares(found: list[RunGap]) -> np.ndarray:
    """Squared total gaps by run, (runs,)."""
    return np.array([gap.total for gap in found]) ** 2


def rms(values: np.ndarray, picks: np.ndarray) -> np.ndarray:
    """Root mean of squares over picked runs, of each row of picks (draws, runs)."""
    return np.sqrt(values[picks].mean(axis=1))


def over_runs(
    value: Callable[[np.ndarray], np.ndarray], rng: np.random.Generator, count: int
) -> tuple[float, tuple[float, float]]:
    """A figure of picked runs, value(picks (draws, runs)): over all runs, and its 90 % interval by bootstrap.

    Of a single run there is no interval.
    """
    whole = float(value(np.arange(count)[None])[0])
    if count == 1:
        return whole, (np.nan, np.nan)
    low, high = np.quantile(value(rng.integers(0, count, (BOOTSTRAP, count))), [0.05, 0.95])
    return whole, (float(low), float(high))


def left_out_squares(search: Search, hypothesis: Hypothesis) -> np.ndarray:
    """A hypothesis's squared gaps on runs left out, (runs,), windows begun where its own filter stands."""
    runs, _ = gaps(search.problem, left_out(search, hypothesis), own_filter=True)
    return squares(runs)


def ablation_importance(search: Search, hypothesis: Hypothesis) -> dict[str, np.ndarray]:
    """By effect of a hypothesis, how much squared gaps on runs left out, (runs,), grow with a model that lacks it.

    It lacks that one alone: all else stays as it was fitted, and windows begin where the whole model's filter stands,
    or where the readings of a model without the effect show the vehicle (as_read).
    """
    problem, effects = search.problem.as_recorded, search.entries(hypothesis)
    found = {label: np.empty(len(problem.runs)) for label in effects}
    for n, (P, F) in enumerate(left_out(search, hypothesis) if effects else []):
        part = problem.part(n)
        gains, listed = at_its_word(part, P, F), cut(part).listed[0]

        def square(other: np.ndarray, part=part, P=P, F=F, gains=gains, listed=listed) -> float:
            Y = fly_windows_from(part, P, other, begun_as_read(part, F, other, gains))
            return run_gap(part.kind.measures, part.runs[0], Y, listed).total ** 2

        whole = square(F)
        for label, entries in effects.items():
            found[label][n] = square(search.without_effect(F, entries)) - whole
    return found


def in_tolerances(grown: np.ndarray) -> float:
    """Root of the mean by which squared gaps (runs,) grow; 0 where they do not."""
    return float(np.sqrt(max(grown.mean(), 0.0)))


def most_often(taken: dict[str, np.ndarray]) -> dict[str, float]:
    """How often each of several figures (runs,) is the largest, by bootstrap over runs."""
    if len(taken) < 2:
        return dict.fromkeys(taken, 1.0)
    table = np.array(list(taken.values()))
    picks = np.random.default_rng(SEED).integers(0, table.shape[1], (BOOTSTRAP, table.shape[1]))
    first = np.argmax(table[:, picks].mean(axis=2), axis=0)
    return {label: float((first == n).mean()) for n, label in enumerate(taken)}


@dataclass
class Further:
    """How far the gap shrinks with something that is no effect, on runs left out."""

    runs: list[RunGap]
    after: float
    shrinkage: float
    ci90: tuple[float, float]


def shrink_further(search: Search, hypothesis: Hypothesis, before: list[RunGap]) -> Further:
    """The gap with another model fitted to the same runs, against the gaps before."""
    runs, _ = gaps(search.problem, left_out(search, hypothesis))
    b, a = squares(before), squares(runs)
    rng = np.random.default_rng(SEED)
    shrunk, ci90 = over_runs(lambda picks: 1.0 - rms(a, picks) / rms(b, picks), rng, len(runs))
    return Further(runs, float(np.sqrt(a.mean())), shrunk if len(runs) > 1 else np.nan, ci90)


def shrinkage_of(runs: dict[str, list[RunGap]], predictions: dict[str, list[np.ndarray]]) -> Shrinkage:
    """What follows from the four models' gaps by run.

    Shrinkage is one of runs left out, so NaN for a single run. Closed is NaN too where there may be nothing to close:
    unless the 90 % interval of before - floor is above 0.
    """
    total = {name: squares(found) for name, found in runs.items()}
    rng, count = np.random.default_rng(SEED), len(runs[BEFORE])

    def closed_of(picks: np.ndarray) -> np.ndarray:
        b, a, f = (rms(total[name], picks) for name in (BEFORE, AFTER, FLOOR))
        return (b - a) / np.maximum(b - f, 1e-9)

    shrunk, ci90 = over_runs(lambda picks: 1.0 - rms(total[AFTER], picks) / rms(total[BEFORE], picks), rng, count)
    closed, closed_ci90 = over_runs(closed_of, rng, count)
    _, beyond = over_runs(lambda picks: rms(total[BEFORE], picks) - rms(total[FLOOR], picks), rng, count)
    if count == 1:
        shrunk = np.nan
    if not beyond[0] > 0.0:
        closed, closed_ci90 = np.nan, (np.nan, np.nan)
    mean = {name: float(np.sqrt(values.mean())) for name, values in total.items()}
    return Shrinkage(
        runs, mean[BEFORE], mean[RECALIBRATED], mean[AFTER], mean[FLOOR], shrunk, ci90, closed, closed_ci90, predictions
    )


def shrink(search: Search, hypothesis: Hypothesis) -> Shrinkage:
    """The gap before, recalibrated, after, and its floor, on runs left out of the fit."""
    problem = search.problem
    rng = np.random.default_rng(SEED)
    flown = predict(problem.case, nominal_model(problem.case), problem.runs)
    listed = cut(problem).listed
    bare, knowing = left_out(search, search.null), search
    for entries in search.entries(search.null).values():  # a recalibrated model knows of no clock that is late
        bare, knowing = [(P, search.without_effect(F, entries)) for P, F in bare], without_extra_noise(search)
    refitted, Y_refitted = gaps(knowing.problem, bare)
    has_effects = bool(search.entries(hypothesis))
    after, Y_after = gaps(problem, left_out(search, hypothesis)) if has_effects else (refitted, Y_refitted)
    runs = {
        BEFORE: [run_gap(problem.kind.measures, run, flown[n], listed[n]) for n, run in enumerate(problem.runs)],
        RECALIBRATED: refitted,
        AFTER: after,
        FLOOR: floor(search, hypothesis, rng),
    }
    predictions = {BEFORE: flown, RECALIBRATED: Y_refitted, AFTER: Y_after}
    return shrinkage_of(runs, predictions)
