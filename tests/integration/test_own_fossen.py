"""The Fossen AUV of docs/examples: a thruster's gain, a current, a lever arm found, and none where there is none."""

import numpy as np
import pytest

from glider.tools.own.decision import NONE
from glider.tools.own.load import read_own
from tests.support.own_cases import FOSSEN, answers, diagnosed, fly, size_of

pytestmark = pytest.mark.computes(seconds=50)


@pytest.fixture(scope="module")
def vehicle():
    return read_own(FOSSEN)


def first(answer) -> tuple[str, float]:
    return max(answer.chances.items(), key=lambda pair: pair[1])


def test_the_model_is_compiled(vehicle):
    assert vehicle.kernels.compiled, vehicle.kernels.why


def test_none_where_there_is_none(vehicle):
    label, chance = first(diagnosed(vehicle, fly(vehicle, 11, {}, runs=2)))
    assert label == NONE
    assert chance > 0.8


@pytest.mark.parametrize(
    ("label", "size", "runs"),
    [("port_gain", -0.12, 2), ("current_north", 0.2, 2), ("pressure_x", -1.0, 4), ("thruster_y", 0.1, 2)],
)
def test_a_change_is_found_with_its_size(vehicle, label, size, runs):
    answer = diagnosed(vehicle, fly(vehicle, 12, {label: size}, runs=runs))
    found, chance = first(answer)
    assert found == label
    assert chance > 0.5
    mean, sd = size_of(answer, label)
    assert mean == pytest.approx(size, abs=3.0 * sd)
    assert sd < 0.3 * abs(size)


def test_answers_of_sealed_cases_are_those_of_their_seed():
    assert answers(4, 30) == answers(4, 30)
    assert answers(4, 30) != answers(5, 30)
    assert sum(not one for one in answers(4, 30)) == 10
    assert all(np.isfinite(list(one.values())).all() for one in answers(4, 30))
