"""Diagnosis against healthy runs of the same vehicle: what do a case's runs do that the healthy ones do not?

The vehicle file is one that was identified, and misses healthy runs by what its form cannot do. How far, channel by
channel, is learned from healthy runs, each flown by a fit to the others; the case's windows are then weighed in units
of that (docs/explanation/against-healthy.md). Every hypothesis is fitted without each of the case's runs and judged on
that run, so that an effect has to shrink what it has not seen:

- no change: what the vehicle file allows;
- a label's parameters beside that, one label or a few;
- an error of free form at one link of the chain, in a label's place: unknown;
- the same beside the best label, and what runs leave beyond healthy ones: the label's own form, as far as it is small
  beside what the label takes, else unknown.
"""

from collections.abc import Callable, Iterable, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp
from scipy.stats import norm

from glider.firmware.model.vehicle import FormTable
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.correction import free_of
from glider.tools.diagnose.held_out import HeldOutWindows, Linearised
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.diagnose.sensor_consistency import inconsistent_sensors
from glider.tools.gap.corrected import submerged
from glider.tools.gap.regimes import ALL
from glider.tools.inference.channels import recorded
from glider.tools.inference.corrected import LINKS
from glider.tools.inference.healthy_level import CHANGED, FORM, USUAL_SCATTER, HealthyLevel
from glider.tools.inference.model import effect_vector
from glider.tools.inference.parameters import CLOCK_PLACE, FreeParameter, effect_parameters, nuisance_parameters
from glider.tools.inference.pooled import Pooled, log_prior
from glider.tools.inference.problem import Problem, problem_of

CAUSE = "cause"
STRANGE = 0.15  # prior probability that something is left where nothing is named
STANDS_IN = 0.25  # of a label that it stands in for something unknown: so many changes no label is for
LEAST_SCALE = 0.05  # tolerances
TOTAL = "total"
REFIT_STEPS, REFIT_FURTHER, MAX_EFFECTS = 6, 4, 3  # labels fitted in full at first, beside others, and effects at most
REFIT_FORMS, MAX_SHAPES = 2, 3  # free forms fitted in full, and shapes of each at most
# nat of log odds that a label is the change: hull and fittings keep their mass distribution and the water that they
# carry along, unless something is built in
SELDOM = {"inertia": -2.0, "added_mass": -2.0}
FAR = (-2.0, 2.0)  # sigma of a label's prior, from which its fit begins where that is better than the step from 0
SHARES = np.linspace(0.005, 0.995, 100)  # of a change, in amplitude, that its label leaves
OWN_FORM = norm.pdf(SHARES, scale=FORM) / norm.pdf(SHARES, scale=FORM).sum()
FILE_ERROR = 0.2  # of a label's prior, 1 sigma that the vehicle file is off by, before healthy runs say more
FILE_ERRORS = np.geomspace(0.02, 2.0, 41)
CONFOUNDED_NAT = 6.0  # nat within which labels are not distinguished
SELECTED_PROBABILITY = 0.9  # probability of a label that is selected beside something unknown


@dataclass(frozen=True)
class AsUsual:
    """What the vehicle file is off by, as a label's parameters: normal, in units of their priors."""

    mean: np.ndarray  # (k,)
    covariance: np.ndarray  # (k, k)

    @classmethod
    def learned(cls, precision: np.ndarray, score: np.ndarray) -> "AsUsual":
        """From what healthy runs say, precision (k, k) and score (k,): the variance is the most probable one with an
        inverse gamma prior about FILE_ERROR squared, worth one observation."""
        one = np.eye(len(score))

        def log_posterior(size: float) -> float:
            evidence = prior_evidence(precision, score, 0.0 * score, size**2 * one)
            return evidence + float(log_prior(size**2, FILE_ERROR**2))

        size = max(FILE_ERRORS, key=log_posterior)
        covariance = np.linalg.inv(precision + one / size**2)
        return cls(covariance @ score, covariance)


