"""Effects that healthy runs show all alike: an identified vehicle has them, and what is asked later is asked beside it.

A sensor that is late, or a motor that takes its time, where the model has neither, is no change: every run shows it.
Such a label is one of the numbers that runs share, with the prior of a parameter. That the model lacks one, or a
further one, is as probable as not before. The most evident is added and all is fitted again, until none is probable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.inference.pooled import Parabola, Pooled, log_prior, marginalised, without
from glider.tools.own.decision import SIZES, UsualLabels, log_odds
from glider.tools.own.effects import PARAMETER, Effect, form_errors, standard_effects, unexplained
from glider.tools.own.evidence import alone, size_evidence
from glider.tools.own.hierarchy import LEAST_REACH, RunLevel, expand, inflation
from glider.tools.own.measure import total_rms
from glider.tools.own.posterior import MOST_EFFECTS
from glider.tools.own.runs_fit import MIN_SCATTER_RUNS, SCATTERS, USUAL_OWN_SCATTER, RunsFit

SESSION_TIMES = np.geomspace(0.25, 16.0, 7)  # that sessions differ in a label as far as is usual over runs
USUAL_LABEL = 0.01  # tolerances, from run to run; at most `USUAL_OWN_SCATTER` spreads
MOST_TRIED, TRIED_ROUNDS = 3, 2  # labels that are fitted beside all else, and how long, before one is chosen


def with_usual_effects(fit: RunsFit, prior: float, say: Callable[[str], None]) -> tuple[RunsFit, list[Effect]]:
    """The fit with labels that all runs show among what they share, and these; prior: 1 sigma of each, spreads.

    One that is not probable any more beside later ones goes again. A step after which runs left out are predicted no
    better is not taken, and is the last.
    """
    added, gone = list[Effect](), set[str]()
    gaps = fit.left_out_gaps() if len(fit.own) >= MIN_SCATTER_RUNS else np.zeros(0)
    while gaps.any():
        odds, reach, eta = _log_odds(fit, added)
        weak = [one for one in added if odds[one] <= 0.0]
        labels = [one for one in odds if odds[one] > 0.0 and one not in added and one.label not in gone]
        if weak:
            tried, new = _without(fit, weak[0]), [one for one in added if one is not weak[0]]
            gone.add(weak[0].label)
        elif labels and len(added) < MOST_EFFECTS:
            likeliest = sorted(labels, key=lambda one: -odds[one])[:MOST_TRIED]
            beside = (_tried(fit, one, prior, eta, reach[one]) for one in likeliest)
            _, tried, effect = max(beside, key=lambda one: one[0])
            new = [*added, effect]
        else:
            break
        tried = tried.led_with_differences(say)
        levels, theirs = fit.errors.levels[:, None], tried.left_out_gaps()
        left, there = (total_rms(one / levels) for one in (gaps, theirs))
        have = ", ".join(one.label for one in new) or "none of these"
        say(f"runs left out {left:.2f} -> {there:.2f} tolerances at their levels, if all runs have {have}")
        if there >= left:
            break
        fit, added, gaps = tried, new, theirs
    return fit, added


def _tried(fit: RunsFit, effect: Effect, prior: float, eta: float, reach: float) -> tuple[float, RunsFit, Effect]:
    """The fit led on with one more label, its log evidence, errors counted as before, and the label."""
    led, level = _beside(fit, effect, prior, reach), RunLevel(fit.errors, eta, 0.0)
    for _ in range(TRIED_ROUNDS):
        found = led.expansions()
        led.stepped([one.tempered(eta) for one in found], found, level, lambda text: None)
        led.errors = fit.errors
    warm = [marginalised(one.tempered(eta), led.scatter) for one in led.expansions()]
    return Pooled.of(warm, led.V).log_evidence() + log_odds(effect), led, effect


def _beside(fit: RunsFit, effect: Effect, prior: float, reach: float) -> RunsFit:
    """The fit with one more number that runs share, at 0, and differ in as they do in labels; reach: tolerances that a
    spread of it moves the channels."""
    V, runs = np.diag(np.append(np.zeros(len(fit.V)), prior**2)), len(fit.own)
    V[:-1, :-1] = fit.V
    low, high = fit.limits
    usual = USUAL_LABEL / max(reach, USUAL_LABEL / USUAL_OWN_SCATTER)
    return replace(
        fit, nuisance=[*fit.nuisance, effect], limits=(np.append(low, effect.low), np.append(high, effect.high)),
        usual=np.append(fit.usual, usual), V=V, values=np.append(fit.values, 0.0),
        own=np.column_stack([fit.own, np.zeros(runs)]), scatter=fit.scatter.beside(np.array([usual])),
    )  # fmt: skip


def _without(fit: RunsFit, effect: Effect) -> RunsFit:
    """The fit without a number that runs share."""
    kept = np.array([one is not effect for one in fit.nuisance])
    low, high = fit.limits
    return replace(
        fit, nuisance=[one for one in fit.nuisance if one is not effect], limits=(low[kept], high[kept]),
        usual=fit.usual[kept], V=fit.V[np.ix_(kept, kept)], values=fit.values[kept], own=fit.own[:, kept],
        scatter=fit.scatter.only(kept),
    )  # fmt: skip


def _log_odds(fit: RunsFit, added: Sequence[Effect]) -> tuple[dict[Effect, float], dict[Effect, float], float]:
    """Log odds, by the parabola and all else integrated out, of labels that are not among what runs share and of those
    that were added to it; tolerances that a spread of each of the former moves the channels; and how many errors are
    the same one.

    A label's slope is the sum of what every run says: where runs differ in it by more than their likelihood has it, it
    counts for so much less (the sandwich variance).
    """
    observer, known = fit.observer, {one.label for one in fit.nuisance}
    every = standard_effects(observer.declared, observer.runs, observer.tolerances)
    labels = [one for one in every if one.family != PARAMETER and one.label not in known]
    first, beside, runs = len(fit.nuisance), np.zeros(len(labels)), len(fit.own)
    effects = [*fit.nuisance, *labels]
    found = [expand(observer, n, effects, np.append(row, beside), fit.errors, observer.horizon)
             for n, row in enumerate(fit.own)]  # fmt: skip
    reach = np.sqrt(np.mean([one.reach for one in found], axis=0))
    scatter, eta = fit.scatter.beside(beside), float(inflation(found)[-1])
    warm = [marginalised(one.tempered(eta), scatter) for one in found]

    def log_odds_of(places: np.ndarray) -> np.ndarray:
        V = np.zeros((len(effects), len(effects)))
        V[:first, :first] = fit.V
        V[places], V[:, places] = 0.0, 0.0
        pooled = Pooled.of(warm, V)
        slope, precision = (one[places] for one in alone(pooled))
        mode = pooled.mean()
        scores = np.array([-one.offset - one.curvature @ mode for one in warm])
        scores -= scores @ (pooled.H @ pooled.covariance()).T
        varied = runs * scores.var(axis=0, ddof=1)[places]
        times = np.maximum(1.0, varied / np.maximum(precision, 1e-12))
        among = [effects[k] for k in places]
        nat = size_evidence(slope / times, precision / times, np.maximum(reach[places], LEAST_REACH),
                            np.array([one.one_sided for one in among]))  # fmt: skip
        nat += np.array([log_odds(one) for one in among]) - np.log(len(every))
        return np.where(reach[places] > LEAST_REACH, nat, -np.inf)

    new = np.arange(first, len(effects))
    odds = dict(zip(labels, log_odds_of(new), strict=True))
    odds |= {one: float(log_odds_of(np.array([fit.nuisance.index(one)]))[0]) for one in added}
    return odds, dict(zip(labels, reach[new].tolist(), strict=True)), eta


@dataclass(frozen=True)
class KnownFromOthers:
    """Runs that came together, as a vehicle identified from the others sees them."""

    runs: Sequence[int]
    values: np.ndarray  # (nuisance,)
    root: np.ndarray  # (nuisance, m), root root' the covariance of what these runs are off that, all alike


def usual_labels(
    fit: RunsFit, units: Sequence[KnownFromOthers], eta: float, share: float
) -> tuple[list[Effect], UsualLabels]:
    """Every label, and what healthy runs show of each alone beside the numbers of runs: what all have, what sessions
    differ by, and runs.

    units: the runs of each session, or each run where there is but one; eta: how many errors are the same one; share:
    usual variance between sessions over that from run to run. Every session is seen as one that is asked about later:
    by a vehicle identified from the others, as certain as these make it. How runs and sessions differ is where the
    marginal likelihood is largest, with the prior of `learn_scatter` for what runs' does in tolerances, so that labels
    that act alike differ alike, in whatever unit, and for sessions' over that of runs. That all have some of a label is
    as probable as not before, as where labels are added to the vehicle; sizes are a change's.
    """
    observer = fit.observer
    labels = standard_effects(observer.declared, observer.runs, observer.tolerances)
    labels += unexplained(observer.declared, observer.runs)
    every = [*labels, *form_errors(observer.declared)]
    into = _placed(fit.nuisance, every)
    found = [expand(observer, n, every, into @ row, fit.errors, observer.horizon).tempered(eta)
             for n, row in enumerate(fit.own)]  # fmt: skip
    reach = np.sqrt(np.mean([one.reach for one in found], axis=0))[: len(labels)]
    reach = np.maximum(reach, USUAL_LABEL / USUAL_OWN_SCATTER)
    scatters = SCATTERS[:, None] / reach  # (grid, labels) spreads
    per_unit = list[np.ndarray]()
    for unit in units:
        about = [replace(found[n], at=found[n].at - into @ unit.values) for n in unit.runs]
        about = [without(one, into @ fit.scatter.root) for one in about]
        per_unit.append(np.array([_in_common(about, into @ unit.root, k, scatters[:, k] ** 2)
                                  for k in range(len(labels))]))  # fmt: skip
    slopes, precisions, nat = np.array(per_unit).transpose(2, 3, 0, 1)  # (grid, units, labels) each
    usual = USUAL_LABEL if len(fit.own) >= MIN_SCATTER_RUNS else 5.0 * USUAL_LABEL
    nat = nat.sum(axis=1) + log_prior(SCATTERS[:, None] ** 2, usual**2)
    apart = np.sqrt(share) * SESSION_TIMES[:, None, None] * scatters  # (times, grid, labels) spreads
    total = 1.0 + apart[:, :, None] ** 2 * precisions
    nat = nat + 0.5 * (slopes**2 * apart[:, :, None] ** 2 / total - np.log(total)).sum(axis=2)
    nat += log_prior(SESSION_TIMES**2, 1.0)[:, None, None]
    # what all have, one size after another, and none
    slope, precision = (slopes / total).sum(axis=2), (precisions / total).sum(axis=2)
    tau2 = (SIZES[:, None, None, None] / reach) ** 2
    variance = tau2 / (1.0 + tau2 * precision)  # (sizes, times, grid, labels)
    mean = variance * slope
    gain = 0.5 * (slope * mean + np.log(variance / tau2)) + np.array([log_odds(one) for one in labels])
    gain += np.where([one.one_sided for one in labels], np.log(2.0) + norm.logcdf(mean / np.sqrt(variance)), 0.0)
    gain = np.concatenate([np.zeros((1, *nat.shape)), gain - np.log(len(SIZES) * len(labels))])
    nat += logsumexp(gain, axis=0)
    each = np.arange(len(labels))
    times, grid = np.unravel_index(np.argmax(nat.reshape(-1, len(labels)), axis=0), nat.shape[:2])
    weights = np.exp(gain - logsumexp(gain, axis=0))[1:]
    first, second = (one.sum(axis=0)[times, grid, each] for one in (weights * mean, weights * (variance + mean**2)))
    error = np.sqrt(np.maximum(second - first**2, 0.0))
    return labels, UsualLabels(scatters[grid, each], apart[times, grid, each], first, error)


def _in_common(about: Sequence[Parabola], root: np.ndarray, k: int, variances: np.ndarray) -> np.ndarray:
    """Slope, precision and log evidence (3, grid) of what runs have in common of label k, beside deviations of each
    run's own of `variances` (grid,) and deviations N(0, root root') of all."""
    a, b = (np.array([root.T @ row for row in rows])
            for rows in ([one.curvature[k] for one in about], [one.offset for one in about]))  # fmt: skip
    alone, c = np.array([(one.curvature[k, k], one.offset[k]) for one in about]).T
    kept = 1.0 / (1.0 + variances[:, None] * alone)  # (grid, runs)
    taken = variances[:, None] * kept
    A = sum(root.T @ one.curvature @ root for one in about) - np.einsum("gn,ni,nj->gij", taken, a, a)
    across, slope = kept @ a, b.sum(axis=0) - (taken * c) @ a
    solved = np.linalg.solve(np.eye(len(root.T)) + A, np.stack([across, slope], axis=2))
    value = -(taken @ c**2) - np.log(kept).sum(axis=1) - (slope * solved[:, :, 1]).sum(axis=1)
    value += np.linalg.slogdet(np.eye(len(root.T)) + A)[1]
    return np.array([-(kept @ c - (across * solved[:, :, 1]).sum(axis=1)),
                     kept @ alone - (across * solved[:, :, 0]).sum(axis=1), -0.5 * value])  # fmt: skip


def _placed(nuisance: Sequence[Effect], effects: Sequence[Effect]) -> np.ndarray:
    """(effects, nuisance): what values of the nuisance are in the spreads of all effects."""
    labels = [one.label for one in effects]
    found = np.zeros((len(effects), len(nuisance)))
    for k, one in enumerate(nuisance):
        place = labels.index(one.label)
        found[place, k] = one.spread / effects[place].spread
    return found
