"""`glider identify` on missions of another simulator: what it flew is found, within the intervals that are given."""

import json
from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.sim_backend.ocean.vehicle import PLACES, UNITS, decode_ocean_vehicle
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.identify.ocean.files import RESULT, VEHICLE, plain, vehicle_text, write
from glider.tools.identify.ocean.identify import MOST_RUNS, identify_ocean, learnable
from glider.tools.inference.model import vehicle_model
from tests.support.ocean import as_case, fly_dives, without

DIVES, SIGMAS = 8, 3.0
# what means the same to the vehicle that flew and to the model
SAME = {
    "volume": foreign.VOLUME, "compressibility": foreign.COMPRESSION, "thermal_expansion": foreign.EXPANSION,
    "Cd0": foreign.DRAG, "lift_slope": foreign.LIFT, "oil_scale": foreign.OIL_SCALE,
    "pitch_offset": foreign.PITCH_OFFSET, "pitch_scale": foreign.PITCH_SCALE, "roll_trim": foreign.ROLL_TRIM,
}  # fmt: skip


@pytest.fixture(scope="module")
def dives():
    return fly_dives(DIVES, speed=True)


@pytest.fixture(scope="module")
def case(tmp_path_factory, dives):
    return as_case(tmp_path_factory.mktemp("speed") / "case", dives.runs)


@pytest.fixture(scope="module")
def found(case):
    return identify_ocean(case)


@pytest.fixture(scope="module")
def on_depth(tmp_path_factory):
    return identify_ocean(as_case(tmp_path_factory.mktemp("depth") / "case", fly_dives(DIVES).runs))


@pytest.mark.parametrize("which", ["found", "on_depth"])
def test_what_was_flown_is_within_the_intervals(which, request, dives):
    for one in request.getfixturevalue(which).parameters:
        true = float(dives.mission.V[SAME[one.name]])
        assert abs(one.mean - true) < SIGMAS * one.sd, f"{one.name}: {one.mean} +- {one.sd}, flown {true}"


def test_what_dives_tell_is_told_far_better_than_before(found, dives):
    sure = {one.name: one.sd / one.prior_sd for one in found.parameters}
    assert sure["volume"] < 0.05
    assert sure["Cd0"] < 0.3
    assert sure["roll_trim"] < 0.1
    assert all(0.0 < share < 1.01 for share in sure.values())


def test_vertical_water_is_what_the_sea_had(found, dives):
    true = np.mean([S[foreign.WATER] for S in dives.mission.seas[:DIVES]])
    assert found.case.disturbance.water == pytest.approx(true, rel=0.5)
    assert found.water_rms == pytest.approx(true, rel=0.5)
    assert set(found.water) == {run.name for run in found.problem.runs}


def test_the_file_reads_back_to_the_same_model(found):
    vehicle = decode_ocean_vehicle(vehicle_text(found), "identified")
    model = vehicle_model("identified", vehicle)
    assert pytest.approx(found.P, rel=1e-12, abs=1e-18) == model.P
    places = [PLACES[one.name] for one in found.parameters]
    for directions, true in ((model.sure, found.covariance), (model.spread, found.allowed)):
        assert directions is not None
        C, scale = directions.T @ directions, np.sqrt(np.diag(true))
        back = C[np.ix_(places, places)] / np.outer(scale, scale)
        assert back == pytest.approx(true / np.outer(scale, scale), abs=1e-6)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([one.sd for one in found.parameters], rel=1e-9)
    assert vehicle.disturbance == found.case.disturbance
    assert vehicle.identified is not None
    assert vehicle.identified.runs == DIVES


def test_the_command_finds_the_same_bit_for_bit(found, case, tmp_path, monkeypatch, capsys):
    once, again = tmp_path / "once", tmp_path / "again"
    write(found, once)
    monkeypatch.setattr("sys.argv", ["glider", "identify", str(case.folder), "--out", str(again), "--json"])
    assert report_errors(cli) == 0
    for name in (VEHICLE, RESULT):
        assert (once / name).read_bytes() == (again / name).read_bytes()
    assert json.loads(capsys.readouterr().out) == json.loads((once / RESULT).read_text())


def test_without_speed_drag_lift_and_pitch_scale_go_together(found, on_depth):
    named = {name for weak_direction in on_depth.ridges for name in weak_direction.names}
    assert {"lift_slope", "pitch_scale"} <= named
    assert on_depth.next_run is not None
    assert "pitch" in on_depth.next_run["text"]
    for weak_direction in on_depth.ridges:
        assert 0.6 <= weak_direction.left <= 1.01
        assert len(weak_direction.names) == len(weak_direction.weights)
    for name in ("Cd0", "pitch_offset", "volume"):
        with_speed, alone = (next(p.sd for p in one.parameters if p.name == name) for one in (found, on_depth))
        assert with_speed < alone, name


def test_fields_of_the_answer(found):
    answer = plain(found)
    assert answer["kind"] == "ocean"
    assert answer["runs"] == [run.name for run in found.problem.runs]
    for one in answer["parameters"]:
        low, high = one["ci90"]
        assert low < one["mean"] < high
        assert one["unit"] == (UNITS | {"net_mass": "kg"})[one["name"]]
    assert {one["name"] for one in answer["parameters"]} == {*SAME, "net_mass"}
    assert set(answer["water"]) == {"sd", "time", "rms", "runs"}
    assert answer["left_out"] == []
    for weak_direction in answer["ridges"]:
        assert set(weak_direction["names"]) <= set(PLACES)


def test_net_mass_is_what_is_heavier_than_the_water(found):
    volume = next(one for one in found.parameters if one.name == "volume")
    mass = found.case.vehicle.buoyancy.mass
    assert found.net_mass.mean == pytest.approx(mass - 1027.0 * volume.mean)
    assert found.net_mass.sd == pytest.approx(1027.0 * volume.sd)


def test_runs_that_tell_nothing_are_left_out_with_their_reason(case):
    runs = list(without(case, names.OIL, (0,)).runs)
    runs[1] = replace(runs[1], columns={name: values[:40] for name, values in runs[1].columns.items()})
    good, out = learnable(runs)
    assert [run.name for run in good] == [run.name for run in runs[2:]]
    assert out[0] == f"run00: no {names.OIL}"
    assert out[1].startswith("run01: ")
    assert "300 s" in out[1]
    with pytest.raises(InputError, match=f"no {names.DENSITY}"):
        identify_ocean(without(case, names.DENSITY))
    assert MOST_RUNS >= DIVES
