"""Disorder over a span of runs: of the water, or of something that no label means; and whether a label says more."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from glider.tools.diagnose.noise_probes import TURBULENCE, WAVES, NoiseProbe, inflated, probes
from glider.tools.diagnose.waves import line_share
from glider.tools.inference.hyperparameters import DIAGNOSIS, HEALTHY, WATCH
from glider.tools.watch.events import GROWING
from glider.tools.watch.excess_noise import (
    SCALES,
    WATER,
    beyond_reference,
    water_gains,
    water_labels,
    with_inflated_noise,
)
from glider.tools.watch.flights import RunEnsemble, excess_nis_sigma, numbers
from glider.tools.watch.history import ChangeEvent, History, within
from glider.tools.watch.label_fit import values_of

SIZE_ERROR = 0.25  # of the size of excess noise, 1 sigma
PROBED = 2  # runs in which it is asked what shakes


def water_event(history: History) -> ChangeEvent | None:
    """The water's disorder over the span where it gains most; None where it gains nothing."""
    flights, best = history.flights, None
    if history.water is None:
        history.water = excess_water_noise(flights, range(flights.count))
    inflated_before = [event.span.weights(flights.count) > 0.0 for event in history.events if not event.has_course]
    for span in history.listed():
        inside = span.weights(flights.count) > 0.0
        if span.course == GROWING or any((inside & before).any() for before in inflated_before):
            continue
        for label, gains in zip(water_labels(flights), history.water, strict=True):
            together = gains[inside].sum(axis=0)
            k = int(together.argmax())
            if best is None or together[k] > best.evidence:
                size, gain = np.array([SCALES[k]]), float(together[k])
                covariance = np.diag((SIZE_ERROR * size) ** 2)
                best = ChangeEvent(label, span, gain, {label: gain}, size, covariance, gain)
    return best


def excess_water_noise(flights: RunEnsemble, runs: Sequence[int]) -> np.ndarray:
    """Nat that the water's disorder gains in runs, (labels, runs, scales); asked of rough ones only."""
    found = np.full((len(water_labels(flights)), len(runs), len(SCALES)), -WATCH.clean_run)
    least = asked_above(int(flights.reference.sum()))
    noisy = [k for k, n in enumerate(runs) if excess_nis_sigma(flights, n) > least]
    if noisy:
        found[:, noisy] = water_gains(flights, [runs[k] for k in noisy])
    return found


def asked_above(learned: int) -> float:
    """`excess_noise_sigma` where a run is held against a few: Student's t, by the runs learned from."""
    return (
        WATCH.excess_noise_sigma
        if learned < WATCH.scatter_runs
        else float(student.isf(norm.sf(WATCH.excess_noise_sigma), learned - 1 + HEALTHY.prior_runs))
    )


def named(history: History, event: ChangeEvent) -> ChangeEvent:
    """Disorder by what shakes most: the water, or something else, which no label means.

    Turbulence shakes every axis, and it does so all the time. A sea that moves the vehicle by more than moving water
    alone does may make turbulence gain more than waves: its line of the spectrum tells.
    """
    flights = history.flights
    inside = numbers((event.span.weights(flights.count) > 0.0) & history.judged)
    largest_nis = sorted(inside, key=lambda n: -excess_nis_sigma(flights, n))[:PROBED]
    wanted = probes(flights.parts[largest_nis[0]])
    gains = beyond_reference(flights, wanted, largest_nis, PROBED).sum(axis=1).max(axis=1)
    first = int(gains.argmax())
    if TURBULENCE not in [one.name for one in wanted]:  # of a kind whose water moves it one way
        return of_water(event, wanted[first].name) if wanted[first].name in WATER else linked(event, wanted, gains)
    own = gains[[one.name for one in wanted].index(TURBULENCE)]
    axes = [gain for gain, one in zip(gains, wanted, strict=True) if one.stage == "force" and one.name != TURBULENCE]
    even = (
        max(axes) < DIAGNOSIS.single_axis_share * own
        and max(burstiness(flights, n) for n in largest_nis) < WATCH.burst_ratio
    )
    if wanted[first].name == WAVES or (wanted[first].name == TURBULENCE and even):
        return of_water(event, wanted[first].name)
    if wanted[first].name == TURBULENCE and a_sea(flights, largest_nis, wanted, gains):
        return of_water(event, WAVES)
    return linked(event, wanted, gains)


