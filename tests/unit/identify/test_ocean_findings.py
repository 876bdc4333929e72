"""A calibration that the vehicle file has wrong is found with its size; labels that nothing parts are told."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.sim_backend.ocean.catalogue import ONE_ON_DEPTH
from glider.tools.identify.ocean.files import plain
from glider.tools.identify.ocean.findings import Calibration, groups_of, one_of_each_group
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.identify.ocean.next_run import flown, to_find, to_part
from glider.tools.watch.whole_case import diagnose_ocean
from glider.tools.watch.whole_case import plain as plain_diagnosis
from tests.support.ocean import as_case, fly_dives

pytestmark = pytest.mark.computes(seconds=25)

CRAFT, DIVES, WRONG, MORE = "seaglider", 8, -0.14, 0.7


@pytest.fixture(scope="module")
def pitch_wrong(tmp_path_factory):
    """A mission with a speed log whose pitch sensor reads far less than the file allows; true scale."""
    dives = fly_dives(DIVES, ("attitude_scale", WRONG, 0), speed=True, vehicle_class=CRAFT)
    case = as_case(tmp_path_factory.mktemp("pitch") / "case", dives.runs, CRAFT)
    return case, float(dives.mission.V[foreign.PITCH_SCALE]) + WRONG


def finding(found, label):
    return next((one for one in found if one.label == label), None)


def test_a_pitch_sensor_far_from_the_file_is_found_with_its_size(pitch_wrong):
    case, true = pitch_wrong
    one = finding(identify_ocean(case).findings, "attitude_scale")
    low, high = one.ci90
    assert low < true - 1.0 < high < -0.03
    assert not one.within
    assert "file allows" in one.sentence


def test_also_where_the_file_has_no_uncertainty_of_it(pitch_wrong):
    case, true = pitch_wrong
    closed = msgspec.structs.replace(case.vehicle.uncertainty, pitch_scale=0.0)
    vehicle = msgspec.structs.replace(case.vehicle, uncertainty=closed)
    found = identify_ocean(replace(case, vehicle=vehicle))
    assert "pitch_scale" not in [one.name for one in found.parameters]
    one = finding(found.findings, "attitude_scale")
    assert one.size == pytest.approx(true - 1.0, abs=0.06)
    assert not one.within


def test_drag_that_the_file_leaves_open_is_a_finding_of_identification_and_of_a_diagnosis(tmp_path):
    dives = fly_dives(DIVES, ("drag", MORE, 0), vehicle_class=CRAFT)
    case = as_case(tmp_path / "case", dives.runs, CRAFT)
    true = dives.mission.V[foreign.DRAG] * (1.0 + MORE) / case.vehicle.hydrodynamics.Cd0 - 1.0
    identified, diagnosed = identify_ocean(case), diagnose_ocean(case)
    for found in (identified, diagnosed):
        one = next(one for one in found.findings if one.label in ONE_ON_DEPTH)
        assert set(one.group) >= set(ONE_ON_DEPTH)
        if one.label == "drag":
            assert one.size == pytest.approx(true, rel=0.25)
    answer = plain(identified)
    assert answer["groups"] == identified.groups
    assert any(set(group) >= set(ONE_ON_DEPTH) for group in answer["groups"])
    assert {"label", "size", "ci90", "unit", "text"} <= set(answer["findings"][0])
    questions = plain_diagnosis(diagnosed)
    assert questions["findings"]
    assert all(one["text"] in questions["cautions"] for one in questions["findings"])
    groups = {one["label"]: one["group"] for one in questions["causes"]}
    assert set(groups["lift"]) >= set(ONE_ON_DEPTH)
    assert groups["lift"][0] == "lift"
    assert " pitch" in questions["next_run"]["text"]


def calibration(label: str, size: float, group: tuple[str, ...]) -> Calibration:
    return Calibration(label, "", 1.0, size, 0.1, "1", False, group)


def test_of_a_group_the_surest_is_told():
    drag = calibration("drag", 1.0, ("drag", "lift"))
    assert one_of_each_group([calibration("lift", -0.5, ("lift",)), drag]) == [drag]
    apart = calibration("ballast_scale", 0.4, ("ballast_scale",))
    assert one_of_each_group([apart, drag]) == [drag, apart]


def test_groups_are_labels_of_directions_that_nothing_was_learned_of():
    assert groups_of([["lift_slope"], ["Cd0", "Cd1"]], ()) == []
    assert groups_of([["oil_scale", "pitch_scale"]], ONE_ON_DEPTH) == [
        list(ONE_ON_DEPTH), ["ballast_scale", "attitude_scale"]
    ]  # fmt: skip
    assert groups_of([["lift_slope", "pitch_scale"]], ONE_ON_DEPTH) == [list(ONE_ON_DEPTH)]


def test_the_next_dives_are_commands_by_how_it_was_flown():
    dives = fly_dives(3, vehicle_class=CRAFT)
    how = flown(dives.runs)
    asked = dives.mission.dives[0]
    assert how.depth == pytest.approx(asked[foreign.DEPTH], rel=0.2)
    assert how.pitch_down == pytest.approx(np.degrees(asked[foreign.PITCH_DOWN]), abs=4.0)
    assert how.oil_up == pytest.approx(1e6 * asked[foreign.OIL_UP], rel=0.2)
    assert f"{0.5 * how.depth:.0f} m" in to_part([["compressibility", "thermal_expansion"]], how)
    assert "cm3 down" in to_part([["ballast_scale", "drag"]], how)
    assert "CTD" in to_part([["net_buoyancy", "density_bias"]], how)
    assert to_part([["drag"]], how) == to_part([["drag", "lift"]], None) == ""
    assert "on the way up" in to_find("on the way up", how)
    assert "thruster" in to_find("", how)
    assert to_find("", None) == ""
