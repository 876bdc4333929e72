"""Which effects all runs of a case share: the most evident first, each fitted.

See docs/explanation/ocean.md, Diagnosis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glider.tools.diagnose.materiality import largest
from glider.tools.inference.expansion import Expansion
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.hyperparameters import DIAGNOSIS, WATCH
from glider.tools.inference.predict import fly_windows_from
from glider.tools.inference.problem import Problem
from glider.tools.inference.shared_model import About, fit_shared, misfit
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.events import STEP, Change, Joint, Span

MOST_EFFECTS = 3
MAX_FITTED_LABELS = 4  # labels that are fitted at most before one is taken
PARABOLA_SHARE = 0.5  # of the most evident parabola's: far from where they were taken parabolas may be wrong by so much
REFITS, CONVERGED_GAIN = 4, 1.0  # times that a fit is taken up again, while it brings so much squared sigma
STEP_SHARES = (0.5, 0.2)  # of the step that parabolas promise, from which a fit begins where the whole leads too far
Model = tuple[np.ndarray, np.ndarray]


@dataclass
class Whole:
    """A model of all runs, fitted: what the vehicle file allows, and effects."""

    shared: SharedParameters  # the effects' entries are free as the file's are
    x: np.ndarray  # (count,) spreads
    labels: list[str]
    cost: float  # -2 log likelihood over the variance inflation, and the prior's
    about: list[Expansion]  # run by run

    def without(self, label: str) -> np.ndarray:
        """Its values with one effect taken out, all else as fitted."""
        x = self.x.copy()
        x[self.shared.labels[label]] = 0.0
        return x


@dataclass
class Round:
    """What every label is worth beside the effects that were found before."""

    before: Whole
    changes: dict[str, Change]
    evidence: dict[str, float]  # nat over no such effect; of those that were fitted, by their fit
    fitted: dict[str, Whole]
    moved: float = 0.0  # tolerances by which the best one moves a channel of a window

    @property
    def best(self) -> str:
        return max(self.fitted, key=lambda label: self.evidence[label])


@dataclass
class SelectionResult:
    """The search's end: the model, and the rounds that led to it."""

    model: Whole
    rounds: list[Round] = field(default_factory=list)

    @property
    def main(self) -> Round:
        """The round that tells the main effect from its rivals: of that which is most evident."""
        taken = [one for one in self.rounds if one.best in self.model.labels]
        return max(taken, key=lambda one: one.evidence[one.best], default=self.rounds[0])


def cost_of(parts: Sequence[Problem], shared: SharedParameters, x: np.ndarray, inflation: float) -> float:
    """-2 log likelihood of all runs over the variance inflation, and the prior's."""
    return misfit(parts, shared, x, 1.0) / inflation + float(x @ (x / shared.prior**2))


def whole_model(
    parts: Sequence[Problem], shared: SharedParameters, x: np.ndarray, inflation: float, labels: Sequence[str] = (),
    about: About | None = None,
) -> Whole:  # fmt: skip
    """The model of all runs fitted from x, until a fit brings no more."""
    cost, about = cost_of(parts, shared, x, inflation), About(parts, shared) if about is None else about
    for _ in range(REFITS):
        tried = fit_shared(parts, shared, x, inflation, about)
        found = cost_of(parts, shared, tried, inflation)
        gained = cost - found
        if gained > 0.0:
            x, cost = tried, found
        if gained < CONVERGED_GAIN:
            break
    return Whole(shared, x, list(labels), cost, about(x))


def with_effect(parts: Sequence[Problem], model: Whole, change: Change, inflation: float) -> Whole:
    """The model with one effect more, fitted from what the parabolas promise of it and of all else beside it."""
    own = set(model.shared.labels[change.label])
    free = [replace(one, label="") if k in own else one for k, one in enumerate(model.shared.free)]
    shared = replace(model.shared, free=free)
    weight = np.diag(shared.prior**-2.0)
    normal = sum(one.curvature for one in model.about) / inflation + weight
    slope = sum(one.slope for one in model.about) / inflation + weight @ model.x
    low, high = np.minimum(shared.low - model.x, 0.0), np.maximum(shared.high - model.x, 0.0)
    step = bounded_step(normal, slope, low, high)
    alone = np.zeros_like(step)
    alone[model.shared.labels[change.label]] = change.size
    starts = [
        np.clip(model.x + one, shared.low, shared.high) for one in (step, *(k * step for k in STEP_SHARES), alone)
    ]
    start = min(starts, key=lambda x: cost_of(parts, shared, x, inflation))
    return whole_model(parts, shared, start, inflation, [*model.labels, change.label])


