"""A user's vehicle identified from healthy runs: shared values, each run's own, how runs differ, noise levels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glider.tools.inference.pooled import (
    Parabola,
    Pooled,
    learn_scatter,
    log_prior,
    marginalised,
    run_values,
    without,
)
from glider.tools.own.declare import RUN, Declaration
from glider.tools.own.effects import (
    FORM,
    OUTPUT,
    PUSH,
    Effect,
    form_errors,
    moved,
    noise_effects,
    pushes,
    standard_effects,
    usual_inputs,
)
from glider.tools.own.excess_noise import NOISE_SIZES, responses, usual_gains
from glider.tools.own.hierarchy import ChannelErrors, Expansion, RunLevel, expand, inflation
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observer import Observer, observer_of
from glider.tools.own.operating_points import input_shares
from glider.tools.own.persistence import channel_scores, persistence
from glider.tools.own.runs import OwnRun

ROUNDS, SHARED_ROUNDS = 40, 10  # at most; of them until it is learned how runs differ
FORM_ROUNDS = 2
SCATTER_ROUNDS = 4  # in which it is learned how runs differ, then held
USUAL_SESSION_SHARE = 0.25  # variance between sessions over that from run to run
MIN_SCATTER_RUNS = 3  # from fewer nothing is learned of how runs differ
FILE_PRIOR = 2.0  # times the file's uncertainties: what the shared values may be
USUAL_SCATTER, USUAL_OWN_SCATTER = 0.02, 0.5  # spreads, from run to run; of what is declared a number of each run
LABEL_SCATTERS = np.geomspace(0.005, 20.0, 60)  # spreads: candidates for a label's scatter
LONGEST_MOVE, SHARES = 2.0, (1.0, 0.4, 0.1)  # spreads a round; of a step, until the exact posterior gains
LEAST_DAMPING, MOST_DAMPING = 0.01, 1e6  # of the curvature, in spreads
CONVERGED_GAIN = 0.5  # of -2 log posterior: no further round
CONVERGED_SCALE = 0.05  # e-folds of what is left, by which it changes no more
LEAST_SCALE = 0.02  # tolerances: less than that no channel is known to be left with
LEVEL_ROWS, PLAIN_ROWS = 3_000, 600  # of runs from which noise levels are found: compiled, plain Python
LEVEL_STEPS = (0.8, 0.4)  # e-folds
MAX_LEVEL_SHIFT = 4.0  # e-folds from the file's noise, at most


@dataclass
class Identified:
    """What runs say of a vehicle."""

    vehicle: LoadedVehicle
    observer: Observer
    nuisance: list[Effect]
    values: np.ndarray  # (nuisance,) spreads
    covariance: np.ndarray
    scatter: np.ndarray  # (nuisance,) spreads, from run to run
    labels: list[Effect]
    label_scatter: np.ndarray  # (labels,) spreads, each alone, beside what runs differ by
    eta: float
    run_inflation: float  # of the variance of shared values by the likelihood of runs
    errors: ChannelErrors  # what healthy runs leave
    run_values: np.ndarray  # (runs, nuisance)
    before: np.ndarray  # (runs, outputs) gaps of the file's model, tolerances
    after: np.ndarray  # the same of a model of the other runs
    level_scatter: float
    sessions: int
    session_scatter: np.ndarray  # (nuisance,) spreads, from session to session beside that
    operating_scatter: dict[str, float]  # by noise, spreads: 1 sigma of what goes with operating points
    noise_gain: dict[str, float]  # nat a window that excess noise gains in healthy runs, by label
    notes: list[str] = field(default_factory=list)

    @property
    def better(self) -> bool:
        """Whether runs left out are predicted no worse than by the file."""
        return _total(self.after) <= _total(self.before)

    @property
    def handed_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Values (nuisance,) of the vehicle handed out, and their covariance.

        Where the file's vehicle is, the file's own: as uncertain as the identified ones, and as far as these are.
        """
        if self.better:
            return self.values, self.covariance
        return np.zeros_like(self.values), self.covariance + np.outer(self.values, self.values)


def nuisance_of(observer: Observer) -> list[Effect]:
    """What the vehicle file allows for: parameters with an uncertainty, outputs with a bias, runs' slow forces.

    A constant force at a noise, of each run its own, is what the model's form cannot do there; one that goes with an
    input is what it cannot do in any run.
    """
    declared = observer.declared
    every = {one.label: one for one in standard_effects(declared, observer.runs, observer.tolerances)}
    found = [every[one.name] for one in declared.parameters if one.uncertainty > 0.0]
    for one in declared.outputs:
        if one.bias > 0.0:
            found.append(replace(every[f"{one.name}_bias"], spread=one.bias))
    return found + pushes(declared) + form_errors(declared)


