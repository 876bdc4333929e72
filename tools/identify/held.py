"""Which vehicle is handed out: candidates judged by the gaps of flights left out of their fits (docs/GAP.md, Measures).

Candidates are the file's vehicle, the likelihood's fit and the prediction error's. The likelihood is efficient, and its
intervals are right, where the vehicle obeys equation (4): it is kept unless another flies runs left out better by more
than the runs' scatter allows. Nothing is handed out that flies them worse than the file does.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.data.runs.case import Case
from tools.data.runs.run import Run
from tools.gap.measure import RunGap, case_channels, root_mean_square
from tools.identify.fit import Fit, fit, fitting_of
from tools.identify.predict import model_of, predicted
from tools.inference.model import Model, effect_vector, nominal_model

MOST = 12  # runs that are predicted; of a longer case evenly chosen ones
FEW = 3  # runs, up to which the likelihood's fit is made anew without each
FOLDS = 4  # parts of the runs; the prediction error's fit is refined without each
REFINED = 5  # steps of that
SCATTER = 0.2  # of the logarithm of two candidates' gaps from run to run, before any run was seen: as much as one run
CLEAR = 2.0  # standard errors of its mean from which another candidate is better than the likelihood's fit
FILE, LIKELIHOOD, PREDICTION = "file", "likelihood", "prediction error"
EARLY = "the fit without the run, by one step from the fit with all"
ALONE = "a fit of the other runs alone"
ITSELF = "the run itself: there is no other"
PARTS = "a fit of the other parts of the runs alone"


@dataclass
class Candidate:
    """A vehicle that may be handed out, and how it flies runs that its fit has not seen."""

    name: str
    fit: Fit | None  # None: the file's vehicle
    how: str  # it was kept from seeing them
    gaps: list[RunGap]
    flown: list[np.ndarray]  # (rows, N_Y)

    @property
    def total(self) -> float:
        """Gap over the runs, in tolerances; infinite where it cannot fly them."""
        found = [gap.total for gap in self.gaps]
        return root_mean_square(found) if np.isfinite(found).all() else float("inf")

    def plain(self) -> dict[str, float]:
        return {"total": self.total, **case_channels(self.gaps)}


@dataclass
class Held:
    """Runs left out, every candidate's gaps there, and which was handed out."""

    runs: list[Run]
    candidates: list[Candidate]  # the file's first
    chosen: Candidate
    why: str

    @property
    def before(self) -> list[RunGap]:
        return self.candidates[0].gaps

    @property
    def after(self) -> list[RunGap]:
        return self.chosen.gaps

    def plain(self) -> dict[str, Any]:
        return {
            "before": self.candidates[0].plain(),
            "after": self.chosen.plain(),
            "runs": [
                {"run": run.name, "before": a.total, "after": b.total}
                for run, a, b in zip(self.runs, self.before, self.after, strict=True)
            ],
            "how": self.chosen.how,
            "handed_out": self.chosen.name,
            "why": self.why,
            "candidates": {one.name: one.plain() for one in self.candidates},
        }


def compared(one: Candidate, other: Candidate) -> tuple[float, float]:
    """By how much the logarithm of one's gap is less than the other's in a run, and the standard error of that."""
    pairs = [(a.total, b.total) for a, b in zip(one.gaps, other.gaps, strict=True)]
    # what cannot be flown at all is as far off as what is worst
    finite = [value for pair in pairs for value in pair if np.isfinite(value)]
    worst, least = max(finite, default=1.0), 1e-3
    a, b = (np.log(np.maximum(np.nan_to_num(column, nan=worst, posinf=worst), least)) for column in np.array(pairs).T)
    less = b - a
    scatter = SCATTER**2 + np.square(less - less.mean()).sum()
    return float(less.mean()), float(np.sqrt(scatter) / len(less))


def choose(candidates: list[Candidate]) -> tuple[Candidate, str]:
    """The one that is handed out, and why; candidates: the file's, then the likelihood's, then others."""
    file, chosen, *others = candidates
    why = "its fit is the most certain, and no other flies runs left out clearly better"
    for other in others:
        less, error = compared(other, chosen)
        if other.total < chosen.total and less > CLEAR * error:
            why = f"runs left out are flown better than by the {chosen.name}: {_apart(other, chosen)}"
            chosen = other
    less, error = compared(file, chosen)
    if file.total < chosen.total and less > error:
        why = f"nothing that was identified flies runs left out better: {_apart(file, chosen)}"
        chosen = file
    return chosen, why


