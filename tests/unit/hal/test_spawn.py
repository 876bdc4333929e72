"""Processes of this project load this project's modules, whatever the working directory holds."""

import os
import subprocess
import sys

import pytest

from glider.hal.board import BoardRequest, board_builder
from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import Field, RecordSpec
from glider.hal.spawn import ROOT, module_command, module_environment
from glider.tools.bench.client import Bench
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle

pytestmark = pytest.mark.realtime
SPEC = RecordSpec("/x", "glider_msgs/msg/X", (Field("x", "m"),))


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A working directory that has packages of this project's names, none of which can be imported."""
    for name in ("firmware", "hal", "sim_backend", "tools"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise SystemExit('{name} of the working directory')\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_module_is_that_of_the_project(elsewhere):
    command = module_command("glider.hal.outofband", "--help")
    assert command[0] == sys.executable
    done = subprocess.run(command, env=module_environment(), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "python -m glider.hal.outofband" in done.stdout


@pytest.mark.parametrize("before", [None, "", "/a/b"])
def test_the_projects_folder_leads_what_pythonpath_had(monkeypatch, before):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    if before is not None:
        monkeypatch.setenv("PYTHONPATH", before)
    environment = module_environment()
    assert environment["PYTHONPATH"].split(os.pathsep) == [str(ROOT), *([before] if before else [])]
    assert {**environment, "PYTHONPATH": before} == {**os.environ, "PYTHONPATH": before}


def test_the_twins_start_there(elsewhere):
    file = load_board_file("twin")
    board = board_builder("twin")(BoardRequest(text=file.text, source=file.source, vehicle=load_vehicle("roughie")))
    try:
        board.connect()
        assert board.state()["slips"] >= 0.0
    finally:
        board.close()


def test_the_bench_starts_there(elsewhere):
    file = load_board_file("twin")
    with Bench(file.text, file.source, "twin", "roughie", None) as bench:
        assert bench.ask("snapshot")["name"] == "twin"


def test_the_recorder_starts_there(elsewhere):
    recorder = Recorder("x.mcap", [SPEC])
    recorder.start()
    recorder.close()
    assert (elsewhere / "x.mcap").stat().st_size > 0