def confounded(model: Whole, label: str) -> bool:
    """Whether a label moves the readings as an effect of the model does, or is that: it is none beside it."""
    A = np.array(sum(one.curvature for one in model.about))
    for own in model.labels:
        a, b = model.shared.labels[own], model.shared.labels[label]
        sizes = np.sqrt(np.outer(np.diag(A)[a], np.diag(A)[b]))
        if own == label or (np.abs(A[np.ix_(a, b)]) > WATCH.same_cosine * sizes).all():
            return True
    return False


def one_round(parts: Sequence[Problem], model: Whole, inflation: float) -> Round:
    """Every label over all runs by their parabolas; the most evident ones fitted, until the next is far behind."""
    joint = Joint(model.shared, [one.tempered(inflation) for one in model.about], [])
    listed = [one for one in joint.changes([Span(0, len(parts), STEP)]) if not confounded(model, one.label)]
    listed.sort(key=lambda one: -one.evidence)
    found = Round(model, {one.label: one for one in listed}, {one.label: one.evidence for one in listed}, {})
    for change in listed[:MAX_FITTED_LABELS]:
        near = (
            min(PARABOLA_SHARE * listed[0].evidence, found.evidence[found.best] - DIAGNOSIS.confounded_evidence)
            if found.fitted
            else -np.inf
        )
        if found.fitted and change.evidence < max(near, 0.0):
            break
        fit = found.fitted[change.label] = with_effect(parts, model, change, inflation)
        found.evidence[change.label] = change.evidence - change.gain + 0.5 * (model.cost - fit.cost)
    most = found.evidence[found.best]
    for label in set(found.changes) - set(found.fitted):  # a parabola predicts too much far from where it was taken
        found.evidence[label] = min(found.evidence[label], most)
    found.moved = moved_by(parts, found.fitted[found.best], found.best)
    return found


def moved_by(parts: Sequence[Problem], model: Whole, label: str) -> float:
    """The largest rms, in tolerances, by which an effect moves a channel of a window: with it and without, all else
    alike, as materiality.movements has it.
    """
    found = 0.0
    for part in parts:
        P, F = model.shared.model(part, model.x)
        gains = part.filter(P, F)
        other = fly_windows_from(part, *model.shared.model(part, model.without(label)), gains)
        found = max(found, largest(part, fly_windows_from(part, P, F, gains), other))
    return found


def evidence_beside(model: Whole, label: str, inflation: float) -> float:
    """Nat of an effect of a model over its lack, everything else free, by the parabolas about the model."""
    columns = model.shared.labels[label]
    normal = sum(one.curvature for one in model.about) / inflation + np.diag(model.shared.prior**-2.0)
    precision = np.linalg.inv(np.linalg.inv(normal)[np.ix_(columns, columns)])
    size = model.x[columns]
    weighed = 0.5 * float(size @ precision @ size) - 0.5 * float(np.linalg.slogdet(precision)[1])
    return weighed + model.shared.odds.get(label, 0.0)


def forward_select(parts: Sequence[Problem], start: Whole, inflation: float) -> SelectionResult:
    """Effects added while they are evident and matter; one that those behind it make needless goes again.

    What cannot be distinguished from an effect is none beside it.
    """
    selection, material = SelectionResult(start), parts[0].kind.material
    while len(selection.model.labels) < MOST_EFFECTS:
        found = one_round(parts, selection.model, inflation)
        selection.rounds.append(found)
        if found.evidence[found.best] < DIAGNOSIS.evidence_needed or found.moved < material:
            break
        selection.model = found.fitted[found.best]
        before = {one: evidence_beside(selection.model, one, inflation) for one in found.before.labels}
        weakest = min(before, key=lambda label: before[label], default="")
        if weakest and before[weakest] < DIAGNOSIS.evidence_needed:
            selection.model = refit_without(parts, selection.model, weakest, inflation)
            break
    return selection


def refit_without(parts: Sequence[Problem], model: Whole, label: str, inflation: float) -> Whole:
    """The model without one of its effects, fitted."""
    own = set(model.shared.labels[label])
    free = [replace(one, label=label) if k in own else one for k, one in enumerate(model.shared.free)]
    kept = [one for one in model.labels if one != label]
    return whole_model(parts, replace(model.shared, free=free), model.without(label), inflation, kept)
