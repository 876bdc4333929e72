"""What docs/explanation/security.md promises and no other test holds: no network, no code out of data, no stranger's
kernels."""

import ast
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

FLY = """
import sys
seen = []
sys.addaudithook(lambda name, args: seen.append((name, repr(args)[:200])) if name.startswith("socket.") else None)
from glider.tools.cli.main import cli
try:
    cli(["fly", "--mission", sys.argv[1], "--log", sys.argv[2], "--json"], standalone_mode=False)
except SystemExit as end:
    assert end.code == 0, end.code
import glider.hal.outofband.guard, glider.hal.recorder.writer, glider.hal.devices
print(*seen, sep="\\n")
"""
DIP = """
format = 1
name = "dip"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
duration_s = 2.0
pitch_deg = -10.0
ballast_kg = 0.02
"""


def test_a_flight_opens_no_socket(tmp_path):
    (tmp_path / "dip.toml").write_text(DIP)
    done = subprocess.run(
        [sys.executable, "-c", FLY, str(tmp_path / "dip.toml"), str(tmp_path / "x.mcap")],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("('socket.")] == []


def _calls(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}


@pytest.mark.parametrize("package", ["hal", "firmware", "sim_backend", "tools"])
def test_no_code_is_made_out_of_data(package):
    """No eval, exec, pickle, shell: data stays data. Kernels are compiled from the project's own files."""
    wrong = []
    for path in sorted((ROOT / package).rglob("*.py")):
        for name, keywords in _calls(ast.parse(path.read_text())):
            bad = name in ("eval", "exec", "compile", "os.system", "os.popen", "__import__")
            bad |= name.split(".")[0] in ("pickle", "marshal", "shelve", "dill", "yaml")
            bad |= keywords.get("shell") == "True" or keywords.get("allow_pickle") == "True"
            if bad:
                wrong.append(f"{path.relative_to(ROOT)}: {name}")
    assert wrong == []


def test_a_cache_that_others_may_write_into_is_not_read(tmp_path):
    folder = tmp_path / "cache"
    folder.mkdir()
    code = "from glider.firmware.core.jit import cache_root; print(cache_root())"
    command = [sys.executable, "-c", code]
    place = {**os.environ, "GLIDER_CACHE_DIR": str(folder)}
    done = subprocess.run(command, env=place, cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == str(folder)
    folder.chmod(0o777)
    done = subprocess.run(command, env=place, cwd=ROOT, capture_output=True, text=True)
    assert "GLIDER_CACHE_DIR" in done.stderr
    if os.getuid() == 0:
        folder.chmod(0o755)
        os.chown(folder, 12345, 12345)
        done = subprocess.run(command, env=place, cwd=ROOT, capture_output=True, text=True)
        assert "GLIDER_CACHE_DIR" in done.stderr


@pytest.mark.parametrize("command", [("acknowledge",), ("compile",), ("fly", "--mission", "spiral", "--no-log")])
def test_no_place_for_kernels_is_said_in_a_line(command, tmp_path):
    blocked = tmp_path / "a-file"
    blocked.write_text("")
    place = {**os.environ, "GLIDER_CACHE_DIR": str(blocked), "GLIDER_STATE_DIR": str(tmp_path)}
    (tmp_path / "case").mkdir()
    done = subprocess.run(
        [sys.executable, "-m", "glider.tools.cli.main", *command], env={**place, "PYTHONPATH": str(ROOT)}, cwd=tmp_path,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert re.fullmatch(f"glider: {blocked}: .* GLIDER_CACHE_DIR", line)


@pytest.fixture
def open_folder():
    """A folder that every user gets to."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def test_a_heartbeats_folder_of_somebody_else_is_refused(open_folder):
    from glider.hal.heartbeat import Heartbeat

    if os.getuid() != 0:
        pytest.skip("only root can give a folder away")
    tmp_path = open_folder
    os.chown(tmp_path, 12345, 12345)
    code = "import os, sys\nfrom glider.hal.heartbeat import Heartbeat\nos.setuid(54321)\n"
    code += "Heartbeat.create(sys.argv[1], 0.02)"
    tmp_path.chmod(0o777)
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, capture_output=True, text=True)
    assert "somebody else" in done.stderr
    (tmp_path / "elsewhere").write_text("precious")
    (tmp_path / "heartbeat").symlink_to(tmp_path / "elsewhere")
    os.chown(tmp_path, 0, 0)
    with pytest.raises(OSError, match="symbolic links"):
        Heartbeat.create(tmp_path, 0.02)
    assert (tmp_path / "elsewhere").read_text() == "precious"


def test_a_text_file_without_end_is_not_read_to_it(tmp_path, monkeypatch):
    from glider.tools.data.errors import InputError
    from glider.tools.data.sources import read_text

    path = tmp_path / "x.toml"
    with path.open("wb") as file:
        file.truncate(2**40)  # a terabyte of nothing
    monkeypatch.setattr("glider.tools.data.sources.MAX_TEXT_CHARACTERS", 1_000_000)
    with pytest.raises(InputError, match=r"x\.toml: .*1000000"):
        read_text(path)
