"""Diagnosis against healthy runs of the same vehicle: what do a case's runs do that the healthy ones do not?

The vehicle file is one that was identified, and misses healthy runs by what its form cannot do. How far, channel by
channel, is learned from healthy runs, each flown by a fit to the others; the case's windows are then weighed in units
of that (docs/explanation/diagnosis.md, Against healthy runs). Every hypothesis is fitted without each of the case's
runs and judged
on that run, so that an effect has to shrink what it has not seen:

- no change: what the vehicle file allows;
- a label's parameters beside that, one label or a few;
- an error of free form at one link of the chain, in a label's place: unknown;
- the same beside the best label, and what runs leave beyond healthy ones: the label's own form, as far as it is small
  beside what the label takes, else unknown.
"""

from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm
from scipy.stats import t as student

from glider.firmware.model.vehicle import FormTable
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.ocean.vehicle import OceanVehicle
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.correction import free_of
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.gap.corrected import submerged
from glider.tools.gap.regimes import ALL
from glider.tools.inference.channels import recorded
from glider.tools.inference.corrected import LINKS
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.model import effect_vector
from glider.tools.inference.parameters import FreeParameter, effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.prediction_error import DIFFERENCE_STEP, HORIZONS, PredictionError
from glider.tools.inference.problem import Gains, Problem, problem_of
from glider.tools.inference.vehicle_parameters import Parameters

CAUSE = "cause"
CHANGED, STRANGE = 0.5, 0.15  # prior probability of a change; that something is left beside what is named
LEFT = 1.5  # 1 sigma of the logarithm of the mean square that something unknown leaves, times what healthy runs leave
FORM = 0.2  # of a change, 1 sigma in amplitude, that is not as its label's equations have it
SITE = 0.25  # 1 sigma of that logarithm from one place and way of flying to another
PRIOR_RUNS = 1.0  # runs that what is usual of that logarithm's scatter is worth
USUAL_SCATTER = 0.5
LEAST_SCALE = 0.05  # tolerances
STANDS_OUT = 2.0  # times what noise leaves of healthy runs, in squares, that the form leaves of them: the form decides
TOTAL = "total"
REFIT_STEPS, REFIT_FURTHER, MAX_EFFECTS = 6, 4, 3  # labels fitted in full at first, beside others, and effects at most
REFIT_FORMS, MAX_SHAPES = 2, 3  # free forms fitted in full, and shapes of each at most
STEPS = 3
SHARES = np.linspace(0.005, 0.995, 100)  # of a change, in amplitude, that its label leaves
OWN_FORM = norm.pdf(SHARES, scale=FORM) / norm.pdf(SHARES, scale=FORM).sum()
CONVERGED_SIGMA = 0.02  # sigma of the priors, by which a step moves nothing any more
CONFOUNDED_NAT = 6.0  # nat within which labels are not distinguished
SELECTED_PROBABILITY = 0.9  # probability of a label that is selected beside something unknown


class HeldOutWindows(PredictionError):
    """Windows of runs with a list of free parameters about a problem's own model."""

    def __init__(self, problem: Problem, free: Sequence[FreeParameter], scales: dict[str, float]):
        super().__init__(problem, Parameters(list(free), np.zeros(len(free))))
        self.scales = scales

    def model(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P, F) at values (n,)."""
        return model_at(self.problem, self.free.free, values)

    @cached_property
    def cuts(self) -> list:
        """The windows, cut in more than one way."""
        horizon, offsets = HORIZONS[-1]
        return [self.windows(horizon, offset) for offset in offsets]

    @property
    def independent(self) -> float:
        """Residuals that can be independent: one a window and channel."""
        return float(len(self.cuts[0].first) * len(self.channels))

    def further_columns(
        self, values: np.ndarray, known: list[np.ndarray], gains: Gains
    ) -> Iterable[tuple[np.ndarray, np.ndarray]]:
        """As `columns`, the first ones (known, of every cut) not flown again; gains: of the same model."""
        n = len(known[0])
        size = np.where(values + DIFFERENCE_STEP <= self.high, DIFFERENCE_STEP, -DIFFERENCE_STEP)
        points = [values, *(values + s * row for s, row in zip(size[n:], np.eye(len(values))[n:], strict=True))]
        Y = self.fly(points, gains, self.cuts)
        for k, one in enumerate(self.cuts):
            E = self.residuals(Y[:, k], one)
            yield E[0], np.concatenate([known[k], (E[1:] - E[0]) / size[n:, None]])

    def linearised(self, values: np.ndarray) -> "Linearised":
        """Every run's mean square about values (n,)."""
        return Linearised.gathered(values, self, self.columns(values, self.gains(values), self.cuts))


