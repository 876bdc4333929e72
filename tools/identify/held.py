"""Which vehicle is handed out: candidates judged by the gaps of flights left out of their fits.

See docs/reference/gap.md, Measures.

Candidates are the file's vehicle, the likelihood's fit and the prediction error's. The likelihood is efficient, and its
intervals are right, where the vehicle obeys equation (4): it is kept unless another flies runs left out better by more
than the runs' scatter allows. Nothing is handed out that flies them worse than the file does.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import RunGap, root_mean_square, run_gap, with_total
from glider.tools.gap.regimes import ALL, gaps_by_regime
from glider.tools.identify.earned import CLEAR, mean_and_error, places, unearned
from glider.tools.identify.fit import IdentificationFit, as_fit, by_prediction, fit, fitting_of
from glider.tools.identify.predict import model_of, predicted
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.model import Model, effect_vector, nominal_model
from glider.tools.inference.predict import fly, observe
from glider.tools.inference.prediction_error import Fitted, PredictionError
from glider.tools.inference.problem import cut, problem_of

MAX_PREDICTED_RUNS = 12  # runs that are predicted; of a longer case evenly chosen ones
MAX_LEAVE_ONE_OUT_RUNS = 3  # runs, up to which the likelihood's fit is made anew without each
FOLDS = 4  # parts of the runs; the prediction error's fit is refined without each
REFIT_STEPS = 3  # steps of that
LEAST_GAP = 1e-3  # tolerances
SEED = 20261125
FILE, LIKELIHOOD, PREDICTION = "file", "likelihood", "prediction error"
EARLY = "the fit without the run, by one step from the fit with all"
ALONE = "a fit of the other runs alone"
ITSELF = "the run itself: there is no other"
PARTS = "a fit of the other parts of the runs alone"


@dataclass
class Candidate:
    """A vehicle that may be handed out, and how it flies runs that its fit has not seen."""

    name: str
    fit: IdentificationFit | None  # None: the file's vehicle
    how: str  # it was kept from seeing them
    gaps: list[RunGap]
    flown: list[np.ndarray]  # (rows, N_Y)

    @property
    def total(self) -> float:
        """Gap over the runs, in tolerances; infinite where it cannot fly them."""
        found = [gap.total for gap in self.gaps]
        return root_mean_square(found) if np.isfinite(found).all() else float("inf")

    def plain(self) -> dict[str, float]:
        return with_total(self.gaps) | {"total": self.total}


@dataclass
class HeldOut:
    """Runs left out, every candidate's gaps there, and which was handed out."""

    runs: list[Run]
    candidates: list[Candidate]  # the file's first
    chosen: Candidate
    why: str
    P: np.ndarray  # of the file's vehicle
    floor: Candidate | None = None  # what noise and disturbance would leave of the likelihood's fit

    @property
    def before(self) -> list[RunGap]:
        return self.candidates[0].gaps

    @property
    def after(self) -> list[RunGap]:
        return self.chosen.gaps

    def by_regime(self, one: Candidate) -> dict[str, dict[str, float]]:
        """A candidate's gaps by regime of flight and channel, `total` among them; ALL first."""
        listed = [ROUGHIE_MEASURES.windows(run.t) for run in self.runs]
        return gaps_by_regime(ROUGHIE_MEASURES, self.runs, one.flown, listed, self.P)

    @property
    def form(self) -> dict[str, Any]:
        """[form] of the vehicle that is handed out."""
        gaps = {
            regime: {name: float(f"{gap:.3g}") for name, gap in channels.items() if np.isfinite(gap)}
            for regime, channels in self.by_regime(self.chosen).items()
        }
        squares = np.log(np.maximum([gap.total for gap in self.after], LEAST_GAP) ** 2)
        scatter = float(squares.std(ddof=1)) if len(squares) > 1 else 0.0
        noise = 0.0 if self.floor is None else self.floor.total
        found = {"scatter": float(f"{scatter:.3g}"), "noise": float(f"{noise:.3g}")}
        return {"runs": len(self.runs), **found, "gaps": gaps}

    @property
    def worst(self) -> str:
        """Where what is handed out flies worst: the regime, and the channel there."""
        found = self.by_regime(self.chosen)
        regime = max((name for name in found if name != ALL), key=lambda name: found[name]["total"])
        channel = max((name for name in found[regime] if name != "total"), key=lambda name: found[regime][name])
        return f"{regime}, {channel}: {found[regime][channel]:.2f} tolerances"

    def plain(self) -> dict[str, Any]:
        before, after = self.by_regime(self.candidates[0]), self.by_regime(self.chosen)
        return {
            "before": self.candidates[0].plain(),
            "after": self.chosen.plain(),
            "regimes": {name: {"before": before[name], "after": after[name]} for name in after if name != ALL},
            "runs": [
                {"run": run.name, "before": a.total, "after": b.total}
                for run, a, b in zip(self.runs, self.before, self.after, strict=True)
            ],
            "how": self.chosen.how,
            "handed_out": self.chosen.name,
            "why": self.why,
            "candidates": {one.name: one.plain() for one in self.candidates},
            "floor": None if self.floor is None else self.floor.plain(),
        }


