"""A case goes into OceanGliders' common format and comes back the same; what was found out about it stands beside."""

import json
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.runs.run import load_run
from tests.support import ocean_files
from tests.support.commands import glider
from tests.support.ocean_files import START, flight


def run_ok(*words: object, cwd: Path):
    done = glider(*words, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done


def opened(path: Path):
    import xarray

    with xarray.open_dataset(path, engine="h5netcdf", decode_times=False) as file:
        return file.load()


@pytest.fixture
def case(tmp_path) -> Path:
    """Two segments of a Slocum, with a hole in the CTD and a column that is not logged everywhere."""
    files = []
    for n, one in enumerate((flight(), flight(START + 7200.0, rows=80))):
        one.columns["fin_rad"][::3] = np.nan
        one.conductivity[40:60] = np.nan
        files += ocean_files.slocum(tmp_path, one, f"unit_7-2020-100-0-{n}")
    run_ok("import", "slocum", *files, "--out", "case", cwd=tmp_path)
    return tmp_path / "case"


def test_a_case_comes_back_byte_for_byte(tmp_path, case):
    run_ok("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    run_ok("import", "og1", "m.nc", "--out", "back", cwd=tmp_path)
    for path in case.iterdir():
        if path.name != "origin.csv":
            assert path.read_bytes() == (tmp_path / "back" / path.name).read_bytes(), path.name
    mine, back = ((folder / "origin.csv").read_text().splitlines() for folder in (case, tmp_path / "back"))
    assert [line.rpartition(",")[0] for line in mine] == [line.rpartition(",")[0] for line in back]


def former(path: Path) -> None:
    """The file as this program wrote it before: dives by another name, fixes along a dimension of their own."""
    file = opened(path)
    fixes = np.isfinite(file.TIME_GPS.values)
    names = ["TIME_GPS", "LATITUDE_GPS", "LONGITUDE_GPS"]
    own = {name: ("N_FIXES", file[name].values[fixes], {"units": file[name].attrs["units"]}) for name in names}
    rows = file.isel(N_MEASUREMENTS=~fixes).drop_vars(names).rename(SEGMENT_NUMBER="DIVE_NUMBER")
    rows["DIVE_NUMBER"] = rows.DIVE_NUMBER.astype(np.int32).drop_encoding()
    rows.assign(own).to_netcdf(path, engine="h5netcdf")


def test_a_file_with_the_former_names_is_read_the_same(tmp_path, case):
    run_ok("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    former(tmp_path / "m.nc")
    assert opened(tmp_path / "m.nc").sizes["N_MEASUREMENTS"] == 200
    run_ok("import", "og1", "m.nc", "--out", "back", cwd=tmp_path)
    for path in case.iterdir():
        if path.name != "origin.csv":
            assert path.read_bytes() == (tmp_path / "back" / path.name).read_bytes(), path.name


def test_exporting_twice_gives_the_same_bytes(tmp_path, case, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for name in ("a.nc", "b.nc"):
        run_ok("export", "og1", case, "--out", name, cwd=tmp_path)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


# Mandatory by the manual of the format, February 2026: variables with their attributes, global attributes.
TIMES = {"units": "seconds since 1970-01-01T00:00:00Z", "calendar": "gregorian"}
MANDATORY = {
    "TIME": {"long_name", "standard_name", "valid_min", "valid_max", "vocabulary"},
    "LATITUDE": {"long_name", "standard_name", "units", "valid_min", "valid_max", "vocabulary"},
    "LONGITUDE": {"long_name", "standard_name", "units", "valid_min", "valid_max", "vocabulary"},
    "DEPTH": {"long_name", "standard_name", "units", "valid_min", "valid_max", "vocabulary"},
    "TIME_GPS": {"long_name", "valid_min", "valid_max"},
    "LATITUDE_GPS": {"long_name", "standard_name", "units", "valid_min", "valid_max"},
    "LONGITUDE_GPS": {"long_name", "standard_name", "units", "valid_min", "valid_max"},
    "TEMP": {"long_name", "standard_name", "units", "vocabulary", "coordinates", "sensor"},
}
SINGLE = {
    "TRAJECTORY": {"cf_role", "long_name"}, "WMO_IDENTIFIER": {"long_name"}, "PLATFORM_SERIAL_NUMBER": {"long_name"},
    "PLATFORM_MODEL": {"long_name", "platform_model_vocabulary"},
    "DEPLOYMENT_TIME": {"long_name", "standard_name", "calendar", "units"}, "DEPLOYMENT_LATITUDE": {"long_name"},
    "DEPLOYMENT_LONGITUDE": {"long_name"},
    "SENSOR_CTD_UNKNOWN": {"sensor_type_vocabulary", "long_name", "sensor_model", "sensor_model_vocabulary"},
}  # fmt: skip
GLOBAL = {
    "title", "platform", "platform_vocabulary", "id", "contributor_name", "contributor_email", "contributor_role",
    "contributor_role_vocabulary", "contributing_institutions", "contributing_institutions_role",
    "contributing_institutions_role_vocabulary", "rtqc_method", "start_date", "date_created", "featureType",
    "Conventions",
}  # fmt: skip


def test_the_file_has_all_that_the_format_makes_mandatory(tmp_path, case):
    about = ("--contributor", "A. Person", "--email", "a@example.org", "--institution", "Pool", "--wmo", "4801904")
    done = run_ok("export", "og1", case, "--out", "m.nc", *about, "--data-mode", "D", cwd=tmp_path)
    assert "unknown" not in done.stderr
    file = opened(tmp_path / "m.nc")
    assert set(file.sizes) == {"N_MEASUREMENTS"}
    assert file.encoding["unlimited_dims"] == {"N_MEASUREMENTS"}
    for name, attributes in MANDATORY.items():
        assert file[name].dims == ("N_MEASUREMENTS",), name
        assert attributes <= set(file[name].attrs) | set(file[name].encoding), name
    for name in ("TIME", "TIME_GPS"):
        assert {key: file[name].attrs[key] for key in TIMES} == TIMES
        assert file[name].encoding["_FillValue"] == -1.0
    for name in ("LATITUDE", "LONGITUDE", "DEPTH", "LATITUDE_GPS", "LONGITUDE_GPS"):
        assert file[name].dtype == np.float64
        assert file[name].encoding["_FillValue"] == -9999.9
    for name, attributes in SINGLE.items():
        assert file[name].dims == (), name
        assert attributes <= set(file[name].attrs), name
    assert set(file.attrs) >= GLOBAL
    start = file.attrs["start_date"]
    assert file.attrs["id"] == f"unit_7_{start}_D"
    assert str(file.TRAJECTORY.values) == f"unit_7_{start}"
    assert file.attrs["Conventions"] == "CF-1.10, ACDD-1.3, OG-1.0"
    assert (file.attrs["contributor_name"], file.attrs["contributing_institutions"]) == ("A. Person", "Pool")
    assert str(file.WMO_IDENTIFIER.values) == "4801904"


def test_the_file_holds_the_runs_and_each_fix_as_a_row(tmp_path, case):
    done = run_ok("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    assert "--contributor, --email, --institution, --wmo" in done.stderr
    file = opened(tmp_path / "m.nc")
    fixes = len((case / "fixes.csv").read_text().splitlines()) - 1
    assert file.sizes == {"N_MEASUREMENTS": 200 + fixes}
    assert fixes > 2
    fixed = np.isfinite(file.TIME_GPS.values)
    assert np.count_nonzero(fixed) == fixes
    for name in ("TIME", "LATITUDE", "LONGITUDE"):
        assert (file[name].values[fixed] == file[f"{name}_GPS"].values[fixed]).all()
    assert np.isnan(file.PITCH.values[fixed]).all()
    assert np.isnan(file.SEGMENT_NUMBER.values[fixed]).all()
    assert (np.diff(file.TIME.values) >= 0.0).all()
    assert file.TIME.values[~fixed][0] == START
    assert file.PITCH.attrs["units"] == "degrees"
    pitch = file.PITCH.values[~fixed][0]
    assert pitch == pytest.approx(np.degrees(flight().columns["pitch_rad"][0]), abs=1e-4)
    assert "magnetic" in file.HEADING.attrs["comment"]
    assert np.unique(file.SEGMENT_NUMBER.values[~fixed]).tolist() == [1, 2]


def velocity(folder: Path, case: Path) -> None:
    """What `gap velocity` writes, for the first run alone and without its first row."""
    folder.mkdir()
    t = load_run(case / "run000.csv.gz").t[1:]
    rows = [f"{moment},0.25,-0.1,0.2,0.15,0.01" for moment in t]
    (folder / "run000.csv").write_text("\n".join(["t_s,u_m_s,w_m_s,vn_m_s,ve_m_s,sd_u_m_s", *rows]) + "\n")


def watch(folder: Path) -> None:
    folder.mkdir()
    cause = {"label": "drag", "probability": 0.9, "group": ["drag"], "size": 0.2, "ci90": [0.1, 0.3], "unit": "1"}
    runs = [
        {"run": "run000", "verdict": "none", "causes": [], "gap": 1.0, "skipped": None},
        {"run": "run001", "verdict": "cause", "causes": [cause], "gap": 2.0, "skipped": None},
    ]
    (folder / "watch.json").write_text(json.dumps({"runs": runs, "events": []}))


def test_velocity_and_verdicts_stand_beside_the_measurements(tmp_path, case):
    velocity(tmp_path / "v", case)
    watch(tmp_path / "w")
    done = run_ok("export", "og1", case, "--out", "m.nc", "--with", "v", "--with", "w", "--json", cwd=tmp_path)
    assert "GLIDER_HORZ_VELO_MODEL_SD" in json.loads(done.stdout)["variables"]
    file = opened(tmp_path / "m.nc")
    file = file.isel(N_MEASUREMENTS=np.isnan(file.TIME_GPS.values))  # rows of the runs
    speed = file.GLIDER_HORZ_VELO_MODEL.values
    assert np.isnan(speed[0])
    assert (speed[1:120] == 0.25).all()
    assert np.isnan(speed[120:]).all()
    assert file.GLIDER_VERT_VELO_MODEL.attrs["units"] == "m/s"
    assert np.unique(file.DIVE_VERDICT.values[:120]).tolist() == [0.0]
    assert file.DIVE_VERDICT.attrs["flag_meanings"].split()[int(file.DIVE_VERDICT.values[150])] == "cause"
    assert file.DIVE_CAUSE.attrs["flag_meanings"].split()[int(file.DIVE_CAUSE.values[150])] == "drag"
    assert file.DIVE_CAUSE_PROBABILITY.values[150] == 0.9
    # None of it is a measurement: the case that comes back is the one that went.
    run_ok("import", "og1", "m.nc", "--out", "back", cwd=tmp_path)
    assert (case / "run000.csv.gz").read_bytes() == (tmp_path / "back" / "run000.csv.gz").read_bytes()


def test_the_verdict_of_a_diagnosis_is_that_of_all_rows(tmp_path, case):
    causes = [{"label": "none", "probability": 0.6}, {"label": "pitch_bias", "probability": 0.4}]
    answer = {"format": 1, "verdict": "cause", "causes": causes, "selected": ["pitch_bias"]}
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "diagnosis.json").write_text(json.dumps(answer))
    run_ok("export", "og1", case, "--out", "m.nc", "--with", "d", cwd=tmp_path)
    file = opened(tmp_path / "m.nc")
    file = file.isel(N_MEASUREMENTS=np.isnan(file.TIME_GPS.values))
    assert np.unique(file.MISSION_VERDICT.values).tolist() == [1.0]
    assert file.MISSION_CAUSE.attrs["flag_meanings"] == "pitch_bias"
    assert np.unique(file.MISSION_CAUSE_PROBABILITY.values).tolist() == [0.4]
    for spoilt in ("{", "[]", json.dumps(answer | {"verdict": "perhaps"})):
        (tmp_path / "d" / "diagnosis.json").write_text(spoilt)
        done = glider("export", "og1", case, "--out", "m2.nc", "--with", "d", cwd=tmp_path)
        assert done.returncode == 2
        assert "diagnosis.json: " in done.stderr


def test_a_measured_speed_goes_along(tmp_path, case):
    path = case / "run000.csv.gz"
    run = load_run(path)
    path.unlink()
    lines = ["t_s,pitch_rad,roll_rad,yaw_rad,depth_m,density_kg_m3,speed_m_s"]
    lines += [f"{moment},-0.4,0,1,20,1026,{0.3 + moment / 1e4}" for moment in run.t]
    (case / "run000.csv").write_text("\n".join(lines) + "\n")
    run_ok("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    run_ok("import", "og1", "m.nc", "--out", "back", cwd=tmp_path)
    found = load_run(tmp_path / "back" / "run000.csv.gz").columns["speed_m_s"]
    np.testing.assert_allclose(found, 0.3 + run.t / 1e4, atol=1e-5)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda case: (case / "origin.csv").unlink(), "no origin.csv"),
        (lambda case: (case / "origin.csv").write_text("run,start_utc\n"), "no samples"),
        (lambda case: (case / "case.toml").write_text(
            (case / "case.toml").read_text().replace('"slocum"', '"roughie"')), "'roughie'"),
        (lambda case: (case / "run001.csv.gz").unlink(), "2 expected, 1 files"),
    ],
)  # fmt: skip
def test_a_case_that_cannot_be_exported_is_refused(tmp_path, case, spoil, said):
    spoil(case)
    done = glider("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("*m.nc*"))


def test_an_answer_of_other_runs_is_refused(tmp_path, case):
    velocity(tmp_path / "v", case)
    text = (tmp_path / "v" / "run000.csv").read_text().replace("\n15.0,", "\n15.7,")
    (tmp_path / "v" / "run000.csv").write_text(text)
    for name, said in (
        ("v", "no row of run000 is at this time"),
        ("case", "neither watch.json, diagnosis.json nor run000.csv with"),
    ):
        done = glider("export", "og1", case, "--out", "m.nc", "--with", name, cwd=tmp_path)
        assert done.returncode == 2
        assert said in done.stderr
