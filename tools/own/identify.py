"""A user's vehicle identified from healthy runs: shared values, each run's own, how runs differ, noise levels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import expit, logit

from glider.tools.inference.pooled import (
    Parabola,
    Pooled,
    Scatter,
    learn_scatter,
    learn_scatter_together,
    marginalised,
)
from glider.tools.own.decision import UsualLabels
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
from glider.tools.own.error_components import Components, Whitening, independence, learn_components, patterns
from glider.tools.own.excess_noise import NOISE_SIZES, responses, usual_gains
from glider.tools.own.hierarchy import ChannelErrors, Expansion, inflation
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.measure import channel_rms, total_rms
from glider.tools.own.noise_levels import fit_levels
from glider.tools.own.observer import Observer
from glider.tools.own.observers import observer_of
from glider.tools.own.operating_points import input_shares
from glider.tools.own.persistence import channel_scores, persistence
from glider.tools.own.runs import OwnRun
from glider.tools.own.runs_fit import (
    LEAST_SCALE,
    MIN_SCATTER_RUNS,
    USUAL_OWN_SCATTER,
    USUAL_SCATTER,
    RunsFit,
    by_channel,
    left_by,
    left_out,
    level_logs,
    level_scatter,
)
from glider.tools.own.sessions import session_share
from glider.tools.own.usual_effects import KnownFromOthers, usual_labels, with_usual_effects

USUAL_SESSION_SHARE = 0.25  # variance between sessions over that from run to run
FILE_PRIOR = 2.0  # times the file's uncertainties: what the shared values may be


@dataclass
class Identified:
    """What runs say of a vehicle."""

    vehicle: LoadedVehicle
    observer: Observer
    nuisance: list[Effect]
    values: np.ndarray  # (nuisance,) spreads
    covariance: np.ndarray
    scatter: Scatter  # (nuisance,) spreads, from run to run
    labels: list[Effect]
    usual: UsualLabels
    eta: float
    run_inflation: float  # of the variance of shared values by the likelihood of runs
    errors: ChannelErrors  # what healthy runs leave
    components: Components | None  # what that is made of; none: more than that
    run_values: np.ndarray  # (runs, nuisance)
    before: np.ndarray  # (runs, outputs) gaps of the file's model, tolerances
    after: np.ndarray  # the same of a model of the other runs
    level_scatter: float
    counts: list[int]  # runs of every session, in order
    session_scatter: Scatter  # from session to session beside that
    operating_scatter: dict[str, float]  # by noise, spreads: 1 sigma of what goes with operating points
    noise_gain: dict[str, float]  # nat a window that excess noise gains in healthy runs, by label
    effects: list[str] = field(default_factory=list)  # labels among the nuisance that all runs show
    notes: list[str] = field(default_factory=list)

    @property
    def channel_ratio(self) -> float:
        """Gaps of runs left out over those of the file's model, geometric mean of channels: what the likelihood of
        errors goes by where the variance of each channel is unknown."""
        after, before = (np.maximum(channel_rms(one), LEAST_SCALE) for one in (self.after, self.before))
        return float(np.exp(np.nanmean(np.log(after / before))))

    @property
    def better(self) -> bool:
        """Whether runs left out are predicted no worse than by the file: a channel that neither predicts, and that
        outweighs the others, decides nothing."""
        return self.channel_ratio <= 1.0

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
    first = np.where([one.family == PUSH for one in nuisance], np.minimum(usual, USUAL_SCATTER), usual)
    file_point = observer.point.copy()
    before = np.array([observer.gaps(n, file_point, horizon) for n in range(count)])
    say(f"{count} runs, {k} numbers; the file's model misses them by {total_rms(before):.2f} tolerances")
    scales = np.maximum(channel_rms(before), LEAST_SCALE)
    errors = ChannelErrors(np.where(np.isfinite(scales), scales, 1.0), np.ones(len(scales)))
    fit = RunsFit(observer, nuisance, limits, usual, V, errors, np.zeros(k), np.zeros((count, k)), Scatter(first))
    fit = fit.led_at_levels(say)
    fit_levels(observer, [moved(declared, observer.point, nuisance, row) for row in fit.own],
               fit.errors.scales, say)  # fmt: skip
    fit, added = with_usual_effects(fit.led_with_differences(say), FILE_PRIOR, say)
    nuisance = fit.nuisance
    vehicles = np.append(vehicles, np.ones(len(added), dtype=bool))
    fit, components, notes = with_components(fit, vehicles, say)
    values, own, scatter, V = fit.values, fit.own, fit.scatter, fit.V
    fit.errors = left_by(fit.expansions(), fit.errors)
    errors, found = fit.errors, fit.expansions(keep=True)
    *_, eta = inflation(found)
    if count < MIN_SCATTER_RUNS:
        scatter = Scatter(fit.usual)
    else:
        scores = [channel_scores(observer, n, nuisance, one, errors).tempered(eta) for n, one in enumerate(found)]
        times = persistence(scores, V, scatter, vehicles)
        fit.errors = errors = replace(errors, inflation=errors.inflation * times)
        say("errors that a run's windows have in common, inflation " + ", ".join(
            f"{one.name} {size:.1f}" for one, size in zip(declared.outputs, times, strict=True)))  # fmt: skip
        found = fit.expansions()
        *_, eta = inflation(found)
    counts, tempered = [len(one) for one in sessions], [one.tempered(eta) for one in found]
    allowed = {f"{one.name}_bias" for one in declared.outputs if one.bias > 0.0}
    biases = np.array([one.label in allowed for one in nuisance], dtype=float)
    scatter, session_scatter = learn_sessions(tempered, V, scatter, counts, biases)
    warm = [marginalised(one, scatter) for one in tempered]
    each = in_sessions(tempered, scatter, counts) if len(counts) > 1 else warm
    apart = session_scatter if len(counts) > 1 else Scatter(np.zeros(len(nuisance)))
    every, others = Pooled.of(warm, V), left_out(warm, V)
    between = run_inflation(every, others, vehicles)
    say(f"runs left out move the values by {np.sqrt(between):.1f} times what their likelihood says")
    each = [marginalised(one, apart).tempered(between) for one in each]
    covariance = Pooled.of(each, V).covariance()
    operating_scatter = {one.name: float(np.sqrt(V[k, k])) for k, one in enumerate(nuisance) if one.at_point == 0}
    after = fit.held_out(every, others)
    share = session_share(scatter, session_scatter, nuisance) if len(counts) > 1 else 0.0
    units = known_from_others(left_out(each, V) if len(counts) > 1 else others, apart, counts)
    labels, usual_of_labels = usual_labels(replace(fit, scatter=scatter), units, eta, share)
    if len(counts) < 2:
        usual_of_labels = replace(usual_of_labels, session=np.sqrt(USUAL_SESSION_SHARE) * usual_of_labels.scatter)
    flown = [responses(observer.about(moved(observer.declared, observer.point, nuisance, own[n])), n, horizon, errors)
             for n in range(count)] if vehicle.declared.noises else []  # fmt: skip
    noise_gain = usual_gains(flown, noise_effects(vehicle.declared), NOISE_SIZES, errors, eta)
    return Identified(vehicle, observer, nuisance, values, covariance, scatter, labels, usual_of_labels, eta, between,
                      errors, components, own, before, after, level_scatter(level_logs(found, errors)), counts,
                      session_scatter, operating_scatter, noise_gain, [one.label for one in added], notes)  # fmt: skip


def with_components(
    fit: RunsFit, of: np.ndarray, say: Callable[[str], None]
) -> tuple[RunsFit, Components | None, list[str]]:
    """The fit with errors of windows made independent, and what they are made of, where runs say that they are; else
    the fit itself. A note says how probable that is. of (k,), bool: the values that runs share.

    Runs say so where what they share differs no more than independent errors have it, and where numbers found so fly
    runs left out as well: of every channel and run, one normal error whose scale either fit has of its own.
    """
    observer, declared, count = fit.observer, fit.observer.declared, len(fit.own)
    if not (observer.vehicle.level and declared.noises) or count < MIN_SCATTER_RUNS:
        return fit, None, []
    found = [patterns(observer.about(moved(declared, observer.point, fit.nuisance, row)), n, observer.horizon)
             for n, row in enumerate(fit.own)]  # fmt: skip
    each = np.ones(len(declared.noises))
    at_level = [replace(one, errors=one.errors / fit.errors.level(n)) for n, one in enumerate(found)]
    learned = learn_components(
        at_level, Components(np.sqrt(observer.point.variance) / observer.tolerances, each, each, 1.0)
    )
    say(f"errors of windows: {learned.said(declared)}")
    tried = replace(fit, errors=replace(fit.errors, whitenings=[Whitening(one, learned) for one in found]))
    whitened = [marginalised(one, tried.scatter) for one in tried.expansions()]
    ratio = run_inflation(Pooled.of(whitened, tried.V), left_out(whitened, tried.V), of)
    chance = independence(ratio, count)
    say(f"runs left out move the values by {np.sqrt(ratio):.1f} times what independent errors would")
    if chance > 0.5:
        tried = tried.led_with_differences(say)
        before, after = (channel_rms(one.left_out_gaps()) for one in (fit, tried))
        predicted = count * np.nansum(np.log(np.maximum(before, LEAST_SCALE) / np.maximum(after, LEAST_SCALE)))
        chance = float(expit(logit(chance) + predicted))
    notes = [f"errors of windows are what the model's noises make: probability {chance:.2f}"]
    say(notes[0])
    return (tried, learned, notes) if chance > 0.5 else (fit, None, notes)


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


def learn_sessions(
    found: Sequence[Expansion], V: np.ndarray, scatter: Scatter, counts: Sequence[int], allowed: np.ndarray
) -> tuple[Scatter, Scatter]:
    """What runs differ by within sessions, and sessions beside that.

    scatter: over all runs; allowed (nuisance,): by which the vehicle file allows sessions to differ, spreads (a bias is
    another in each case). One session says nothing of how sessions differ: what is usual is assumed.
    """
    if len(counts) < 2:
        return scatter, Scatter.of(USUAL_SESSION_SHARE * scatter.covariance + np.diag(allowed**2))
    A = by_channel(found)
    within, effects = learn_scatter_together(found, V + scatter.covariance, scatter.sizes, A, counts)
    usual = np.hypot(np.sqrt(USUAL_SESSION_SHARE) * within.sizes, allowed)
    each = in_sessions(found, within, counts)
    if within.correlation is None:
        return within, learn_scatter(each, V, Scatter(usual))
    least = USUAL_SESSION_SHARE * np.where(np.isfinite(effects), effects, 0.0)
    return within, learn_scatter_together(each, V, usual, A, least=least)[0]


def known_from_others(others: Sequence[Pooled], apart: Scatter, counts: Sequence[int]) -> list[KnownFromOthers]:
    """Of each session, or of each run of a single one, what a vehicle of the others says; apart: what sessions differ
    by."""
    ends = np.cumsum(counts if len(counts) > 1 else np.ones(counts[0], dtype=int))
    found = list[KnownFromOthers]()
    for other, first, end in zip(others, [0, *ends[:-1]], ends, strict=True):
        variances, axes = np.linalg.eigh(other.covariance() + apart.covariance)
        root = axes * np.sqrt(np.maximum(variances, 0.0))
        found.append(KnownFromOthers(range(first, end), other.mean(), root[:, variances > 0.0]))
    return found


def in_sessions(found: Sequence[Expansion], scatter: Scatter, counts: Sequence[int]) -> list[Parabola]:
    """The runs of each session as one, their own deviations integrated out."""
    runs, ends = [marginalised(one, scatter) for one in found], np.cumsum(counts)
    return [Pooled.of(runs[end - count : end], np.zeros(0)).parabola()
            for count, end in zip(counts, ends, strict=True)]  # fmt: skip