def usual_scatter(declared: Declaration, effects: Sequence[Effect]) -> np.ndarray:
    """1 sigma (effects,) in spreads of how runs differ, before any is seen; a vehicle's parameters stay as they are."""
    own = {one.name for one in declared.parameters if one.scope == RUN}
    found = {PUSH: USUAL_OWN_SCATTER, OUTPUT: USUAL_SCATTER}
    return np.array([USUAL_OWN_SCATTER if one.name in own else found.get(one.family, 0.0) for one in effects])


def identify(
    vehicle: LoadedVehicle, sessions: Sequence[Sequence[OwnRun]], say: Callable[[str], None] = lambda text: None
) -> Identified:
    """A vehicle from healthy runs of one or more sessions; InputError where its model cannot fly them."""
    runs = [run for session in sessions for run in session]
    declared = vehicle.declared
    if not declared.usual_inputs:
        declared = replace(declared, usual_inputs=usual_inputs(declared, runs))
        declared = replace(declared, input_shares=input_shares(declared, runs))
        vehicle = replace(vehicle, declared=declared)
    observer = observer_of(vehicle, list(runs))
    vehicle = observer.vehicle
    nuisance, horizon = nuisance_of(observer), observer.horizon
    k, count = len(nuisance), len(runs)
    priors = {PUSH: 0.0, FORM: USUAL_SCATTER**2}
    V = np.diag([priors.get(one.family, FILE_PRIOR**2) for one in nuisance])
    vehicles = np.array([one.family not in (PUSH, FORM) for one in nuisance])
    limits = np.array([one.low for one in nuisance]), np.array([one.high for one in nuisance])
    usual = usual_scatter(vehicle.declared, nuisance)
    # forces of runs wait until what runs share is found: else they take it for their own
    values, own = np.zeros(k), np.zeros((count, k))
    scatter = np.where([one.family == PUSH for one in nuisance], np.minimum(usual, USUAL_SCATTER), usual)
    file_point = observer.point.copy()
    before = np.array([observer.gaps(n, file_point, horizon) for n in range(count)])
    say(f"{count} runs, {k} numbers; the file's model misses them by {_total(before):.2f} tolerances")
    fit_levels(observer, say)
    scales = np.maximum(np.sqrt(np.nanmean(before**2, axis=0)), LEAST_SCALE)
    errors, eta = ChannelErrors(np.where(np.isfinite(scales), scales, 1.0), np.ones(len(scales))), 1.0
    learned, differ = 0, False
    for round_ in range(ROUNDS):
        found = [expand(observer, n, nuisance, own[n], errors, horizon) for n in range(count)]
        *_, eta = inflation(found)
        warm = [one.tempered(eta) for one in found]
        if differ and learned < SCATTER_ROUNDS:
            V = with_form_errors([marginalised(one, scatter) for one in warm], V, nuisance)
            found_scatter = learn_scatter(warm, V, usual)
            scatter = found_scatter if learned == 0 else np.sqrt(scatter * found_scatter)
            learned += 1
        search = LineSearch(observer, nuisance, warm, scatter, eta, V, limits, errors, horizon)
        step = damped_step(Pooled.of([marginalised(one, scatter) for one in warm], V), values)
        values, own, gain = search.along(values, own, step)
        before_errors, left = errors, left_by(found, errors)
        errors = ChannelErrors(left.scales, errors.inflation)  # channels' own inflation is for what is asked later
        said = f"round {round_ + 1}: gain {gain:.1f}, {np.sqrt(np.mean(errors.scales**2)):.2f} tolerances left"
        say(f"{said}, inflation {eta:.0f}")
        if gain < CONVERGED_GAIN and np.abs(np.log(errors.scales / before_errors.scales)).max() < CONVERGED_SCALE:
            if learned == SCATTER_ROUNDS or count < MIN_SCATTER_RUNS:
                break
            differ = True
        differ = differ or (round_ == SHARED_ROUNDS and count >= MIN_SCATTER_RUNS)
    found = [expand(observer, n, nuisance, own[n], errors, horizon) for n in range(count)]
    errors = left_by(found, errors)
    found = [expand(observer, n, nuisance, own[n], errors, horizon, keep=True) for n in range(count)]
    *_, eta = inflation(found)
    if count < MIN_SCATTER_RUNS:
        scatter = usual
    else:
        scores = [channel_scores(observer, n, nuisance, one, errors).tempered(eta) for n, one in enumerate(found)]
        times = persistence(scores, V, scatter, vehicles)
        errors = ChannelErrors(errors.scales, errors.inflation * times)
        say("errors that a run's windows have in common, inflation " + ", ".join(
            f"{one.name} {size:.1f}" for one, size in zip(declared.outputs, times, strict=True)))  # fmt: skip
        found = [expand(observer, n, nuisance, own[n], errors, horizon) for n in range(count)]
        *_, eta = inflation(found)
    counts, tempered = [len(one) for one in sessions], [one.tempered(eta) for one in found]
    scatter, session_scatter = learn_sessions(tempered, V, scatter, counts)
    warm = [marginalised(one, scatter) for one in tempered]
    each = in_sessions(tempered, scatter, counts) if len(counts) > 1 else warm
    apart = session_scatter if len(counts) > 1 else np.zeros(k)
    every, others = Pooled.of(warm, V), left_out(warm, V)
    between = run_inflation(every, others, vehicles)
    say(f"runs left out move the values by {np.sqrt(between):.1f} times what their likelihood says")
    covariance = Pooled.of([marginalised(one, apart).tempered(between) for one in each], V).covariance()
    operating_scatter = {one.name: float(np.sqrt(V[k, k])) for k, one in enumerate(nuisance) if one.at_point == 0}
    # to first order in what leaving a run out moves
    after = _held_out(observer, nuisance, [values + one.mean() - every.mean() for one in others], limits)
    labels, label_scatter = _label_scatter(observer, nuisance, own, others, scatter, eta, errors)
    flown = [responses(observer.about(moved(observer.declared, observer.point, nuisance, own[n])), n, horizon)
             for n in range(count)] if vehicle.declared.noises else []  # fmt: skip
    noise_gain = usual_gains(flown, noise_effects(vehicle.declared), NOISE_SIZES, errors, eta)
    return Identified(vehicle, observer, nuisance, values, covariance, scatter, labels, label_scatter, eta, between,
                      errors, own, before, after, level_scatter(found), len(sessions), session_scatter,
                      operating_scatter, noise_gain)  # fmt: skip


