"""A cut, a foreign, an empty and a mixed-up file are named in one line, and nothing is imported."""

import gzip
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.data.importers.ocean import netcdf
from glider.tools.data.importers.ocean.og1 import read_og1
from tests.support import ocean_files
from tests.support.commands import glider
from tests.support.ocean_files import START, flight

DAMAGED = Path(__file__).parents[2] / "data" / "damaged"


def refused(kind: str, files: list[Path], out: Path, *more: object) -> str:
    """The one line that is said; nothing was written."""
    done = glider("import", kind, *files, "--out", out, *more, cwd=out.parent)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert done.stdout == ""
    assert not out.exists()
    assert len(done.stderr.splitlines()) == 1, done.stderr
    return done.stderr.strip()


def cut(path: Path, share: float = 0.6) -> Path:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    return path


def slocum(folder: Path, name: str = "unit_7-2020-100-0-1", factored: bool = True) -> list[Path]:
    return ocean_files.slocum(folder, flight(), name, factored)


def with_unit(path: Path, variable: str, unit: str | None, engine: str) -> Path:
    import xarray

    with xarray.open_dataset(path, engine=engine, decode_times=False) as file:
        dataset = file.load()
    dataset[variable].attrs.pop("units", None)
    if unit is not None:
        dataset[variable].attrs["units"] = unit
    dataset.to_netcdf(path, engine=engine, format="NETCDF3_64BIT" if engine == "scipy" else None)
    return path


WRITERS: dict[str, Callable[[Path], list[Path]]] = {
    "slocum": slocum,
    "seaexplorer": lambda folder: ocean_files.seaexplorer(folder, flight()),
    "seaglider": lambda folder: [ocean_files.seaglider(folder / "p0770001.nc", flight())],
    "og1": lambda folder: [ocean_files.og1(folder / "mission.nc", [flight()])],
}


@pytest.mark.parametrize("kind", WRITERS)
def test_an_empty_a_cut_and_a_missing_file(tmp_path, kind):
    for n in range(len(WRITERS[kind](tmp_path))):
        files = WRITERS[kind](tmp_path)
        assert files[n].name in refused(kind, [*files[:n], cut(files[n]), *files[n + 1 :]], tmp_path / "case")
        files[n].write_bytes(b"")
        assert files[n].name in refused(kind, files, tmp_path / "case")
        files[n].unlink()
        assert files[n].name in refused(kind, files, tmp_path / "case")


@pytest.mark.parametrize("seed", range(3))
def test_bytes_overwritten_in_the_middle(tmp_path, seed):
    path = ocean_files.og1(tmp_path / "mission.nc", [flight()])
    whole = path.read_bytes()
    first, behind = len(whole) // 4, len(whole) // 2
    path.write_bytes(whole[:first] + np.random.default_rng(seed).bytes(behind - first) + whole[behind:])
    with pytest.raises(InputError) as error:
        read_og1(path, None)
    assert str(error.value).startswith(f"{path}: ")
    assert len(str(error.value).splitlines()) == 1


def test_damage_in_which_a_library_finds_no_end(tmp_path, monkeypatch):
    """A mission of `ocean_files.og1` with byte 2704 changed."""
    path = tmp_path / "mission.nc"
    path.write_bytes(gzip.decompress((DAMAGED / "read_for_ever.nc.gz").read_bytes()))
    monkeypatch.setattr(netcdf, "LEAST_READ_S", 1)
    with pytest.raises(InputError, match=r"mission\.nc: .*damaged"):
        read_og1(path, None)


@pytest.mark.parametrize("kind", WRITERS)
def test_files_of_another_glider_are_foreign(tmp_path, kind):
    for other, write in WRITERS.items():
        if other != kind:
            folder = tmp_path / other
            folder.mkdir(exist_ok=True)
            files = write(folder)[:1]
            assert files[0].name in refused(kind, files, tmp_path / "case")


def test_a_slocum_file_without_the_other_of_its_segment(tmp_path):
    engineering, science = slocum(tmp_path)
    assert ".dbd" in refused("slocum", [science], tmp_path / "case")
    assert ".ebd" in refused("slocum", [engineering], tmp_path / "case")
    other = slocum(tmp_path, "unit_7-2020-100-0-2")[1]
    assert "(unit_7-2020-100-0-2)" in refused("slocum", [engineering, other], tmp_path / "case")


def test_a_header_cache_that_is_missing_is_named(tmp_path):
    files = slocum(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "aaaa0001.cac").rename(elsewhere / "AAAA0001.CAC")
    line = refused("slocum", files, tmp_path / "case")
    assert "aaaa0001.cac" in line
    assert "--cache" in line
    assert glider("import", "slocum", *files, "--cache", elsewhere, "--out", "a", cwd=tmp_path).returncode == 0
    assert glider("import", "slocum", *files, elsewhere / "AAAA0001.CAC", "--out", "b", cwd=tmp_path).returncode == 0
    (tmp_path / "aaaa0001.cac").write_text("s: T 0 0 4 m_pitch rad\n")
    assert "aaaa0001.cac: cut: 1 of 13" in refused("slocum", files, tmp_path / "case")


