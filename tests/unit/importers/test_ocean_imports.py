"""Ocean gliders' native files, made here from a flight that is known, come back as that flight; damaged ones do not."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.runs.origin import read_fixes
from glider.tools.data.runs.run import Run, load_run
from tests.support import ocean_files
from tests.support.commands import glider
from tests.support.ocean_files import START, Flight, flight

# How far a column may be off: half its last written digit, and what single precision or interpolation leaves.
TOLERANCES = {
    "t_s": 6e-4, "depth_m": 1e-3, "pitch_rad": 1e-6, "roll_rad": 1e-6, "yaw_rad": 1e-6, "oil_m3": 1e-9,
    "battery_m": 1e-6, "fin_rad": 6e-6, "density_kg_m3": 2e-4, "temperature_c": 1e-4, "pump": 0.0,
}  # fmt: skip
KINDS = ("slocum", "seaglider", "seaexplorer", "og1")


def write(kind: str, folder: Path, flights: list[Flight]) -> list[Path]:
    """The native files of a mission of these flights."""
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "og1":
        return [ocean_files.og1(folder / "mission.nc", flights)]
    if kind == "seaglider":
        return [ocean_files.seaglider(folder / f"p077{n:04d}.nc", one) for n, one in enumerate(flights, start=1)]
    if kind == "seaexplorer":
        return [path for n, one in enumerate(flights, start=1) for path in ocean_files.seaexplorer(folder, one, n)]
    names = [f"unit_7-2020-100-0-{n}" for n in range(len(flights))]
    return [path for name, one in zip(names, flights, strict=True) for path in ocean_files.slocum(folder, one, name)]


def bring(kind: str, files: list[Path], out: Path, *more: str):
    return glider("import", kind, *files, "--out", out, *more, cwd=out.parent)


def assert_is_the_flight(run: Run, one: Flight) -> None:
    assert {"depth_m", "pitch_rad", "roll_rad", "yaw_rad", "oil_m3", "density_kg_m3", "temperature_c"} <= set(
        run.columns
    )
    assert run.rows == len(one.t)
    for name, values in run.columns.items():
        if name != "pump":
            np.testing.assert_allclose(values, one.columns[name], rtol=0.0, atol=TOLERANCES[name], err_msg=name)
    assert not {"speed_m_s", "vn_m_s", "ve_m_s"} & set(run.columns)  # nobody measured one


@pytest.mark.parametrize("kind", KINDS)
def test_a_mission_comes_back_as_it_was_flown(tmp_path, kind):
    flights = [flight(), flight(START + 7200.0, rows=80)]
    done = bring(kind, write(kind, tmp_path / "in", flights)[::-1], tmp_path / "case", "--json")
    assert done.returncode == 0, done.stderr
    for n, one in enumerate(flights):
        assert_is_the_flight(load_run(tmp_path / "case" / f"run{n:03d}.csv.gz"), one)
    text = (tmp_path / "case" / "case.toml").read_text()
    assert f'vehicle = "{"seaglider" if kind == "og1" else kind}"' in text
    assert "runs = 2\n" in text
    assert "log_rate_hz = 0.2\n" in text
    assert (tmp_path / "case" / "mission.csv").read_text() == "run,hours_since_start\nrun000,0.0000\nrun001,2.0000\n"
    origin = (tmp_path / "case" / "origin.csv").read_text().splitlines()
    assert origin[1].startswith("run000,2020-09-13T12:26:40.000Z,45.25000,-20.50000,")
    fixes = read_fixes(tmp_path / "case")
    for one in flights:
        behind = fixes[np.searchsorted(fixes[:, 0], one.t[-1])]  # the first fix after its last row, or at it
        assert behind == pytest.approx([behind[0], ocean_files.LATITUDE + ocean_files.NORTHWARD, ocean_files.LONGITUDE])
        if kind != "seaexplorer":  # which logs a position at its start that is no new fix
            before = fixes[fixes[:, 0] < one.t[30]][-1]
            assert before == pytest.approx([before[0], ocean_files.LATITUDE, ocean_files.LONGITUDE], abs=1e-6)
    result = json.loads(done.stdout)
    assert result["rows"] == [120, 80]
    assert result["hours_since_start"] == [0.0, 2.0]
    assert result["left_out"] == [{}, {}]


@pytest.mark.parametrize("kind", KINDS)
def test_importing_twice_gives_the_same_bytes(tmp_path, kind):
    files = write(kind, tmp_path / "in", [flight(), flight(START + 7200.0, rows=80)])
    before = {path: path.read_bytes() for path in (tmp_path / "in").iterdir()}
    for name, order in (("a", files), ("b", files[::-1])):
        assert bring(kind, order, tmp_path / name).returncode == 0
    assert {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()} == {
        path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()
    }
    assert before == {path: path.read_bytes() for path in (tmp_path / "in").iterdir()}  # nothing is written there


def test_a_slocum_logs_rudder_pump_and_its_own_lists_of_sensors(tmp_path):
    one = flight()
    files = ocean_files.slocum(tmp_path, one, factored=False)
    assert bring("slocum", files, tmp_path / "case").returncode == 0
    run = load_run(tmp_path / "case" / "run000.csv.gz")
    np.testing.assert_allclose(run.columns["fin_rad"], one.columns["fin_rad"], atol=6e-6)
    assert (run.columns["pump"] == one.columns["pump"]).all()
    assert ",-0.12500,unit_7," in (tmp_path / "case" / "origin.csv").read_text()  # west is positive aboard


def test_compressed_binaries_give_the_same(tmp_path):
    files = ocean_files.slocum(tmp_path, flight(rows=700))
    bring("slocum", files, tmp_path / "plain")
    packed = [ocean_files.compressed(path) for path in files]
    assert {path.suffix for path in packed} == {".dcd", ".ecd"}
    assert bring("slocum", packed, tmp_path / "case").returncode == 0
    name = "run000.csv.gz"
    assert (tmp_path / "case" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
    packed[0].write_bytes(packed[0].read_bytes()[:20_000])
    assert "damaged" in bring("slocum", packed, tmp_path / "cut").stderr


def test_what_is_sent_ashore_may_lack_sensors(tmp_path):
    one = flight()
    nothing = np.full(len(one.t), np.nan)
    for name in ("roll_rad", "fin_rad", "battery_m"):
        one.columns[name] = nothing
    assert bring("slocum", ocean_files.slocum(tmp_path, one), tmp_path / "case").returncode == 0
    run = load_run(tmp_path / "case" / "run000.csv.gz")
    assert not {"roll_rad", "fin_rad", "battery_m"} & set(run.columns)
    assert {"pitch_rad", "yaw_rad", "oil_m3"} <= set(run.columns)


def test_a_seagliders_ctd_may_have_its_own_times(tmp_path):
    one = flight()
    for engine in ("scipy", "h5netcdf"):
        path = ocean_files.seaglider(tmp_path / f"{engine}.nc", one, engine=engine, two=True)
        assert bring("seaglider", [path], tmp_path / engine).returncode == 0
        assert_is_the_flight(load_run(tmp_path / engine / "run000.csv.gz"), one)


def test_a_seaglider_pumps_where_its_log_or_its_volume_says_so(tmp_path):
    bring("seaglider", [ocean_files.seaglider(tmp_path / "p1.nc", flight())], tmp_path / "case")
    pump = load_run(tmp_path / "case" / "run000.csv.gz").columns["pump"]
    assert np.flatnonzero(pump).tolist() == [10, 11, 12, 59, 60]


def test_the_zero_of_a_seagliders_volume_is_that_of_its_first_dive(tmp_path):
    flights = [flight(), flight(START + 7200.0)]
    files = [
        ocean_files.seaglider(tmp_path / f"p{n}.nc", one, zero_counts=counts)
        for n, (one, counts) in enumerate(zip(flights, (2900.0, 2860.0), strict=True))
    ]
    done = bring("seaglider", files, tmp_path / "case")
    assert " +10.0 cm3" in done.stderr
    later = load_run(tmp_path / "case" / "run001.csv.gz").columns["oil_m3"]
    np.testing.assert_allclose(later, flights[1].columns["oil_m3"] + 1e-5, atol=1e-9)


def test_an_og1_mission_without_numbers_is_parted_at_its_surfacings(tmp_path):
    flights = [flight(), flight(START + 900.0), flight(START + 9000.0)]
    file = ocean_files.og1(tmp_path / "m.nc", flights, numbered=False)
    assert bring("og1", [file], tmp_path / "case").returncode == 0
    assert [load_run(path).rows for path in sorted((tmp_path / "case").glob("run*"))] == [120, 120, 120]


@pytest.mark.parametrize("kind", ["slocum", "seaexplorer"])
def test_a_late_science_clock_is_put_right_and_said(tmp_path, kind):
    one = flight(rows=400, deepest=100.0)
    late = dataclasses.replace(one, ctd_t=one.ctd_t + 60.0)
    done = bring(kind, write(kind, tmp_path / "in", [late]), tmp_path / "case")
    assert " -60.0 s" in done.stderr
    found = load_run(tmp_path / "case" / "run000.csv.gz").columns["density_kg_m3"][2:-2]
    np.testing.assert_allclose(found, one.columns["density_kg_m3"][2:-2], atol=0.01)


@pytest.mark.parametrize(("kind", "hole_s"), [("slocum", 15.0), ("seaexplorer", 65.0)])
def test_the_ctd_is_not_interpolated_over_long_holes(tmp_path, kind, hole_s):
    one = flight()
    for size, missing in ((hole_s - 3.0, False), (hole_s + 3.0, True)):
        begin = one.ctd_t[100]
        keep = (one.ctd_t <= begin) | (one.ctd_t >= begin + size)
        holed = dataclasses.replace(
            one, ctd_t=one.ctd_t[keep], pressure=one.pressure[keep], temperature=one.temperature[keep],
            conductivity=one.conductivity[keep],
        )  # fmt: skip
        out = tmp_path / f"case{missing}"
        assert bring(kind, write(kind, tmp_path / f"in{missing}", [holed]), out).returncode == 0
        found = np.isnan(load_run(out / "run000.csv.gz").columns["density_kg_m3"])
        inside = (one.t > begin) & (one.t < one.ctd_t[one.ctd_t >= begin + size][0])
        assert (found == (inside & missing)).all()


@pytest.mark.parametrize("kind", ["slocum", "seaexplorer"])
def test_what_is_taken_out_is_counted_and_said(tmp_path, kind):
    one = flight()
    one.pressure[50] += 300.0
    one.temperature[70] = 99.0
    one.conductivity[90] -= 1.0
    one.pressure[:4] = 0.1
    one.t[30] = START - 400.0 * 86400.0
    done = bring(kind, write(kind, tmp_path / "in", [one]), tmp_path / "case", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["left_out"] == [{
        "at a time outside the mission": 1, "of the CTD above 0.3 dbar": 4, "spike of conductivity": 1,
        "temperature outside -3 to 45": 1, "spike of pressure": 1,
    }]  # fmt: skip
    assert "1 spike of pressure" in done.stderr
    assert load_run(tmp_path / "case" / "run000.csv.gz").rows == 119


def test_a_flag_that_calls_a_sample_bad_is_heeded(tmp_path):
    import xarray

    path = ocean_files.seaglider(tmp_path / "p1.nc", flight())
    with xarray.open_dataset(path, engine="scipy", decode_times=False) as file:
        dataset = file.load()
    dataset["salinity_qc"][50:80] = b"4"
    dataset.to_netcdf(path, engine="scipy", format="NETCDF3_64BIT")
    done = bring("seaglider", [path], tmp_path / "case", "--json")
    assert json.loads(done.stdout)["left_out_in_all"] == {"of the CTD that the base station calls bad or has not": 30}
    run = load_run(tmp_path / "case" / "run000.csv.gz")
    assert np.flatnonzero(np.isnan(run.columns["density_kg_m3"])).tolist() == list(range(50, 80))
    assert np.isfinite(run.columns["depth_m"]).all()


def test_many_files_show_how_far_they_are(tmp_path):
    flights = [flight(START + 7200.0 * n, rows=12) for n in range(10)]
    done = bring("seaexplorer", write("seaexplorer", tmp_path / "in", flights), tmp_path / "case")
    assert [line for line in done.stderr.splitlines() if line.startswith("import")][-1] == "import seaexplorer: 20/20"
    assert len(done.stdout.splitlines()) == 10
