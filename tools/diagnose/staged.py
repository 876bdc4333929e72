"""A vehicle far from its file, in stages, each checked on runs left out (docs/explanation/diagnosis.md, Stages).

Readings first: what they say of each other goes into the model. Then the vehicle: identified by prediction error, once
without each run (or each of FOLDS parts of many runs). Then what is wrong with the sensors beside it, one after the
other: every effect of theirs is tried by one linear step, the best are fitted in full, and the one that takes most of
the gap of runs left out stays, if it takes LEAST_GAP_REDUCTION of it, in every part, with the same sign. A fit of the
runs themselves
says little here: with many effects to choose from one of them always brings something.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose import by_readings
from glider.tools.diagnose.by_readings import Size
from glider.tools.diagnose.shrink import SEED, gaps
from glider.tools.diagnose.waterfall import NOMINAL, READINGS, Stage
from glider.tools.gap.corrected import ReadingCorrections, correct_readings, submerged
from glider.tools.gap.measure import RunGap, root_mean_square, run_gap
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.model import Model, effect_vector, nominal_model
from glider.tools.inference.parameters import NINETY, FreeParameter, effect_parameters
from glider.tools.inference.predict import fly, observe
from glider.tools.inference.prediction_error import HORIZONS, Fitted, PredictionError
from glider.tools.inference.problem import cut, problem_of
from glider.tools.inference.vehicle_parameters import GAUGE, Parameters, first_effects, listed, parameters

IDENTIFIED = "identified"  # its stage
FOLDS, ALONE = 4, 6  # parts of many runs; runs up to which each is left out alone
EFFECTS_FITTED = 4  # effects fitted in full, of those whose linear step takes most
REFIT_STEPS = 5
LEAST_GAP_REDUCTION = 0.1  # of the squared gap of runs left out, that an effect has to take
CERTAIN_SIGMA = NINETY  # sigma in the fit to all runs: its 90 % interval leaves 0 out


@dataclass
class Staged:
    """What the stages came to."""

    read: ReadingCorrections
    stages: list[Stage]
    selected: list[str]  # labels: of readings first, then by the order in which they were added
    sizes: dict[str, dict[str, Size]]  # by label (or GAUGE), of the fit to all runs
    vehicle: dict[str, Size]  # what was identified, by name
    model: tuple[np.ndarray, np.ndarray]  # P, F of the fit to all runs
    predictions: list[np.ndarray]  # of each run by the model that has not seen it, (rows, N_Y)
    floor: list[RunGap]  # what noise and disturbance would leave of the last model
    taken: dict[str, float] = field(default_factory=dict)  # squared tolerances of left-out runs that each label took


@dataclass
class _Fold:
    """A part of the runs that is predicted by a fit to the others."""

    left_out: list[int]
    read: ReadingCorrections
    values: np.ndarray


class _Stages:
    def __init__(self, case: Case, say: Callable[[str], None]):
        self.say = say
        self.nominal = nominal_model(case)
        self.whole = correct_readings(case, self.nominal)
        runs = len(case.runs)
        parts = [[n] for n in range(runs)] if runs <= ALONE else [list(range(k, runs, FOLDS)) for k in range(FOLDS)]
        self.folds = []
        for left_out in parts:
            # What the readings say is found without the run, too; of a single run nothing can be left out.
            kept = [run for n, run in enumerate(case.runs) if n not in left_out] or case.runs
            self.folds.append(_Fold(left_out, correct_readings(case, self.nominal, kept), np.empty(0)))
        self.case = submerged(case)

    def free(self, model: Model, runs: list[Run], more: list[FreeParameter]) -> PredictionError:
        """The fitting of everything identified, and more, to runs."""
        problem = problem_of(self.case, model, runs)
        return PredictionError(problem, listed(problem, [*parameters(problem, first=True).free, *more]))

    def predict(self, n: int, P: np.ndarray, F: np.ndarray) -> tuple[RunGap, np.ndarray]:
        """A run as it was recorded, flown by a model: its gap, and the prediction."""
        problem = problem_of(self.case, self.nominal, [self.case.runs[n]])
        Y = fly(problem, P, F)
        return run_gap(problem.kind.measures, self.case.runs[n], Y, cut(problem).listed[0]), Y

    def flown(self, models: dict[int, tuple[np.ndarray, np.ndarray]]) -> tuple[list[RunGap], list[np.ndarray]]:
        """Every run by its own model."""
        found = [self.predict(n, *models[n]) for n in range(len(self.case.runs))]
        return [gap for gap, _ in found], [Y for _, Y in found]

    def identify(self) -> None:
        """Every fold's fit of the vehicle."""
        for fold in self.folds:
            how = "without" if len(self.case.runs) > 1 else "from"
            self.say(f"identified {how} {', '.join(self.case.runs[n].name for n in fold.left_out)}")
            fitting = self.free(fold.read.model, fold.read.runs, [])
            fold.values = fitting.through(fitting.file_values).values

    def models(self, more: list[FreeParameter], values: list[np.ndarray]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """By run, the model that has not seen it; constant errors of the sensors are a run's own."""
        found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for fold, at in zip(self.folds, values, strict=True):
            P, F = self.free(fold.read.model, fold.read.runs, more).model(at)
            F[ef.BIAS : ef.BIAS + ef.N_BIASES] = 0.0
            found |= {n: (P, F) for n in fold.left_out}
        return found

    def candidates(self) -> dict[str, list[FreeParameter]]:
        """Effects of the sensors that may be added, by label; GAUGE has none.

        Effects of forces and masses are not asked here: beside drag, lift and trim that were identified a moment ago,
        within priors that may be too narrow, a tether or a current is one more parameter of the same.
        """
        problem = problem_of(self.case, self.whole.model, self.whole.runs)
        own = {one.name: [one] for one in first_effects(problem) if one.name != "stall"}
        effects = catalogue()
        known = {
            label: free
            for label, free in effect_parameters(problem).items()
            if effects[label].subsystem == "sensing" and label not in own
        }
        return {label: free for label, free in (own | known).items() if label not in self.whole.added}

    def linear_importance(
        self, added: list[FreeParameter], candidates: dict[str, list[FreeParameter]]
    ) -> dict[str, float]:
        """Mean square left on runs left out after one linear step with each candidate, by label."""
        more = [*added, *(f for free in candidates.values() for f in free)]
        found = dict.fromkeys(candidates, 0.0)
        for fold in self.folds:
            inside = self.free(fold.read.model, fold.read.runs, more)
            kept = fold.left_out if len(fold.left_out) < len(self.case.runs) else range(len(self.case.runs))
            outside = self.free(fold.read.model, [self.case.runs[n] for n in kept], more)
            at = np.concatenate([fold.values, np.zeros(len(more) - len(added))])
            horizon, offsets = HORIZONS[-1]
            cuts = [inside.windows(horizon, offset) for offset in offsets]
            cost, gains = inside.cost(at, cuts)
            held = max(cost, 1.0) / (len(cuts[0].first) * len(inside.channels))
            normal, slope = inside.linear(at, gains, cuts)
            normal, slope = normal + held * np.eye(len(at)), slope + held * at
            ((e, J),) = outside.columns(at, outside.gains(at), [outside.windows(horizon, 0.0)])
            first = len(fold.values)
            for label, free in candidates.items():
                on = np.concatenate([np.arange(len(fold.values)), np.arange(first, first + len(free))])
                first += len(free)
                step = bounded_step(
                    normal[np.ix_(on, on)], slope[on], inside.low[on] - at[on], inside.high[on] - at[on]
                )
                found[label] += outside.weights(e + step @ J[on])[1] / len(self.folds)
        return found

    def sure(self, more: list[FreeParameter], new: int, values: list[np.ndarray]) -> bool:
        """Whether the fit to all runs has one of the `new` last parameters away from 0 by CERTAIN_SIGMA."""
        fitting = self.free(self.whole.model, self.whole.runs, more)
        found = fitting.again(np.clip(np.mean(values, axis=0), fitting.low, fitting.high), REFIT_STEPS)
        sd = np.sqrt(np.diag(found.covariance))
        return bool((np.abs(found.values[-new:]) > CERTAIN_SIGMA * sd[-new:]).any())

    def refitted(self, more: list[FreeParameter], new: int) -> list[np.ndarray]:
        """Every fold's values with `new` parameters more at the end, from where it stands."""
        found = []
        for fold in self.folds:
            fitting = self.free(fold.read.model, fold.read.runs, more)
            begin = np.concatenate([fold.values, np.zeros(new)])
            begin[-new:] = np.where(fitting.one_sided[-new:], np.where(fitting.high[-new:] > 0.0, 0.5, -0.5), 0.0)
            found.append(fitting.again(begin, REFIT_STEPS).values)
        return found


def reduces_gap(before: list[RunGap], after: list[RunGap], folds: list[list[int]]) -> bool:
    """Whether a stage takes LEAST_GAP_REDUCTION of the squared gap of runs left out, and some of it in every part of
    them.
    """
    b, a = np.array([gap.total for gap in before]) ** 2, np.array([gap.total for gap in after]) ** 2
    return bool(a.sum() <= (1.0 - LEAST_GAP_REDUCTION) * b.sum()) and all(
        a[part].sum() < b[part].sum() for part in folds
    )


def staged(case: Case, say: Callable[[str], None] = lambda text: None) -> Staged:
    """Readings, vehicle and causes of a case whose vehicle file misses its runs."""
    work = _Stages(case, say)
    every = range(len(case.runs))
    nominal = (work.nominal.P, effect_vector(work.nominal))
    stages = [Stage(NOMINAL, [], work.flown(dict.fromkeys(every, nominal))[0])]
    if work.whole.added:
        models = {n: (fold.read.model.P, effect_vector(fold.read.model)) for fold in work.folds for n in fold.left_out}
        stages.append(Stage(READINGS, work.whole.added, work.flown(models)[0]))
    work.identify()
    left, predictions = work.flown(work.models([], [fold.values for fold in work.folds]))
    stages.append(Stage(IDENTIFIED, [], left))
    added: list[FreeParameter] = []
    chosen: list[str] = []
    taken: dict[str, float] = {}
    candidates = work.candidates()
    parts = [fold.left_out for fold in work.folds]
    while candidates and len(case.runs) > 1:  # a fit to the run itself decides nothing
        say(f"causes beside the vehicle: {len(chosen) + 1}")
        importance = work.linear_importance(added, candidates)
        best = None
        for label in sorted(importance, key=lambda name: importance[name])[:EFFECTS_FITTED]:
            own = candidates[label]
            values = work.refitted([*added, *own], len(own))
            left, flown = work.flown(work.models([*added, *own], values))
            new = np.array([at[-len(own) :] for at in values])
            same_sign = bool((np.abs(np.sign(new).sum(axis=0)) == len(new)).any())
            if same_sign and work.sure([*added, *own], len(own), values) and reduces_gap(stages[-1].gaps, left, parts):
                total = root_mean_square([gap.total for gap in left])
                if best is None or total < best[0]:
                    best = (total, label, values, left, flown)
        if best is None:
            break
        total, label, values, left, predictions = best
        taken[label] = stages[-1].total ** 2 - total**2
        added += candidates.pop(label)
        chosen.append(label)
        for fold, at in zip(work.folds, values, strict=True):
            fold.values = at
        stages.append(Stage(f"+ {label}", [label], left))
    return _concluded(work, stages, chosen, added, predictions, taken)


def _concluded(
    work: _Stages, stages: list[Stage], chosen: list[str], added: list[FreeParameter], predictions: list[np.ndarray],
    taken: dict[str, float],
) -> Staged:  # fmt: skip
    """The fit to all runs with everything that was chosen."""
    work.say("all runs")
    fitting = work.free(work.whole.model, work.whole.runs, added)
    start = np.mean([fold.values for fold in work.folds], axis=0)
    candidates = [fitting.again(np.clip(start, fitting.low, fitting.high))]
    if len(work.folds) > 1:
        candidates += [fitting.again(np.clip(fold.values, fitting.low, fitting.high)) for fold in work.folds[:2]]
    found = min(candidates, key=lambda one: one.cost)
    P, F = fitting.model(found.values)
    F[ef.BIAS : ef.BIAS + ef.N_BIASES] = 0.0
    sizes = sizes_of(fitting.free, found)
    by_label: dict[str, dict[str, Size]] = {}
    first = len(fitting.free.free) - len(added)
    for n, one in enumerate(added):
        name = one.label or one.name
        own = one.name if one.label else catalogue()[name].parameters[0].name if name in catalogue() else "size"
        by_label.setdefault(name, {})[own] = sizes[first + n]
    said = by_readings.sizes(work.whole.findings)
    by_label |= {label: said[label] for label in work.whole.labels if label in said}
    vehicle = dict(zip(fitting.free.names[:first], sizes[:first], strict=True))
    selected = [*work.whole.labels, *(label for label in chosen if label != GAUGE)]
    floor = floor_of(work, P, F)
    return Staged(work.whole, stages, selected, by_label, vehicle, (P, F), predictions, floor, taken)


def floor_of(work: _Stages, P: np.ndarray, F: np.ndarray) -> list[RunGap]:
    """Gaps of the model's own simulated flights of the runs, predicted by itself."""
    problem = problem_of(work.case, work.nominal)
    starts = observe(problem, P, F).X[problem.recording.bounds[:-1]]
    Z = problem.simulated(P, F, starts, np.random.default_rng(SEED))
    return gaps(problem, [(P, F)] * len(problem.runs), Z)[0]


def sizes_of(free: Parameters, found: Fitted) -> list[Size]:
    """Every parameter with its 90 % interval by Laplace's approximation, limits kept, SI."""
    sd = np.sqrt(np.diag(found.covariance))
    sizes = []
    for n, one in enumerate(free.free):
        low = max(found.values[n] - CERTAIN_SIGMA * sd[n], one.low)
        high = min(found.values[n] + CERTAIN_SIGMA * sd[n], one.high)
        at = one.moved(free.nominal[n], np.array([found.values[n], low, high]))
        sizes.append(Size(float(at[0]), (float(at[1]), float(at[2])), one.unit))
    return sizes
