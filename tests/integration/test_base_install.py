"""The flying part stays small: a base install, without extras, flies a mission on a board and keeps its log."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOT_ON_THE_GLIDER = ("matplotlib", "scipy", "jinja2", "pandas", "polars", "pytest", "hypothesis")


def run(*command, **options):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=300, **options)


@pytest.fixture(scope="module")
def base_install(tmp_path_factory):
    folder = tmp_path_factory.mktemp("base")
    python = folder / "venv" / "bin" / "python"
    assert run(sys.executable, "-m", "venv", folder / "venv").returncode == 0
    installed = run(
        python, "-m", "pip", "install", "--disable-pip-version-check", "--constraint", ROOT / "constraints.txt", ROOT
    )
    if installed.returncode != 0 and "Could not find a version" in installed.stderr + installed.stdout:
        pytest.skip("no package index to install from")
    assert installed.returncode == 0, installed.stderr
    return folder


@pytest.mark.slow
def test_a_base_install_flies(base_install):
    bin_ = base_install / "venv" / "bin"
    environment = {**os.environ, "GLIDER_CACHE_DIR": str(base_install / "kernels")}
    environment.pop("PYTHONPATH", None)
    done = run(bin_ / "glider", "fly", "--mission", "spiral", "--json", cwd=base_install, env=environment)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["completed"]
    assert result["records"]["complete"]
    listed = run(bin_ / "python", "-m", "pip", "list", "--format", "json").stdout
    packages = {package["name"].lower() for package in json.loads(listed)}
    assert not packages & set(NOT_ON_THE_GLIDER)
    info = run(bin_ / "glider", "log", "info", result["log"], "--json", cwd=base_install, env=environment)
    assert info.returncode == 0, info.stderr


@pytest.mark.slow
def test_a_command_that_needs_more_says_so(base_install):
    (base_install / "case").mkdir()
    (base_install / "case" / "case.toml").write_text(
        'format = 1\nvehicle = "roughie"\nsite = "pool"\nlog_rate_hz = 10.0\nwater_density_kg_m3 = 998.0\n'
        "motion_capture = false\nruns = 1\n"
    )
    rows = "\n".join(f"{0.1 * i:.1f},0,0,0.1,0,0,0,0,0,0,0,0,{1 + 0.01 * i:.2f}" for i in range(300))
    (base_install / "case" / "run00.csv").write_text(
        "t_s,cmd_servo_rad,cmd_slider_m,cmd_ballast_kg,slider_m,ballast_kg,roll_rad,pitch_rad,yaw_rad,"
        f"p_rad_s,q_rad_s,r_rad_s,depth_m\n{rows}\n"
    )
    done = run(base_install / "venv" / "bin" / "glider", "gap", "measure", "case", cwd=base_install)
    assert done.returncode == 2
    assert "pip install 'glider[analysis]'" in done.stderr
    assert "Traceback" not in done.stderr
