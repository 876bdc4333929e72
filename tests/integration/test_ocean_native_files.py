"""Native files of real ocean gliders come in by one command each, and agree with runs that others made of them."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.runs.run import load_run
from tests.support.commands import glider

# Half the last digit that those runs are written with, and one count of a digit that was rounded twice.
TOLERANCES = {
    "t_s": 0.0055, "depth_m": 0.0011, "pitch_rad": 1.1e-5, "roll_rad": 1.1e-5, "yaw_rad": 1.1e-5, "oil_m3": 1.1e-8,
    "battery_m": 1.1e-5, "fin_rad": 1.1e-4, "density_kg_m3": 1.1e-4, "temperature_c": 1.1e-4, "pump": 0.0,
}  # fmt: skip
# Files, run of the import, and the case and run that hold the same.
CALLS = {
    "slocum": (("00000002.dbd", "00000002.ebd"), ((0, 4),)),
    "seaglider": (("p0000001.nc", "p0000002.nc"), ((0, 0), (1, 6))),
    "seaexplorer": (
        tuple(f"sea000.1.{kind}.sub.{n}" for n in (1, 2) for kind in ("gli", "pld1")),
        ((0, 3), (1, 4)),
    ),
}


@pytest.fixture(scope="module")
def ocean(shared) -> Path:
    folder = shared / "data" / "ocean"
    if not folder.is_dir():
        pytest.skip("no real ocean flights in 'shared'")
    return folder


def bring(kind: str, files: list[Path], out: Path):
    done = glider("import", kind, *files, "--out", out, "--json", cwd=out.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("kind", CALLS)
def test_each_column_is_that_of_the_run(ocean, tmp_path, kind):
    names, same = CALLS[kind]
    bring(kind, [ocean / "raw" / kind / name for name in names], tmp_path / "case")
    for run, held in same:
        found = load_run(tmp_path / "case" / f"run{run:03d}.csv.gz")
        wanted = load_run(ocean / kind / f"run{held:03d}.csv.gz")
        assert found.rows == wanted.rows
        assert set(found.columns) == set(wanted.columns)
        for name, values in wanted.columns.items():
            off = found.columns[name] - values
            off = (off + np.pi) % (2.0 * np.pi) - np.pi if name == "yaw_rad" else off
            assert np.nanmax(np.abs(off)) <= TOLERANCES[name], (run, name)
            # The run's neighbours gave the payload's last samples before it, which this call was not given.
            first = np.flatnonzero(np.isfinite(found.columns[name]))[0] if kind == "seaexplorer" else 0
            assert (np.isnan(off) == np.isnan(values))[first:].all(), (run, name)
            assert first <= 4


def test_a_mission_in_og1_comes_in_dive_by_dive(ocean, tmp_path):
    result = bring("og1", [ocean / "raw" / "og1" / "mission_delayed.nc"], tmp_path / "case")
    assert result["vehicle"] == "seaglider"
    assert len(result["rows"]) == 19
    deepest = []
    for path in result["files"]:
        run = load_run(path)
        assert np.median(np.diff(run.t)) < 35.0
        density = run.columns["density_kg_m3"]
        assert np.nanmin(density) > 1020.0
        assert np.nanmax(density) < 1034.0
        deepest.append(np.nanmax(run.columns["depth_m"]))
    assert max(deepest) == pytest.approx(1146.0, abs=5.0)


@pytest.mark.parametrize("kind", ["slocum", "seaglider", "seaexplorer", "og1"])
def test_twice_the_same_and_a_cut_file_named(ocean, tmp_path, kind):
    files = sorted(path for path in (ocean / "raw" / kind).iterdir() if path.suffix != ".cac")
    for name in ("a", "b"):
        bring(kind, files, tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
    cut = tmp_path / files[0].name
    cut.write_bytes(files[0].read_bytes()[: int(0.4 * files[0].stat().st_size)])
    more = ("--cache", ocean / "raw" / "slocum") if kind == "slocum" else ()
    done = glider("import", kind, cut, *files[1:], *more, "--out", "c", cwd=tmp_path)
    assert done.returncode == 2
    assert files[0].name in done.stderr.splitlines()[-1]
    assert not (tmp_path / "c").exists()


def test_a_packed_table_of_a_seaexplorer(ocean, tmp_path):
    files = []
    for path in sorted((ocean / "raw" / "seaexplorer").iterdir()):
        files.append(tmp_path / f"{path.name}.gz")
        files[-1].write_bytes(gzip.compress(path.read_bytes()))
    assert bring("seaexplorer", files, tmp_path / "packed")["rows"] == [509, 497]