def test_a_damaged_header_ends(tmp_path):
    engineering, science = slocum(tmp_path)
    text = engineering.read_bytes()
    for old, new in (
        (b"num_ascii_tags:    14", b"num_ascii_tags:    99"),
        (b"encoding_ver:    5", b"encoding_ver:    9"),
    ):
        engineering.write_bytes(text.replace(old, new))
        assert engineering.name in refused("slocum", [engineering, science], tmp_path / "case")
    engineering.write_bytes(text[:300])
    assert engineering.name in refused("slocum", [engineering, science], tmp_path / "case")
    engineering.write_bytes(text[:-200] + b"?" * 200)
    assert engineering.name in refused("slocum", [engineering, science], tmp_path / "case")


def test_a_compressed_file_that_is_none(tmp_path):
    engineering, science = slocum(tmp_path)
    named = engineering.rename(engineering.with_suffix(".dcd"))
    assert named.name in refused("slocum", [named, science], tmp_path / "case")


def test_two_gliders_in_one_call(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    files = slocum(tmp_path / "a") + ocean_files.slocum(tmp_path / "b", flight(START + 9000.0), "unit_8-2020-100-0-1")
    assert "unit_7 and unit_8" in refused("slocum", files, tmp_path / "case")
    files = [ocean_files.seaglider(tmp_path / f"p{n}.nc", flight(START + 9000.0 * n), glider=n) for n in (1, 2)]
    assert "SG001 and SG002" in refused("seaglider", files, tmp_path / "case")
    files = [*ocean_files.seaexplorer(tmp_path, flight(), 1), *ocean_files.seaexplorer(tmp_path, flight(), 2, "sea010")]
    assert "sea009.4 and sea010.4" in refused("seaexplorer", files, tmp_path / "case")


def test_the_same_dive_twice(tmp_path):
    first, second = (ocean_files.seaglider(tmp_path / f"p{n}.nc", flight()) for n in (1, 2))
    assert "p2.nc" in refused("seaglider", [first, second], tmp_path / "case")
    files = slocum(tmp_path)
    assert files[0].name in refused("slocum", files + files[:1], tmp_path / "case")


def test_a_seaexplorer_segment_without_its_other_half(tmp_path):
    navigation, payload = ocean_files.seaexplorer(tmp_path, flight())
    assert "(gli) of segment 1" in refused("seaexplorer", [payload], tmp_path / "case")
    assert "(pld1) of segment 1" in refused("seaexplorer", [navigation], tmp_path / "case")
    swapped = [navigation.rename(tmp_path / "x"), payload.rename(navigation), (tmp_path / "x").rename(payload)]
    assert "Timestamp" in refused("seaexplorer", swapped[1:], tmp_path / "case")


def test_two_files_of_a_segment_that_are_of_different_days(tmp_path):
    navigation = ocean_files.seaexplorer(tmp_path, flight())[0]
    (tmp_path / "later").mkdir()
    _, later = ocean_files.seaexplorer(tmp_path / "later", flight(START + 9000.0))
    assert later.name in refused("seaexplorer", [navigation, later], tmp_path / "case")
    engineering, _ = slocum(tmp_path)
    _, later = ocean_files.slocum(tmp_path / "later", flight(START + 9000.0))
    assert "segment" in refused("slocum", [engineering, later], tmp_path / "case")


def test_other_units_are_refused_by_file_and_variable(tmp_path):
    path = ocean_files.seaglider(tmp_path / "p1.nc", flight())
    for variable, unit in (("ctd_pressure", "bar"), ("eng_pitchAng", None), ("time", "days since 1970-1-1 00:00:00")):
        copy = tmp_path / f"{variable}.nc"
        copy.write_bytes(path.read_bytes())
        line = refused("seaglider", [with_unit(copy, variable, unit, "scipy")], tmp_path / "case")
        assert f"{variable}.nc: {variable}: unit '{unit or ''}', expected" in line
    path = ocean_files.og1(tmp_path / "m.nc", [flight()])
    line = refused("og1", [with_unit(path, "TEMP", "K", "h5netcdf")], tmp_path / "case")
    assert re.search(r"m\.nc: TEMP: .*'K', .*degrees_Celsius", line)
    engineering, science = slocum(tmp_path, factored=False)
    engineering.write_bytes(engineering.read_bytes().replace(b" m_pitch rad", b" m_pitch deg"))
    line = refused("slocum", [engineering, science], tmp_path / "case")
    assert re.search(r"\.dbd: m_pitch: .*'deg', .*rad$", line)
    navigation, payload = ocean_files.seaexplorer(tmp_path, flight())
    text = payload.read_text().splitlines()
    rows = [line.split(";") for line in text[1:]]
    payload.write_text("\n".join([text[0], *(";".join([*r[:2], f"{10 * float(r[2])}", *r[3:]]) for r in rows)]) + "\n")
    assert "GPCTD_CONDUCTIVITY" in refused("seaexplorer", [navigation, payload], tmp_path / "case")


def test_an_og1_file_that_names_no_vehicle_needs_one(tmp_path):
    path = ocean_files.og1(tmp_path / "m.nc", [flight()], model="a drifting bottle")
    assert "--vehicle" in refused("og1", [path], tmp_path / "case")
    assert glider("import", "og1", path, "--vehicle", "slocum", "--out", "case", cwd=tmp_path).returncode == 0


def test_a_folder_that_holds_a_case_is_not_written_into(tmp_path):
    files = WRITERS["seaglider"](tmp_path)
    assert glider("import", "seaglider", *files, "--out", "case", cwd=tmp_path).returncode == 0
    done = glider("import", "seaglider", *files, "--out", "case", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("glider: case: ")