def _apart(one: Candidate, other: Candidate) -> str:
    return f"{one.total:.2f} tolerances, not {other.total:.2f}"


def without(found: Fit, run: int) -> np.ndarray:
    """The most probable values without one of the runs, by one step from the fit with all."""
    assert found.at is not None
    of = np.broadcast_to(found.problem.run_of[:, None], found.problem.z.shape)[found.problem.valid]
    kept = np.flatnonzero(of == run)
    J, e = found.at.J[:, kept], found.at.e[kept]
    q, scale = found.quadratic, 1.0 / found.quadratic.heat
    normal = q.normal - scale * (J @ J.T)
    low = np.array([f.low for f in found.free.free])
    return np.maximum(q.at - np.linalg.solve(normal, q.slope - scale * (J @ e)), low)


class Judge:
    """Flies the runs that are left out."""

    def __init__(self, case: Case, model: Model, runs: list[Run], say: Callable[[str], None]):
        self.case, self.model, self.say = case, model, say
        self.all = runs
        recorded = {run.name: run for run in case.runs}  # with their spikes, as everybody measures them
        self.picked = np.unique(np.linspace(0, len(runs) - 1, min(MOST, len(runs))).astype(int)).tolist()
        self.runs = [recorded[runs[n].name] for n in self.picked]

    def candidate(self, name: str, fit: Fit | None, how: str, models: list[tuple[np.ndarray, np.ndarray]]) -> Candidate:
        """A candidate, flown in each run by the model that has not seen it."""
        found = [predicted(self.case, self.model, run, *one) for run, one in zip(self.runs, models, strict=True)]
        return Candidate(name, fit, how, [gap for gap, _ in found], [Y for _, Y in found])

    def others(self, left_out: list[int]) -> list[Run]:
        return [run for n, run in enumerate(self.all) if n not in left_out]

    def file(self) -> Candidate:
        """The vehicle that the case names."""
        nominal = nominal_model(self.case)
        models = [(nominal.P, effect_vector(nominal))] * len(self.runs)
        return self.candidate(FILE, None, "it has seen no run", models)

    def likelihood(self, found: Fit) -> Candidate:
        """The likelihood's fit."""
        if len(self.all) == 1:
            return self.candidate(LIKELIHOOD, found, ITSELF, [model_of(self.model, found.free, found.best)])
        if len(self.all) > FEW:
            models = [model_of(self.model, found.free, without(found, n)) for n in self.picked]
            return self.candidate(LIKELIHOOD, found, EARLY, models)
        models = []
        for n in self.picked:
            self.say(f"without {self.all[n].name}")
            other = fit(self.case, self.model, self.others([n]))
            models.append(model_of(self.model, other.free, other.best))
        return self.candidate(LIKELIHOOD, found, ALONE, models)

    def prediction(self, found: Fit) -> Candidate:
        """The prediction error's fit."""
        if len(self.all) == 1:
            return self.candidate(PREDICTION, found, ITSELF, [model_of(self.model, found.free, found.best)])
        folds = min(FOLDS, len(self.all))
        parts = [list(range(k, len(self.all), folds)) for k in range(folds)]
        by_part = []
        for left_out in parts:
            self.say(f"without {', '.join(self.all[n].name for n in left_out)}")
            fitting = fitting_of(self.case, self.model, self.others(left_out))
            by_part.append(model_of(self.model, found.free, fitting.again(found.best, REFINED).values))
        return self.candidate(PREDICTION, found, PARTS, [by_part[n % folds] for n in self.picked])


def judge(
    case: Case, model: Model, likelihood: Fit, prediction: Fit, say: Callable[[str], None] = lambda text: None
) -> Held:
    """All candidates, flown in runs that were left out, and which of them is handed out."""
    court = Judge(case, model, likelihood.problem.runs, say)
    candidates = [court.file(), court.likelihood(likelihood), court.prediction(prediction)]
    chosen, why = choose(candidates)
    return Held(court.runs, candidates, chosen, why)
