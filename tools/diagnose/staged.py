"""A vehicle far from its file, in stages, each checked on runs left out (docs/explanation/diagnosis.md, Stages).

Readings first: what they say of each other goes into the model. Then the vehicle: identified by prediction error, from
all runs and once without each (or each of FOLDS parts of many). Then what is wrong with the sensors beside it, one
after the other: of every effect of theirs the evidence is asked by one linear step, the best are fitted in full, and
the one with the most stays where it is more than the choice among them costs, and runs left out are flown better by it.
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
from glider.tools.gap.measure import RunGap, run_gap
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.model import Model, effect_vector, nominal_model
from glider.tools.inference.parameters import NINETY, FreeParameter, effect_parameters
from glider.tools.inference.predict import fly, observe
from glider.tools.inference.prediction_error import HORIZONS, Fitted, PredictionError
from glider.tools.inference.problem import cut, problem_of
from glider.tools.inference.vehicle_parameters import GAUGE, Parameters, first_effects, listed, parameters
from glider.tools.readings.stretches import since_dive

IDENTIFIED = "identified"  # its stage
FOLDS, ALONE = 4, 6  # parts of many runs; runs up to which each is left out alone
EFFECTS_FITTED = 4  # effects fitted in full, of those with most evidence by a linear step


@dataclass
class Staged:
    """What the stages came to."""

    read: ReadingCorrections
    stages: list[Stage]
    predictions: list[np.ndarray]  # of each run by the model that has not seen it, (rows, N_Y)
    taken: dict[str, float] = field(default_factory=dict)  # squared tolerances of left-out runs that each label took
    evidence: dict[str, float] = field(default_factory=dict)  # nat, of each label that was added beside the vehicle
    selected: list[str] = field(default_factory=list)  # labels: of readings first, then in the order of adding
    sizes: dict[str, dict[str, Size]] = field(default_factory=dict)  # by label (or GAUGE), of the fit to all runs
    vehicle: dict[str, Size] = field(default_factory=dict)  # what was identified, by name
    model: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.empty(0), np.empty(0)))  # P, F of that fit
    floor: list[RunGap] = field(default_factory=list)  # what noise and disturbance would leave of that model


@dataclass
class _Fold:
    """A part of the runs that is predicted by a fit to the others; with nothing left out, the fit to all."""

    left_out: list[int]
    read: ReadingCorrections
    fitted: Fitted = field(init=False)


class _Stages:
    def __init__(self, case: Case, say: Callable[[str], None]):
        self.say = say
        self.nominal = nominal_model(case)
        self.every = _Fold([], correct_readings(case, self.nominal))
        self.whole = self.every.read
        runs = len(case.runs)
        parts = [[n] for n in range(runs)] if runs <= ALONE else [list(range(k, runs, FOLDS)) for k in range(FOLDS)]
        self.folds = []
        for left_out in parts:
            # What the readings say is found without the run, too; of a single run nothing can be left out.
            kept = [run for n, run in enumerate(case.runs) if n not in left_out] or case.runs
            self.folds.append(_Fold(left_out, correct_readings(case, self.nominal, kept)))
        self.case = submerged(case)

    def free(self, model: Model, runs: list[Run], more: list[FreeParameter]) -> PredictionError:
        """The fitting of everything identified, and more, to runs, from their first dive on."""
        problem = problem_of(self.case, model, [since_dive(run) for run in runs])
        return PredictionError(problem, listed(problem, [*parameters(problem, first=True).free, *more]), doubts=True)

    def predict(self, n: int, P: np.ndarray, F: np.ndarray) -> tuple[RunGap, np.ndarray]:
        """A run as it was recorded, flown by a model: its gap, and the prediction."""
        problem = problem_of(self.case, self.nominal, [self.case.runs[n]])
        Y = fly(problem, P, F)
        return run_gap(problem.kind.measures, self.case.runs[n], Y, cut(problem).listed[0]), Y

    def flown(self, models: dict[int, tuple[np.ndarray, np.ndarray]]) -> tuple[list[RunGap], list[np.ndarray]]:
        """Every run by its own model."""
        found = [self.predict(n, *models[n]) for n in range(len(self.case.runs))]
        return [gap for gap, _ in found], [Y for _, Y in found]

    def fitting(self, fold: _Fold, more: list[FreeParameter]) -> PredictionError:
        """The same to a fold's runs."""
        return self.free(fold.read.model, fold.read.runs, more)

    def identify(self) -> None:
        """Every fit of the vehicle."""
        self.every.fitted = self.identified(self.every, [])
        alone = len(self.case.runs) == 1
        for fold in self.folds:
            how = "from" if alone else "without"
            self.say(f"identified {how} {', '.join(self.case.runs[n].name for n in fold.left_out)}")
            fold.fitted = self.every.fitted if alone else self.identified(fold, [])

    def identified(self, fold: _Fold, more: list[FreeParameter]) -> Fitted:
        """A fold's fit through all horizons."""
        fitting = self.fitting(fold, more)
        return fitting.through(fitting.file_values)

    def with_effect(self, added: list[FreeParameter], own: list[FreeParameter]) -> tuple[Fitted, float]:
        """The fit to all runs with an effect more, and the effect's evidence (nat) in it."""
        found = self.identified(self.every, [*added, *own])
        n = len(found.values)
        return found, found.evidence(np.zeros(n), np.arange(n - len(own), n))

    def models(self, more: list[FreeParameter], fitted: list[Fitted]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """By run, the model that has not seen it; constant errors of the sensors are a run's own."""
        found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for fold, at in zip(self.folds, fitted, strict=True):
            P, F = self.fitting(fold, more).model(at.values)
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

    def linear_evidence(
        self, added: list[FreeParameter], candidates: dict[str, list[FreeParameter]]
    ) -> dict[str, float]:
        """Evidence (nat) of each candidate after one linear step of the fit to all runs, by label."""
        more = [f for free in candidates.values() for f in free]
        fitting = self.fitting(self.every, [*added, *more])
        first = len(self.every.fitted.values)
        at = np.concatenate([self.every.fitted.values, np.zeros(len(more))])
        horizon, offsets = HORIZONS[-1]
        cuts = [fitting.windows(horizon, offset) for offset in offsets]
        fitting.expect(at)
        cost, gains = fitting.cost(at, cuts)
        independent = fitting.independent(cuts)
        weight = independent / max(cost, 1.0)
        normal, slope = fitting.linear(at, gains, cuts)
        normal, slope = weight * normal + np.eye(len(at)), weight * slope + at
        found, known = {}, first
        for label, free in candidates.items():
            on = np.concatenate([np.arange(known), np.arange(first, first + len(free))])
            first += len(free)
            own = normal[np.ix_(on, on)]
            step = bounded_step(own, slope[on], fitting.low[on] - at[on], fitting.high[on] - at[on])
            reached = Fitted(at[on] + step, cost, own, independent)
            found[label] = reached.evidence(np.zeros(len(on)), np.arange(known, len(on)))
        return found


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
    left, predictions = work.flown(work.models([], [fold.fitted for fold in work.folds]))
    stages.append(Stage(IDENTIFIED, [], left))
    found = Staged(work.whole, stages, predictions)
    added: list[FreeParameter] = []
    candidates = work.candidates()
    choice = float(np.log(max(len(candidates), 1)))  # nat, that the choice among them costs
    while candidates and len(case.runs) > 1:  # a fit to the run itself decides nothing
        say(f"causes beside the vehicle: {len(found.taken) + 1}")
        label = _one_more(work, found, added, candidates, choice)
        if label is None:
            break
        added += candidates.pop(label)
    return _concluded(work, found, added)


def _one_more(
    work: _Stages, found: Staged, added: list[FreeParameter], candidates: dict[str, list[FreeParameter]], choice: float
) -> str | None:
    """The label of the stage that was added: the most evident by which runs left out are flown better, if any is."""
    asked = work.linear_evidence(added, candidates)
    fitted = {
        label: work.with_effect(added, candidates[label])
        for label in sorted(asked, key=lambda name: -asked[name])[:EFFECTS_FITTED]
    }
    for label in sorted(fitted, key=lambda name: -fitted[name][1]):
        (whole, evidence), more = fitted[label], [*added, *candidates[label]]
        if evidence <= choice:
            break
        folds = [work.identified(fold, more) for fold in work.folds]
        left, predictions = work.flown(work.models(more, folds))
        stage, before = Stage(f"+ {label}", [label], left), found.stages[-1]
        if stage.total < before.total:
            found.taken[label], found.evidence[label] = before.total**2 - stage.total**2, evidence
            found.stages.append(stage)
            found.predictions, work.every.fitted = predictions, whole
            for fold, at in zip(work.folds, folds, strict=True):
                fold.fitted = at
            return label
    return None


def _concluded(work: _Stages, found: Staged, added: list[FreeParameter]) -> Staged:
    """What the fit to all runs says, with everything that was added."""
    fitting, fitted = work.fitting(work.every, added), work.every.fitted
    P, F = fitting.model(fitted.values)
    F[ef.BIAS : ef.BIAS + ef.N_BIASES] = 0.0
    sizes = sizes_of(fitting.free, fitted)
    first = len(fitting.free.free) - len(added)
    for n, one in enumerate(added):
        name = one.label or one.name
        own = one.name if one.label else catalogue()[name].parameters[0].name if name in catalogue() else "size"
        found.sizes.setdefault(name, {})[own] = sizes[first + n]
    said = by_readings.sizes(work.whole.findings)
    found.sizes |= {label: said[label] for label in work.whole.labels if label in said}
    found.vehicle = dict(zip(fitting.free.names[:first], sizes[:first], strict=True))
    found.selected = [*work.whole.labels, *(label for label in found.taken if label != GAUGE)]
    found.model, found.floor = (P, F), floor_of(work, P, F)
    return found


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
        low = max(found.values[n] - NINETY * sd[n], one.low)
        high = min(found.values[n] + NINETY * sd[n], one.high)
        at = one.moved(free.nominal[n], np.array([found.values[n], low, high]))
        sizes.append(Size(float(at[0]), (float(at[1]), float(at[2])), one.unit))
    return sizes
