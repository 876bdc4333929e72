"""Effects that healthy runs show all alike: an identified vehicle has them, and what is asked later is asked beside it.

A sensor that is late, or a motor that takes its time, where the model has neither, is no change: every run shows it.
Such a label is one of the numbers that runs share, with the prior of a parameter. The most evident is added, as
probable before as in a diagnosis, and all is fitted again, until none is probable.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glider.tools.inference.pooled import Pooled, marginalised
from glider.tools.own.decision import ANOTHER, log_odds
from glider.tools.own.effects import PARAMETER, Effect, standard_effects
from glider.tools.own.hierarchy import LEAST_REACH, RunLevel, expand, inflation
from glider.tools.own.posterior import MOST_EFFECTS, alone, size_evidence
from glider.tools.own.runs_fit import MIN_SCATTER_RUNS, RunsFit, left_out

MOST_TRIED, TRIED_ROUNDS = 3, 2  # labels that are fitted beside all else, and how long, before one is chosen


def with_usual_effects(fit: RunsFit, prior: float, say: Callable[[str], None]) -> tuple[RunsFit, list[Effect]]:
    """The fit with labels that all runs show among what they share, and these; prior: 1 sigma of each, spreads.

    A label stays if runs left out are predicted better with it, each by the logarithm of its errors.
    """
    added, scales = list[Effect](), fit.errors.scales
    left = _left(fit, scales) if len(fit.own) >= MIN_SCATTER_RUNS else -np.inf
    while np.isfinite(left) and len(added) < MOST_EFFECTS:
        labels, eta = _evident(fit)
        if not labels:
            break
        _, led, effect = max((_tried(fit, one, prior, eta) for one in labels), key=lambda one: one[0])
        led = led.led_with_differences(say)
        before, left = left, _left(led, scales)
        times = np.exp(0.5 * (left - before))
        say(f"all runs show {effect.label}: with it the errors of runs left out are {times:.2f} times as large")
        if left >= before:
            break
        fit = led
        added.append(effect)
    return fit, added


def _left(fit: RunsFit, scales: np.ndarray) -> float:
    """Logarithm of the mean square of runs left out, mean over runs; scales (outputs,) in which errors are counted."""
    found = fit.expansions()
    eta = float(inflation(found)[-1])
    warm = [marginalised(one.tempered(eta), fit.scatter) for one in found]
    gaps = fit.held_out(Pooled.of(warm, fit.V), left_out(warm, fit.V)) / scales
    return float(np.mean(np.log(np.nanmean(gaps**2, axis=1))))


def _tried(fit: RunsFit, effect: Effect, prior: float, eta: float) -> tuple[float, RunsFit, Effect]:
    """The fit led on with one more label, its log evidence, errors counted as before, and the label."""
    led, level = _beside(fit, effect, prior), RunLevel(fit.errors, eta, 0.0)
    for _ in range(TRIED_ROUNDS):
        found = led.expansions()
        led.stepped([one.tempered(eta) for one in found], found, level, lambda text: None)
        led.errors = fit.errors
    warm = [marginalised(one.tempered(eta), led.scatter) for one in led.expansions()]
    return Pooled.of(warm, led.V).log_evidence() + log_odds(effect), led, effect


def _beside(fit: RunsFit, effect: Effect, prior: float) -> RunsFit:
    """The fit with one more number that runs share, at 0."""
    V, runs = np.diag(np.append(np.zeros(len(fit.V)), prior**2)), len(fit.own)
    V[:-1, :-1] = fit.V
    low, high = fit.limits
    return replace(
        fit, nuisance=[*fit.nuisance, effect], limits=(np.append(low, effect.low), np.append(high, effect.high)),
        usual=np.append(fit.usual, 0.0), V=V, values=np.append(fit.values, 0.0),
        own=np.column_stack([fit.own, np.zeros(runs)]), scatter=np.append(fit.scatter, 0.0),
    )  # fmt: skip


def _evident(fit: RunsFit) -> tuple[list[Effect], float]:
    """Labels that are more probable than not by the parabola, all else integrated out, the likeliest, and inflation.

    A label's slope is the sum of what every run says: where runs differ in it by more than their likelihood has it, it
    counts for so much less (the sandwich variance).
    """
    observer, known = fit.observer, {one.label for one in fit.nuisance}
    every = standard_effects(observer.declared, observer.runs, observer.tolerances)
    labels = [one for one in every if one.family != PARAMETER and one.label not in known]
    first, count, runs = len(fit.nuisance), len(labels), len(fit.own)
    effects, beside = [*fit.nuisance, *labels], np.zeros(count)
    found = [expand(observer, n, effects, np.append(row, beside), fit.errors, observer.horizon)
             for n, row in enumerate(fit.own)]  # fmt: skip
    reach = np.sqrt(np.mean([one.reach for one in found], axis=0))[first:]
    scatter, eta = np.append(fit.scatter, beside), float(inflation(found)[-1])
    warm = [marginalised(one.tempered(eta), scatter) for one in found]
    V = np.zeros((first + count, first + count))
    V[:first, :first] = fit.V
    pooled = Pooled.of(warm, V)
    slope, precision = (one[first:] for one in alone(pooled))
    mode, gain = pooled.mean(), pooled.H @ pooled.covariance()
    scores = np.array([-one.offset - one.curvature @ mode for one in warm])
    scores -= scores @ gain.T
    varied = runs * scores.var(axis=0, ddof=1)[first:]
    times = np.maximum(1.0, varied / np.maximum(precision, 1e-12))
    nat = size_evidence(slope / times, precision / times, np.maximum(reach, LEAST_REACH),
                        np.array([one.one_sided for one in labels]))  # fmt: skip
    nat += np.array([log_odds(one) for one in labels]) - np.log(len(every))
    nat += np.log(ANOTHER)
    nat[reach <= LEAST_REACH] = -np.inf
    return [labels[k] for k in np.argsort(-nat)[:MOST_TRIED] if nat[k] > 0.0], eta
