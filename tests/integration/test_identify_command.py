"""`glider identify` on a small captured case: truth held, bad runs named, files that others read."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from glider.firmware.model.vehicle import COEFFICIENTS, decode_vehicle
from glider.tools.cli.identify import identify
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.design import CAPTURE, make_runs
from glider.tools.inference.vehicle_parameters import coefficient_sizes

pytestmark = pytest.mark.computes(seconds=35)

ABOUT = dict(vehicle="roughie", site="pool", log_rate_hz=50.0, water_density_kg_m3=998.0, sensors=CAPTURE)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A case of seven runs, the capture of one 4 s behind, one in millimetres: result, folder, truth."""
    folder = tmp_path_factory.mktemp("identify")
    runs, world = make_runs(load_vehicle("roughie"), 6, [0, 6, 12, 18, 24, 31, 37])
    late = {name: np.concatenate([np.repeat(np.nan, 200), runs[2].columns[name][:-200]]) for name in names.MOCAP}
    runs[2] = replace(runs[2], columns=runs[2].columns | late)
    longer = {name: 1000.0 * runs[4].columns[name] for name in names.MOCAP_POSITION}
    runs[4] = replace(runs[4], columns=runs[4].columns | longer)
    write_case(folder / "case", runs, **ABOUT)
    ran = CliRunner().invoke(identify, [str(folder / "case"), "--out", str(folder / "out"), "--json"])
    assert ran.exit_code == 0, ran.output
    return json.loads(ran.stdout), folder / "out", world.coefficients()


def test_the_truth_is_held_and_close(found):
    result, _, truth = found
    sizes = dict(zip(COEFFICIENTS, coefficient_sizes(load_vehicle("roughie").vector()), strict=True))
    assert [p["name"] for p in result["parameters"]] == list(COEFFICIENTS)
    assert np.median([abs(p["mean"] - truth[p["name"]]) / sizes[p["name"]] for p in result["parameters"]]) < 0.02
    assert sum(p["ci90"][0] <= truth[p["name"]] <= p["ci90"][1] for p in result["parameters"]) >= 8
    assert all(p["rhat"] <= 1.01 and p["ess"] >= 400 for p in result["parameters"])
    assert 0.3 < result["acceptance"] < 0.6


def test_runs_that_cannot_be_fitted_are_named(found):
    result, _, _ = found
    reasons = {entry["run"]: entry["reason"] for entry in result["divergent_runs"]}
    assert set(reasons) == {"run02", "run04"}
    assert "millimetres?" in reasons["run04"]
    assert "every model" in reasons["run02"]


def test_flights_left_out_are_predicted_better(found):
    held = found[0]["held_out"]
    assert held["after"]["total"] < 0.5 * held["before"]["total"]
    assert held["handed_out"] == "likelihood"  # the vehicle obeys equation (4)
    assert held["candidates"]["likelihood"] == held["after"]
    for regime in held["regimes"].values():
        assert regime["after"]["total"] < regime["before"]["total"]


def test_the_vehicle_file_says_what_its_form_leaves(found):
    result, out, _ = found
    form = decode_vehicle((out / "identified.toml").read_text(encoding="utf-8"), "identified.toml").form
    assert form.runs == len(result["held_out"]["runs"])
    assert form.gaps["all"]["total"] == pytest.approx(result["held_out"]["after"]["total"], rel=0.01)
    assert {"dive", "turning", "straight", "moving"} <= set(form.gaps)


def test_files_are_there_and_others_read_them(found):
    import arviz

    result, out, _ = found
    vehicle = decode_vehicle((out / "identified.toml").read_text(encoding="utf-8"), "identified.toml")
    assert result["parameters"][3]["mean"] == pytest.approx(vehicle.hydrodynamics.K_L, rel=1e-3)
    assert vehicle.identified.runs == 5
    C = np.array(vehicle.identified.covariance)
    assert np.sqrt(C[3, 3]) == pytest.approx(result["parameters"][3]["sd"], rel=0.05)
    posterior = arviz.from_netcdf(str(out / "posterior.nc")).posterior
    assert float(posterior["K_L"].mean()) == pytest.approx(result["parameters"][3]["mean"])
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "data:image/png;base64" in page
    assert "run04" in page
    assert 'src="http' not in page


def test_a_case_of_nothing_but_bad_runs_is_one_line(tmp_path):
    from glider.tools.data.errors import InputError

    runs, _ = make_runs(load_vehicle("roughie"), 6, [0, 6])
    bad = [
        replace(run, columns=run.columns | {n: np.degrees(run.columns[n]) for n in names.MOCAP_ATTITUDE})
        for run in runs
    ]
    write_case(tmp_path / "case", bad, **ABOUT)
    ran = CliRunner().invoke(identify, [str(tmp_path / "case")])
    assert isinstance(ran.exception, InputError)
    assert " 2 runs" in str(ran.exception)
    assert "run00.csv" in str(ran.exception)


def test_where_no_fit_is_better_the_file_s_vehicle_is_handed_out(tmp_path, monkeypatch):
    from glider.tools.identify import held

    runs, _ = make_runs(load_vehicle("roughie"), 6, [0, 12, 24, 37])
    write_case(tmp_path / "case", runs, **ABOUT)
    reason = "no fit is better"
    monkeypatch.setattr(held, "choose", lambda candidates: (candidates[0], reason))
    ran = CliRunner().invoke(identify, [str(tmp_path / "case"), "--out", str(tmp_path / "out"), "--json"])
    assert ran.exit_code == 0, ran.output
    result = json.loads(ran.stdout)
    assert result["held_out"]["handed_out"] == "file"
    assert result["held_out"]["after"] == result["held_out"]["before"]
    assert any(note.startswith("identified.toml") and reason in note for note in result["notes"])
    vehicle = decode_vehicle((tmp_path / "out" / "identified.toml").read_text(encoding="utf-8"), "identified.toml")
    assert vehicle.form.runs == 4
    assert msgspec.structs.replace(vehicle, form=None) == load_case(tmp_path / "case").roughie
