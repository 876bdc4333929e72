"""How much evidence a change needs, by what is known of how much runs differ."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.parameters import NUISANCE, FreeParameter
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.events import STEP, Span
from glider.tools.watch.flights import RunEnsemble
from glider.tools.watch.history import ChangeEvent, History
from glider.tools.watch.search import evidence_needed
from glider.tools.watch.water import asked_above

FREE = [FreeParameter(NUISANCE, "P[0]", "P", 0, 0.1), FreeParameter("drag", "scale", "F", 0, 0.4, -2.0, 10.0)]
LABELS = ["drag", *(f"another {n}" for n in range(45))]
SHARED = SharedParameters(FREE, {label: [1] for label in LABELS}, {label: [(-2.0, 10.0)] for label in LABELS})


def needed(learned: int, inside: int, label: str = "drag", watched: int = 9) -> float:
    flights = RunEnsemble([None] * (learned + watched), SHARED, np.arange(learned + watched) < learned)
    history = History(flights, np.arange(learned + watched) >= learned, learned)
    event = ChangeEvent(label, Span(learned, learned + inside, STEP), 0.0, {}, np.zeros(1), np.eye(1), 0.0)
    return evidence_needed(history, event)


def test_a_change_of_one_run_needs_more_where_few_runs_were_learned_from():
    several = [needed(learned, 1) for learned in (3, 5, 12, 40)]
    assert several == sorted(several, reverse=True)
    assert needed(5, 1) > needed(5, 3) > needed(5, 6) > needed(5, 6, "turbulence")


def test_where_nothing_was_learned_no_event_is_sure_and_none_is_kept_back():
    assert needed(2, 1) == needed(2, 6) == needed(100_000, 1)


def test_with_many_runs_it_is_that_of_a_normal_deviation():
    looked_at = len(LABELS) * (9 * 10 // 2 + 7)  # steps, and growths of three runs or more up to the last one
    normal = 0.5 * norm.isf(0.5 * WATCH.false_alarms / looked_at) ** 2
    assert needed(100_000, 1) == WATCH.evidence_by_chance + math.log(looked_at) > normal


def test_disorder_is_no_deviation_of_a_run():
    assert needed(5, 1, "turbulence") == needed(2, 1)


def test_roughness_beside_a_few_runs_is_asked_about_from_further_up():
    several = [asked_above(learned) for learned in (3, 5, 12, 40, 100_000)]
    assert several == sorted(several, reverse=True)
    assert asked_above(100_000) == pytest.approx(WATCH.excess_noise_sigma, abs=1e-3)
    assert asked_above(2) == WATCH.excess_noise_sigma  # how rough runs are usually is taken as it is
