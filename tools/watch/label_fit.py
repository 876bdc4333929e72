"""One label fitted to the runs of a span, beside the shared model: how large, and how much of the misfit it takes.

The shared values are held; only the label's own parameters move, so that a step costs a few flights. A strong change
is reached by way of filters that expect a rough disturbance, as in tools/diagnose/search.py.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from glider.tools.inference.expansion import at_bound, columns_at
from glider.tools.inference.fit import EFFECT_STEP, FIRST_STEP, bounded_step
from glider.tools.inference.problem import Problem
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.flights import RunEnsemble

STEPS = 5
PROCESS_NOISE_SCALES = (100.0, 10.0)
CONVERGED_GAIN = 1.0  # squared sigma that a step predicts: no further step
FURTHER_STARTS = (
    0.1,
    0.4,
    0.9,
    1.3,
    1.7,
    2.1,
)  # spreads: further starts of what begins at a kink, or behind a threshold
STEP_SHARES = (1.0, 0.4, 0.1, 0.02)  # of a step that is tried


@dataclass
class Affected:
    """Runs of a span, each a problem of its own, with their share of the full size and the model that they share."""

    parts: Sequence[Problem]
    weights: Sequence[float]
    at: Sequence[np.ndarray]  # (count,) values of each run without the change
    inflations: Sequence[float]

    def each(self) -> Iterator[tuple[Problem, float, np.ndarray, float]]:
        """Run by run: the problem, its weight, its values and its variance inflation."""
        return zip(self.parts, self.weights, self.at, self.inflations, strict=True)


def affected_runs(
    flights: RunEnsemble, chosen: Sequence[int], weights: np.ndarray, base: Sequence[np.ndarray]
) -> Affected:
    """Runs with their weights (runs,) of a span, their values without the change, and their variance inflations."""
    parts, inflations = [flights.parts[n] for n in chosen], [flights.inflation_in_run(n) for n in chosen]
    return Affected(parts, [float(weights[n]) for n in chosen], base, inflations)


@dataclass(frozen=True)
class LabelFit:
    """A label at its most probable size."""

    label: str
    size: np.ndarray  # spreads, of its parameters
    cost: float  # -2 log likelihood over the variance inflation, and the prior's


def values_of(shared: SharedParameters, label: str, at: np.ndarray, weight: float, size: np.ndarray) -> np.ndarray:
    """The values (count,) of a run that has a share of a change."""
    x = at.copy()
    x[shared.labels[label]] += weight * size
    return x


def cost_of(
    runs: Affected, shared: SharedParameters, label: str, size: np.ndarray, process_noise_scale: float = 1.0
) -> float:
    """-2 log likelihood of the runs with a change of this size, by its own filters, over the variance inflation; and
    the prior's.
    """
    found = float(size @ size)
    for part, weight, at, inflation in runs.each():
        model = shared.model(part, values_of(shared, label, at, weight, size))
        found += float(part.filter(*model, process_noise_scale=process_noise_scale, begin=True).misfit[0]) / inflation
    return found if np.isfinite(found) else np.inf


@dataclass
class LabelStep:
    """Where a label's size stands, by its own filters, and where its parabola and the kept gains lead from there."""

    cost: float
    predicted_gain: float
    to: np.ndarray


def next_step(
    runs: Affected,
    shared: SharedParameters,
    label: str,
    size: np.ndarray,
    process_noise_scale: float,
    shares: Sequence[float],
) -> LabelStep:
    """The cost of a size, and the share of the Gauss-Newton step within its limits that does best with gains kept."""
    columns, low_high = shared.labels[label], shared.limits(label, runs.at[0])
    normal, slope, cost = np.eye(len(columns)), size.copy(), float(size @ size)
    kept = []
    for part, weight, at, inflation in runs.each():
        x = values_of(shared, label, at, weight, size)
        gains = part.filter(*shared.model(part, x), process_noise_scale=process_noise_scale, begin=True)
        cost += float(gains.misfit[0]) / inflation
        steps = np.where(np.abs(size) > 0.0, EFFECT_STEP * np.maximum(1.0, np.abs(x[columns])), FIRST_STEP)
        steps = np.where(at_bound(shared, x)[columns], 1.0, steps)
        steps = np.where(x[columns] + steps > shared.high[columns], -steps, steps)

        def moved(k: int, step: float, part: Problem = part, x: np.ndarray = x) -> tuple[np.ndarray, np.ndarray]:
            point = x.copy()
            if k >= 0:
                point[columns[k]] += step
            return shared.model(part, point)

        e, J = columns_at(part, gains, moved, at_bound(shared, x)[columns], steps)
        normal += weight**2 * J @ J.T / inflation
        slope += weight * J @ e / inflation
        kept.append(gains)
    low, high = low_high
    step = bounded_step(normal, slope, np.minimum(low - size, 0.0), np.maximum(high - size, 0.0))
    tried = [np.clip(size + share * step, low, high) for share in shares]
    misfits = np.array([one @ one for one in tried])
    for (part, weight, at, inflation), gains in zip(runs.each(), kept, strict=True):
        E = part.follow([shared.model(part, values_of(shared, label, at, weight, one)) for one in tried], gains)
        misfits += (E**2).sum(axis=1) / inflation
    predicted_gain = -float(2.0 * slope @ step + step @ normal @ step)
    return LabelStep(cost if np.isfinite(cost) else np.inf, predicted_gain, tried[int(misfits.argmin())])


def fit_label(
    runs: Affected, shared: SharedParameters, label: str, start: np.ndarray, process_noise_scale: Sequence[float] = ()
) -> LabelFit:
    """The label led to its least misfit from `start` (spreads), through filters of each process-noise scale first."""
    size = start.copy()
    for noise_scale in process_noise_scale:
        size = next_step(runs, shared, label, size, noise_scale, STEP_SHARES).to
    best, least, whole = size, np.inf, True
    for _ in range(STEPS):
        step = next_step(runs, shared, label, size, 1.0, STEP_SHARES if whole else STEP_SHARES[1:])
        if step.cost < least:
            best, least, whole = size, step.cost, True
            if step.predicted_gain < CONVERGED_GAIN:
                break
            size = step.to
        elif whole:  # the filter of the new model sees it otherwise: half way back
            size, whole = best + 0.3 * (size - best), False
        else:
            break
    return LabelFit(label, best, least)


def best_fit(runs: Affected, shared: SharedParameters, label: str, linear: np.ndarray, strong: bool) -> LabelFit:
    """From the size that parabolas promise, and from nothing; of strong changes, by way of rough filters too."""
    nothing = np.zeros(len(linear))
    starts = [linear, nothing]
    low, high = shared.limits(label, runs.at[0])
    if at_bound(shared, runs.at[0])[shared.labels[label]].any():  # a threshold leads nowhere before it is reached
        far = [sign * size for size in FURTHER_STARTS for sign in (1.0, -1.0)]
        alone = [np.clip(size * one, low, high) for one in np.eye(len(linear)) for size in far]
        starts += [one for one in alone if one.any()]
    start = min(starts, key=lambda size: cost_of(runs, shared, label, size))
    fits = [fit_label(runs, shared, label, start)]
    if strong:
        fits.append(fit_label(runs, shared, label, nothing, PROCESS_NOISE_SCALES))
    return min(fits, key=lambda fit: fit.cost)