@dataclass
class Linearised:
    """Mean squares of runs, value + 2 slope d + d normal d at values + d; over channels, in healthy runs' units."""

    values: np.ndarray  # (n,)
    value: np.ndarray  # (runs,)
    slope: np.ndarray  # (runs, n)
    normal: np.ndarray  # (runs, n, n)
    windows: HeldOutWindows
    samples: list[tuple[np.ndarray, ...]]

    @classmethod
    def gathered(cls, values: np.ndarray, windows: "HeldOutWindows", cut_columns: Iterable) -> "Linearised":
        """From (residuals, columns) of every cut."""
        n, runs = len(values), len(windows.problem.runs)
        normal, slope, value = np.zeros((runs, n, n)), np.zeros((runs, n)), np.zeros(runs)
        samples: list[tuple[np.ndarray, ...]] = []
        for one, (e, J) in zip(windows.cuts, cut_columns, strict=True):
            weight = windows.weights(e)[0] / len(windows.cuts)
            run_of, channel_of = windows.origins(one)
            samples.append((e, J, weight, run_of, channel_of))
            for run in range(runs):
                own = np.flatnonzero(run_of == run)
                weighted = J[:, own] * weight[own]
                normal[run] += weighted @ J[:, own].T
                slope[run] += weighted @ e[own]
                value[run] += float(weight[own] @ e[own] ** 2)
        return cls(values, value, slope, normal, windows, samples)

    def step(self, free: np.ndarray, weight: float, without: int | None = None) -> np.ndarray:
        """The most probable step (n,) in some of the parameters, by all runs but one; weight of a mean square of 1."""
        kept = np.arange(len(self.value)) != (-1 if without is None else without)
        normal = weight * self.normal[kept].sum(axis=0)[np.ix_(free, free)] + np.eye(len(free))
        slope = weight * self.slope[kept].sum(axis=0)[free] + self.values[free]
        low, high = self.windows.low - self.values, self.windows.high - self.values
        step = np.zeros(len(self.values))
        step[free] = bounded_step(normal, slope, np.minimum(low[free], 0.0), np.maximum(high[free], 0.0))
        return step

    def held_out(self, free: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean squares (runs,) of runs left out, and the steps without each, (runs, n)."""
        runs = len(self.value)
        steps = np.array([self.step(free, weight, run if runs > 1 else None) for run in range(runs)])
        left = self.value + 2.0 * (self.slope * steps).sum(axis=1)
        return left + np.einsum("ri,rij,rj->r", steps, self.normal, steps), steps

    def by_channel(self, steps: np.ndarray) -> np.ndarray:
        """Mean squares (channels,) of runs at their own steps (runs, n), in the units of the residuals."""
        found = np.zeros(len(self.windows.channels))
        for e, J, weight, run_of, channel_of in self.samples:
            at = e + np.einsum("ns,sn->s", J, steps[run_of])
            found += np.bincount(channel_of, weight * at * at, len(found))
        return found * len(found)


@dataclass
class Healthy:
    """What healthy runs leave: by channel in tolerances, and the logarithm of a run's mean square in those units."""

    runs: list[str]  # empty where the vehicle file alone says it
    scales: dict[str, float]
    count: int  # runs that it is known from
    level: float  # mean of that logarithm
    seen: float  # its scatter from run to run, 1 sigma

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the logarithms' scatter."""
        return self.count - 1 + PRIOR_RUNS

    @property
    def scatter(self) -> float:
        """1 sigma of the logarithm from run to run, with what is usual as so many runs more."""
        squares = (self.count - 1) * self.seen**2 + PRIOR_RUNS * USUAL_SCATTER**2
        return float(np.sqrt(squares / self.freedom))

    @property
    def independent(self) -> float:
        """Independent residuals of a run: of so many the mean square has this scatter (chi-squared)."""
        return 2.0 / self.scatter**2


def learn(case: Case, runs: list[Run]) -> Healthy:
    """Every healthy run flown by what the vehicle file allows, fitted to the others.

    Where the vehicle was identified from these runs they are held too well: [form] has the gaps of runs left out.
    """
    problem = problem_of(case, runs=runs)
    free = nuisance_parameters(problem)
    every, scales = np.arange(len(free)), dict[str, float]()
    form = case.roughie.form.gaps[ALL] if case.roughie.form is not None else {}
    for _ in range(2):  # first in tolerances, then in what the first found
        windows = HeldOutWindows(problem, free, scales)
        at = windows.linearised(windows.file_values)
        left, steps = at.held_out(every, windows.independent)
        measured = np.sqrt(at.by_channel(steps))
        scales = {
            channel.name: max(float(one) * scales.get(channel.name, 1.0), form.get(channel.name, 0.0), LEAST_SCALE)
            for channel, one in zip(windows.channels, measured, strict=True)
        }
    run_of = at.samples[0][3]
    share = np.array([np.mean(run_of == n) for n in range(len(runs))])
    logs = np.log(np.maximum(left / share, 1e-6))
    level, scatter = float(np.log(np.exp(logs).mean())), float(logs.std(ddof=1)) if len(logs) > 1 else USUAL_SCATTER
    return Healthy([run.name for run in runs], scales, len(runs), level, scatter)


def of_form(form: FormTable) -> Healthy:
    """The same as identification wrote it into the vehicle file."""
    scales = {name: max(gap, LEAST_SCALE) for name, gap in form.gaps[ALL].items() if name != TOTAL}
    return Healthy([], scales, form.runs, 0.0, form.scatter)


def form_stands_out(case: Case) -> bool:
    """Whether a case's vehicle was identified, and its form leaves more of healthy runs than noise does, in squares."""
    form = None if isinstance(case.vehicle, OceanVehicle) else case.roughie.form
    return form is not None and form.gaps[ALL][TOTAL] ** 2 > STANDS_OUT * form.noise**2


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
        self.windows = HeldOutWindows(self.problem, self.free, self.healthy.scales)

    def columns_of(self, labels: Iterable[str]) -> np.ndarray:
        """Places of what is free under labels."""
        return np.concatenate([self.nuisance, *(self.places[label] for label in labels)])

    @property
    def independent(self) -> float:
        """Independent residuals of the case's runs."""
        return min(self.healthy.independent * len(self.problem.runs), self.windows.independent)

    def weight(self, mean_square: float) -> float:
        """Of a mean square of 1: as many independent residuals, of what is there where that is more than usual."""
        return self.independent / max(mean_square, 1.0)

    def windows_of(self, labels: tuple[str, ...], form: FreeForm | None = None) -> HeldOutWindows:
        """Windows with what is free under labels, and behind it the coefficients of a free form."""
        free, problem = [self.free[k] for k in self.columns_of(labels)], self.problem
        if form is not None:
            F = effect_vector(problem.model)
            F[ef.LINK] = 1.0 + LINKS.index(form.link)
            problem = replace(problem, model=replace(problem.model, F=F))
        return HeldOutWindows(problem, free + (form.free if form else []), self.healthy.scales)

    def fitted(
        self, labels: tuple[str, ...], begin: np.ndarray, form: FreeForm | None = None
    ) -> HealthyHypothesis | None:
        """Labels led from values (n,) to where they are most probable; None where their flights are lost."""
        free, own = self.columns_of(labels), self.windows_of(labels, form)
        every = np.arange(len(own.low))
        values = own.clipped(np.concatenate([begin[free], np.zeros(len(every) - len(free))]))
        best: tuple[float, np.ndarray, Linearised] | None = None
        for _ in range(STEPS):
            at = own.linearised(values)
            cost = float(at.value.sum())
            if not np.isfinite(cost):
                break
            if best is not None and cost + values @ values / self.independent >= best[0]:
                values = 0.5 * (values + best[1])
                continue
            best = cost + float(values @ values) / self.independent, values, at
            step = at.step(every, self.weight(cost))
            if np.abs(step).max(initial=0.0) < CONVERGED_SIGMA:
                break
            values = own.clipped(values + step)
        if best is None:
            return None
        _, values, at = best
        weight = self.weight(float(at.value.sum()))
        left, steps = at.held_out(every, weight)
        count, sd = len(self.free), np.zeros(len(self.free))
        known = slice(len(free))  # the coefficients of a free form are no parameters of the answer
        sd[free] = np.sqrt(np.diag(np.linalg.inv(weight * at.normal.sum(axis=0) + np.eye(len(every)))))[known]
        whole, others = np.zeros(count), np.zeros((len(left), count))
        whole[free], others[:, free] = (values + at.step(every, weight))[known], (values + steps)[:, known]
        return HealthyHypothesis(labels, whole, left, others, sd, form)

    def free_forms(self, begin: HealthyHypothesis) -> list[FreeForm]:
        """Errors of free form beside a hypothesis, those that promise most first: at each link shapes are added while
        they bring more than the choice among them costs."""
        own, found = self.windows_of(begin.labels), []
        values = own.clipped(begin.values[self.columns_of(begin.labels)])
        bare, n, gains = own.linearised(values), len(values), own.gains(values)
        weight, columns = self.weight(begin.mean_square), [one[1] for one in bare.samples]
        for link in LINKS:
            shapes = [one.name for one in free_of(link)]
            whole = self.windows_of(begin.labels, FreeForm(link, tuple(shapes)))
            start = np.concatenate([values, np.zeros(len(shapes))])
            at = Linearised.gathered(start, whole, whole.further_columns(start, columns, gains))
            chosen, best = list[int](), self.nat_of(float(bare.held_out(np.arange(n), weight)[0].sum()))
            while len(chosen) < MAX_SHAPES:
                tried = []
                for k in set(range(len(shapes))) - set(chosen):
                    free = np.concatenate([np.arange(n), n + np.array([*chosen, k])])
                    tried.append((self.nat_of(float(at.held_out(free, weight)[0].sum())), k))
                nat, k = max(tried)
                if nat - np.log(ef.N_SHAPES) <= best:
                    break
                chosen, best = [*chosen, k], nat - float(np.log(ef.N_SHAPES))
            if chosen:
                found.append((best, FreeForm(link, tuple(shapes[k] for k in chosen))))
        return [form for _, form in sorted(found, key=lambda one: -one[0])]

    def predicted_gain(self, begin: HealthyHypothesis) -> list[tuple[float, str, np.ndarray]]:
        """Labels beside a hypothesis by one linear step, best first: mean square of runs left out, label, values."""
        at, found = self.windows.linearised(self.windows.clipped(begin.values)), []
        weight = self.weight(begin.mean_square)
        for label in self.places:
            if label not in begin.labels:
                free = self.columns_of((*begin.labels, label))
                left = float(at.held_out(free, weight)[0].sum())
                found.append((left, label, at.values + at.step(free, weight)))
        return sorted(found, key=lambda one: one[0])

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
        healthy = self.healthy
        scale = np.sqrt(healthy.scatter**2 * (1.0 / healthy.count + 1.0 / len(one.left)) + SITE**2)
        at, usual = np.log(max(one.mean_square, 1e-9)), np.exp(healthy.level)
        if not one.labels:
            shifts = np.linspace(0.0, 4.0 * LEFT, 121)
            prior = 2.0 * norm.pdf(shifts, scale=LEFT) * (shifts[1] - shifts[0])
            nothing = float(student.logpdf(max(at - healthy.level, 0.0) / scale, healthy.freedom))
            more = student.logpdf((at - healthy.level - shifts) / scale, healthy.freedom)
            return nothing, float(logsumexp(more, b=prior))
        away = (at - np.log(usual + SHARES**2 * max(self.bare - usual, 0.0))) / scale
        nothing = float(logsumexp(student.logpdf(np.maximum(away, 0.0), healthy.freedom), b=OWN_FORM))
        return nothing, float(logsumexp(student.logpdf(away, healthy.freedom), b=1.0 / len(SHARES)))

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
    """The posterior's weights; what does not shrink the gap of runs left out is none."""
    alone, beside = [], []
    nothing = listed[0]
    kept = [nothing, *(one for one in listed[1:] if one.mean_square < nothing.mean_square)]
    for one in kept:
        usual, more = compared.leftover(one)
        usual, more = usual + float(np.log1p(-STRANGE)), more + float(np.log(STRANGE))
        at, either = compared.nat(one), float(np.logaddexp(usual, more))
        if one.form is not None:
            at += one.form.prior
        if one.form is not None and not one.labels:
            alone.append(-np.inf)
            beside.append(at + float(np.log(CHANGED * STRANGE)) + either)
            continue
        at += float(len(one.labels) * np.log(CHANGED / len(compared.places)) if one.labels else np.log1p(-CHANGED))
        if one.form is not None:  # its label's own form, or something unknown
            label = next(other for other in kept if other.labels == one.labels and other.form is None)
            share = compared.share(label, one)
            own, other = norm.logpdf(share, scale=FORM) + np.log(2.0 * (1.0 - STRANGE)), np.log(STRANGE)
            more = float(np.logaddexp(usual + other, more))
            usual += float(own)
        alone.append(at + usual)
        beside.append(at + more)
    return Weighed(kept, alone, beside)


def hypotheses(compared: Comparison, say: Callable[[str], None]) -> list[HealthyHypothesis]:
    """No change, the labels that promise most, and further ones beside the best while they bring more than chance."""
    nothing = compared.fitted((), np.zeros(len(compared.free)))
    if nothing is None:
        raise InputError("the identified vehicle does not fly these runs", source=compared.problem.case.folder)
    compared.bare = nothing.mean_square
    say(f"no change: {nothing.mean_square:.2f} times what healthy runs leave")
    odds, listed, best = float(np.log(CHANGED / len(compared.places))), [nothing], nothing
    while len(best.labels) < MAX_EFFECTS:
        predicted_gain = compared.predicted_gain(best)[: REFIT_FURTHER if best.labels else REFIT_STEPS]
        found = [compared.fitted((*best.labels, label), values) for _, label, values in predicted_gain]
        there = [one for one in found if one is not None]
        listed += there
        leading = max(there, key=compared.nat, default=best)
        if compared.nat(leading) + odds <= compared.nat(best):
            break
        best = leading
        say(f"{', '.join(best.labels)}: {best.mean_square:.2f} times")
    for one in [nothing, best] if best.labels else [nothing]:
        for form in compared.free_forms(one)[:REFIT_FORMS]:
            free = compared.fitted(one.labels, one.values, form)
            if free is not None and free.mean_square < one.mean_square:
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
    nuisance, effects = nuisance_parameters(problem), effect_parameters(problem)
    free, places = list(nuisance), dict[str, np.ndarray]()
    for label, own in effects.items():
        places[label] = np.arange(len(free), len(free) + len(own))
        free += own
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
