"""The Fossen AUV of docs/examples: a thruster's gain, a current, a lever arm found, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from glider.tools.own.decision import NONE
from glider.tools.own.declare import with_groups
from glider.tools.own.load import read_own
from tests.support.own_cases import FOSSEN, answers, diagnosed, fly, identified, size_of

pytestmark = pytest.mark.computes(seconds=50)


@pytest.fixture(scope="module")
def vehicle():
    return read_own(FOSSEN)


@pytest.fixture(scope="module")
def known(vehicle, tmp_path_factory):
    return identified(vehicle, 5, tmp_path_factory.mktemp("known"))


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


@pytest.mark.parametrize("late", [0.4, -0.4])
def test_all_inputs_late_are_one_cause_and_so_are_all_outputs(known, late):
    """Commands that act later than they are stamped, and readings that are stamped later than they were taken."""
    runs = fly(known, 14, {"inputs_delay": late})
    clocks = [replace(run, outputs=shifted(known, run, late)) for run in fly(known, 15, {})]
    for flown in (runs, clocks):
        answer = diagnosed(known, flown)
        found, chance = first(answer)
        assert found == "inputs_delay"
        assert chance > 0.9
        assert size_of(answer, found)[0] == pytest.approx(late, abs=0.05)


def test_one_input_late_is_not_all(known):
    found, chance = first(diagnosed(known, fly(known, 16, {"elevator_delay": 0.6})))
    assert found == "elevator_delay"
    assert chance > 0.9


def test_a_device_that_is_late_is_one_cause_where_the_file_says_what_it_reads(known):
    imu = [one.name for one in known.declared.outputs if one.unit.startswith("rad")]
    runs = [replace(run, outputs=shifted(known, run, 0.3, imu)) for run in fly(known, 17, {})]
    grouped = replace(known, declared=with_groups(known.declared, {"imu": imu}))
    answer = diagnosed(grouped, runs)
    found, chance = first(answer)
    assert found == "imu_delay"
    assert chance > 0.9
    assert size_of(answer, found)[0] == pytest.approx(0.3, abs=0.05)
    unasked = replace(grouped, declared=replace(grouped.declared, odds={"imu_delay": 0.0}))
    assert first(diagnosed(unasked, runs))[0] != "imu_delay"


def shifted(vehicle, run, late: float, names=None) -> np.ndarray:
    """Outputs of a run, those of some names, read `late` seconds later than they are stamped."""
    found = [np.interp(run.t - late, run.t, np.unwrap(y) if one.angle else y)
             if names is None or one.name in names else y
             for one, y in zip(vehicle.declared.outputs, run.outputs.T, strict=True)]  # fmt: skip
    return np.array(found).T


def test_answers_of_sealed_cases_are_those_of_their_seed():
    assert answers(4, 30) == answers(4, 30)
    assert answers(4, 30) != answers(5, 30)
    assert sum(not one for one in answers(4, 30)) == 10
    assert all(np.isfinite(list(one.values())).all() for one in answers(4, 30))
