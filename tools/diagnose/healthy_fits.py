"""Hypotheses of a change against healthy runs, each fitted without each of the case's runs and judged on that run."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.linalg import block_diag

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.correction import free_of
from glider.tools.diagnose.healthy_runs import Healthy, prior_evidence
from glider.tools.diagnose.held_out import HeldOutWindows, Linearised
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.diagnose.sensor_consistency import inconsistent_sensors
from glider.tools.inference.corrected import LINKS
from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.model import effect_vector
from glider.tools.inference.parameters import CLOCK_PLACE, FreeParameter
from glider.tools.inference.problem import Problem

REFIT_STEPS, REFIT_FURTHER, MAX_EFFECTS = 6, 4, 3  # labels fitted in full at first, beside others, and effects at most
REFIT_FORMS, MAX_SHAPES = 2, 3  # free forms fitted in full, and shapes of each at most
FAR = (-2.0, 2.0)  # sigma of a label's prior, from which its fit begins where that is better than the step from 0


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


def hypotheses(compared: Comparison, say: Callable[[str], None]) -> list[HealthyHypothesis]:
    """No change, the labels that promise most, and further ones beside the best while they bring more than chance."""
    nothing = compared.fitted((), np.zeros(len(compared.free)))
    compared.bare = nothing.mean_square
    say(f"no change: {nothing.mean_square:.2f} times what healthy runs leave")
    odds, listed, best = float(np.log(HEALTHY.changed / len(compared.places))), [nothing], nothing
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