def of_water(event: ChangeEvent, label: str) -> ChangeEvent:
    """Disorder of the water by its name."""
    return replace(event, label=label, rivals={label: event.evidence})


def a_sea(flights: RunEnsemble, runs: Sequence[int], wanted: Sequence[NoiseProbe], gains: np.ndarray) -> bool:
    """Whether no link but turbulence gains more than waves, and what they move has a sea's line; gains (probes,)."""
    others = [n for n, one in enumerate(wanted) if one.name != TURBULENCE]
    waves = wanted[max(others, key=lambda n: gains[n])]
    if waves.name != WAVES:
        return False
    shares = []
    for n in runs:
        part = flights.parts[n]
        model = flights.shared.model(part, flights.own_values(n))
        each = [inflated(part, waves, scale) for scale in SCALES]
        tried = [part.filter(*model, begin=True, more=more, doubt=doubt) for more, doubt in each]
        shares.append(line_share(part, min(tried, key=lambda one: float(one.misfit[0]))))
    return min(shares) >= DIAGNOSIS.wave_share


def linked(event: ChangeEvent, wanted: Sequence[NoiseProbe], gains: np.ndarray) -> ChangeEvent:
    """Disorder that no label means, at the single link that shakes most."""
    first = int(gains.argmax())
    link = max((n for n, one in enumerate(wanted) if one.name not in WATER), key=lambda n: gains[n])
    return replace(event, label="", rivals={}, probe=(wanted[first].name, float(event.size[0])), place=wanted[link])


def burstiness(flights: RunEnsemble, n: int) -> float:
    """By how much a run's squared innovations change from one stretch to the next, over how far they exceed 1."""
    part = flights.parts[n]
    E = part.filter(*flights.shared.model(part, flights.own_values(n)), begin=True).E
    rows = max(2, int(WATCH.burst_seconds / np.median(np.diff(part.recording.t))))
    each = [np.nanmean(E[k : k + rows] ** 2) for k in range(0, len(E) - rows + 1, rows)]
    return float(np.std(each) / max(np.mean(each) - 1.0, 0.05))


def noise_beats_label(history: History, noisy: ChangeEvent, event: ChangeEvent) -> bool:
    """Whether disorder says more of the runs than a label does; of other runs, whether it is the more evident.

    By more than what a label may leave: the form of nature's is never the catalogue's, and of a strong effect that
    little is more than any chance. What it leaves is asked about then (unknown.py).
    """
    flights = history.flights
    both = (noisy.span.weights(flights.count) > 0.0) & (event.span.weights(flights.count) > 0.0) & history.judged
    if not both.any():
        return noisy.evidence > event.evidence
    chosen = sorted(numbers(both), key=lambda n: -excess_nis_sigma(flights, n))[:PROBED]
    weights, by_label, by_excess_noise = event.span.weights(flights.count), 0.0, 0.0
    for n in chosen:
        x = flights.raw[n].at
        nothing = flights.own_cost(flights.parts[n], x)
        by_excess_noise += nothing - flights.own_cost(
            with_inflated_noise(flights.parts[n], noisy.label, float(noisy.size[0])), x
        )
        changed = values_of(flights.shared, event.label, x, weights[n], event.size)
        by_label += nothing - flights.own_cost(flights.parts[n], within(flights, changed))
    return by_label < (1.0 - DIAGNOSIS.misfit_share) * by_excess_noise
