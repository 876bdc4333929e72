"""`glider gap velocity`: held to the true speed of another simulator's dives, and what it refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.ocean.core import layout as at
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.runs.run import Run, load_run, write_run
from glider.tools.gap.velocity import COLUMNS, MEANS, OUT_OF_MODEL, directions, mean_speed, of_run, velocities
from glider.tools.identify.ocean.files import vehicle_text
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.inference.model import nominal_model
from glider.tools.inference.ocean_inputs import unsteady
from glider.tools.inference.parameters import NINETY
from glider.tools.inference.problem import problem_of
from tests.support.ocean import as_case, fly_dives, without

DIVES, EVERY = 6, 60.0


@pytest.fixture(scope="module", params=[False, True], ids=["depth alone", "with speed"])
def mission(request, tmp_path_factory):
    """Dives, the case with its vehicle as identified from them, and what is found of their velocity."""
    folder = tmp_path_factory.mktemp("mission")
    dives = fly_dives(DIVES, speed=request.param)
    case = as_case(folder / "case", dives.runs)
    (folder / "identified.toml").write_text(vehicle_text(identify_ocean(case)))
    case = load_case(case.folder, str(folder / "identified.toml"))
    return dives, case, velocities(case, nominal_model(case)), request.param


def against_truth(mission) -> tuple[np.ndarray, np.ndarray]:
    """Found less true horizontal speed where the glider flies steadily, and its standard deviation, m/s."""
    dives, case, found, _ = mission
    missed, sd = [], []
    for run, true, one in zip(case.runs, dives.truth, found, strict=True):
        t = EVERY * np.arange(len(true))
        steady = np.interp(t, run.t, unsteady(run).astype(float)) == 0.0
        missed.append((np.interp(t, run.t, one.columns["u_m_s"]) - true)[steady])
        sd.append(np.interp(t, run.t, one.columns["sd_u_m_s"])[steady])
    return np.concatenate(missed), np.concatenate(sd)


def test_it_is_close_to_the_true_speed(mission):
    missed, sd = against_truth(mission)
    assert len(missed) > 60
    assert np.sqrt(np.mean(missed**2)) < (0.015 if mission[3] else 0.03)
    assert np.mean(np.abs(missed) < 2.5 * sd) > 0.9
    assert np.sqrt(np.mean(missed**2)) > 0.15 * np.mean(sd)  # nor is it said to be far worse than it is


def test_the_mean_of_a_dive_is_surer_than_its_rows(mission):
    dives, case, found, speed = mission
    missed, sd = [], []
    for run, true, one in zip(case.runs, dives.truth, found, strict=True):
        rows, said = one.steady, mean_speed(one)
        missed.append(said["u_m_s"] - np.interp(run.t, EVERY * np.arange(len(true)), true)[rows].mean())
        sd.append((said["ci90"][1] - said["u_m_s"]) / NINETY)
        assert sd[-1] == pytest.approx(one.sd_mean_u)
        assert sd[-1] < one.columns["sd_u_m_s"][rows].mean()
    assert np.abs(missed).max() < 2.5 * np.mean(sd)
    assert np.mean(sd) < (0.008 if speed else 0.02)


def test_a_weight_is_next_to_none_of_a_dives_mean(mission):
    problem = problem_of(mission[1])
    heavy = problem.model.P.copy()
    heavy[at.MASS] += 0.02
    one = of_run(problem.part(1), (problem.model.P, np.zeros(at.N_F)), [(heavy, np.zeros(at.N_F))])
    bare = of_run(problem.part(1), (problem.model.P, np.zeros(at.N_F)), [])
    rows = np.sqrt(one.columns["sd_u_m_s"] ** 2 - bare.columns["sd_u_m_s"] ** 2)[one.steady].mean()
    assert rows > 0.005
    assert np.sqrt(one.sd_mean_u**2 - bare.sd_mean_u**2) < 0.3 * rows  # down faster, up slower


def test_where_nothing_is_steady_the_mean_is_no_models(mission):
    problem = problem_of(mission[1]).part(0)
    problem.recording.inputs[:, at.U_UNSTEADY] = 1.0
    one = of_run(problem, (problem.model.P, np.zeros(at.N_F)), [])
    assert one.sd_mean_u == OUT_OF_MODEL
    assert mean_speed(one)["u_m_s"] == pytest.approx(one.columns["u_m_s"].mean())


def test_a_speed_that_was_measured_makes_it_surer(mission):
    _, sd = against_truth(mission)
    assert np.median(sd) < 0.01 if mission[3] else 0.008 < np.median(sd) < 0.05


def test_north_and_east_are_the_horizontal_speed_along_the_heading(mission):
    _, case, found, _ = mission
    for run, one in zip(case.runs, found, strict=True):
        c, yaw = one.columns, run.columns[names.ATTITUDE[2]]
        assert np.hypot(c["vn_m_s"], c["ve_m_s"]) == pytest.approx(c["u_m_s"], abs=1e-9)
        sailing = c["u_m_s"] > 0.05
        turned = np.arctan2(c["ve_m_s"], c["vn_m_s"])[sailing] - yaw[sailing]
        assert np.abs(np.angle(np.exp(1j * turned))).max() < 1e-6
        for name in COLUMNS:
            assert np.isfinite(c[name]).all()
            if name.startswith("sd_"):
                assert np.all(c[name] > 0.0)


def test_depth_is_the_way_of_the_vehicle_and_of_the_water(mission):
    _, case, found, _ = mission
    for run, one in zip(case.runs, found, strict=True):
        steady = ~unsteady(run)
        rate = np.gradient(run.columns[names.DEPTH], run.t)[steady]
        whole = (one.columns["w_m_s"] + one.columns["water_w_m_s"])[steady]
        assert np.mean(rate - whole) == pytest.approx(0.0, abs=0.005)
        assert np.sqrt(np.mean((rate - whole) ** 2)) < 0.03  # the noise of the depth over two rows


def test_what_is_no_steady_flight_is_not_sure(mission):
    _, case, found, _ = mission
    for run, one in zip(case.runs, found, strict=True):
        rough, sd = unsteady(run), one.columns["sd_u_m_s"]
        assert sd[rough].min() > sd[~rough].max()


def test_directions_are_the_covariance_and_the_rest(mission):
    model = nominal_model(mission[1])
    assert model.sure is not None
    found = np.array(directions(model))
    whole = found.T @ found
    seen = np.abs(model.sure).max(axis=0) > 0.0
    assert whole[np.ix_(seen, seen)] == pytest.approx((model.sure.T @ model.sure)[np.ix_(seen, seen)], rel=1e-9)
    assert np.diag(whole)[~seen] == pytest.approx(model.sigma[~seen] ** 2)
    assert whole[at.MASS, at.MASS] == 0.0


# --- the command ---
def glider(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    """Exit code, output and complaints of a command."""
    monkeypatch.setattr("sys.argv", ["glider", *map(str, arguments)])
    code = report_errors(cli)
    said = capsys.readouterr()
    return code, said.out, said.err


def test_a_file_for_each_run(mission, tmp_path, monkeypatch, capsys):
    _, case, found, _ = mission
    out = tmp_path / "velocity"
    code, flagged, _ = glider(monkeypatch, capsys, "gap", "velocity", case.folder, "--model", case.vehicle_name,
    "--out",
                           out, "--json")  # fmt: skip
    assert code == 0
    means = json.loads((out / MEANS).read_text())["runs"]
    assert means == {run.name: mean_speed(one) for run, one in zip(case.runs, found, strict=True)}
    assert [out / f"{run.name}.csv" for run in case.runs] == [type(out)(name) for name in json.loads(flagged)["files"]]
    for run, one in zip(case.runs, found, strict=True):
        lines = (out / f"{run.name}.csv").read_text().splitlines()
        assert lines[0].split(",") == [names.TIME, *COLUMNS]
        table = np.array([[float(field) for field in line.split(",")] for line in lines[1:]])
        assert np.array_equal(table[:, 0], run.t)
        for n, name in enumerate(COLUMNS, start=1):
            assert table[:, n] == pytest.approx(one.columns[name], abs=6e-6)


def refused(monkeypatch, capsys, folder, out) -> str:
    """What is said of a case that is refused: one line."""
    code, flagged, said = glider(monkeypatch, capsys, "gap", "velocity", folder, "--out", out)
    assert (code, flagged) == (2, "")
    assert len(said.splitlines()) == 1
    assert not out.exists()
    return said


def test_another_kind_of_vehicle_is_refused(tmp_path, monkeypatch, capsys):
    t = 0.1 * np.arange(50)
    write_case(tmp_path / "case", [Run("run00", None, {names.TIME: t, names.DEPTH: 1.0 + 0.1 * t})], vehicle="roughie",
               site="made", log_rate_hz=10.0, water_density_kg_m3=998.0)  # fmt: skip
    assert "an ocean glider" in refused(monkeypatch, capsys, tmp_path / "case", tmp_path / "out")
    case = load_case(tmp_path / "case")
    with pytest.raises(InputError, match="an ocean glider"):
        velocities(case, nominal_model(case))


@pytest.mark.parametrize("column", [names.OIL, names.DENSITY, names.ATTITUDE[1], names.DEPTH])
def test_a_run_without_what_drives_the_model_is_refused(tmp_path, monkeypatch, capsys, column):
    case = as_case(tmp_path / "case", fly_dives(2).runs)
    missing_input = without(case, column).runs[1]
    write_run(case.runs[1].path, missing_input)
    assert column not in load_run(case.runs[1].path).columns
    said = refused(monkeypatch, capsys, case.folder, tmp_path / "out")
    assert case.runs[1].path.name in said
    assert column in said
    empty = replace(missing_input, columns=missing_input.columns | {column: np.full(missing_input.rows, np.nan)})
    with pytest.raises(InputError, match=column):
        velocities(replace(case, runs=[empty]), nominal_model(case))
