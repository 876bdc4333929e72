"""`glider gap`: what stands where, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.run import load_run
from tests.support.flights import World, fly_case


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    case, _ = fly_case(World(mocap=True, seconds=45.0), 21, runs=2)
    path = tmp_path_factory.mktemp("gap") / "pond"
    write_case(
        path, case.runs, vehicle="roughie", site="pond", log_rate_hz=10.0, water_density_kg_m3=998.0, suffix=".csv.gz"
    )
    return path


def run(monkeypatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["glider", *map(str, arguments)])
    return report_errors(cli)


def test_json_alone_on_standard_output(folder, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, "gap", "measure", folder, "--json") == 0
    out = capsys.readouterr().out
    found = json.loads(out)
    assert [entry["name"] for entry in found["runs"]] == ["run00", "run01"]
    assert set(found["runs"][0]["channels"]) == {"depth", "pitch", "roll", "yaw", "rates", "slider", "ballast", "xy"}
    totals = [entry["total"] for entry in found["runs"]]
    assert found["total"] == pytest.approx(np.sqrt(np.mean(np.square(totals))))
    for entry in found["runs"]:
        assert entry["total"] == pytest.approx(np.sqrt(np.mean(np.square(list(entry["channels"].values())))))
    assert sum(part["share"] for part in found["where"]) == pytest.approx(1.0)
    assert found["where"][-1]["element"] == "unexplained"
    assert list(tmp_path.iterdir()) == []  # no report unless one is asked for


def test_a_table_and_a_report_in_the_working_directory(folder, monkeypatch, capsys, tmp_path):
    before = sorted(path.name for path in folder.iterdir())
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, "gap", "measure", folder) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert lines[0].split() == ["depth", "pitch", "roll", "yaw", "rates", "slider", "ballast", "xy", "total"]
    assert [line.split()[0] for line in lines[1:4]] == ["run00", "run01", "all"]
    assert (tmp_path / "pond-gap.html").is_file()
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_report_where_it_is_wanted(folder, monkeypatch, capsys, tmp_path):
    assert run(monkeypatch, "gap", "measure", folder, "--json", "--report", tmp_path / "deep.html") == 0
    json.loads(capsys.readouterr().out)
    assert "pond" in (tmp_path / "deep.html").read_text()


def test_predict_writes_rows_and_columns_of_the_run(folder, monkeypatch, capsys, tmp_path):
    recorded = folder / "run01.csv.gz"
    out = tmp_path / "predicted.csv"
    assert run(monkeypatch, "gap", "predict", recorded, "--model", "nominal", "--out", out) == 0
    assert capsys.readouterr().out == ""
    measured, predicted = load_run(recorded), load_run(out)
    assert list(predicted.columns) == list(measured.columns)
    np.testing.assert_array_equal(predicted.t, measured.t)
    assert all(np.isfinite(values).all() for values in predicted.columns.values())


def test_a_vehicle_file_predicts(folder, monkeypatch, tmp_path):
    from glider.firmware.model.library import shipped

    model = tmp_path / "mine.toml"
    model.write_text(shipped("model/vehicles")["roughie"])
    outs = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for name, out in zip(("nominal", model), outs, strict=True):
        assert run(monkeypatch, "gap", "predict", folder / "run00.csv.gz", "--model", name, "--out", out) == 0
    assert outs[0].read_text() == outs[1].read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["measure", "nowhere"], "no such folder"),
        (["predict", "nowhere.csv", "--out", "x.csv"], "no such file"),
        (["predict", "{run}", "--model", "nobody", "--out", "x.csv"], "no vehicle 'nobody'"),
        (["predict", "{run}"], "--out"),
        (["predict", "{run}", "--out", "{run}"], "overwrite"),
        (["predict", "{run}", "--model", "{bad}", "--out", "x.csv"], "bad.toml"),
        (["predict", "{run}", "--out", "{folder}/no/where.csv"], "where.csv"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_exit_2(folder, monkeypatch, capsys, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    bad = tmp_path / "bad.toml"
    bad.write_text("format = 1\nname = 'x'\nwings = 2\n")
    names = {"run": folder / "run00.csv.gz", "bad": bad, "folder": folder}
    before = (folder / "run00.csv.gz").read_bytes()
    assert run(monkeypatch, "gap", *(argument.format(**names) for argument in arguments)) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert (folder / "run00.csv.gz").read_bytes() == before


def test_a_case_with_nothing_to_score_says_so(tmp_path, monkeypatch, capsys):
    case, _ = fly_case(World(seconds=1.5), 22, runs=1)
    path = tmp_path / "blink"
    write_case(path, case.runs, vehicle="roughie", site="pond", log_rate_hz=10.0, water_density_kg_m3=998.0)
    assert run(monkeypatch, "gap", "measure", path, "--json") == 2
    assert "nothing" in capsys.readouterr().err
