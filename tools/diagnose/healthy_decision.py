"""What hypotheses against healthy runs come to: their weights, and the probability of each cause and of unknown."""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.diagnose.healthy_fits import Comparison, FreeForm, HealthyHypothesis
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.inference.hyperparameters import DIAGNOSIS, HEALTHY

# nat of log odds that a label is the change: hull and fittings keep their mass distribution and the water that they
# carry along, unless something is built in
SELDOM = dict.fromkeys(("inertia", "added_mass"), HEALTHY.seldom)
SHARES = np.linspace(0.005, 0.995, 100)  # of a change, in amplitude, that its label leaves
OWN_FORM = norm.pdf(SHARES, scale=HEALTHY.form_error) / norm.pdf(SHARES, scale=HEALTHY.form_error).sum()


@dataclass
class Weighed:
    """Hypotheses with their log weights: with nothing beside them, and with something unknown."""

    listed: list[HealthyHypothesis]
    alone: list[float]
    beside: list[float]

    def best(self, main: str) -> HealthyHypothesis:
        """The most probable one with a main cause, NONE or a label; of UNKNOWN the one that it is beside."""
        weights = np.array(self.beside if main == UNKNOWN else np.logaddexp(self.alone, self.beside))
        if main != UNKNOWN:
            weights[[(one.labels[0] if one.labels else NONE) != main for one in self.listed]] = -np.inf
        return self.listed[int(weights.argmax())]

    def certain(self, one: HealthyHypothesis) -> list[str]:
        """Labels of a hypothesis that are there whatever else is, by `selected_probability`."""
        weights = np.logaddexp(self.alone, self.beside)
        weights = np.exp(weights - logsumexp(weights))
        within = {label: sum(w for w, h in zip(weights, self.listed, strict=True) if label in h.labels)
                  for label in one.labels}  # fmt: skip
        return [label for label in one.labels if within[label] >= DIAGNOSIS.selected_probability]

    def links(self) -> dict[str, float]:
        """Probability that something unknown enters at a link of the chain, by link."""
        whole, found = float(logsumexp([*self.alone, *self.beside])), dict[str, float]()
        for one, beside in zip(self.listed, self.beside, strict=True):
            if one.form is not None:
                found[one.form.link] = found.get(one.form.link, 0.0) + float(np.exp(beside - whole))
        return found

    def probabilities(self) -> dict[str, float]:
        """Of none, of each label as the main cause, and of unknown."""
        whole = float(logsumexp([*self.alone, *self.beside]))
        found = {NONE: 0.0, UNKNOWN: 0.0}
        for one, alone, beside in zip(self.listed, self.alone, self.beside, strict=True):
            name = one.labels[0] if one.labels else NONE
            found[name] = found.get(name, 0.0) + float(np.exp(alone - whole))
            found[UNKNOWN] += float(np.exp(beside - whole))
        return found


def leftover(compared: Comparison, one: HealthyHypothesis) -> tuple[float, float]:
    """Log densities of what runs left out leave: where that is what healthy runs leave, and where it is more.

    What a label leaves is a share of the change, in amplitude: half-normal by `form_error` where the label is right,
    any from 0 to 1 where it stands in for something unknown.
    """
    healthy, scale = compared.healthy, compared.healthy.scale(len(one.left))
    at, usual = float(np.log(max(one.mean_square, 1e-9))), np.exp(healthy.level)
    if not one.labels:
        return healthy.unchanged(at, scale)
    away = (at - np.log(usual + SHARES**2 * max(compared.bare - usual, 0.0))) / scale
    nothing = float(logsumexp(healthy.at_most(away), b=OWN_FORM))
    return nothing, float(logsumexp(healthy.at(away), b=1.0 / len(SHARES)))


def form_share(compared: Comparison, one: HealthyHypothesis, free: HealthyHypothesis) -> float:
    """Of the change, in amplitude, what a free form takes beside a hypothesis."""
    change = max(compared.bare - free.mean_square, 1e-9)
    return float(np.sqrt(np.clip((one.mean_square - free.mean_square) / change, 0.0, 1.0)))


def weigh(compared: Comparison, listed: list[HealthyHypothesis]) -> Weighed:
    """The posterior's weights; what does not shrink the gap of runs left out is none.

    What healthy runs show of labels, too, is no change: of such fits, and of that without the labels, the most
    probable stands for what is left of the labels.
    """
    weights = dict[tuple[tuple[str, ...], FreeForm | None], tuple[float, float, HealthyHypothesis]]()
    nothing = listed[0]
    kept = [nothing, *(one for one in listed[1:] if one.mean_square < nothing.mean_square)]
    usual_ones = [other for one in kept if one.form is None for other in compared.without_change(one)]
    for one in [*kept, *usual_ones]:
        strange = HEALTHY.stands_in if one.labels else HEALTHY.unexplained
        usual, more = leftover(compared, one)
        usual, more = usual + float(np.log1p(-strange)), more + float(np.log(strange))
        at, either = compared.nat(one) + one.as_usual, float(np.logaddexp(usual, more))
        if one.form is not None:
            at += one.form.prior
        if one.form is not None and not one.labels:
            named = float(np.log(HEALTHY.changed * HEALTHY.unexplained))
            weights[one.labels, one.form] = -np.inf, at + named + either, one
            continue
        odds = np.log(HEALTHY.changed / len(compared.places))
        at += float(len(one.labels) * odds if one.labels else np.log1p(-HEALTHY.changed))
        seldom = sum(SELDOM.get(label, 0.0) for label in one.labels)  # what stands in for something unknown may be any
        if one.form is not None:  # its label's own form, or something unknown
            label = next(other for other in kept if other.labels == one.labels and other.form is None)
            share = form_share(compared, label, one)
            own = norm.logpdf(share, scale=HEALTHY.form_error) + np.log(2.0 * (1.0 - HEALTHY.stands_in))
            other = np.log(HEALTHY.stands_in)
            more = float(np.logaddexp(usual + other, more))
            usual += float(own)
        usual += seldom
        before = weights.get((one.labels, one.form))
        if before is None or np.logaddexp(*before[:2]) < at + np.logaddexp(usual, more):
            weights[one.labels, one.form] = at + usual, at + more, one
    alone, beside, those = (list(column) for column in zip(*weights.values(), strict=True))
    return Weighed(those, alone, beside)
