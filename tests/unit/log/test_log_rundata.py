"""Logs to run data and back, bit for bit; what a log does not know, what a cut one still gives; the command line."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from glider.hal.strict import ConfigError
from glider.tools.cli.log import log as command
from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.rundata import export_case, run_of, write_log
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import SensorsPart, load_case, write_case
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle
from tests.support.commands import glider
from tests.support.examples import examples
from tests.support.log_files import METADATA, TICK, VEHICLE, tick_rows, write_small_log

FACTS = {"vehicle": "roughie", "site": "pool", "log_rate_hz": 10.0, "water_density_kg_m3": 998.0}


def _same_bits(first, second):
    np.testing.assert_array_equal(np.isnan(first), np.isnan(second))
    there = ~np.isnan(first)
    return first[there].tobytes() == second[there].tobytes()


def test_a_log_becomes_a_case(small_log, rows, tmp_path):
    export_case(read_log(small_log), tmp_path / "case")
    case = load_case(tmp_path / "case")
    assert (case.vehicle_name, case.site, case.log_rate_hz) == ("roughie", "pool", 50.0)
    assert case.water_density_kg_m3 == 998.2
    assert not case.motion_capture
    (run,) = case.runs
    assert list(run.columns) == ["t_s", "pitch_rad", "depth_m"]  # yaw was never there
    for name in run.columns:
        assert _same_bits(run.columns[name], rows[:, TICK.index(name)])
    assert [float(text) for text in run.extra["ref_depth_m"]] == rows[:, TICK.index("ref_depth_m")].tolist()
    assert [float(text) for text in run.extra["wrench_7"]] == rows[:, TICK.index("wrench") + 7].tolist()
    truth = run.extra["true_x_m"]
    assert truth[::2] == [repr(float(number)) for number in range(0, 500, 2)]
    assert set(truth[1::2]) == {""}
    assert not (tmp_path / "case" / "vehicle.toml").exists()


def test_a_vehicle_that_is_not_shipped_goes_with_its_case(tmp_path):
    text = VEHICLE.replace("m_t = 13.0", "m_t = 13.5")
    path = write_small_log(tmp_path / "x.mcap", tick_rows(20), attachments={"vehicle.toml": text})
    export_case(read_log(path), tmp_path / "case")
    assert load_case(tmp_path / "case").vehicle.mass.m_t == 13.5
    assert (tmp_path / "case" / "vehicle.toml").read_text() == text
    export_case(read_log(path), tmp_path / "other", vehicle="roughie")
    assert load_case(tmp_path / "other").vehicle.mass.m_t == 13.0


def test_a_log_that_does_not_say_enough(tmp_path):
    rows = tick_rows(20)

    def written(name, **metadata):
        path = tmp_path / f"{name}.mcap"
        return read_log(write_small_log(path, rows, attachments={}, metadata=metadata))

    with pytest.raises(InputError, match="water_density"):
        export_case(written("a", vehicle="roughie"), tmp_path / "a")
    with pytest.raises(InputError, match="--vehicle"):
        export_case(written("b", water_density_kg_m3="998"), tmp_path / "b")
    exported = export_case(written("c", water_density_kg_m3="998"), tmp_path / "c", vehicle="roughie")
    assert "50" in exported.notes[0]
    assert load_case(tmp_path / "c").log_rate_hz == 50.0
    with pytest.raises(ConfigError, match="water_density"):
        export_case(written("d", vehicle="roughie", water_density_kg_m3="nan"), tmp_path / "d")
    empty = tmp_path / "empty.mcap"
    write_small_log(empty, rows[:0])
    with pytest.raises(InputError, match="/tick"):
        run_of(read_log(empty))


def test_times_that_do_not_go_on_and_infinite_values_are_left_out(tmp_path):
    rows = tick_rows(6)
    rows[:, 0] = [0.0, np.nan, 0.2, 0.1, 0.2, 0.3]
    rows[0, TICK.index("depth_m")] = np.inf
    rows[0, TICK.index("ref_depth_m")] = np.inf
    exported = export_case(read_log(write_small_log(tmp_path / "x.mcap", rows)), tmp_path / "case")
    (run,) = load_case(tmp_path / "case").runs
    assert run.t.tolist() == [0.0, 0.2, 0.3]
    assert math.isnan(run.columns["depth_m"][0])
    assert run.extra["ref_depth_m"][0] == "inf"
    assert len(exported.notes) == 2


numbers = st.one_of(st.floats(allow_infinity=False), st.just(-0.0))
words = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=6)
extras = st.one_of(words, numbers.map(lambda x: "" if math.isnan(x) else repr(x)), st.just("12"))


@st.composite
def runs(draw):
    rows = draw(st.integers(2, 5))
    steps = draw(st.lists(st.floats(1e-6, 1e6), min_size=rows, max_size=rows))
    columns = {names.TIME: np.cumsum(steps) - draw(st.floats(0.0, 1e3))}
    known = [name for name in names.ALL[1:] if name != names.OIL]  # an ocean glider's alone: refused with this vehicle
    for name in draw(st.lists(st.sampled_from(known), unique=True, max_size=6)):
        columns[name] = np.array(draw(st.lists(numbers, min_size=rows, max_size=rows)))
    free = st.one_of(st.sampled_from(["x_counts", "true_x_m", "Lin ADC", "a__b"]), words.map(str.strip))
    free = free.filter(lambda name: name not in names.KNOWN and not name.startswith("\ufeff"))
    extra = {
        name: draw(st.lists(extras, min_size=rows, max_size=rows))
        for name in draw(st.lists(free, unique=True, max_size=3))
    }
    return Run("run00", None, columns, extra)


@examples(80)
@given(run=runs())
def test_run_data_survives_the_way_through_a_log(tmp_path_factory, run):
    folder = tmp_path_factory.mktemp("there")
    sensors = SensorsPart(depth=load_vehicle("roughie").sensors.gyro)
    write_case(folder / "a", [run], **FACTS, sensors=sensors)
    case = load_case(folder / "a")
    write_log(folder / "x.mcap", case, case.runs[0])
    log = read_log(folder / "x.mcap")
    assert log.whole
    export_case(log, folder / "b")
    again = load_case(folder / "b")
    assert (folder / "a" / "case.toml").read_text() == (folder / "b" / "case.toml").read_text()
    assert again.sensors == case.sensors
    assert set(again.runs[0].columns) == set(run.columns)
    for name, values in run.columns.items():
        assert _same_bits(again.runs[0].columns[name], values)
    assert again.runs[0].extra == run.extra


def test_reference_runs_survive_the_way_through_a_log(shared, tmp_path):
    for folder in (shared / "data" / "roughie2015", shared / "identify" / "dev"):
        case = load_case(folder)
        log = write_log(tmp_path / f"{folder.name}.mcap", case, case.runs[0])
        export_case(read_log(log), tmp_path / folder.name)
        again = load_case(tmp_path / folder.name)
        assert again.sensors == case.sensors
        for name, values in case.runs[0].columns.items():
            assert _same_bits(again.runs[0].columns[name], values)
        assert again.runs[0].extra == case.runs[0].extra


def test_the_command_goes_both_ways_by_the_kind_of_its_input(small_log, tmp_path):
    data = small_log.read_bytes()
    log = tmp_path / "flight.mcap"
    log.write_bytes(data)
    there = CliRunner().invoke(command, ["export", str(log)], catch_exceptions=False)
    run_file = tmp_path / "flight" / "run00.csv"
    assert there.stdout.split() == [str(run_file)]
    back = CliRunner().invoke(command, ["export", str(run_file), "--out", str(tmp_path / "b.mcap")])
    assert back.stdout.split() == [str(tmp_path / "b.mcap")]
    again = CliRunner().invoke(command, ["export", str(tmp_path / "b.mcap"), "--json"])
    assert json.loads(again.stdout)["rows"] == 500
    assert (tmp_path / "b" / "run00.csv").read_bytes() == run_file.read_bytes()
    # A cut log is exported as far as it goes, and that is said.
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    cut = CliRunner().invoke(command, ["export", str(tmp_path / "cut.mcap")])
    assert "cut at" in cut.stderr
    assert 0 < load_case(tmp_path / "cut").runs[0].rows < 500


def test_several_logs_are_one_case_of_several_runs(small_log, tmp_path):
    second = write_small_log(tmp_path / "second.mcap", tick_rows(60))
    both = ["export", str(small_log), str(second), "--out", str(tmp_path / "both"), "--json"]
    done = CliRunner().invoke(command, both)
    found = json.loads(done.stdout)
    assert [path.rsplit("/", 1)[1] for path in found["files"]] == ["run00.csv", "run01.csv"]
    assert found["rows"] == 560
    assert [run.rows for run in load_case(tmp_path / "both").runs] == [500, 60]
    elsewhere = write_small_log(tmp_path / "sea.mcap", tick_rows(60), metadata={**METADATA, "site": "sea"})
    with pytest.raises(InputError, match=r"sea.mcap: site sea, in .*: "):
        export_case(read_log(small_log), tmp_path / "no", more=[read_log(elsewhere)])
    heavy = {"vehicle.toml": VEHICLE.replace("m_t = 13.0", "m_t = 13.5")}
    other = write_small_log(tmp_path / "other.mcap", tick_rows(60), attachments=heavy)
    with pytest.raises(InputError, match="another vehicle"):
        export_case(read_log(small_log), tmp_path / "no", more=[read_log(other)])
    assert not (tmp_path / "no").exists()


def test_the_flight_of_a_run_goes_with_it_into_a_case_and_back_through_a_log(tmp_path):
    dated = write_small_log(tmp_path / "w06.mcap", tick_rows(60), epoch_ns=1_795_168_800 * 10**9)
    undated = write_small_log(tmp_path / "w07.mcap", tick_rows(60))
    first = read_log(dated)
    assert first.began == "2026-11-20T10:00:00Z"
    export_case(first, tmp_path / "case", more=[read_log(undated)])
    runs = load_case(tmp_path / "case").runs
    assert [run.flight for run in runs] == ["w06.mcap, 2026-11-20", "w07.mcap"]
    made = CliRunner().invoke(command, ["export", str(tmp_path / "case"), "--out", str(tmp_path / "logs")])
    assert made.exit_code == 0, made.output
    back = [read_log(tmp_path / "logs" / f"run0{n}.mcap") for n in (0, 1)]
    export_case(back[0], tmp_path / "back", more=back[1:])
    assert (tmp_path / "back" / "origin.csv").read_bytes() == (tmp_path / "case" / "origin.csv").read_bytes()


@pytest.mark.parametrize("text", ["", "run,start_utc\n", "run,start_utc,files\nrun00,2026\n", "\x00\xff"])
def test_an_origin_that_cannot_be_read_leaves_runs_their_names(small_log, tmp_path, text):
    export_case(read_log(small_log), tmp_path / "case")
    (tmp_path / "case" / "origin.csv").write_text(text)
    assert [run.flight for run in load_case(tmp_path / "case").runs] == [""]


def test_info_says_what_is_there(small_log, tmp_path):
    result = json.loads(CliRunner().invoke(command, ["info", str(small_log), "--json"]).stdout)
    assert result["complete"] is True
    assert result["topics"]["/tick"]["records"] == 500
    assert result["metadata"] == {**METADATA, "epoch_ns": "0"}
    assert len(result["events"]) == 5
    text = CliRunner().invoke(command, ["info", str(small_log)]).stdout
    assert "complete; 9.98 s" in text
    assert "event 400 äöü" in text
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(small_log.read_bytes()[:50_000])
    assert "cut at" in CliRunner().invoke(command, ["info", str(cut)]).stdout


def test_repair_on_the_command_line(small_log, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(small_log.read_bytes()[:50_000])
    result = CliRunner().invoke(command, ["repair", str(cut), "--json"])
    assert json.loads(result.stdout)["torn_bytes"] > 0
    assert read_log(tmp_path / "cut.repaired.mcap").whole
    assert CliRunner().invoke(command, ["repair", str(small_log)]).exit_code == 0


def test_wrong_input_ends_in_one_line_and_code_2(tmp_path):
    (tmp_path / "x.mcap").write_text("no log")
    for arguments in (["info", "x.mcap"], ["export", "nowhere.mcap"], ["repair", "."], ["export", "."]):
        done = glider("log", *arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
        assert done.stdout == ""
