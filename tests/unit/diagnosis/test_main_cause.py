"""The main cause: the one that takes the most of the gap; small ones, and what they leave, make nothing sure."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose import search as search_module
from glider.tools.diagnose import verdict as verdict_module
from glider.tools.diagnose.noise_probes import CLOCK, NoiseProbe, ProbeResult
from glider.tools.diagnose.probabilities import doubt_small
from glider.tools.diagnose.record import NONE
from glider.tools.diagnose.search import run
from glider.tools.diagnose.shrink import ablation_importance, in_tolerances, left_out_squares, most_often
from glider.tools.diagnose.unknown import (
    Remainder,
    left_floors,
    left_share,
    probability_unknown,
)
from glider.tools.diagnose.verdict import (
    HeldOutImportance,
    conclude,
    drop,
    held_out_importance,
    nuisance_prior_cost,
    prune_effects,
    rank_by_importance,
    with_least_gap,
)
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case


def test_worth_is_the_root_of_what_the_gap_grows_by():
    importance = HeldOutImportance(np.array([1.0, 1.0]), {"drag": np.array([3.0, 5.0]), "lift": np.array([-0.1, 0.0])})
    assert importance.tolerances("drag") == pytest.approx(2.0)
    assert importance.share("drag") == pytest.approx(2.0)
    assert importance.tolerances("lift") == 0.0


@pytest.fixture(scope="module")
def two_effects(tmp_path_factory):
    """The search over runs with two effects."""
    F = np.zeros(ef.N_F)
    F[ef.NET_MASS_OFFSET], F[ef.PITCH_TRIM] = 0.02, 0.3
    return run(problem_of(make_case(tmp_path_factory.mktemp("two"), F, seed=4)))


def test_more_evidence_wins_only_as_far_as_it_closes_the_gap_of_runs_left_out(two_effects):
    both = next(one for one in two_effects.ranked() if set(one.labels) == {"net_buoyancy", "pitch_trim"})
    alone = {label: drop(two_effects, both, other) for label, other in (both.labels, both.labels[::-1])}
    left = {label: float(left_out_squares(two_effects, one).mean()) for label, one in alone.items()}
    closes, leaves = min(left, key=lambda label: left[label]), max(left, key=lambda label: left[label])
    for main in (closes, leaves):
        other = leaves if main == closes else closes
        chances = {main: 0.01, other: 0.98, NONE: 0.01}
        found, ahead = with_least_gap(two_effects, alone[main], main, chances)
        assert found[closes] > 0.9
        assert 0.5 < ahead < 1.0  # 4.6 nat
        assert sum(found.values()) == pytest.approx(1.0)
    fewer = {closes: 0.6, leaves: 0.4, NONE: 0.0}
    assert with_least_gap(two_effects, alone[closes], closes, fewer) == (fewer, 0.0)


def test_strain_is_what_the_prior_loses():
    whole, less = SimpleNamespace(nuisance=np.array([1.0, 0.0])), SimpleNamespace(nuisance=np.array([3.0, -4.0]))
    assert nuisance_prior_cost(whole, less) == pytest.approx(12.0)
    assert nuisance_prior_cost(less, whole) == pytest.approx(-12.0)


@pytest.mark.parametrize(("lost", "stays"), [(DIAGNOSIS.evidence_needed, 2), (DIAGNOSIS.evidence_needed - 0.1, 1)])
def test_what_is_allowed_takes_no_effect_s_place_that_it_fills_only_at_its_limits(
    two_effects, monkeypatch, lost, stays
):
    def idle(search, hypothesis):
        return HeldOutImportance(np.ones(3), {label: np.zeros(3) for label in hypothesis.labels})

    monkeypatch.setattr(verdict_module, "held_out_importance", idle)
    monkeypatch.setattr(verdict_module, "nuisance_prior_cost", lambda hypothesis, less: lost)
    both = next(one for one in two_effects.ranked() if set(one.labels) == {"net_buoyancy", "pitch_trim"})
    kept, gained = prune_effects(two_effects, both)
    assert len(kept.labels) == stays
    assert set(gained) == set(kept.labels)


def test_a_search_that_takes_over_effects_makes_its_filter_at_them(two_effects, monkeypatch):
    """Made at the best single effect, it would weigh what is allowed as if all were still as far off."""
    monkeypatch.setattr(search_module, "MOST_EFFECTS", 2)  # none is added to those taken over, and nothing refined
    again = run(two_effects.problem.as_recorded, before=[two_effects.best])
    assert set(again.best.labels) == {"net_buoyancy", "pitch_trim"}
    assert again.fitter.temperature < 1.05  # 1.3 at the single one


def test_an_effect_is_as_large_as_it_is_where_what_is_allowed_could_take_it(two_effects):
    search = two_effects
    found = next(one for one in search.ranked() if set(one.labels) == {"net_buoyancy", "pitch_trim"})
    refitted = held_out_importance(search, found).tolerances("net_buoyancy")
    without_effect = {label: in_tolerances(grown) for label, grown in ablation_importance(search, found).items()}
    assert without_effect["net_buoyancy"] > 1.3 * refitted


def test_an_effect_that_is_worth_less_than_it_takes_is_ranked_by_the_geometric_mean(two_effects):
    search = two_effects
    found = next(one for one in search.ranked() if set(one.labels) == {"net_buoyancy", "pitch_trim"})
    without_effect, importance = ablation_importance(search, found), held_out_importance(search, found)
    ranked = rank_by_importance(search, found, without_effect)
    for label in found.labels:
        mean = np.sqrt(in_tolerances(without_effect[label]) * importance.tolerances(label))
        assert in_tolerances(ranked[label]) == pytest.approx(min(mean, in_tolerances(without_effect[label])))
    assert in_tolerances(ranked["net_buoyancy"]) < 0.9 * in_tolerances(without_effect["net_buoyancy"])


def test_an_effect_that_takes_most_in_every_run_is_first_in_every_draw():
    taken = {"drag": np.array([5.0, 4.0, 6.0]), "lift": np.array([1.0, 2.0, 0.5])}
    assert most_often(taken) == {"drag": 1.0, "lift": 0.0}


def test_effects_that_take_the_most_in_turn_share_the_first_place():
    taken = {"drag": np.array([5.0, 0.0, 5.0, 0.0]), "lift": np.array([0.0, 5.0, 0.0, 5.1])}
    found = most_often(taken)
    assert sum(found.values()) == pytest.approx(1.0)
    assert 0.3 < found["drag"] < 0.7
    assert most_often({"drag": np.array([1.0])}) == {"drag": 1.0}


@pytest.mark.parametrize("size", [0.05, 0.5, 1.0])
def test_a_small_effect_is_never_sure_and_none_never_before_it(size):
    found = doubt_small({"drag": 0.9, "lift": 0.1, NONE: 0.0}, "drag", size)
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["drag"] < 0.6
    assert found[NONE] <= DIAGNOSIS.none_ratio * found["drag"] + 1e-9
    assert found["lift"] / found["drag"] == pytest.approx(1.0 / 9.0)


def test_a_large_effect_stays_sure():
    assert doubt_small({"drag": 0.99, NONE: 0.01}, "drag", 4.0)["drag"] > 0.98


def shrinkage(after: float, floor: float = 0.15, recalibrated: float = 1.0, before: float = 1.0) -> SimpleNamespace:
    return SimpleNamespace(before=before, after=after, floor=floor, recalibrated=recalibrated)


def unknown(
    after: float, left: float, explained: float, evident: bool = True, taken: float = 9.0, noise=None,
    probed=(), effects=(), well_specified=False, before: float = 1.0,
) -> float:  # fmt: skip
    search = SimpleNamespace(
        problem=SimpleNamespace(rules=SimpleNamespace(whiteness=True)), well_specified=well_specified
    )
    remainder = Remainder(explained, left, list(probed))
    places = [catalogue()[label].place for label in effects]
    missed = shrinkage(after, recalibrated=before, before=before)
    return probability_unknown(search, evident, missed, remainder, noise, taken, places)


def gains(**by_name: float) -> list[ProbeResult]:
    places = {"gyro": ("sensing", "gyro"), "servo": ("actuation", "servo"), "slider": ("actuation", "slider")}
    return [ProbeResult(NoiseProbe(name, "sensor", *places[name]), gain, 6.0) for name, gain in by_name.items()]


def test_what_is_left_at_the_main_cause_s_sensor_alone_is_of_another_form_however_narrow():
    narrow = {"after": 0.23, "left": 1e5, "explained": 5e5}
    assert unknown(**narrow, probed=gains(gyro=1e5, servo=2e3), effects=["gyro_bias"]) > 0.5
    assert unknown(**narrow, probed=gains(gyro=1e5, servo=5e4), effects=["gyro_bias"]) < 0.2
    assert unknown(**narrow, probed=gains(slider=1e5, servo=2e3), effects=["gyro_bias"]) < 0.2
    small = narrow | {"left": 2.5e3}  # half a percent, of a sensor
    assert unknown(**small, probed=gains(gyro=2.5e3), effects=["gyro_bias"]) < 0.1
    small = narrow | {"left": 5e3}
    assert unknown(**small, probed=gains(slider=5e3), effects=["slider_slow"]) < 0.1


def test_what_is_left_at_the_sensor_of_any_effect_alone_is_of_another_form():
    narrow = {"after": 0.23, "left": 6e4, "explained": 5e5}
    assert unknown(**narrow, probed=gains(gyro=6e4, servo=2e3), effects=["drag", "gyro_bias"]) > 0.8
    assert unknown(**narrow, probed=gains(gyro=6e4, servo=2e3), effects=["drag"]) < 0.2
    assert unknown(**narrow, probed=gains(slider=6e4, servo=2e3), effects=["drag", "slider_slow"]) < 0.2


def test_what_leaves_next_to_no_gap_is_not_unknown_however_many_nat_it_has():
    assert left_floors(shrinkage(0.15 * np.sqrt(2.0))) == pytest.approx(1.0)
    assert unknown(after=0.16, left=1e5, explained=10.0) < 0.02
    assert unknown(after=0.16, left=1e5, explained=0.0, evident=False) < 0.02
    assert unknown(after=0.9, left=1e5, explained=10.0) > 0.9


def test_a_wide_gap_is_unknown_where_a_sensor_s_small_error_has_nearly_all_the_nat():
    assert left_share(shrinkage(0.8), 9.0) > 0.6
    assert unknown(after=0.8, left=1e3, explained=1e6) > 0.6
    assert unknown(after=0.2, left=1e3, explained=1e6) == DIAGNOSIS.least_unknown


def test_misfit_that_closes_with_the_gap_is_a_small_effect_s_unless_the_vehicle_is_known():
    closed = {"after": 0.5, "before": 3.0, "left": 2.0e4, "explained": 8.0e4}  # a fifth of the misfit, 3 % of the gap
    assert unknown(**closed, taken=15.0, well_specified=True) > 0.5
    assert unknown(**closed, taken=15.0) < 0.2


def test_a_narrow_gap_is_a_small_effect_s_unless_the_vehicle_is_known():
    narrow = {"after": 0.22, "left": 4.0e4, "explained": 6.0e4}  # 1.07 floors
    assert unknown(**narrow, well_specified=True) > 0.7
    assert unknown(**narrow) < 0.1
    assert (
        unknown(**narrow | {"left": 3.0e3}, well_specified=True) < 0.1
    )  # a known effect in another form leaves as much
    assert (
        unknown(**narrow | {"after": 0.17}, well_specified=True) < 0.5
    )  # half a floor: nobody could see it in a window


def test_what_is_wider_than_the_effects_themselves_is_unknown_however_wrong_the_recalibrated_model_is():
    assert left_share(shrinkage(1.2, recalibrated=3.3), taken=0.09) > 0.9
    assert left_share(shrinkage(1.2, recalibrated=3.3), taken=9.0) < 0.2


def test_what_the_allowed_parameters_take_up_of_a_large_effect_is_its_own():
    assert left_share(shrinkage(0.5, recalibrated=0.8, before=2.5), taken=9.0) < 0.1
    assert left_share(shrinkage(0.5, recalibrated=0.8, before=0.9), taken=9.0) > 0.25


def test_beside_a_wandering_clock_what_leaves_no_gap_is_not_unknown():
    clock = ProbeResult(NoiseProbe(CLOCK, "sensor", "timing", "mocap"), 5e4, 6.0)
    assert unknown(after=0.2, left=3e4, explained=5e4, noise=clock) < 0.05
    assert unknown(after=0.9, left=3e4, explained=5e4, noise=clock) > 0.5
    assert unknown(after=0.9, left=3e3, explained=5e6, noise=clock) > 0.9  # the clock has the nat, and not the gap


def test_as_likely_as_not_at_the_width_that_small_effects_leave():
    after = 0.15 * np.sqrt(1.0 + DIAGNOSIS.own_size**2)
    assert unknown(after, left=1e9, explained=0.0, evident=False) == pytest.approx(0.5)
    assert unknown(DIAGNOSIS.far_full_gap + 0.1, left=1.0, explained=1e9) > 0.99


def test_the_main_cause_takes_the_most_of_the_gap_however_many_nat_a_sensor_s_small_error_has(tmp_path):
    F = np.zeros(ef.N_F)
    F[ef.DRAG_0], F[ef.GYRO_SCALE] = 1.2, 0.15
    answer = conclude(run(problem_of(make_case(tmp_path, F, seed=6, mocap=True, rough=1.5))))
    assert answer.main == answer.selected[0] == "drag"
    assert "gyro_scale" in answer.selected
    assert answer.gained["gyro_scale"] > answer.gained["drag"]
    assert answer.probabilities["drag"] > 0.8
