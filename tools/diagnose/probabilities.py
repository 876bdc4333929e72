"""Arithmetic on probabilities of labels, of none and of unknown, each a dictionary by name that sums to 1."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import ndtr

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.gates import materiality
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.inference.hyperparameters import DIAGNOSIS


def softmax(logs: dict[str, float]) -> dict[str, float]:
    top = max(logs.values())
    weights = {name: float(np.exp(value - top)) for name, value in logs.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def doubt_small(chances: dict[str, float], main: str, size: float) -> dict[str, float]:
    """Probabilities where the largest of the effects may be one of many small ones, and nothing the main cause.

    size: of the main one, in sizes at which that is as likely as not. What this takes off the labels goes to none, but
    no more than `none_ratio` of what the main one keeps: there is something.
    """
    large = float(ndtr(np.log(max(size, 1e-6)) / DIAGNOSIS.main_size_width))
    labels = sum(chance for name, chance in chances.items() if name != NONE)
    # of the labels' probability that stays
    least = 1.0 / (1.0 + DIAGNOSIS.none_ratio * chances[main] / max(labels, 1e-9))
    kept = max(large, least)
    found = {name: kept * chance for name, chance in chances.items() if name != NONE}
    return found | {NONE: 1.0 - sum(found.values())}


def to_none(chances: dict[str, float], negligible: Iterable[str], moved: dict[str, float]) -> dict[str, float]:
    """Probabilities with those of effects that do not matter given to none: there is no gap with them.

    moved: by how much each moves the windows, tolerances; an effect is material by degrees (`gates.materiality`).
    """
    material = {label: materiality(far) for label, far in moved.items()}
    material |= dict.fromkeys(negligible, 0.0)
    kept = {label: chance * material.get(label, 1.0) for label, chance in chances.items()}
    return kept | {NONE: kept.get(NONE, 0.0) + sum(chances.values()) - sum(kept.values())}


def answer_first(chances: dict[str, float], gained: Iterable[str]) -> tuple[str, dict[str, float]]:
    """The most probable of none, unknown and what was selected; probabilities in which no other label passes it.

    A label that was not selected can only pass by what is mixed in for errors, or where elimination went another way.
    """
    top = max((NONE, UNKNOWN, *gained), key=lambda name: chances.get(name, 0.0))
    capped = {name: min(chance, chances[top]) for name, chance in chances.items()}
    total = sum(capped.values())
    return top, {name: capped[name] / total for name in (top, *(name for name in capped if name != top))}


def mix_in_error_rate(chances: dict[str, float], main: str, others: Sequence[str] = ()) -> dict[str, float]:
    """Probabilities of which `error_rate` goes to all labels: the search may have lost the true one on its way.

    Half of it goes to `others` than the main one that the search found: of nine effects that were not put first, six
    were among those.
    """
    labels = catalogue()
    others = [name for name in others if name in labels and name != main]
    shares = dict.fromkeys(labels, (0.5 if others else 1.0) * DIAGNOSIS.error_rate / len(labels))
    for name in others:
        shares[name] += 0.5 * DIAGNOSIS.error_rate / len(others)
    return {name: (1.0 - DIAGNOSIS.error_rate) * value + shares.get(name, 0.0) for name, value in chances.items()}


def grouped(logs: dict[str, float]) -> dict[str, list[str]]:
    """For every label, those whose evidence these data cannot part from its own."""
    labels = sorted(logs, key=lambda name: -logs[name])

    def near(label: str) -> list[str]:
        return [one for one in labels if one != label and abs(logs[one] - logs[label]) < DIAGNOSIS.confounded_evidence]

    return {label: [label, *near(label)] for label in labels}
