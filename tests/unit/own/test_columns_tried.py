"""A log whose columns stand in another unit, with a turned sign, or exchanged: said before anything is fitted."""

from dataclasses import replace

import numpy as np
import pytest

from glider.tools.own.columns_tried import tried
from glider.tools.own.load import read_own
from tests.support.own_cases import FOSSEN, fly

pytestmark = pytest.mark.computes(seconds=20)
DEGREES = 180.0 / np.pi


@pytest.fixture(scope="module")
def vehicle():
    return read_own(FOSSEN)


@pytest.fixture(scope="module")
def runs(vehicle):
    return fly(vehicle, 3, {}, runs=4)


def logged(vehicle, run, mistakes, exchanged=()):
    """A run as a mistaken import has it: columns times a factor, by name, and two exchanged."""
    tables = {"inputs": run.inputs.copy(), "outputs": run.outputs.copy()}
    for name, times in mistakes.items():
        what = "inputs" if name in [one.name for one in vehicle.declared.inputs] else "outputs"
        tables[what][:, vehicle.declared.index(what, name)] *= times
    if exchanged:
        a, b = (vehicle.declared.index("inputs", name) for name in exchanged)
        tables["inputs"][:, [a, b]] = tables["inputs"][:, [b, a]]
    return replace(run, **tables)


def test_of_a_log_as_it_should_be_nothing_is_said(vehicle, runs):
    assert tried(vehicle, runs) == []


def test_nor_of_a_vehicle_that_is_far_from_its_file(vehicle):
    assert tried(vehicle, fly(vehicle, 4, {"port_gain": -0.3, "depth_bias": 2.0, "pitch_bias": 0.2})) == []


@pytest.mark.parametrize(
    ("mistakes", "times"),
    [
        ({"pitch": DEGREES}, 1.0 / DEGREES),
        ({"gyro_x": DEGREES, "gyro_y": DEGREES, "gyro_z": DEGREES}, 1.0 / DEGREES),
        ({"elevator": -1.0}, -1.0),
        ({"elevator": DEGREES}, 1.0 / DEGREES),
        ({"depth": -1.0}, -1.0),
        ({"log_forward": 100.0}, 0.01),
    ],
    ids=lambda one: "-".join(one) if isinstance(one, dict) else "",
)
def test_a_mistake_of_an_import_is_the_first_that_is_said(vehicle, runs, mistakes, times):
    first = tried(vehicle, [logged(vehicle, run, mistakes) for run in runs])[0]
    declared = [*vehicle.declared.inputs, *vehicle.declared.outputs]
    assert first["columns"] == [one.column for one in declared if one.name in mistakes]
    assert first["times"] == pytest.approx(times)


def test_two_propellers_exchanged_are_said_by_name(vehicle, runs):
    first = tried(vehicle, [logged(vehicle, run, {}, ("port", "starboard")) for run in runs])[0]
    assert "exchanged?" in first["what"]
    assert first["columns"] == [one.column for one in vehicle.declared.inputs if one.name in ("port", "starboard")]
