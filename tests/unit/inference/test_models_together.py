"""Models followed several at once against each of them alone, whatever is at work in them and flies beside them."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.problem import LOST, problem_of
from tests.support.cases import make_case

# entries of F for each model: every branch of the physics is taken by some, and no two lanes take the same
MODELS = (
    {}, {"COMMAND_DELAY": 0.65}, {"SERVO_PLAY": 0.1, "SLIDER_PLAY": 0.004}, {"ATTITUDE_LAG": 0.4, "DEPTH_LAG": 0.9},
    {"COMPASS_S1": 0.1, "COMPASS_C2": 0.05}, {"STALL": 20.0, "CLIMB_DIVE": 0.3}, {"PUMP_DROOP": 0.1},
    {"MOCAP_DELAY": 0.35, "CLOCK_SKEW": 0.002}, {"TETHER": 1.0, "TETHER_ACROSS": 0.5}, {"LINEAR_DRAG": 0.5},
    {"ROLL_TRIM": 0.1, "YAW_TRIM": 0.1}, {"DEPTH_LEVER": 0.2, "GYRO_SCALE": 0.1}, {"SERVO_LIMIT": 0.3},
    {"SERVO_LIMIT": 0.4, "SERVO_GIVE": 0.5}, {"MASS_PER_DEPTH": -0.01, "MIXED_LAYER": 1.0},
    {"LINK": 5.0, "SHAPE": 0.05}, {"LINK": 11.0, "SHAPE": 0.02}, {"LINK": 7.0, "SHAPE": 0.02},
)  # fmt: skip


def vector(entries):
    F = np.zeros(ef.N_F)
    for name, value in entries.items():
        F[getattr(ef, name)] = value
    return F


@pytest.fixture(scope="module", params=[False, True], ids=["taken at its word", "lacking"])
def problem(request, tmp_path_factory):
    made = problem_of(make_case(tmp_path_factory.mktemp("together"), vector({}), seed=4, runs=2, mocap=True))
    if request.param:
        made.spreads = np.hstack([made.spreads, np.tile(made.kind.model_error_sd, (len(made.runs), 1))])
    return made


@pytest.fixture(scope="module")
def models(problem):
    """Parameters of their own, and one of MODELS each."""
    rng, model = np.random.default_rng(7), problem.model
    return [(model.P + 0.1 * model.sigma * rng.standard_normal(len(model.P)), vector(entries)) for entries in MODELS]


def test_each_of_several_models_flies_as_the_filter_does(problem, models):
    """The filter flies one at a time, by the C library's functions; with its gains it is the model followed."""
    apart = []
    for number, (P, F) in enumerate(models):
        gains = problem.filter(P, F)
        alone = gains.E[problem.valid]
        apart.append(np.max(np.abs(problem.follow(models, gains)[number] - alone) / np.maximum(1.0, np.abs(alone))))
    plays = [number for number, entries in enumerate(MODELS) if "SERVO_PLAY" in entries]
    # whether a play is taken up turns on the last digit, and the filter alone moves as much when P does by 1e-16
    assert max(np.delete(apart, plays)) < 1e-8
    assert max(apart) < 1.0


def test_a_model_flies_alike_whatever_flies_beside_it(problem, models):
    gains = problem.filter(problem.model.P, vector({}))
    together = problem.follow(models, gains)
    order = np.random.default_rng(8).permutation(len(models))
    np.testing.assert_array_equal(problem.follow([models[n] for n in order], gains), together[order])
    np.testing.assert_array_equal(problem.follow(models[6:7], gains), together[6:7])


def test_a_lost_model_takes_none_along(problem, models):
    gains = problem.filter(problem.model.P, vector({}))
    P, F = models[1]
    together, lost = problem.follow(models, gains), problem.follow([models[0], (P * np.nan, F), *models[2:]], gains)
    assert (np.abs(lost[1]) == LOST).mean() > 0.9  # but for what is read of nothing that moves
    others = np.arange(len(models)) != 1
    np.testing.assert_array_equal(lost[others], together[others])
