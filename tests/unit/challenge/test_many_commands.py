"""`glider gap watch` and `gap diagnose` of several cases: a folder a case, kept or asked again, what fails named."""

import json
import shutil

import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.cli.many_cases import CASES, REFERENCE, VEHICLE, OneCommand
from tests.support.ocean import as_case, fly_dives


def run(capsys, *words: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["glider", *map(str, words)])
        code = report_errors(cli)
    return code, *capsys.readouterr()


@pytest.fixture(scope="module")
def missions(tmp_path_factory):
    """Two missions of three dives, one of which cannot be read, and the answer to the good one asked alone."""
    folder = tmp_path_factory.mktemp("missions")
    case = as_case(folder / "good", fly_dives(3).runs)
    (folder / "bad").mkdir()
    (folder / "bad" / "case.toml").write_text("format = 2\n")
    return case.folder, folder / "bad"


def test_several_are_watched_what_fails_is_named_and_what_is_there_is_kept(missions, tmp_path, capsys):
    good, bad = missions
    out, alone = tmp_path / "out", tmp_path / "alone"
    assert run(capsys, "gap", "watch", good, "--out", alone)[0] == 0
    code, result, said = run(capsys, "gap", "watch", good, bad, "--out", out, "--json")
    assert code == 1
    assert any(line.startswith("bad: exit 2: ") and "case.toml" in line for line in said.splitlines())
    assert list(json.loads(result)["cases"]) == ["good"]
    assert len(json.loads(result)["failed"]) == 1
    assert [path.name for path in out.iterdir()] == ["good"]
    for file in sorted(alone.iterdir()):
        assert (out / "good" / file.name).read_bytes() == file.read_bytes(), file.name
    (out / "good" / "watch.json").write_text("{}")
    assert run(capsys, "gap", "watch", good, "--jobs", "1", "--out", out)[0] == 0
    assert (out / "good" / "watch.json").read_text() == "{}"
    assert run(capsys, "gap", "watch", good, "--again", "--out", out)[0] == 0
    assert json.loads((out / "good" / "watch.json").read_text())["runs"]


def test_what_goes_along_with_a_case(missions, tmp_path):
    good, _ = missions
    near, far = tmp_path / "near", tmp_path / "far"
    shutil.copytree(good, far)
    text = (good / "case.toml").read_text()
    (tmp_path / "mine.toml").write_text("a vehicle")
    (far / "case.toml").write_text(text.replace('"slocum"', '"../mine.toml"'))
    shutil.copytree(far, near)
    (near / "case.toml").write_text(text.replace('"slocum"', '"mine.toml"'))
    (near / "mine.toml").write_text("its own")
    watch = OneCommand(("gap", "watch"), "watch.json")
    assert VEHICLE not in watch("near", near).commands[0]
    assert watch("near", near).files[str(CASES / "near" / "mine.toml")] == b"its own"
    outside = watch("far", far)
    assert outside.files[str(VEHICLE)] == b"a vehicle"
    assert outside.commands[0][-2:] == ["--vehicle", VEHICLE]
    named = OneCommand(("gap", "watch"), "watch.json", vehicle="slocum", reference=good)("far", far)
    assert named.commands[0][-4:] == ["--vehicle", "slocum", "--reference", REFERENCE]
    assert str(REFERENCE / "case.toml") in named.files


def test_refused_in_a_line(missions, tmp_path, capsys):
    good, bad = missions
    code, _, said = run(capsys, "gap", "diagnose", good, bad, "--out", good.parent)
    assert (code, "overwrite" in said) == (2, True)
    assert (good / "case.toml").is_file()
    other = tmp_path / "good"
    shutil.copytree(good, other)
    code, _, said = run(capsys, "gap", "diagnose", good, other, "--out", tmp_path / "out")
    assert (code, "good: another case" in said) == (2, True)
    code, _, said = run(capsys, "gap", "watch", good, bad)
    assert (code, "--out" in said) == (2, True)
    code, _, said = run(capsys, "gap", "diagnose", good, bad, "--out", tmp_path / "out", "--dask", "tcp://127.0.0.1:9")
    assert (code, "Dask scheduler" in said) == (2, True)