def left_out(found: Sequence[Parabola], V: np.ndarray) -> list[Pooled]:
    """What the other runs say, of each run; a single one's others are itself."""
    return [Pooled.of([*found[:n], *found[n + 1 :]] or found, V) for n in range(len(found))]


def run_inflation(every: Pooled, others: Sequence[Pooled], free: np.ndarray) -> float:
    """How much less runs say of the shared values than their likelihood has it: variance of the jackknife over runs
    over what it would be, median over some values (free: k, of bool); at least 1.

    every, others: all runs, and all but each (`left_out`), their own deviations integrated out. Errors that last longer
    than a window, or that go with how a run was flown, are the same in all of a run; its likelihood counts them window
    by window.
    """
    if len(others) < MIN_SCATTER_RUNS or not free.any():
        return 1.0
    moves = np.array([one.mean() - every.mean() for one in others])[:, free]
    expected = sum(np.diag(one.covariance() - every.covariance())[free] for one in others)
    ratio = (moves**2).sum(axis=0) / np.maximum(expected, 1e-12)
    return max(1.0, float(np.median(ratio)))


def damped_step(pooled: Pooled, values: np.ndarray) -> np.ndarray:
    """Step (k,) to the most probable shared values, damped as Levenberg has it until no value moves LONGEST_MOVE."""
    damping = 0.0
    while True:
        near = replace(pooled, H=pooled.H + damping * np.eye(len(values)), r=pooled.r + damping * values)
        step = near.mean() - values
        if np.abs(step).max(initial=0.0) <= LONGEST_MOVE or damping > MOST_DAMPING:
            return np.clip(step, -LONGEST_MOVE, LONGEST_MOVE)
        damping = max(4.0 * damping, LEAST_DAMPING)


def with_form_errors(found: Sequence[Expansion], V: np.ndarray, nuisance: Sequence[Effect]) -> np.ndarray:
    """The prior covariance with the variances of form errors learned, two for every noise: of what goes with inputs,
    and with operating points.

    The most probable, with the prior of `learn_scatter`, of runs with their own deviations integrated out.
    """
    kept = Pooled.of(found, V)
    for _ in range(FORM_ROUNDS):
        for kind in dict.fromkeys(kind for one in nuisance if (kind := one.form_kind) is not None):
            places = np.array([one.form_kind == kind for one in nuisance])
            usual = USUAL_SCATTER if kind[1] else USUAL_OWN_SCATTER

            def at(size: float, V=V, places=places) -> np.ndarray:
                return np.diag(np.where(places, size**2, np.diag(V)))

            def score(size: float, at=at, usual=usual) -> float:
                return kept.log_evidence(at(size)) + float(log_prior(size**2, usual**2))

            V = at(max(LABEL_SCATTERS, key=score))
    return V