def compared(one: Candidate, other: Candidate) -> tuple[float, float]:
    """By how much the logarithm of one's gap is less than the other's in a run, and the standard error of that."""
    pairs = [(a.total, b.total) for a, b in zip(one.gaps, other.gaps, strict=True)]
    # what cannot be flown at all is as far off as what is worst
    finite = [value for pair in pairs for value in pair if np.isfinite(value)]
    worst, least = max(finite, default=1.0), 1e-3
    a, b = (np.log(np.maximum(np.nan_to_num(column, nan=worst, posinf=worst), least)) for column in np.array(pairs).T)
    return mean_and_error(b - a)


def clearly_better(one: Candidate, other: Candidate) -> bool:
    """Whether one flies runs left out better by more than their scatter allows."""
    less, error = compared(one, other)
    return one.total < other.total and less > CLEAR * error


def choose(candidates: list[Candidate]) -> tuple[Candidate, str]:
    """The one that is handed out, and why; candidates: the file's, then the likelihood's, then others."""
    file, chosen, *others = candidates
    why = "the likelihood's fit is the most certain, and none flies runs left out clearly better"
    for other in others:
        if clearly_better(other, chosen):
            why = f"flies runs left out better than the fit by {chosen.name}: {_apart(other, chosen)}"
            chosen = other
    less, error = compared(file, chosen)
    if file.total < chosen.total and less > error:
        why = f"no fit flies runs left out better than the vehicle file: {_apart(file, chosen)}"
        chosen = file
    return chosen, why


def _apart(one: Candidate, other: Candidate) -> str:
    return f"{one.total:.2f} tolerances, not {other.total:.2f}"


def without(found: IdentificationFit, run: int) -> np.ndarray:
    """The most probable values without one of the runs, by one step from the fit with all."""
    assert found.at is not None
    of = np.broadcast_to(found.problem.run_of[:, None], found.problem.z.shape)[found.problem.valid]
    kept = np.flatnonzero(of == run)
    J, e = found.at.J[:, kept], found.at.e[kept]
    q, scale = found.quadratic, 1.0 / found.quadratic.inflation
    normal = q.normal - scale * (J @ J.T)
    low = np.array([f.low for f in found.free.free])
    return np.maximum(q.at - np.linalg.solve(normal, q.slope - scale * (J @ e)), low)


