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


def test_exporting_twice_gives_the_same_bytes(tmp_path, case):
    for name in ("a.nc", "b.nc"):
        run_ok("export", "og1", case, "--out", name, cwd=tmp_path)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_the_file_is_as_the_format_asks(tmp_path, case):
    run_ok("export", "og1", case, "--out", "m.nc", cwd=tmp_path)
    file = opened(tmp_path / "m.nc")
    fixes = len((case / "fixes.csv").read_text().splitlines()) - 1
    assert file.sizes == {"N_MEASUREMENTS": 200, "N_FIXES": fixes}
    assert fixes > 2
    assert "OG-1.0" in file.attrs["Conventions"]
    assert {"TIME", "LATITUDE", "LONGITUDE", "DEPTH", "TRAJECTORY", "PLATFORM_MODEL", "PLATFORM_SERIAL_NUMBER"} <= set(
        file.variables
    )
    assert file.TIME.values[0] == START
    assert file.PITCH.attrs["units"] == "degrees"
    assert file.PITCH.values[0] == pytest.approx(np.degrees(flight().columns["pitch_rad"][0]), abs=1e-4)
    assert "magnetic" in file.HEADING.attrs["comment"]
    assert np.unique(file.DIVE_NUMBER.values).tolist() == [1, 2]


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
    assert np.unique(file.MISSION_VERDICT.values).tolist() == [1.0]
    assert file.MISSION_CAUSE.attrs["flag_meanings"] == "pitch_bias"
    assert np.unique(file.MISSION_CAUSE_PROBABILITY.values).tolist() == [0.4]
    for spoilt in ("{", "[]", json.dumps(answer | {"verdict": "perhaps"})):
        (tmp_path / "d" / "diagnosis.json").write_text(spoilt)
        done = glider("export", "og1", case, "--out", "m2.nc", "--with", "d", cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.endswith("diagnosis.json: not the answer of `glider gap diagnose`\n")


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
        (lambda case: (case / "origin.csv").write_text("run,start_utc\n"), "no samples below the header"),
        (lambda case: (case / "case.toml").write_text(
            (case / "case.toml").read_text().replace('"slocum"', '"roughie"')), "'roughie' is no ocean glider"),
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
