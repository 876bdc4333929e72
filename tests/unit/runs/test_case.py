"""Cases: strict case.toml, the vehicle's entries replaced one by one, only the run files read."""

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import CASE_FILE, SensorsPart, load_case, load_case_of_run, load_runs, write_case
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle

FACTS = {"vehicle": "roughie", "site": "pool", "log_rate_hz": 10.0, "water_density_kg_m3": 998.0}


def _run(offset=0.0):
    return Run("x", None, {"t_s": np.arange(3) / 10, "depth_m": np.arange(3) + offset})


@pytest.fixture
def folder(tmp_path):
    write_case(tmp_path / "case", [_run(0.0), _run(1.0)], **FACTS)
    return tmp_path / "case"


def _edit(folder, old, new):
    path = folder / CASE_FILE
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_a_case_reads_back(folder):
    case = load_case(folder)
    assert [run.name for run in case.runs] == ["run00", "run01"]
    assert case.vehicle == load_vehicle("roughie")
    assert (case.vehicle_name, case.site, case.log_rate_hz) == ("roughie", "pool", 10.0)
    assert case.water_density_kg_m3 == 998.0
    assert case.motion_capture is False
    assert case.sensors == case.vehicle.sensors
    assert case.disturbance == case.vehicle.disturbance


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('site = "pool"', 'site = "pool"\nsalt = 1.0', "salt: unknown key"),
        ('site = "pool"\n', "", "site: missing key"),
        ("format = 1", "format = 2", "format"),
        ("998.0", '"998"', "water_density_kg_m3"),
        ("998.0", "9.98", "water_density_kg_m3"),
        ("log_rate_hz = 10.0", "log_rate_hz = nan", "log_rate_hz"),
        ("runs = 2", "runs = 2.5", "runs"),
        ("motion_capture = false", "motion_capture = 0", "motion_capture"),
        ("runs = 2", "runs = 2\n[sensors]\nattitude = { noise = -1.0 }", "sensors.attitude.noise"),
        ("runs = 2", "runs = 2\n[sensors]\nsonar = { noise = 1.0 }", "sonar: unknown key"),
    ],
)
def test_case_toml_is_strict(folder, old, new, said):
    _edit(folder, old, new)
    with pytest.raises(ConfigError) as error:
        load_case(folder)
    assert said in str(error.value)
    assert CASE_FILE in str(error.value)


def test_the_number_of_runs_must_be_right(folder):
    _edit(folder, "runs = 2", "runs = 3")
    with pytest.raises(InputError, match=r"case.toml: runs: 3 expected, 2 files"):
        load_case(folder)


def test_sensors_and_disturbance_may_be_given_entry_by_entry(folder):
    with (folder / CASE_FILE).open("a") as file:
        file.write("[sensors]\nmocap_position = { noise = 0.0005 }\n[disturbance]\nangular = 0.5\n")
    case = load_case(folder)
    assert case.sensors.mocap_position.noise == 0.0005
    assert case.sensors.attitude == case.vehicle.sensors.attitude
    assert case.disturbance.angular == 0.5
    assert case.disturbance.linear == case.vehicle.disturbance.linear


def test_only_the_case_and_its_runs_are_read(folder):
    (folder / "notes.csv").write_text("nonsense")
    (folder / "held.csv.gz").write_bytes(b"nonsense")
    assert len(load_case(folder).runs) == 2


def test_a_run_that_is_there_twice_is_refused(folder):
    (folder / "run01.csv.gz").write_bytes(b"")
    with pytest.raises(InputError, match="twice"):
        load_case(folder)


def test_runs_come_in_the_order_of_their_numbers(tmp_path):
    write_case(tmp_path / "c", [_run(number) for number in range(101)], **FACTS)
    assert [run.columns["depth_m"][0] for run in load_case(tmp_path / "c").runs] == list(range(101))


def test_one_run_finds_its_case_and_leaves_the_others_alone(folder):
    (folder / "run00.csv").write_text("broken")
    case, run = load_case_of_run(folder / "run01.csv")
    assert case.runs == [run]
    assert run.columns["depth_m"][0] == 1.0


