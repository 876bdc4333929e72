"""Foreign CSV logs by mapping files: a synthetic logger, the real logs of 2015, and everything that can be wrong."""

import gzip
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from glider.hal.strict import ConfigError
from glider.tools.cli.import_ import import_
from glider.tools.data.errors import InputError
from glider.tools.data.importers.csvlog import import_csv
from glider.tools.data.importers.mapping import UNITS, Target, decode_map, load_map
from glider.tools.data.runs.case import load_case

MAP = """\
format = 1
vehicle = "roughie"
site = "lake"
water_density_kg_m3 = 1000.0
rate_hz = 10.0
max_gap_s = 0.3

[time]
column = "millis"
unit = "ms"

[columns.depth_m]
source = "adc"
unit = "ft"
zero = 100
scale = 0.04

[columns.pitch_rad]
source = "pitch"
unit = "deg"
sign = -1

[columns.yaw_rad]
source = "yaw"
unit = "deg"

[extra.adc_counts]
source = "adc"
decimals = 1

[[cut]]
file = "a*"
start_s = 1.0
end_s = 3.0
"""


def synthetic(seconds=5.0, hole=(2.0, 2.2)):
    """A log as a small logger writes it: uneven, whole numbers, yaw that wraps, one hole."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.01, 0.03, size=int(seconds / 0.02)))
    t = t[(t < hole[0]) | (t > hole[1])]
    yaw = (170.0 + 8.0 * t + 180.0) % 360.0 - 180.0
    lines = ["millis,adc,pitch,yaw"]
    for moment, heading in zip(t, yaw, strict=True):
        lines.append(f"{777_000 + round(1000 * moment)},{round(100 + 20 * moment)},{-3.0 * moment:.4f},{heading:.4f}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.csv").write_text(synthetic())
    (tmp_path / "map.toml").write_text(MAP)
    return tmp_path


def _import(folder, *files, out="out", text=None):
    if text is not None:
        (folder / "map.toml").write_text(text)
    return import_csv([folder / name for name in files or ("a.csv",)], str(folder / "map.toml"), folder / out)


def test_a_synthetic_log_becomes_run_data(folder):
    imported = _import(folder)
    case = load_case(folder / "out")
    assert (case.site, case.log_rate_hz, case.water_density_kg_m3) == ("lake", 10.0, 1000.0)
    (run,) = case.runs
    np.testing.assert_allclose(run.t, np.arange(20) / 10)
    first = float(synthetic().splitlines()[1].split(",")[0]) / 1000 - 777.0
    t = run.t + 1.0 + first  # the mapping counts from the file's first row
    np.testing.assert_allclose(run.columns["pitch_rad"], np.deg2rad(3.0 * t), atol=2e-3)
    np.testing.assert_allclose(run.columns["depth_m"], 0.3048 * 0.04 * 20 * t, atol=0.01)
    yaw = np.deg2rad((170.0 + 8.0 * t + 180.0) % 360.0 - 180.0)
    assert np.abs((run.columns["yaw_rad"] - yaw + np.pi) % (2 * np.pi) - np.pi).max() < 5e-3
    assert np.abs(run.columns["yaw_rad"]).max() <= np.pi
    assert not np.isnan(run.columns["depth_m"]).any()  # the hole is shorter than max_gap_s
    assert set(run.extra) == {"adc_counts"}
    assert imported.notes == []


def test_a_hole_longer_than_allowed_is_missing(folder):
    _import(folder, text=MAP.replace("max_gap_s = 0.3", "max_gap_s = 0.1"))
    depth = load_case(folder / "out").runs[0].columns["depth_m"]
    assert np.isnan(depth).sum() in (1, 2)


def test_without_a_rate_the_rows_are_taken_as_they_are(folder):
    imported = _import(folder, text=MAP.replace("rate_hz = 10.0\nmax_gap_s = 0.3\n", ""))
    (run,) = load_case(folder / "out").runs
    lines = [line.split(",") for line in synthetic().splitlines()[1:]]
    logged = np.array([(int(line[0]) - int(lines[0][0])) / 1000 for line in lines])
    use = (logged >= 1.0) & (logged < 3.0)
    np.testing.assert_array_equal(run.t, logged[use] - 1.0)
    assert "row by" in imported.notes[0]


def test_two_files_are_two_runs_each_with_its_cut(folder):
    (folder / "b.csv.gz").write_bytes(gzip.compress(synthetic().encode()))
    _import(folder, "a.csv", "b.csv.gz")
    first, second = load_case(folder / "out").runs
    assert first.rows == 20
    assert second.rows == pytest.approx(50, abs=2)


def test_rates_out_of_attitude(folder):
    extra = '[columns.roll_rad]\nsource = "pitch"\nunit = "deg"\nscale = 1e-9\n'
    text = MAP.replace("max_gap_s", "rates_from_attitude = true\nmax_gap_s").replace("[extra.", extra + "[extra.")
    _import(folder, text=text)
    (run,) = load_case(folder / "out").runs
    assert run.has("p_rad_s", "q_rad_s", "r_rad_s")
    assert np.median(run.columns["q_rad_s"]) == pytest.approx(np.deg2rad(3.0), rel=0.05)
    with pytest.raises(ConfigError, match="rates_from_attitude"):
        decode_map(MAP.replace("max_gap_s", "rates_from_attitude = true\nmax_gap_s"), "m")


def test_a_semicolon_log_with_decimal_commas_and_marks_for_missing(folder):
    text = MAP.replace("[time]", '[text]\ndelimiter = ";"\ndecimal = ","\nmissing = ["-999"]\nskip_lines = 2\n[time]')
    lines = synthetic().replace(",", ";").replace(".", ",").splitlines()
    lines[70] = ";".join([*lines[70].split(";")[:2], "-999", "-999"])
    (folder / "a.csv").write_text("Logger 3\nserial; 7\n" + "\n".join(lines))
    (folder / "plain.csv").write_text(synthetic())
    _import(folder, text=text)
    _import(folder, "plain.csv", out="plain", text=MAP.replace('file = "a*"', 'file = "p*"'))
    first, second = load_case(folder / "out").runs[0], load_case(folder / "plain").runs[0]
    np.testing.assert_array_equal(first.columns["depth_m"], second.columns["depth_m"])
    assert np.abs(first.columns["pitch_rad"] - second.columns["pitch_rad"]).max() < 0.01


def test_a_log_without_header_and_with_broken_rows(folder):
    lines = synthetic().splitlines()[1:]
    lines[10] = lines[10][:9]
    (folder / "a.csv").write_text("\n".join(lines))
    names = 'header = ["millis", "adc", "pitch", "yaw"]'
    with pytest.raises(InputError, match=r"a.csv:11: "):
        _import(folder, text=MAP.replace("[time]", f"[text]\n{names}\n[time]"))
    text = MAP.replace("[time]", f'[text]\n{names}\nbroken_rows = "drop"\n[time]')
    imported = _import(folder, text=text)
    assert imported.left_out == [{"broken": 1}]
    assert imported.notes[0].endswith("1 broken (line 11)")
    # Lines are still the file's own where rows before them were left out.
    lines[20] = "x,1,2,3"
    (folder / "a.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"a.csv:21: millis: "):
        _import(folder, out="other", text=text)


def test_times_that_do_not_go_on(folder):
    lines = synthetic().splitlines()
    lines[30] = lines[20]
    (folder / "a.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"a.csv:31: millis: time"):
        _import(folder)
    imported = _import(folder, text=MAP.replace('unit = "ms"', 'unit = "ms"\nnot_increasing = "drop"'))
    assert re.search(r"1 of 239 rows .*\(line 31\)$", imported.notes[0])


def test_a_row_written_twice_is_named_with_its_own_time(folder):
    lines = synthetic().splitlines()
    lines.insert(20, lines[20])
    (folder / "a.csv").write_text("\n".join(lines))
    moment = (float(lines[20].split(",")[0]) - float(lines[1].split(",")[0])) / 1000.0
    with pytest.raises(InputError, match=rf"a.csv:22: .*go on: {moment:g} s after {moment:g} s"):
        _import(folder)


def test_dates_are_times_too(folder):
    stamps = [f"2015-07-23T10:00:{second:06.3f}" for second in np.arange(0.0, 5.0, 0.05)]
    rows = [f"{stamp},{number},1,2" for number, stamp in enumerate(stamps)]
    (folder / "a.csv").write_text("\n".join(["millis,adc,pitch,yaw", *rows]))
    text = MAP.replace('unit = "ms"', 'unit = "iso8601"')
    _import(folder, text=text)
    run = load_case(folder / "out").runs[0]
    assert (run.rows, run.flight) == (20, "a.csv, 2015-07-23")
    (folder / "a.csv").write_text("\n".join(["millis,adc,pitch,yaw", *rows, "yesterday,1,1,1"]))
    with pytest.raises(InputError, match="a date"):
        _import(folder, out="other", text=text)


def test_times_of_day_go_on_through_midnight(folder):
    stamps = [f"23:59:{second:06.3f}" for second in np.arange(57.0, 60.0, 0.05)]
    stamps += [f"0:00:{second:04.1f}".replace(".", ",") for second in np.arange(0.0, 2.0, 0.1)]
    rows = [f'"{stamp}",{number},1,2' for number, stamp in enumerate(stamps)]
    (folder / "a.csv").write_text("\n".join(["millis,adc,pitch,yaw", *rows]))
    text = MAP.replace('unit = "ms"', 'unit = "clock"')
    _import(folder, text=text)
    run = load_case(folder / "out").runs[0]
    np.testing.assert_allclose(run.t, 0.1 * np.arange(20), atol=1e-9)  # 1 s to 3 s, at 10 Hz
    assert float(run.extra["adc_counts"][0]) == pytest.approx(20.5, abs=1.0)
    (folder / "a.csv").write_text("\n".join(["millis,adc,pitch,yaw", *rows, "noon,1,1,1"]))
    with pytest.raises(InputError, match="of day"):
        _import(folder, out="other", text=text)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("millis;adc;pitch;yaw\n0;1;1;1", r'text.delimiter = ";"'),
        ("millis\tadc\tpitch\tyaw\n0\t1\t1\t1", r'text.delimiter = "\\t"'),
        ('millis,adc,pitch,yaw\n0,"1,5",1,1\n20,1,1,1', r'text.decimal = ","'),
        ("millis,adc,pitch,yaw\n12:34:56.7,1,1,1", r'time.unit = "clock"'),
        ("millis,adc,pitch,yaw\n2026-05-01T12:34:56,1,1,1", r'time.unit = "iso8601"'),
    ],
)
def test_a_table_that_another_key_would_read_names_the_key(folder, line, said):
    (folder / "a.csv").write_text(line + "\n")
    with pytest.raises(InputError, match=said):
        _import(folder)


def test_pressure_becomes_depth_of_this_water(folder):
    text = MAP.replace('unit = "ft"', 'unit = "kPa"').replace("scale = 0.04", "scale = 0.5")
    _import(folder, text=text)
    run = load_case(folder / "out").runs[0]
    counts = np.array([float(word) for word in run.extra["adc_counts"]])
    np.testing.assert_allclose(run.columns["depth_m"], (counts - 100) * 500 / (1000 * 9.80665), atol=0.003)


def test_an_absolute_pressure_is_noted(folder):
    text = MAP.replace('unit = "ft"', 'unit = "kPa"').replace("zero = 100\nscale = 0.04", "scale = 0.04")
    rows = [f"{20 * n},{2450 + n % 50},1,2" for n in range(250)]  # 98 kPa and more
    (folder / "a.csv").write_text("\n".join(["millis,adc,pitch,yaw", *rows]))
    notes = _import(folder, text=text).notes
    assert any("10.0 m: " in note and "`zero`" in note for note in notes)
    zeroed = text.replace("scale = 0.04", "scale = 0.04\nzero = 2450")
    assert not any("absolute" in note for note in _import(folder, out="other", text=zeroed).notes)


def test_values_that_cannot_be_are_missing(folder):
    _import(folder, text=MAP.replace("max_gap_s = 0.3\n", "").replace("scale = 0.04", "scale = 0.04\nvalid = [0, 0.4]"))
    depth = load_case(folder / "out").runs[0].columns["depth_m"]
    assert np.nanmax(depth) <= 0.4
    assert np.isnan(depth).any()


def test_a_vehicle_file_beside_the_mapping_goes_with_the_case(folder):
    from glider.firmware.model.library import shipped

    (folder / "mine.toml").write_text(shipped("model/vehicles")["roughie"].replace("m_t = 13.0", "m_t = 12.0"))
    _import(folder, text=MAP.replace('"roughie"', '"mine.toml"'))
    assert load_case(folder / "out").vehicle.mass.m_t == 12.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rate_hz = 10.0", "rate = 10.0", "rate: unknown key"),
        ("zero = 100", "zeros = 100", "columns.depth_m.zeros: unknown key"),
        ("[columns.depth_m]", "[columns.height_m]", "columns.height_m: "),
        ("[columns.depth_m]", "[columns.t_s]", "columns.t_s: "),
        ("[extra.adc_counts]", "[extra.q_rad_s]", "extra.q_rad_s: "),
        ('unit = "ft"', 'unit = "furlong"', "unit: expected"),
        ('unit = "ft"', 'unit = "deg"', "columns.depth_m.unit: 'deg'"),
        ("sign = -1", "sign = 2", "columns.pitch_rad.sign"),
        ("scale = 0.04", "scale = 0.0", "scale"),
        ("scale = 0.04", "scale = 0.04\nvalid = [1, 0]", "valid"),
        ("end_s = 3.0", "end_s = 0.5", "end_s"),
        ('unit = "ms"', 'unit = "days"', "unit"),
        ("rate_hz = 10.0\n", "", "max_gap_s: needs rate_hz"),
        ("format = 1", "format = 1\nformat = 1", "not TOML"),
    ],
)
def test_mappings_are_strict(old, new, said):
    assert old in MAP
    with pytest.raises(ConfigError) as error:
        decode_map(MAP.replace(old, new), "map.toml")
    assert said in str(error.value)
    assert str(error.value).startswith("map.toml")


@pytest.mark.parametrize(("columns", "said"), [("", "missing key"), ("columns = 3\n", "columns: ")])
def test_a_mapping_needs_columns(columns, said):
    head, tables = MAP.partition("[columns.depth_m]")[0].split("[time]")
    with pytest.raises(ConfigError, match=rf"^map\.toml.*{said}"):
        decode_map(f"{head}{columns}[time]{tables}", "map.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('source = "adc"', 'source = "ADC"', "'ADC'; it has millis, adc, pitch, yaw"),
        ("start_s = 1.0\nend_s = 3.0", "start_s = 100.0", "nothing between 100 s"),
        ('unit = "ms"', 'unit = "h"', "time's unit"),
    ],
)
def test_logs_that_do_not_fit_their_mapping(folder, old, new, said):
    with pytest.raises(InputError) as error:
        _import(folder, text=MAP.replace(old, new).replace("end_s = 3.0\n", ""))
    assert said in str(error.value)
    assert not (folder / "out").exists()


def test_the_example_of_the_documentation_works(tmp_path):
    """Its mapping, on a log as it describes one."""
    guide = (Path(__file__).parents[3] / "docs" / "how-to" / "import.md").read_text()
    (tmp_path / "map.toml").write_text(guide.split("```toml\n")[1].split("```")[0])
    lines = ["two lines of", "the logger's own"]
    lines += [f"{20 * row};{138 + row / 10:.1f};0,5;-999;{90 - row / 100:.2f}".replace(".", ",") for row in range(7000)]
    (tmp_path / "flight1.csv").write_bytes("\n".join(lines).encode("latin-1"))
    import_csv([tmp_path / "flight1.csv"], str(tmp_path / "map.toml"), tmp_path / "out")
    (run,) = load_case(tmp_path / "out").runs
    assert run.rows == 840
    np.testing.assert_allclose(run.columns["depth_m"], 0.1 * (run.t + 40) / 0.02 * 0.0423062 * 0.3048, atol=0.004)
    np.testing.assert_allclose(run.columns["yaw_rad"], np.deg2rad((run.t + 40) / 2), atol=2e-4)
    assert np.isnan(run.columns["pitch_rad"]).all()
    assert run.has("p_rad_s", "q_rad_s", "r_rad_s")


def test_units_are_what_they_say():
    assert UNITS["deg"][1] == math.radians(1)
    assert UNITS["psi"][1] == pytest.approx(0.45359237 * 9.80665 / 0.0254**2)


def test_the_command_and_the_shipped_mapping(folder):
    mapping, _ = load_map("roughie2015")
    assert mapping.rate_hz == 10.0
    with pytest.raises(InputError, match="no mapping 'nothing'"):
        load_map("nothing")
    arguments = ["csv", str(folder / "a.csv"), "--map", str(folder / "map.toml"), "--json"]
    result = CliRunner().invoke(import_, arguments, catch_exceptions=False)
    assert json.loads(result.stdout)["rows"] == [20]
    assert load_case(folder / "a.case").runs[0].rows == 20


def test_the_flights_of_2015_are_reproduced(shared, tmp_path):
    """Exact but for the last digit of the second flight, and for two samples of the first that lie just between two
    rows: which of them takes such a sample is the rounding of a time that the given files counted from elsewhere."""
    given = shared / "data" / "roughie2015"
    raw = [given / "raw" / "flight1.csv.gz", given / "raw" / "flight2.csv.gz"]
    import_csv(raw, "roughie2015", tmp_path / "out")
    assert (tmp_path / "out" / "case.toml").read_text() == (given / "case.toml").read_text()
    ours, theirs = load_case(tmp_path / "out"), load_case(given)
    between = {0: 4, 1: 0}
    for number, (mine, wanted) in enumerate(zip(ours.runs, theirs.runs, strict=True)):
        assert list(mine.columns) == list(wanted.columns)
        assert list(mine.extra) == list(wanted.extra)
        wrong = np.zeros(wanted.rows, dtype=bool)
        for name, values in wanted.columns.items():
            np.testing.assert_array_equal(np.isnan(mine.columns[name]), np.isnan(values))
            wrong |= np.abs(mine.columns[name] - values) > 1.01e-5
            np.testing.assert_allclose(mine.columns[name], values, atol=0.01)
        assert np.count_nonzero(wrong) == between[number]


def test_the_template_is_a_mapping_that_names_every_column_and_key(tmp_path):
    from glider.tools.data.importers.mapping import ColumnTable, MapTable
    from glider.tools.data.runs import columns as names

    path = tmp_path / "mine.toml"
    ran = CliRunner().invoke(import_, ["csv", "--template", str(path)])
    assert ran.exit_code == 0, ran.output
    assert set(decode_map(path.read_text(), "mine.toml").columns) == {"depth_m"}
    lines = path.read_text().splitlines()
    last = next(n for n, line in enumerate(lines) if line.startswith("# Units")) + 2
    whole = [line[2:] if line.startswith("# ") and n > last and not line.startswith(("# One", "# Roll")) else line
             for n, line in enumerate(lines)]  # fmt: skip
    everything = decode_map("\n".join(whole), "mine.toml")
    onboard = {*names.COMMANDS, *names.DRAW_WIRES, *names.ATTITUDE, *names.RATES, names.DEPTH}
    assert set(everything.columns) == onboard
    assert all(name in path.read_text() for name in MapTable.__struct_fields__ if name != "commands")
    assert all(name in path.read_text() for name in ColumnTable.__struct_fields__ if name != "words")
    again = CliRunner().invoke(import_, ["csv", "--template", str(path)])
    assert isinstance(again.exception, InputError)
    assert CliRunner().invoke(import_, ["csv"]).exit_code == 2


def test_a_volume_of_ballast_is_a_mass_of_the_water(folder):
    text = MAP + '\n[columns.ballast_kg]\nsource = "adc"\nunit = "ml"\n'
    run = _import(folder, text=text).runs[0]
    counts = np.array([float(text) for text in run.extra["adc_counts"]])
    seen = np.isfinite(run.columns["ballast_kg"])
    assert run.columns["ballast_kg"][seen] == pytest.approx(counts[seen] * 1e-3, abs=1e-4)  # of 1000 kg/m3


def test_a_wrong_unit_is_said_at_its_key(folder):
    with pytest.raises(ConfigError, match=r"map\.toml:14: columns\.depth_m\.unit: .* m, cm"):
        _import(folder, text=MAP.replace('unit = "ft"', 'unit = "furlong"'))
    with pytest.raises(ConfigError, match=r"map\.toml:14: columns\.depth_m\.unit: 'deg' "):
        _import(folder, text=MAP.replace('unit = "ft"', 'unit = "deg"'))


def test_after_an_import_one_table_says_what_is_in_it(folder):
    asked = ["csv", str(folder / "a.csv"), "--map", str(folder / "map.toml"), "--out"]
    ran = CliRunner().invoke(import_, [*asked, str(folder / "c")])
    (line,) = (line for line in ran.stderr.splitlines() if line.startswith("depth_m"))
    depth = load_case(folder / "c").runs[0].columns["depth_m"]
    assert line.split()[1:4] == ["m", f"{np.nanmin(depth):.4g}", f"{np.nanmax(depth):.4g}"]
    plain = json.loads(CliRunner().invoke(import_, [*asked, str(folder / "d"), "--json"]).stdout)
    assert [one["name"] for one in plain["columns"]] == ["t_s", "pitch_rad", "yaw_rad", "depth_m"]
    assert plain["seconds"] == [pytest.approx(2.0, abs=0.11)]


def of_a_model(unit: str, declared: str) -> dict:
    """A mapping of one column, logged in `unit`, of a model that declares it in another."""
    target = Target(("value",), vehicle=Path("mine.toml"), units={"value": declared})
    text = f'format = 1\nvehicle = "mine.toml"\n[time]\ncolumn = "t"\n[columns.value]\nsource = "v"\nunit = "{unit}"\n'
    return decode_map(text, "map.toml", target).columns


@pytest.mark.parametrize(
    ("unit", "declared", "logged", "wanted"),
    [("rpm", "1/s", 120.0, 2.0), ("%", "1", 40.0, 0.4), ("cm/s", "m/s", 150.0, 1.5),
     ("kn", "m/s", 1.0, 1852.0 / 3600.0),
     ("N", "N", 3.0, 3.0), ("deg", "rad", 180.0, math.pi)],
)  # fmt: skip
def test_a_column_of_a_model_is_logged_in_any_unit_of_what_it_measures(unit, declared, logged, wanted):
    column = of_a_model(unit, declared)["value"]
    assert column.converted(np.array([logged]), None) == pytest.approx([wanted])


@pytest.mark.parametrize(("unit", "declared"), [("%", "rad"), ("rpm", "rad/s"), ("m", "m/s"), ("m", "N m")])
def test_one_in_a_unit_of_something_else_is_refused_by_name(unit, declared):
    with pytest.raises(ConfigError, match=f"columns.value.unit: '{unit}' is no unit of"):
        of_a_model(unit, declared)
