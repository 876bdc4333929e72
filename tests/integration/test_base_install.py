"""The flying part stays small: without extras a mission is flown, and every command works or says what it needs."""

import json
import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import click
import pytest

from tools.cli.main import cli
from tools.data.errors import extras, missing_extra

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests" / "support" / "every_command.py"
NOT_ON_THE_GLIDER = ("matplotlib", "scipy", "jinja2", "pandas", "polars", "pytest", "hypothesis")
BROUGHT = ("analysis", "bench", "campaign", "identify")

# In this order, each with the extra that it asks for; None: it does its work without any.
CALLS: tuple[tuple[str, str | None], ...] = (
    ("fly --mission spiral --log flight.mcap", None),
    ("missions", None),
    ("check", None),
    ("check --board twin", None),
    ("log info flight.mcap", None),
    ("log export flight.mcap --out case", None),
    ("log repair flight.mcap --out mended.mcap", None),
    ("import csv log.csv --map map.toml --out imported", None),
    ("import qualisys capture.tsv --out captured", "analysis"),
    ("vehicle new mine.toml", None),
    ("vehicle show mine.toml", None),
    ("simulate commands.csv --out simulated.csv", None),
    ("faults --only 34", None),
    ("faults --only 32", "bench"),
    ("benchmark --only memory", None),
    ("benchmark --only campaign", "campaign"),
    ("benchmark --only identify", "test"),
    ("twin --print-sim", None),
    ("twin --dir ports", "bench"),
    ("bench --board twin", "bench"),
    ("gap measure case", "analysis"),
    ("gap predict case/run00.csv --out predicted.csv", "analysis"),
    ("gap readings case", "analysis"),
    ("gap report answer", "analysis"),
    ("gap diagnose case --out answer", "analysis"),
    ("gap challenge make --out blind --seed 1 --single 1 --none 0 --pairs 0 --unknown 0 --jobs 1", None),
    ("gap challenge run --cases blind --out answers", "analysis"),
    ("gap challenge score --cases blind --answers blind/answers.zip --diagnoses answers", "analysis"),
    ("identify case", "identify"),
    ("reproduce fig5", "analysis"),
    ("reproduce fig4", "identify"),
    ("campaign", "campaign"),
    ("campaign --design identification", "analysis"),
    ("tune", "analysis"),
)
FILES = {
    "log.csv": "ms,deg\n" + "".join(f"{100 * i},{i % 7}\n" for i in range(100)),
    "map.toml": 'format = 1\nvehicle = "roughie"\nsite = "pool"\nwater_density_kg_m3 = 998.0\n[time]\ncolumn = "ms"\n'
    'unit = "ms"\n[columns.pitch_rad]\nsource = "deg"\nunit = "deg"\n',
    "capture.tsv": "",
    "commands.csv": "t_s,cmd_servo_rad,cmd_slider_m,cmd_ballast_kg,X,Y,Z,phi,theta,psi,u,v,w,p,q,r,servo_rad,slider_m,"
    "ballast_kg\n0,0,-0.02,0.1,0,0,5,0,0,0.3,0.2,0,0,0,0,0,0,0,0\n1,0,-0.02,0.1" + "," * 15 + "\n",
}  # fmt: skip


def leaves(command: click.Command, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every command that a person can call, by its words."""
    if not isinstance(command, click.Group):
        return [path]
    context = click.Context(command)
    found = [(name, command.get_command(context, name)) for name in command.list_commands(context)]
    return [leaf for name, one in found if one is not None for leaf in leaves(one, (*path, name))]


def test_the_list_of_calls_has_every_command():
    called = [tuple(call.split()) for call, _ in CALLS]
    assert [leaf for leaf in leaves(cli) if not any(call[: len(leaf)] == leaf for call in called)] == []


def call_all(python: object, folder: Path, blocked: list[str], environment: dict[str, str]) -> list[dict]:
    """What came of CALLS, in a process of another Python."""
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "calls.json").write_text(json.dumps({"calls": [call.split() for call, _ in CALLS], "blocked": blocked}))
    done = run(python, DRIVER, "calls.json", cwd=folder, env=environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def check_all(found: list[dict]) -> None:
    """Each command has worked, or said in one line which extra it needs."""
    wrong = []
    for (_, extra), one in zip(CALLS, found, strict=True):
        lines = [line for line in one["err"].splitlines() if not line.endswith(" ...")]  # it names what it begins with
        asks = len(lines) == 1 and lines[0].endswith(f"pip install 'glider[{extra}]'") and one["out"] == ""
        if "Traceback" in one["err"] or not (one["code"] == 0 if extra is None else one["code"] == 2 and asks):
            wrong.append((extra, one))
    assert wrong == []


def run(*command, **options):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=900, **options)


def test_every_command_works_or_names_its_extra_where_the_extras_are_hidden(tmp_path):
    brought = {package for packages in extras().values() for package in packages}
    hidden = sorted(brought & set(packages_distributions()))
    assert {"scipy", "jinja2", "matplotlib", "tomlkit", "joblib", "arviz", "emcee"} <= set(hidden)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    check_all(call_all(sys.executable, tmp_path / "calls", hidden, environment))


def test_the_extras_are_those_of_the_package():
    assert set(BROUGHT) <= set(extras())
    assert {"dask", "distributed", "joblib", "jinja2"} == set(extras()["campaign"])
    assert "'glider[identify]'" in str(missing_extra(ModuleNotFoundError(name="arviz.stats")))
    assert missing_extra(ModuleNotFoundError(name="tools.nothing")) is None


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
def test_a_base_install_flies_and_every_command_works_or_names_its_extra(base_install):
    python = base_install / "venv" / "bin" / "python"
    environment = {**os.environ, "GLIDER_CACHE_DIR": str(base_install / "kernels")}
    environment.pop("PYTHONPATH", None)
    check_all(call_all(python, base_install / "calls", [], environment))
    listed = run(python, "-m", "pip", "list", "--format", "json").stdout
    packages = {package["name"].lower() for package in json.loads(listed)}
    assert not packages & set(NOT_ON_THE_GLIDER)