class Judge:
    """Flies the runs that are left out."""

    def __init__(self, case: Case, model: Model, runs: list[Run], say: Callable[[str], None]):
        self.case, self.model, self.say = case, model, say
        self.all = runs
        recorded = {run.name: run for run in case.runs}  # with their spikes, as everybody measures them
        self.picked = np.unique(np.linspace(0, len(runs) - 1, min(MAX_PREDICTED_RUNS, len(runs))).astype(int)).tolist()
        self.runs = [recorded[runs[n].name] for n in self.picked]

    def candidate(
        self, name: str, fit: IdentificationFit | None, how: str, models: list[tuple[np.ndarray, np.ndarray]]
    ) -> Candidate:
        """A candidate, flown in each run by the model that has not seen it."""
        model = self.noise_matches_file(fit)
        found = [predicted(self.case, model, run, *one) for run, one in zip(self.runs, models, strict=True)]
        return Candidate(name, fit, how, [gap for gap, _ in found], [Y for _, Y in found])

    def noise_matches_file(self, fit: IdentificationFit | None) -> Model:
        """The model that the observer has: of a file of guesses its numbers as sure as a fit is of them."""
        if fit is None or not self.case.assumed:
            return self.model
        sigma = self.model.sigma.copy()
        for f, size in zip(fit.free.free, fit.free.alone(fit.quadratic.normal), strict=True):
            if f.vector == "P":
                sigma[f.entry] = min(sigma[f.entry], size)
        return replace(self.model, sigma=sigma)

    def others(self, left_out: list[int]) -> list[Run]:
        return [run for n, run in enumerate(self.all) if n not in left_out]

    def file(self) -> Candidate:
        """The vehicle that the case names."""
        nominal = nominal_model(self.case)
        models = [(nominal.P, effect_vector(nominal))] * len(self.runs)
        return self.candidate(FILE, None, "it has seen no run", models)

    def on_its_own(self, found: IdentificationFit) -> Candidate:
        """A fit in the runs that it was made of."""
        return self.candidate(
            LIKELIHOOD, found, ITSELF, [model_of(self.model, found.free, found.best)] * len(self.runs)
        )

    def likelihood(self, found: IdentificationFit) -> Candidate:
        """The likelihood's fit."""
        if len(self.all) == 1:
            return self.on_its_own(found)
        if len(self.all) > MAX_LEAVE_ONE_OUT_RUNS:
            models = [model_of(self.model, found.free, without(found, n)) for n in self.picked]
            return self.candidate(LIKELIHOOD, found, EARLY, models)
        models = []
        for n in self.picked:
            self.say(f"without {self.all[n].name}")
            other = fit(self.case, self.model, self.others([n]))
            models.append(model_of(self.model, other.free, other.best))
        return self.candidate(LIKELIHOOD, found, ALONE, models)

    def floor(self, found: IdentificationFit) -> Candidate:
        """What noise and disturbance of the file would leave: recordings that the fit simulates, flown by itself."""
        P, F = model_of(self.model, found.free, found.best)
        rng, gaps, flown = np.random.default_rng(SEED), [], []
        for run in self.runs:
            problem = problem_of(self.case, self.noise_matches_file(found), [run])
            starts = observe(problem, P, F).X[problem.recording.bounds[:-1]]
            Z = problem.simulated(P, F, starts, rng)
            Y = fly(replace(problem, z=Z), P, F)
            for onboard, mocap in problem.kind.doubled:  # a channel is motion capture's where nothing is onboard
                Z[:, onboard] = np.where(np.isnan(Z[:, onboard]), Z[:, mocap], Z[:, onboard])
            gaps.append(run_gap(problem.kind.measures, run, Y, cut(problem).listed[0], Z))
            flown.append(Y)
        return Candidate("noise", None, "simulated", gaps, flown)

    def prediction(self, likelihood: IdentificationFit, begin: dict[str, float] | None) -> Candidate:
        """The prediction error's fit, without the terms that are less probable to be there than not."""
        whole = by_prediction(self.case, self.model, likelihood, begin, self.say)
        count = min(FOLDS, len(self.all))
        parts = [list(range(k, len(self.all), count)) for k in range(count)]
        folds = [self.fold(part, whole.values) for part in parts]
        every = fitting_of(self.case, self.model, self.all)
        gone = unearned(whole, every)
        fitting, fitted = every, whole
        if gone:
            self.say(f"without {', '.join(name for term in gone for name in term)}")
            fitting = fitting_of(self.case, self.model, self.all, gone)
            fitted = fitting.again(self.kept(whole, every, gone), REFIT_STEPS)
            begins = [self.kept(fold, every, gone) for fold in folds]
            folds = [self.fold(part, values, gone) for part, values in zip(parts, begins, strict=True)]
        models = [model_of(self.model, fitting.free, fold.values) for fold in folds]
        found = as_fit(fitting, fitted, likelihood)
        return self.candidate(
            PREDICTION, found, PARTS if count > 1 else ITSELF, [models[n % count] for n in self.picked]
        )

    def fold(self, left_out: list[int], values: np.ndarray, gone: Sequence[tuple[str, ...]] = ()) -> Fitted:
        """The fit without a part of the runs, from values on; of a single run nothing can be left out."""
        kept = self.others(left_out) or self.all
        return fitting_of(self.case, self.model, kept, gone).again(values, REFIT_STEPS)

    @staticmethod
    def kept(found: Fitted, fitting: PredictionError, gone: list[tuple[str, ...]]) -> np.ndarray:
        """Values of what stays free without the terms that go."""
        at = places(fitting.free.names, gone)
        return np.delete(fitting.clipped(found.conditional(fitting.file_values, at)), at)


def judge(
    case: Case,
    model: Model,
    likelihood: IdentificationFit,
    begin: dict[str, float] | None,
    say: Callable[[str], None] = lambda text: None,
) -> HeldOut:
    """All candidates, flown in runs that were left out, and which of them is handed out.

    Without the prediction error's where the likelihood's fit flies its own runs as well as noise and disturbance allow:
    what it then lacks in others is data.
    """
    court = Judge(case, model, likelihood.problem.runs, say)
    candidates, floor = [court.file(), court.likelihood(likelihood)], court.floor(likelihood)
    if clearly_better(floor, court.on_its_own(likelihood)):
        candidates.append(court.prediction(likelihood, begin))
    chosen, why = choose(candidates)
    return HeldOut(court.runs, candidates, chosen, why, case.roughie.vector(), floor)
