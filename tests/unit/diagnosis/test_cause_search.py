"""The search: who is dropped and who not, what is tried where a step fails, and effects with kinks and steps found."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.descent import PRUNE_BEHIND, prune
from glider.tools.diagnose.search import run
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=20)


def candidate(name, misfit, gained):
    return SimpleNamespace(labels=(name,), misfit=misfit, gained=gained)


def test_a_candidate_far_behind_is_dropped_unless_it_still_moves():
    best = candidate("best", 1000.0, 0.0)
    stands = candidate("stands", 1000.0 + 3.0 * PRUNE_BEHIND, 0.0)
    falls = candidate("falls", 1000.0 + 3.0 * PRUNE_BEHIND, 2.0 * PRUNE_BEHIND)
    kept = prune([stands, falls, best], worst=1050.0, most=5, least_kept=1)
    assert [c.labels[0] for c in kept] == ["best", "falls"]


def test_a_candidate_that_took_no_step_yet_is_judged_by_where_it_is():
    best = candidate("best", 1000.0, 0.0)
    new = candidate("new", 1000.0 + 3.0 * PRUNE_BEHIND, np.inf)
    assert prune([new, best], worst=1050.0, most=5, least_kept=1) == [best]


@pytest.mark.parametrize(
    ("label", "entry", "value"),
    [
        ("servo_limit", ef.SERVO_LIMIT, 0.65),
        ("stall", ef.STALL, 12.0),
        ("command_delay", ef.COMMAND_DELAY, 0.13),
        ("mocap_delay", ef.MOCAP_DELAY, 1.7),
        ("clock_skew", ef.CLOCK_SKEW, 0.06),
    ],
)
def test_effects_that_begin_with_a_kink_or_go_in_steps_are_found(tmp_path, label, entry, value):
    F = np.zeros(ef.N_F)
    F[entry] = value
    search = run(problem_of(make_case(tmp_path, F, seed=5, runs=2, mocap=entry in (ef.MOCAP_DELAY, ef.CLOCK_SKEW))))
    best = max((c for c in search.hypotheses if len(c.labels) == 1), key=lambda c: c.log_evidence(search.fitter))
    assert best.labels == (label,)
    assert best.values[0] * best.free[0].spread == pytest.approx(value, rel=0.25)


@pytest.mark.parametrize(("seed", "loss", "give"), [(6, 0.7, 0.0), (8, 0.68, 0.0)])
def test_a_limit_that_commands_hardly_reach_is_found_alone(tmp_path, seed, loss, give):
    """No slope leads to it from none at all: five other effects were taken for the first, two for the second."""
    F = np.zeros(ef.N_F)
    F[ef.SERVO_LIMIT], F[ef.SERVO_GIVE] = loss, give
    search = run(problem_of(make_case(tmp_path, F, seed=seed, runs=4)))
    found = next(c for c in search.ranked() if c.labels == ("servo_limit",))
    assert found.values[0] * found.free[0].spread == pytest.approx(loss, rel=0.03)
    without = max(c.log_evidence(search.fitter) for c in search.ranked() if "servo_limit" not in c.labels)
    assert found.log_evidence(search.fitter) > without + 50.0


@pytest.mark.parametrize("seed", [3, 5])
def test_a_vehicle_that_would_roll_over_on_the_other_side_of_the_truth_is_found(tmp_path, seed):
    """A difference step to starboard rolls it over beside a gyro's biases: the centre of gravity is to port."""
    F = np.zeros(ef.N_F)
    for label, values in {"cg_lateral": (-0.54e-3,), "gyro_bias": (-0.015, 0.0255, 0.007)}.items():
        for parameter, value in zip(catalogue()[label].parameters, values, strict=True):
            F[parameter.entry] = value
    search = run(problem_of(make_case(tmp_path, F, seed=seed)))
    assert set(search.best.labels) == {"cg_lateral", "gyro_bias"}
