"""`glider gap isolability`: which effects a planned log could show and distinguish."""

import json

import numpy as np
import pytest

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs import columns as names
from glider.tools.data.sources import load_vehicle
from glider.tools.diagnose.isolability import ONBOARD, isolability, planned
from glider.tools.inference.hyperparameters import DIAGNOSIS


@pytest.fixture(scope="module")
def onboard():
    return {one.label: one for one in isolability(planned(load_vehicle("roughie"), ONBOARD))}


@pytest.fixture
def glider(monkeypatch, capsys):
    """Run the command line; returns exit code, standard output, standard error."""

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["glider", *words])
        code = report_errors(cli)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def test_every_effect_with_a_predictable_course_is_asked_about(onboard):
    clocks = {"mocap_delay", "clock_skew"}  # of motion capture, which is not onboard
    assert set(onboard) == {label for label, effect in catalogue().items() if effect.apply is None} - clocks


def test_what_moves_nothing_that_is_measured_is_not_visible(onboard):
    assert not onboard["current"].visible  # a steady current, without positions
    assert np.isinf(onboard["current"].smallest)
    assert onboard["drag"].visible
    assert onboard["gyro_scale"].visible


def test_a_sensor_that_is_left_out_hides_its_effects():
    without = planned(load_vehicle("roughie"), [name for name in ONBOARD if name not in names.RATES])
    found = {one.label: one for one in isolability(without)}
    assert not found["gyro_scale"].visible
    assert not found["gyro_bias"].visible
    assert found["drag"].visible


def test_what_acts_alike_is_confused_both_ways(onboard):
    """Net mass that changes with depth: lighter by the water, heavier by the hull."""
    assert "stratification" in onboard["compressibility"].confused_with
    assert "compressibility" in onboard["stratification"].confused_with
    assert "gyro_scale" not in onboard["drag"].confused_with


def test_an_effect_of_the_smallest_size_has_the_evidence_needed(onboard):
    """Evidence goes with the square of a size: by half the trace of the information."""
    for one in onboard.values():
        if one.visible:
            assert one.evidence <= DIAGNOSIS.evidence_needed / one.smallest**2


def test_motion_capture_shows_a_current():
    columns = (*ONBOARD, *names.MOCAP)
    found = {one.label: one for one in isolability(planned(load_vehicle("roughie"), columns), ["current"])}
    assert found["current"].visible
    assert list(found) == ["current"]


def test_the_command_as_json(glider):
    code, out, _ = glider("gap", "isolability", "--labels", "drag,lift", "--manoeuvres", "steep", "--json")
    assert code == 0
    found = json.loads(out)
    assert [one["label"] for one in found["effects"]] == ["drag", "lift"]
    assert found["columns"] == list(ONBOARD)
    assert found["manoeuvres"] == ["steep"]


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--columns", "roll,depth_m", "--columns: no column 'roll'; "),
        ("--labels", "dragg", "--labels: no 'dragg'; "),
        ("--manoeuvres", "loop", "--manoeuvres: no 'loop'"),
    ],
)
def test_a_bad_name_is_one_line_and_exit_2(glider, option, value, said):
    code, out, err = glider("gap", "isolability", option, value)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1
