"""A log of one's own with one thing wrong: said in one line at import or by the first command, never mended wrongly."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.cli.readings import readings
from glider.tools.data.errors import InputError
from glider.tools.data.importers.csvlog import import_csv
from glider.tools.data.runs.case import load_case
from glider.tools.readings.check import check
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=5)

# name in the log, column of run data, unit, and how many of it are an SI unit
LOGGED = [
    ("rudder", "cmd_servo_rad", "deg", 180.0 / np.pi), ("mass cmd", "cmd_slider_m", "mm", 1000.0),
    ("tank cmd", "cmd_ballast_kg", "g", 1000.0), ("mass", "slider_m", "mm", 1000.0),
    ("tank", "ballast_kg", "g", 1000.0), ("Roll", "roll_rad", "deg", 180.0 / np.pi),
    ("Pitch", "pitch_rad", "deg", 180.0 / np.pi), ("Heading", "yaw_rad", "deg", 180.0 / np.pi),
    ("gx", "p_rad_s", "deg/s", 180.0 / np.pi), ("gy", "q_rad_s", "deg/s", 180.0 / np.pi),
    ("gz", "r_rad_s", "deg/s", 180.0 / np.pi), ("Depth", "depth_m", "cm", 100.0),
]  # fmt: skip


@pytest.fixture(scope="module")
def flights(tmp_path_factory) -> list[dict[str, np.ndarray]]:
    """Three flights of the shipped vehicle as a logger of one's own writes them: ms, degrees, cm, mm, g."""
    case = make_case(tmp_path_factory.mktemp("flown"), np.zeros(ef.N_F), seed=5, runs=3)
    return [
        {"millis": 1000.0 * run.t} | {name: factor * run.columns[column] for name, column, _, factor in LOGGED}
        for run in case.runs
    ]


def mapping(**units: str) -> str:
    """The mapping that fits the log, but for these units."""
    tables = [
        f'[columns.{column}]\nsource = "{name}"\nunit = "{units.get(column, unit)}"\n'
        for name, column, unit, _ in LOGGED
    ]
    head = 'format = 1\nvehicle = "roughie"\nsite = "lake"\nwater_density_kg_m3 = 998.0\n'
    return f'{head}[time]\ncolumn = "millis"\nunit = "{units.get("t_s", "ms")}"\n' + "\n".join(tables)


def written(folder: Path, flights, text: str) -> list[Path]:
    """The logs and their mapping."""
    (folder / "map.toml").write_text(text)
    files = []
    for number, flight in enumerate(flights):
        out = io.StringIO()
        table = csv.writer(out, lineterminator="\n")
        table.writerow(flight)
        for row in zip(*flight.values(), strict=True):
            table.writerow("" if np.isnan(value) else f"{value:.9g}" for value in row)
        files.append(folder / f"flight{number}.csv")
        files[-1].write_text(out.getvalue())
    return files


def imported(folder: Path, flights, text: str | None = None) -> Path:
    """The case of the logs."""
    files = written(folder, flights, mapping() if text is None else text)
    return import_csv(files, str(folder / "map.toml"), folder / "case").folder


def changed(flights, **made):
    """The flights with columns made from their own, by name with _ for a space."""
    return [flight | {name.replace("_", " "): f(flight) for name, f in made.items()} for flight in flights]


def accused(folder: Path) -> dict:
    """What the readings say of signs, units and axes, by channel."""
    return {
        one.channel: one for one in check(load_case(folder).runs).findings if one.finding in ("sign", "units", "axes")
    }


def test_the_sound_log_is_accused_of_nothing(tmp_path, flights):
    assert accused(imported(tmp_path, flights)) == {}


