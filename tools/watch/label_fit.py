"""One label fitted to the runs of a span, beside the shared model: how large, and how much of the misfit it takes.

The shared values are held; only the label's own parameters move, so that a step costs a few flights. A strong change
is reached by way of filters that expect a rough disturbance, as in tools/diagnose/search.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.inference.fit import EFFECT_STEP, FIRST_STEP, bounded_step
from tools.inference.problem import Problem
from tools.watch.shared_parameters import SharedParameters

STEPS = 5
ROUGH = (100.0, 10.0)
ENOUGH = 1.0  # squared sigma that a step promises: no further step
SHARES = (1.0, 0.4, 0.1, 0.02)  # of a step that is tried


@dataclass
class Affected:
    """Runs of a span, each a problem of its own, with their share of the full size and the model that they share."""

    parts: Sequence[Problem]
    weights: Sequence[float]
    at: Sequence[np.ndarray]  # (count,) values of each run without the change
    heat: float


@dataclass(frozen=True)
class LabelFit:
    """A label at its most probable size."""

    label: str
    size: np.ndarray  # spreads, of its parameters
    cost: float  # -2 log likelihood over the heat, and the prior's


def values_of(shared: SharedParameters, label: str, at: np.ndarray, weight: float, size: np.ndarray) -> np.ndarray:
    """The values (count,) of a run that has a share of a change."""
    x = at.copy()
    x[shared.labels[label]] += weight * size
    return x


def cost_of(runs: Affected, shared: SharedParameters, label: str, size: np.ndarray, roughness: float = 1.0) -> float:
    """-2 log likelihood of the runs with a change of this size, by its own filters, over the heat; and the prior's."""
    found = float(size @ size)
    for part, weight, at in zip(runs.parts, runs.weights, runs.at, strict=True):
        model = shared.model(part, values_of(shared, label, at, weight, size))
        found += float(part.filter(*model, roughness=roughness, begin=True).misfit[0]) / runs.heat
    return found if np.isfinite(found) else np.inf


def own_step(
    runs: Affected, shared: SharedParameters, label: str, size: np.ndarray, roughness: float
) -> tuple[np.ndarray, float, np.ndarray]:
    """The Gauss-Newton step of a label's size within its limits, what it promises, and the normal matrix."""
    columns = shared.labels[label]
    normal, slope = np.eye(len(columns)), size.copy()
    for part, weight, at in zip(runs.parts, runs.weights, runs.at, strict=True):
        x = values_of(shared, label, at, weight, size)
        gains = part.filter(*shared.model(part, x), roughness=roughness, begin=True)
        steps = np.where(np.abs(size) > 0.0, EFFECT_STEP * np.maximum(1.0, np.abs(x[columns])), FIRST_STEP)
        steps = np.where(shared.kinked[columns] & (x[columns] == 0.0), 1.0, steps)
        steps = np.where(x[columns] + steps > shared.high[columns], -steps, steps)
        models = [shared.model(part, x)]
        for k, step in zip(columns, steps, strict=True):
            moved = x.copy()
            moved[k] += step
            models.append(shared.model(part, moved))
        E = part.follow(models, gains)
        J = weight * (E[1:] - E[0]) / steps[:, None]
        normal += J @ J.T / runs.heat
        slope += J @ E[0] / runs.heat
    low, high = shared.limits(label, runs.at[0])
    step = bounded_step(normal, slope, np.minimum(low - size, 0.0), np.maximum(high - size, 0.0))
    return step, -float(2.0 * slope @ step + step @ normal @ step), normal


def fit_label(
    runs: Affected, shared: SharedParameters, label: str, start: np.ndarray, roughness: Sequence[float] = ()
) -> LabelFit:
    """The label led to its least misfit from `start` (spreads), through filters of each roughness first."""
    size = start.copy()
    low, high = shared.limits(label, runs.at[0])
    for rough in (*roughness, *(STEPS * (1.0,))):
        step, promised, _ = own_step(runs, shared, label, size, rough)
        if promised < ENOUGH:
            if rough == 1.0:
                break
            continue
        least = cost_of(runs, shared, label, size, rough)
        for share in SHARES:
            tried = np.clip(size + share * step, low, high)
            cost = cost_of(runs, shared, label, tried, rough)
            if cost < least:
                size = tried
                break
        else:
            if rough == 1.0:
                break
    return LabelFit(label, size, cost_of(runs, shared, label, size))


def best_fit(runs: Affected, shared: SharedParameters, label: str, linear: np.ndarray, strong: bool) -> LabelFit:
    """From the size that parabolas promise, or the share of it that does best; of strong changes, the rough way too."""
    nothing = np.zeros(len(linear))
    starts = [share * linear for share in (1.0, 0.5, 0.25)] + [nothing]
    start = min(starts, key=lambda size: cost_of(runs, shared, label, size))
    fits = [fit_label(runs, shared, label, start)]
    if strong:
        fits.append(fit_label(runs, shared, label, nothing, ROUGH))
    return min(fits, key=lambda fit: fit.cost)
