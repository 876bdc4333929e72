"""Messy cases: noise times drawn factors, four small effects beside the main one, and how they are scored."""

import numpy as np
import pytest

from glider.tools.data.runs import columns as names
from glider.tools.data.sources import load_vehicle
from glider.tools.verify.challenge.design import POOL
from glider.tools.verify.challenge.diagnosis import AnsweredCause, AnswerFile
from glider.tools.verify.challenge.forms import FORMS
from glider.tools.verify.challenge.make import Order
from glider.tools.verify.challenge.messy import (
    BIAS,
    DISTURBANCE,
    LARGEST_SMALL_GAP,
    NOISE,
    draw_factors,
    small_one,
    small_ones,
)
from glider.tools.verify.challenge.plan import MESSY, Counts, plan
from glider.tools.verify.challenge.score import ScoredCase, score
from glider.tools.verify.challenge.trial import Trial, draw_trial, flyable

VEHICLE = load_vehicle("roughie")


@pytest.fixture(scope="module")
def trial() -> Trial:
    """A pool trial of two runs, flyable without effects, its noise not what the file says."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found = draw_trial(rng, VEHICLE, POOL, draw_factors(rng, VEHICLE).applied(VEHICLE))
        found.designs = found.designs[:2]
        if flyable(found.fly(found.shapes), POOL):
            return found
    raise AssertionError("no flyable trial in twenty")


def test_factors_are_drawn_within_their_ranges_and_each_of_its_own():
    factors = draw_factors(np.random.default_rng(1), VEHICLE)
    for drawn, (low, high) in ((factors.noise, NOISE), (factors.bias, BIAS), (factors.disturbance, DISTURBANCE)):
        assert all(low <= factor <= high for factor in drawn.values())
        assert len(set(drawn.values())) == len(drawn)
    flown = factors.applied(VEHICLE)
    assert flown.sensors.gyro.noise == pytest.approx(VEHICLE.sensors.gyro.noise * factors.noise["gyro"])
    assert flown.sensors.depth.bias == pytest.approx(VEHICLE.sensors.depth.bias * factors.bias["depth"])
    assert flown.disturbance.angular == pytest.approx(VEHICLE.disturbance.angular * factors.disturbance["angular"])
    assert flown.mass == VEHICLE.mass


def test_a_messy_vehicle_flies_with_its_own_noise_and_its_file_says_another(trial):
    run = trial.fly(trial.shapes, 1)[0].run
    jumps = np.diff(run.columns[names.RATES[1]], 3)
    noise = np.median(np.abs(jumps)) / 0.6745 / np.sqrt(20.0)
    assert noise == pytest.approx(trial.flown.sensors.gyro.noise, rel=0.1)
    assert trial.vehicle.sensors == VEHICLE.sensors != trial.flown.sensors


def test_a_small_effect_is_visible_but_at_most_by_the_factor_allowed(trial):
    found = small_one(np.random.default_rng(3), trial, FORMS["drag"])
    assert found is not None
    assert 1.1 < found.visible <= LARGEST_SMALL_GAP
    assert found.strength < FORMS["drag"].most


def test_four_small_ones_of_places_of_their_own(trial):
    taken = {("hydrodynamics", "surge"), ("sensing", "attitude")}
    found = small_ones(np.random.default_rng(4), trial, taken)
    places = [place for size in found for place in size.form.places]
    assert len(found) == 4
    assert len(set(places)) == len(places)
    assert not taken & set(places)


def test_a_messy_plan_is_the_plain_one_with_a_flag():
    for messy, clean in zip(plan(5, Counts(), True), plan(5, Counts()), strict=True):
        assert (messy.labels, messy.weak, messy.mocap, messy.messy) == (clean.labels, clean.weak, clean.mocap, True)
    assert MESSY.total == 140


def test_the_order_of_a_clean_set_is_as_it_was(tmp_path):
    clean, messy = (Order(tmp_path, 1, Counts(), tmp_path / "a", flag) for flag in (False, True))
    assert "messy" not in clean.plain
    assert messy.plain == clean.plain | {"messy": True}


def truth(*labels: str, secret=()) -> dict:
    small = [{"label": "gyro_bias"}, {"label": "compass"}]
    return {"labels": list(labels), "places": [], "secret": list(secret), "small": small}


def said(verdict: str, *causes: tuple[str, float]) -> AnswerFile:
    return AnswerFile(1, verdict, [], [AnsweredCause(*cause) for cause in causes], [])


def test_without_a_large_effect_small_ones_may_have_some_probability_but_none_is_sure():
    shared = ScoredCase("a", truth(), said("cause", ("gyro_bias", 0.5), ("none", 0.4), ("drag", 0.1)))
    sure = ScoredCase("b", truth(), said("cause", ("gyro_bias", 0.9), ("none", 0.1)))
    none = ScoredCase("c", truth(), said("none", ("none", 0.95), ("drag", 0.05)))
    unknown = ScoredCase("d", truth(), said("unknown", ("unknown", 0.9), ("none", 0.1)))
    silent = ScoredCase("e", truth(), None)
    found = {figure.key: (figure.count, figure.of) for figure in score([shared, sure, none, unknown, silent]).figures}
    assert found["small_sure"] == (3, 5)  # b, d, e
    assert found["small_called_gap"] == (4, 5)
    assert found["sure_and_wrong"] == (3, 5)
    assert shared.log_loss() == pytest.approx(-np.log(0.9))
    assert sure.log_loss() == pytest.approx(0.0, abs=1e-12)


def test_beside_a_large_effect_a_small_one_is_wrong():
    right = ScoredCase("a", truth("drag"), said("cause", ("drag", 0.9), ("gyro_bias", 0.1)))
    wrong = ScoredCase("b", truth("drag"), said("cause", ("gyro_bias", 0.9), ("drag", 0.1)))
    found = {figure.key: (figure.count, figure.of) for figure in score([right, wrong]).figures}
    assert found["right_cause_first"] == (1, 2)
    assert found["in_first_three"] == (2, 2)
    assert found["sure_and_wrong"] == (1, 2)