@pytest.mark.parametrize(
    ("units", "says"),
    [
        ({"pitch_rad": "rad"}, "pitch_rad: up to "),
        ({"depth_m": "m"}, "depth_m: moves at "),
        ({"slider_m": "m", "cmd_slider_m": "m"}, "slider_m: up to "),
        ({"ballast_kg": "kg"}, "ballast_kg: up to "),
        ({"t_s": "s"}, "millis: rows 100 s "),
        ({"t_s": "us"}, "millis: rows 0.0001 s "),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_a_wrong_unit_is_refused_before_anything_is_written(tmp_path, flights, units, says, monkeypatch, capsys):
    files = written(tmp_path, flights, mapping(**units))
    asked = ["import", "csv", *map(str, files), "--map", str(tmp_path / "map.toml"), "--out", str(tmp_path / "case")]
    monkeypatch.setattr("sys.argv", ["glider", *asked])
    assert report_errors(cli) == 2
    said = capsys.readouterr().err
    assert says in said
    assert "flight0.csv" in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "case").exists()


def test_depth_counted_upwards_is_refused(tmp_path, flights):
    with pytest.raises(InputError, match=r"depth_m: down to -.*\?"):
        imported(tmp_path, changed(flights, Depth=lambda c: -c["Depth"]))


def test_a_pitch_that_is_turned_is_put_right_and_the_gyro_left_alone(tmp_path, flights):
    sound = load_case(imported(tmp_path, flights)).runs
    (tmp_path / "turned").mkdir()
    case = imported(tmp_path / "turned", changed(flights, Pitch=lambda c: -c["Pitch"]))
    found = check(load_case(case).runs)
    (one,) = (one for one in found.findings if one.finding == "sign")
    assert (one.channel, one.mended) == ("pitch_rad", True)
    assert " to 1 by " in one.text
    for right, run in zip(sound, found.runs, strict=True):
        assert np.nanmax(np.abs(right.columns["pitch_rad"] - run.columns["pitch_rad"])) < 0.02
        assert np.nanmax(np.abs(right.columns["q_rad_s"] - run.columns["q_rad_s"])) < 0.02


def test_a_rate_that_is_turned_is_put_right_and_the_pitch_left_alone(tmp_path, flights):
    said = accused(imported(tmp_path, changed(flights, gy=lambda c: -c["gy"])))
    assert set(said) == {"q_rad_s"}
    assert said["q_rad_s"].mended
    assert "opposite sign" in said["q_rad_s"].text


def test_where_nothing_decides_the_pair_is_said_and_nothing_put_right(tmp_path, flights):
    """No depth, and no turn that would show in the other axes: pitch alone moves."""
    straight = [
        {name: values for name, values in flight.items() if name != "Depth"} | {
            name: 0.0 * flight["millis"] for name in ("Roll", "Heading", "gx", "gz")
        } | {"gy": -np.gradient(flight["Pitch"], 1e-3 * flight["millis"])}
        for flight in flights
    ]  # fmt: skip
    text = mapping()
    text = text[: text.index("[columns.depth_m]")]
    case = imported(tmp_path, straight, text)
    (one,) = accused(case).values()
    assert not one.mended
    assert "pitch_rad and q_rad_s" in one.text
    ran = CliRunner().invoke(readings, [str(case)])
    assert ran.exit_code == 0
    assert "(mended)" not in "".join(line for line in ran.output.splitlines() if line.startswith("sign"))


def test_pitch_and_rate_both_turned_are_said_against_the_depth(tmp_path, flights):
    said = accused(imported(tmp_path, changed(flights, Pitch=lambda c: -c["Pitch"], gy=lambda c: -c["gy"])))
    assert said
    assert not any(one.mended for name, one in said.items() if name == "depth_m")


def test_radians_called_degrees_are_found_in_the_pitch(tmp_path, flights):
    said = accused(imported(tmp_path, changed(flights, Pitch=lambda c: np.radians(c["Pitch"]))))
    assert set(said) == {"pitch_rad"}
    assert said["pitch_rad"].finding == "units"
    assert said["pitch_rad"].size == pytest.approx(np.pi / 180.0, rel=0.05)


def test_exchanged_axes_are_found_where_they_are(tmp_path, flights):
    said = accused(imported(tmp_path, changed(flights, Roll=lambda c: c["Pitch"], Pitch=lambda c: c["Roll"])))
    assert set(said) == {"roll_rad", "pitch_rad"}
    (tmp_path / "gyro").mkdir()
    said = accused(imported(tmp_path / "gyro", changed(flights, gx=lambda c: c["gy"], gy=lambda c: c["gx"])))
    assert set(said) == {"p_rad_s", "q_rad_s"}


def test_a_column_of_another_name_in_one_run_is_refused(tmp_path, flights):
    case = imported(tmp_path, flights)
    run = case / "run02.csv"
    head, _, body = run.read_text().partition("\n")
    run.write_text(head.replace("pitch_rad", "Pitch") + "\n" + body)
    with pytest.raises(InputError, match=r"run02\.csv: pitch_rad: .*'Pitch'"):
        load_case(case)


def test_a_rate_that_the_rows_contradict_is_refused(tmp_path, flights):
    file = imported(tmp_path, flights) / "case.toml"
    file.write_text(file.read_text().replace("log_rate_hz = 10.0", "log_rate_hz = 5.0"))
    with pytest.raises(InputError, match=r"case\.toml: log_rate_hz: 5 .* 10 Hz"):
        load_case(file.parent)


def test_doubled_rows_are_refused_with_the_key_that_drops_them(tmp_path, flights):
    twice = [{name: np.repeat(values, 2) for name, values in flight.items()} for flight in flights]
    with pytest.raises(InputError, match=r"flight0\.csv:3: millis: .*not_increasing = \"drop\""):
        imported(tmp_path, twice)


def test_a_clock_that_jumps_is_refused(tmp_path, flights):
    def jumped(flight):
        return flight["millis"] + np.where(np.arange(len(flight["millis"])) > 200, 3.6e6, 0.0)

    with pytest.raises(InputError, match=r"flight0\.csv: millis: .*3600 s at 20 s"):
        imported(tmp_path, changed(flights, millis=jumped))


def test_holes_are_said(tmp_path, flights):
    kept = np.ones(len(flights[0]["millis"]), dtype=bool)
    kept[100:150] = False
    holes = [{name: values[kept] for name, values in flight.items()} for flight in flights]
    found = check(load_case(imported(tmp_path, holes)).runs).findings
    assert any("5.10 s" in one.text for one in found)
    assert not any(one.finding in ("sign", "units", "axes") for one in found)


def test_measure_says_it_too(tmp_path, flights, monkeypatch, capsys):
    case = imported(tmp_path, changed(flights, Pitch=lambda c: -c["Pitch"]))
    monkeypatch.setattr("sys.argv", ["glider", "gap", "measure", str(case), "--json"])
    assert report_errors(cli) == 0
    assert "note: pitch_rad " in capsys.readouterr().err