def test_folders_that_are_no_case(tmp_path, folder):
    with pytest.raises(InputError, match="such folder"):
        load_case(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"no case\.toml"):
        load_case(tmp_path)
    with pytest.raises(InputError, match="a folder"):
        load_case(folder / CASE_FILE)
    with pytest.raises(InputError, match="such file"):
        load_case_of_run(folder / "run07.csv")


def test_a_vehicle_file_is_looked_for_beside_the_case(folder):
    from glider.firmware.model.library import shipped

    text = shipped("model/vehicles")["roughie"].replace('name = "roughie"', 'name = "heavy"')
    (folder / "heavy.toml").write_text(text)
    _edit(folder, 'vehicle = "roughie"', 'vehicle = "heavy.toml"')
    assert load_case(folder).vehicle.name == "heavy"


def test_writing_refuses_a_folder_that_holds_a_case(folder):
    with pytest.raises(InputError, match="already"):
        write_case(folder, [_run()], **FACTS)


def test_writing_keeps_odd_words_and_own_sensors(tmp_path):
    sensors = SensorsPart(depth=load_vehicle("roughie").sensors.gyro)
    site = 'a "lake"\\\n\tübër \x7f'
    write_case(tmp_path / "c", [_run()], **{**FACTS, "site": site}, sensors=sensors, suffix=".csv.gz")
    case = load_case(tmp_path / "c")
    assert case.site == site
    assert case.sensors.depth == case.vehicle.sensors.gyro


def test_all_reference_cases_load(shared):
    folders = [*sorted((shared / "gap" / "cases").iterdir()), shared / "identify" / "dev", shared / "data/roughie2015"]
    for path in folders:
        case = load_case(path)
        assert case.runs
        assert all(run.rows > 100 for run in case.runs)
        assert case.motion_capture == any(run.has_mocap for run in case.runs)


def test_a_case_of_many_runs_numbers_them_all_with_as_many_digits(tmp_path):
    runs = [Run("", None, {"t_s": np.array([0.0, 1.0]), "pitch_rad": np.array([0.1, n / 1000])}) for n in range(101)]
    files = write_case(
        tmp_path / "c", runs, vehicle="roughie", site="pool", log_rate_hz=1.0, water_density_kg_m3=1000.0,
        beside={"mission.csv": b"run,hours_since_start\n"},
    )  # fmt: skip
    assert [files[0].name, files[100].name] == ["run000.csv", "run100.csv"]
    assert (tmp_path / "c" / "mission.csv").read_bytes() == b"run,hours_since_start\n"
    assert [run.columns["pitch_rad"][1] for run in load_case(tmp_path / "c").runs] == [n / 1000 for n in range(101)]
    table, again = load_runs(tmp_path / "c")
    assert (table.vehicle, len(again)) == ("roughie", 101)


@pytest.mark.parametrize("asked", [("gap", "measure"), ("gap", "watch"), ("identify",)], ids=" ".join)
def test_an_ocean_gliders_runs_are_not_read_as_anothers(tmp_path, monkeypatch, capsys, asked):
    columns = {name: np.ones(3) for name in ("oil_m3", "density_kg_m3", "pitch_rad", "depth_m")}
    write_case(tmp_path / "case", [Run("x", None, {"t_s": np.arange(3.0)} | columns)], **FACTS | {"vehicle": "slocum"})
    assert load_case(tmp_path / "case").vehicle.kind == "ocean"
    out = ("--out", str(tmp_path / "out")) if asked == ("identify",) else ()
    monkeypatch.setattr("sys.argv", ["glider", *asked, str(tmp_path / "case"), "--vehicle", "roughie", *out])
    assert report_errors(cli) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert "(oil_m3)" in said.err
    _edit(tmp_path / "case", '"slocum"', '"roughie"')
    with pytest.raises(InputError, match="its vehicle"):
        load_case(tmp_path / "case")