def prior_evidence(precision: np.ndarray, score: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Of a normal prior, mean (k,) and covariance (k, k); precision (k, k) and score (k,) of the likelihood about 0."""
    score = score - precision @ mean
    return Pooled(precision, score, -float(mean @ (2.0 * score + precision @ mean)), covariance).log_evidence()


@dataclass
class Healthy(HealthyLevel):
    """What healthy runs leave: by channel in tolerances, and the logarithm of a run's mean square in those units."""

    scales: dict[str, float] = field(default_factory=dict)
    runs: list[str] = field(default_factory=list)  # empty where the vehicle file alone says it
    usual: dict[str, AsUsual] = field(default_factory=dict)  # by label


def learn(case: Case, runs: list[Run]) -> Healthy:
    """Every healthy run flown by what the vehicle file allows, fitted to the others.

    Where the vehicle was identified from these runs they are held too well: [form] has the gaps of runs left out.
    """
    problem = problem_of(case, runs=runs)
    free = nuisance_parameters(problem)
    scales = dict[str, float]()
    form = case.roughie.form.gaps[ALL] if case.roughie.form is not None else {}
    values = np.zeros(len(free))
    for _ in range(2):  # first in tolerances, then in what the first found
        windows = HeldOutWindows(problem, free, scales)
        found = windows.left_out(values)
        values = found.values
        measured = np.sqrt(found.channels)
        scales = {
            channel.name: max(float(one) * scales.get(channel.name, 1.0), form.get(channel.name, 0.0), LEAST_SCALE)
            for channel, one in zip(windows.channels, measured, strict=True)
        }
    run_of, _ = windows.origins(windows.cuts[0])
    share = np.array([np.mean(run_of == n) for n in range(len(runs))])
    logs = np.log(np.maximum(found.runs / share, 1e-6))
    level, scatter = float(np.log(np.exp(logs).mean())), float(logs.std(ddof=1)) if len(logs) > 1 else USUAL_SCATTER
    healthy = Healthy(len(runs), level, scatter, scales, [run.name for run in runs])
    places, every = with_labels(problem, free)
    windows = HeldOutWindows(problem, every, scales, healthy.independent * len(runs))
    at = windows.linearised(windows.clipped(np.pad(found.values, (0, len(every) - len(free)))))
    weight = windows.independent(windows.cuts) / max(float(at.value.sum()), 1.0)
    nuisance = np.arange(len(free))
    for label, own in places.items():
        precision, score = at.information(nuisance, own, weight)
        healthy.usual[label] = AsUsual.learned(precision, score)
    return healthy


def with_labels(problem: Problem, nuisance: list[FreeParameter]) -> tuple[dict[str, np.ndarray], list[FreeParameter]]:
    """Places of each label's parameters behind the nuisance parameters, and all parameters."""
    free, places = list(nuisance), dict[str, np.ndarray]()
    for label, own in effect_parameters(problem).items():
        places[label] = np.arange(len(free), len(free) + len(own))
        free += own
    return places, free


def of_form(form: FormTable) -> Healthy:
    """The same as identification wrote it into the vehicle file."""
    scales = {name: max(gap, LEAST_SCALE) for name, gap in form.gaps[ALL].items() if name != TOTAL}
    return Healthy(form.runs, 0.0, form.scatter, scales)


@dataclass(frozen=True)
class FreeForm:
    """An error at a link of the chain that no label describes: a sum of a few of the corrections' shapes."""

    link: str
    shapes: tuple[str, ...]

    @property
    def free(self) -> list[FreeParameter]:
        """Its coefficients."""
        return [one for one in free_of(self.link) if one.name in self.shapes]

    @property
    def prior(self) -> float:
        """Log probability of this link and of these shapes: all links, and all shapes, are as likely."""
        return -float(np.log(len(LINKS)) + len(self.shapes) * np.log(ef.N_SHAPES))

    def __str__(self) -> str:
        return f"{UNKNOWN} at {self.link} with {' and '.join(self.shapes)}"


@dataclass
class HealthyHypothesis:
    """Labels beside what the vehicle file allows, fitted to the case's runs; and an error of free form."""

    labels: tuple[str, ...]
    values: np.ndarray  # (n,) of every free parameter, those of other labels 0
    left: np.ndarray  # (runs,) mean squares of runs left out, their sum a mean over channels and runs
    others: np.ndarray  # (runs, n) values without each run
    sigma: np.ndarray  # (n,) posterior standard deviations, 0 of what is not free
    form: FreeForm | None = None
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # of the labels' parameters, one by one
    as_usual: float = 0.0  # log evidence of labels that are as healthy runs have them, no change, over their change

    @property
    def name(self) -> str:
        """Its labels and its error of free form."""
        return ", ".join([*self.labels, *([str(self.form)] if self.form else [])]) or NONE

    @property
    def mean_square(self) -> float:
        """Of runs left out, in units of what healthy runs leave."""
        return float(self.left.sum())


@dataclass
class Comparison:
    """A case's runs beside what healthy ones leave."""

    problem: Problem
    healthy: Healthy
    free: list[FreeParameter]
    places: dict[str, np.ndarray]  # of each label's parameters in `free`
    nuisance: np.ndarray
    windows: HeldOutWindows = field(init=False)
    bare: float = 1.0  # mean square of runs left out without a change

    def __post_init__(self) -> None:
        self.windows = self.windows_of(self.free)

    @cached_property
    def far_clocks(self) -> dict[str, tuple[int, float]]:
        """By label of motion capture's clock that reconciles poses and readings far from 0: which parameter, and where,
        in sigma of its prior."""
        clocks = {
            label: [self.free[k] for k in own]
            for label, own in self.places.items()
            if catalogue()[label].place == CLOCK_PLACE
        }
        found = inconsistent_sensors(self.problem, [self.free[k] for k in self.nuisance], clocks) if clocks else []
        return {one.label: (self.free.index(one), far) for one, far in found}

    def columns_of(self, labels: Iterable[str]) -> np.ndarray:
        """Places of what is free under labels."""
        return np.concatenate([self.nuisance, *(self.places[label] for label in labels)])

    @property
    def independent(self) -> float:
        """Independent residuals of the case's runs."""
        return self.windows.independent(self.windows.cuts)

    def weight(self, mean_square: float) -> float:
        """Of a mean square of 1: as many independent residuals, of what is there where that is more than usual."""
        return self.independent / max(mean_square, 1.0)

    def windows_of(self, free: list[FreeParameter], form: FreeForm | None = None) -> HeldOutWindows:
        """Windows with what is free, and behind it the coefficients of a free form."""
        problem, healthy = self.problem, self.healthy
        if form is not None:
            F = effect_vector(problem.model)
            F[ef.LINK] = 1.0 + LINKS.index(form.link)
            problem, free = replace(problem, model=replace(problem.model, F=F)), [*free, *form.free]
        return HeldOutWindows(problem, free, healthy.scales, healthy.independent * len(problem.runs))

    def fitted(self, labels: tuple[str, ...], begin: np.ndarray, form: FreeForm | None = None) -> HealthyHypothesis:
        """Labels, and a free form, led from values (n,) to where they are most probable."""
        places = self.columns_of(labels)
        own = self.windows_of([self.free[k] for k in places], form)
        found = own.left_out(np.concatenate([begin[places], np.zeros(len(own.low) - len(places))]))
        known, count = slice(len(places)), len(self.free)  # the coefficients of a free form are none of the answer
        values, others, sd = np.zeros(count), np.zeros((len(found.runs), count)), np.zeros(count)
        values[places], others[:, places] = found.values[known], found.others[:, known]
        covariance = np.linalg.inv(found.precision)
        sd[places] = np.sqrt(np.diag(covariance))[known]
        of_labels = slice(len(self.nuisance), len(places))
        return HealthyHypothesis(labels, values, found.runs, others, sd, form, covariance[of_labels, of_labels])

    def last_as_usual(self, one: HealthyHypothesis) -> float:
        """Log predictive density of a hypothesis without a form, its last label as healthy runs show it."""
        without = [self.nat(other) + other.as_usual for other in self.without_change(one)
                   if other.labels == one.labels[:-1]]  # fmt: skip
        return max(without, default=-np.inf)

    def without_change(self, one: HealthyHypothesis) -> list[HealthyHypothesis]:
        """The same fit, some of its labels or all as healthy runs show them: no change of those."""
        found = list[HealthyHypothesis]()
        label_of = np.repeat(one.labels, [len(self.places[label]) for label in one.labels])
        values = [one.values[self.places[label]] for label in one.labels]
        for count in range(1, len(one.labels) + 1):
            for usual in combinations([label for label in one.labels if label in self.healthy.usual], count):
                own = np.flatnonzero(np.isin(label_of, usual))
                inverse = np.linalg.inv(one.covariance[np.ix_(own, own)])
                precision, score = inverse - np.eye(len(own)), inverse @ np.concatenate(values)[own]
                known = [self.healthy.usual[label] for label in one.labels if label in usual]
                mean, covariance = np.concatenate([k.mean for k in known]), block_diag(*(k.covariance for k in known))
                gain = prior_evidence(precision, score, mean, covariance)
                gain -= prior_evidence(precision, score, 0.0 * mean, np.eye(len(own)))
                rest = tuple(label for label in one.labels if label not in usual)
                found.append(replace(one, labels=rest, as_usual=gain))
        return found

    def free_forms(self, begin: HealthyHypothesis) -> list[FreeForm]:
        """Errors of free form beside a hypothesis, those that promise most first: at each link shapes are added while
        they bring more than the choice among them costs."""
        places, found = self.columns_of(begin.labels), []
        own = self.windows_of([self.free[k] for k in places])
        values = own.clipped(begin.values[places])
        n, gains = len(values), own.gains(values)
        bare = own.linearised(values, gains)
        for link in LINKS:
            shapes = [one.name for one in free_of(link)]
            whole = self.windows_of([self.free[k] for k in places], FreeForm(link, tuple(shapes)))
            start = np.concatenate([values, np.zeros(len(shapes))])
            at = Linearised.gathered(start, whole, whole.further_columns(start, bare.columns, gains))
            chosen, best = list[int](), self.expected(bare, np.arange(n), begin)[0]
            while len(chosen) < MAX_SHAPES:
                tried = []
                for k in set(range(len(shapes))) - set(chosen):
                    free = np.concatenate([np.arange(n), n + np.array([*chosen, k])])
                    tried.append((self.expected(at, free, begin)[0], k))
                nat, k = max(tried)
                if nat - np.log(ef.N_SHAPES) <= best:
                    break
                chosen, best = [*chosen, k], nat - float(np.log(ef.N_SHAPES))
            if chosen:
                found.append((best, FreeForm(link, tuple(shapes[k] for k in chosen))))
        return [form for _, form in sorted(found, key=lambda one: -one[0])]

    def expected(self, at: Linearised, free: np.ndarray, begin: HealthyHypothesis) -> tuple[float, np.ndarray]:
        """Log evidence of what is free, by one linear step from a hypothesis, and where that step leads."""
        objective, occam, step = at.expected(free, self.weight(begin.mean_square))
        return self.nat_of(objective) - occam, at.values + step

    def expected_labels(self, begin: HealthyHypothesis) -> list[tuple[float, str, np.ndarray]]:
        """Labels beside a hypothesis, the most probable first: log evidence, label, values to begin a fit from.

        The evidence is that of one linear step or, where the misfit is smaller there, of a parameter far from 0 as it
        is: a rate limit does nothing until it is reached, and a fit from 0 rests before. A fit begins where the misfit
        is least: at the step's end, far from 0, or where the hypothesis stands; with a clock far out (`far_clocks`) by
        an observer of its own, no other sees the poses in their place.
        """
        values = self.windows.clipped(begin.values)
        gains = self.windows.gains(values)
        at, weight = self.windows.linearised(values, gains), self.weight(begin.mean_square)
        places = {label: own for label, own in self.places.items() if label not in begin.labels}
        foreseen = {label: at.expected(self.columns_of((*begin.labels, label)), weight) for label in places}
        starts = {
            label: [values, self.windows.clipped(values + foreseen[label][2]),
                    *(self.windows.clipped(values + far * np.eye(1, len(values), k)[0]) for k in own for far in FAR)]
            for label, own in places.items()
        }  # fmt: skip
        points = [point for of_label in starts.values() for point in of_label]
        squares = iter(self.windows.squares(points, gains).sum(axis=(1, 2)))
        found = []
        for label, of_label in starts.items():
            there = [float(next(squares) + point @ point / weight) for point in of_label]
            if label in self.far_clocks:
                k, far = self.far_clocks[label]
                of_label.append(self.windows.clipped(values + (far - values[k]) * np.eye(1, len(values), k)[0]))
                own = self.windows.squares(of_label[-1:], self.windows.gains(of_label[-1]))
                there.append(float(own.sum() + of_label[-1] @ of_label[-1] / weight))
            objective, occam, _ = foreseen[label]
            best = min(objective, *there[2:])
            found.append((self.nat_of(best) - occam, label, of_label[int(np.argmin(there))]))
        return sorted(found, key=lambda one: -one[0])

    def nat(self, one: HealthyHypothesis) -> float:
        """Log predictive density of runs left out, their scale known from so many healthy runs only."""
        return self.nat_of(one.mean_square)

    def nat_of(self, mean_square: float) -> float:
        """The same of a mean square of runs left out."""
        count, freedom = self.independent, self.healthy.freedom
        return -0.5 * (freedom + count) * float(np.log1p(count * max(mean_square, 1e-9) / freedom))

    def leftover(self, one: HealthyHypothesis) -> tuple[float, float]:
        """Log densities of what runs left out leave: where that is what healthy runs leave, and where it is more.

        What a label leaves is a share of the change, in amplitude: half-normal by FORM where the label is right, any
        from 0 to 1 where it stands in for something unknown.
        """
        healthy, scale = self.healthy, self.healthy.scale(len(one.left))
        at, usual = float(np.log(max(one.mean_square, 1e-9))), np.exp(healthy.level)
        if not one.labels:
            return healthy.unchanged(at, scale)
        away = (at - np.log(usual + SHARES**2 * max(self.bare - usual, 0.0))) / scale
        nothing = float(logsumexp(healthy.at_most(away), b=OWN_FORM))
        return nothing, float(logsumexp(healthy.at(away), b=1.0 / len(SHARES)))

    def share(self, one: HealthyHypothesis, free: HealthyHypothesis) -> float:
        """Of the change, in amplitude, what a free form takes beside a hypothesis."""
        change = max(self.bare - free.mean_square, 1e-9)
        return float(np.sqrt(np.clip((one.mean_square - free.mean_square) / change, 0.0, 1.0)))


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
        """Labels of a hypothesis that are there whatever else is, by SELECTED_PROBABILITY."""
        weights = np.logaddexp(self.alone, self.beside)
        weights = np.exp(weights - logsumexp(weights))
        within = {label: sum(w for w, h in zip(weights, self.listed, strict=True) if label in h.labels)
                  for label in one.labels}  # fmt: skip
        return [label for label in one.labels if within[label] >= SELECTED_PROBABILITY]

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
        strange = STANDS_IN if one.labels else STRANGE
        usual, more = compared.leftover(one)
        usual, more = usual + float(np.log1p(-strange)), more + float(np.log(strange))
        at, either = compared.nat(one) + one.as_usual, float(np.logaddexp(usual, more))
        if one.form is not None:
            at += one.form.prior
        if one.form is not None and not one.labels:
            weights[one.labels, one.form] = -np.inf, at + float(np.log(CHANGED * STRANGE)) + either, one
            continue
        at += float(len(one.labels) * np.log(CHANGED / len(compared.places)) if one.labels else np.log1p(-CHANGED))
        seldom = sum(SELDOM.get(label, 0.0) for label in one.labels)  # what stands in for something unknown may be any
        if one.form is not None:  # its label's own form, or something unknown
            label = next(other for other in kept if other.labels == one.labels and other.form is None)
            share = compared.share(label, one)
            own, other = norm.logpdf(share, scale=FORM) + np.log(2.0 * (1.0 - STANDS_IN)), np.log(STANDS_IN)
            more = float(np.logaddexp(usual + other, more))
            usual += float(own)
        usual += seldom
        before = weights.get((one.labels, one.form))
        if before is None or np.logaddexp(*before[:2]) < at + np.logaddexp(usual, more):
            weights[one.labels, one.form] = at + usual, at + more, one
    alone, beside, those = (list(column) for column in zip(*weights.values(), strict=True))
    return Weighed(those, alone, beside)


def hypotheses(compared: Comparison, say: Callable[[str], None]) -> list[HealthyHypothesis]:
    """No change, the labels that promise most, and further ones beside the best while they bring more than chance."""
    nothing = compared.fitted((), np.zeros(len(compared.free)))
    compared.bare = nothing.mean_square
    say(f"no change: {nothing.mean_square:.2f} times what healthy runs leave")
    odds, listed, best = float(np.log(CHANGED / len(compared.places))), [nothing], nothing
    while len(best.labels) < MAX_EFFECTS:
        likely = compared.expected_labels(best)[: REFIT_FURTHER if best.labels else REFIT_STEPS]
        found = [compared.fitted((*best.labels, label), values) for _, label, values in likely]
        listed += found
        bare = compared.nat(best)
        changes = [one for one in found if compared.nat(one) + odds > max(bare, compared.last_as_usual(one))]
        if not changes:
            break
        best = max(changes, key=compared.nat)
        say(f"{', '.join(best.labels)}: {best.mean_square:.2f} times")
    for one in [nothing, best] if best.labels else [nothing]:
        for form in compared.free_forms(one)[:REFIT_FORMS]:
            free = compared.fitted(one.labels, one.values, form)
            if free.mean_square < one.mean_square:
                listed.append(free)
                say(f"{free.name}: {free.mean_square:.2f} times")
    return listed


def as_the_case_sees(run: Run, case: Case) -> Run:
    """A healthy run with those readings alone that some of the case's runs have: what it leaves is what these show."""
    there: Set[str] = {name for one in case.runs for name in one.columns if recorded(one, name)}
    kept = {name: values for name, values in run.columns.items() if name in there or name not in columns.KNOWN}
    return replace(run, columns=kept)


@dataclass
class AgainstHealthy:
    """What was found of a case."""

    compared: Comparison
    healthy: Healthy
    verdict: str
    probabilities: dict[str, float]
    group: list[str]  # labels that the runs do not tell from the main one, itself first
    selected: list[str]
    nothing: HealthyHypothesis
    best: HealthyHypothesis
    evidence: dict[str, float]  # nat over no change
    left: dict[str, float]  # by hypothesis, the mean square of runs left out over what healthy runs leave
    links: dict[str, float]  # probability of something unknown at a link of the chain

    @property
    def case(self) -> Case:
        return self.compared.problem.case


def diagnose_against_healthy(
    case: Case, reference: Case | None, say: Callable[[str], None] = lambda text: None
) -> AgainstHealthy:
    """What a case's runs do that healthy runs of the same vehicle do not; InputError where nothing is known of those.

    reference: the healthy runs; None: what [form] of the vehicle file says of them.
    """
    case = submerged(case)
    if reference is not None:
        healthy = learn(case, [as_the_case_sees(run, case) for run in submerged(reference).runs])
        say(f"learned from {len(healthy.runs)} healthy runs")
    elif case.roughie.form is not None:
        healthy = of_form(case.roughie.form)
        say(f"{healthy.count} healthy runs, as the vehicle file has them")
    else:
        raise InputError("no healthy runs, and a vehicle without [form]", source=case.folder)
    problem = problem_of(case)
    nuisance = nuisance_parameters(problem)
    places, free = with_labels(problem, nuisance)
    for label, own in places.items():  # where healthy runs are not there, or do not show it
        nothing = np.zeros(len(own))
        healthy.usual.setdefault(label, AsUsual.learned(np.diag(nothing), nothing))
    compared = Comparison(problem, healthy, free, places, np.arange(len(nuisance)))
    listed = hypotheses(compared, say)
    weighed = weigh(compared, listed)
    chances = weighed.probabilities()
    first = max(chances, key=lambda name: chances[name])
    best = weighed.best(first)
    verdict = first if first in (NONE, UNKNOWN) else CAUSE
    singles = {one.labels[0]: compared.nat(one) for one in listed if len(one.labels) == 1 and one.form is None}
    least = singles.get(first, np.inf) - CONFOUNDED_NAT
    near = [label for label in sorted(singles, key=lambda n: -singles[n]) if singles[label] > least and label != first]
    selected = weighed.certain(best) if verdict == UNKNOWN else list(best.labels)
    bare = compared.nat(listed[0])
    return AgainstHealthy(
        compared, healthy, verdict, chances, [first, *near] if verdict == CAUSE else [], selected, listed[0], best,
        {label: nat - bare for label, nat in singles.items()},
        {one.name: one.mean_square for one in listed}, weighed.links(),
    )  # fmt: skip