def left_by(found: Sequence[Expansion], errors: ChannelErrors) -> ChannelErrors:
    """What runs leave, channel by channel, where they were expanded; `errors`: in what they were counted."""
    squares = np.sum([one.squares for one in found], axis=0)
    samples = np.sum([one.samples for one in found], axis=0)
    scales = errors.scales * np.sqrt(np.where(samples > 0, squares / np.maximum(samples, 1), 1.0))
    return ChannelErrors(np.maximum(scales, LEAST_SCALE), inflation(found)[:-1])


@dataclass
class LineSearch:
    """The exact posterior along a step of the shared values."""

    observer: Observer
    nuisance: list[Effect]
    warm: list[Expansion]
    scatter: np.ndarray
    eta: float
    V: np.ndarray
    limits: tuple[np.ndarray, np.ndarray]
    errors: ChannelErrors
    horizon: float
    first: int = 0  # run of the observer that `warm` begins with
    level: RunLevel | None = None  # of the runs' own errors, where they have one

    def prior(self, x: np.ndarray, own: np.ndarray) -> float:
        apart, free = ((own - x) / np.maximum(self.scatter, 1e-6)) ** 2, np.diag(self.V) > 0.0
        return float(apart.sum() + x[free] @ np.linalg.solve(self.V[np.ix_(free, free)], x[free]))

    def misfit(self, n: int, row: np.ndarray) -> float:
        point = moved(self.observer.declared, self.observer.point, self.nuisance, row)
        error = self.observer.residuals(
            self.first + n, [point], self.observer.filter(self.first + n, point), self.horizon
        )[0]
        squares = float((error**2 / self.errors.weight).sum()) / self.eta
        return squares if self.level is None else self.level.value(squares, self.level.count(self.warm[n]))

    def along(self, values: np.ndarray, own: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Values, runs' own values and the gain of a step, shortened until the exact posterior gains."""

        def at(share: float, of_own: float = 1.0) -> tuple[float, np.ndarray, np.ndarray]:
            x = np.clip(values + share * step, *self.limits)
            target = np.array([run_values(one, x, self.scatter) for one in self.warm])
            theirs = own + of_own * np.clip(target - own, -LONGEST_MOVE, LONGEST_MOVE)
            theirs = np.clip(np.where(self.scatter > 0.0, theirs, x), *self.limits)
            return sum(self.misfit(n, row) for n, row in enumerate(theirs)) + self.prior(x, theirs), x, theirs

        here = sum(one.value for one in self.warm) + self.prior(values, own), values, own
        stay = here
        for of_own in SHARES:
            tried = at(0.0, of_own)
            if tried[0] < stay[0]:
                stay = tried
                break
        if not step.any():
            return stay[1], stay[2], 0.0
        for share in SHARES:
            tried = at(share)
            if tried[0] < stay[0]:
                return tried[1], tried[2], stay[0] - tried[0]
        return stay[1], stay[2], 0.0


def fit_levels(observer: Observer, say: Callable[[str], None]) -> None:
    """Noise of sensors and of the model by the filter's likelihood: coordinate steps, shortened.

    They say how far the filter that finds where windows begin trusts the model; no evidence hangs on them.
    """
    if observer.vehicle.level == 0:
        return
    declared, budget = observer.declared, LEVEL_ROWS if observer.vehicle.kernels.compiled else PLAIN_ROWS
    used, rows = list[int](), 0
    for n in sorted(range(len(observer.runs)), key=lambda n: len(observer.runs[n].t)):
        if used and rows + len(observer.runs[n].t) > budget:
            break
        used.append(n)
        rows += len(observer.runs[n].t)
    free = [("density", n) for n in range(len(declared.noises)) if declared.noises[n].density > 0.0]
    free += [("variance", n) for n in range(len(declared.outputs))]
    level = dict.fromkeys(free, 0.0)

    def cost() -> float:
        total = 0.0
        for n in used:
            point = observer.point.copy()
            for (what, k), shift in level.items():
                getattr(point, what)[k] *= np.exp(shift if what == "density" else 2.0 * shift)
            total += observer.filter(n, point).value
        return total + sum(shift**2 for shift in level.values()) / MAX_LEVEL_SHIFT**2 * 4.0

    best = cost()
    for size in LEVEL_STEPS:
        for one in free:
            for sign in (1.0, -1.0):
                moved_any = False
                while abs(level[one] + sign * size) <= MAX_LEVEL_SHIFT:
                    level[one] += sign * size
                    tried = cost()
                    if tried < best - 0.5:
                        best, moved_any = tried, True
                    else:
                        level[one] -= sign * size
                        break
                if moved_any:
                    break
    for (what, k), shift in level.items():
        getattr(observer.point, what)[k] *= np.exp(shift if what == "density" else 2.0 * shift)
    said = [f"{declared.noises[k].name if what == 'density' else declared.outputs[k].name} x{np.exp(shift):.2g}"
            for (what, k), shift in level.items() if abs(shift) > 0.3]  # fmt: skip
    say(f"noise levels: {', '.join(said) or 'as the file has them'}")


def _label_scatter(observer, nuisance, own, others, scatter, eta, errors) -> tuple[list[Effect], np.ndarray]:
    """How far each label alone differs from run to run beside the numbers of runs: what healthy runs show of it.

    Every run is seen as one that is asked about later: by a vehicle identified from the others, as certain as these
    make it. 1 sigma (labels,) in spreads, by the largest of its marginal likelihood with the prior of `learn_scatter`.
    """
    labels = standard_effects(observer.declared, observer.runs, observer.tolerances)
    every = [*labels, *pushes(observer.declared), *form_errors(observer.declared)]
    into = placed(nuisance, every)
    about = []
    for n, without_it in enumerate(others):
        variances, axes = np.linalg.eigh(without_it.covariance())
        known, root = into @ without_it.mean(), into @ (axes * np.sqrt(np.maximum(variances, 0.0)))
        one = expand(observer, n, every, into @ own[n], errors, observer.horizon).tempered(eta)
        one = marginalised(replace(one, at=one.at - known), into @ scatter)
        about.append(without(one, root))
    slopes = np.array([-one.offset for one in about])[:, : len(labels)]
    precisions = np.array([np.diag(one.curvature) for one in about])[:, : len(labels)]
    total = 1.0 + LABEL_SCATTERS[:, None, None] ** 2 * precisions  # (grid, runs, labels)
    nat = 0.5 * (slopes**2 * LABEL_SCATTERS[:, None, None] ** 2 / total - np.log(total)).sum(axis=1)
    usual = USUAL_SCATTER if len(own) >= MIN_SCATTER_RUNS else 5.0 * USUAL_SCATTER
    prior = log_prior(LABEL_SCATTERS[:, None] ** 2, usual**2)
    return labels, LABEL_SCATTERS[np.argmax(nat + prior, axis=0)]


def learn_sessions(
    found: Sequence[Expansion], V: np.ndarray, scatter: np.ndarray, counts: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """1 sigma (nuisance,) from run to run within sessions, and of sessions beside that.

    scatter: over all runs. One session says nothing of how sessions differ: what is usual is assumed.
    """
    if len(counts) < 2:
        return scatter, np.sqrt(USUAL_SESSION_SHARE) * scatter
    within = learn_scatter(found, V + np.diag(scatter**2), scatter, counts)
    return within, learn_scatter(in_sessions(found, within, counts), V, np.sqrt(USUAL_SESSION_SHARE) * within)


def in_sessions(found: Sequence[Expansion], scatter: np.ndarray, counts: Sequence[int]) -> list[Parabola]:
    """The runs of each session as one, their own deviations integrated out."""
    runs, ends = [marginalised(one, scatter) for one in found], np.cumsum(counts)
    return [Pooled.of(runs[end - count : end], np.zeros(0)).parabola()
            for count, end in zip(counts, ends, strict=True)]  # fmt: skip


def level_scatter(found: Sequence[Expansion]) -> float:
    """1 sigma from run to run of the logarithm of the mean square that is left."""
    logs = np.log([one.squares.sum() / max(1, one.samples.sum()) for one in found])
    return float(logs.std(ddof=1)) if len(logs) > 1 else 0.5


def placed(nuisance: Sequence[Effect], effects: Sequence[Effect]) -> np.ndarray:
    """(effects, nuisance): what values of the nuisance are in the spreads of all effects."""
    labels = [one.label for one in effects]
    found = np.zeros((len(effects), len(nuisance)))
    for k, one in enumerate(nuisance):
        place = labels.index(one.label)
        found[place, k] = one.spread / effects[place].spread
    return found


def _held_out(observer, nuisance, values, limits) -> np.ndarray:
    """Gaps (runs, outputs) of every run by a model of the others, whose values (runs, nuisance) are."""
    points = [moved(observer.declared, observer.point, nuisance, np.clip(one, *limits)) for one in values]
    return np.array([observer.gaps(n, point, observer.horizon) for n, point in enumerate(points)])


def _total(gaps: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(gaps**2)))
