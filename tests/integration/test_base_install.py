"""The flying part stays small: without extras a mission is flown, and every command works or says what it needs."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import click
import pytest
from packaging.requirements import Requirement

from glider.tools.cli.main import cli
from glider.tools.data.errors import extras, missing_extra
from glider.tools.data.version import DISTRIBUTION

pytestmark = pytest.mark.computes(seconds=25)

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests" / "support" / "every_command.py"
PACKAGES = ("firmware", "hal", "sim_backend", "tools")
NOT_ON_THE_GLIDER = {
    "matplotlib", "scipy", "jinja2", "pandas", "polars", "xarray", "h5netcdf", "gsw", "dbdreader", "pytest",
    "hypothesis",
}  # fmt: skip
BROUGHT = (
    "analysis", "ardupilot", "bench", "campaign", "fmu", "identify", "live", "notebook", "ocean", "parquet",
    "ros", "slocum",
)  # fmt: skip

# In this order, each with the extra that it asks for; None: it does its work without any.
CALLS: tuple[tuple[str, str | None], ...] = (
    ("fly --mission spiral --log flight.mcap", None),
    ("live", "live"),
    ("live --layout glider.json", None),
    ("missions", None),
    ("effects", None),
    ("check", None),
    ("check --board twin", None),
    ("compile", None),
    ("acknowledge --state state", None),
    ("status --help", None),  # its work is a flight's on devices: test_health_page.py
    ("log info flight.mcap", None),
    ("log replay flight.mcap", None),
    ("log export flight.mcap --out case", None),
    ("log fetch --help", None),  # its work is ssh's: test_log_fetch.py
    ("log repair flight.mcap --out mended.mcap", None),
    ("import csv log.csv --map map.toml --out imported", None),
    ("import qualisys capture.tsv --out captured", "analysis"),
    ("import slocum one.dbd one.ebd --out slocum", "slocum"),
    ("import seaglider p0010001.nc --out seaglider", "ocean"),
    ("import seaexplorer sea001.1.gli.sub.1 sea001.1.pld1.sub.1 --out seaexplorer", "ocean"),
    ("import og1 mission.nc --out og1", "ocean"),
    ("import rosbag dive --map ros-imu --out bag", "ros"),
    ("import ardusub dive.BIN --map ardusub-bin --out sub", "ardupilot"),
    ("export og1 case --out mission.nc", "ocean"),
    ("export parquet case --out parquet", "parquet"),
    ("export parameters roughie --as toml", None),
    ("export fossen roughie", None),
    ("export sdf roughie", None),
    ("export stonefish roughie", None),
    ("vehicle new mine.toml", None),
    ("vehicle show mine.toml", None),
    ("vehicle check sinker.toml", None),
    ("simulate commands.csv --out simulated.csv", None),
    ("faults --only 34", None),
    ("faults --only 32", "bench"),
    ("benchmark --only memory", None),
    ("benchmark --only campaign", "campaign"),
    ("benchmark --only ocean", "analysis"),
    ("benchmark --only identify", "test"),
    ("twin --print-sim", None),
    ("twin --dir ports", "bench"),
    ("bench --board twin", "bench"),
    ("gap measure case", "analysis"),
    ("gap predict case/run00.csv --out predicted.csv", None),
    ("gap readings case", "analysis"),
    ("gap isolability --columns pitch_rad,depth_m", "analysis"),
    ("gap report answer", "analysis"),
    ("gap compare answer answer", "analysis"),
    ("gap watch case", "analysis"),
    ("gap velocity dives --out velocity", None),
    ("gap diagnose case --out answer", "analysis"),
    ("gap challenge make --out blind --seed 1 --single 1 --none 0 --pairs 0 --unknown 0 --jobs 1", None),
    ("gap challenge run --cases blind --out answers", "analysis"),
    ("gap challenge score --cases blind --answers blind/answers.zip --diagnoses answers", "analysis"),
    ("identify case", "identify"),
    ("identify dives", "analysis"),
    ("reproduce fig5", "analysis"),
    ("reproduce fig4", "identify"),
    ("campaign", "campaign"),
    ("campaign --design identification", "analysis"),
    ("tune", "analysis"),
)
FILES = {
    "sinker.toml": 'format = 1\nmodel = "sinker"\n',
    "sinker.py": "import numpy as np\noutputs = {'depth': 'm'}\nstates = {'z': 'm'}\n"
    "parameters = [('sink', 'm/s', 0.1, 0.1)]\n"
    "def derivative(x, u, w, theta):\n    return np.array([theta[0]])\n"
    "def measure(x, u, theta):\n    return np.array([x[0]])\n",
    "log.csv": "ms,deg\n" + "".join(f"{100 * i},{i % 7}\n" for i in range(100)),
    "map.toml": 'format = 1\nvehicle = "roughie"\nsite = "pool"\nwater_density_kg_m3 = 998.0\n[time]\ncolumn = "ms"\n'
    'unit = "ms"\n[columns.pitch_rad]\nsource = "deg"\nunit = "deg"\n',
    "capture.tsv": "",
    "dives/case.toml": 'format = 1\nvehicle = "slocum"\nsite = "ocean"\nlog_rate_hz = 0.25\n'
    "water_density_kg_m3 = 1026.0\nmotion_capture = false\nruns = 1\n",
    "dives/run00.csv": "t_s,pitch_rad,depth_m,oil_m3,density_kg_m3\n"
    + "".join(f"{4 * i},-0.4,{10.0 + 0.6 * i},-0.0002,1026.0\n" for i in range(100)),
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


def needed(package: str, found: set[str]) -> set[str]:
    """A package and all that it asks for without extras, by the metadata of what is installed here."""
    if package not in found:
        found.add(package)
        for line in distribution(package).requires or ():
            wanted = Requirement(line)
            if wanted.marker is None or wanted.marker.evaluate({"extra": ""}):
                needed(wanted.name.lower(), found)
    return found


@pytest.fixture(scope="module")
def base_install(tmp_path_factory) -> Path:
    """An environment of just the packages that the base install brings: links to those of this one."""
    folder = tmp_path_factory.mktemp("base")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    for package in needed(DISTRIBUTION, set()):
        one = distribution(package)
        for top in {Path(file).parts[0] for file in one.files} - {".."}:
            if package != DISTRIBUTION or top.endswith(".dist-info"):  # the project itself is this tree
                (site / top).symlink_to(Path(one.locate_file(top)))
    return folder


@pytest.mark.slow
def test_in_a_base_install_every_command_works_or_names_its_extra(base_install):
    python, folder = base_install / "venv" / "bin" / "python", base_install / "calls"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "calls.json").write_text(json.dumps([call.split() for call, _ in CALLS]))
    done = subprocess.run(
        [python, DRIVER, "calls.json"], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    wrong = []
    for (_, extra), one in zip(CALLS, json.loads(done.stdout), strict=True):
        lines = [line for line in one["err"].splitlines() if not line.endswith(" ...")]  # it names what it begins with
        asks = len(lines) == 1 and lines[0].endswith(f"pip install '{DISTRIBUTION}[{extra}]'") and one["out"] == ""
        if "Traceback" in one["err"] or not (one["code"] == 0 if extra is None else one["code"] == 2 and asks):
            wrong.append((extra, one))
    assert wrong == []


def test_the_extras_are_those_of_the_package():
    assert set(BROUGHT) <= set(extras())
    assert {"dask", "distributed", "joblib", "jinja2"} == set(extras()["campaign"])
    assert "'underwater-glider[identify]'" in str(missing_extra(ModuleNotFoundError(name="arviz.stats")))
    assert missing_extra(ModuleNotFoundError(name="glider.tools.nothing")) is None


def test_what_flies_asks_for_few_packages():
    packages = needed(DISTRIBUTION, set())
    assert {"numba", "numpy", "pyserial"} <= packages
    assert not packages & NOT_ON_THE_GLIDER


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """The project's wheel, of a copy of the tree: building leaves its own folders behind."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in (*PACKAGES, "glider"):
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / "tree" / name, symlinks=True, ignore=skipped)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "tree")
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--disable-pip-version-check"]
    done = subprocess.run([*build, "-w", folder, folder / "tree"], capture_output=True, text=True)
    if done.returncode != 0 and "Could not find a version" in done.stderr + done.stdout:
        pytest.skip("no package index to fetch setuptools from")
    assert done.returncode == 0, done.stderr
    (built,) = folder.glob("underwater_glider-*.whl")
    return built


@pytest.mark.slow
def test_a_wheel_holds_every_file_of_the_packages(wheel):
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        (metadata,) = [archive.read(name) for name in archive.namelist() if name.endswith("METADATA")]
    tree = [path for name in PACKAGES for path in (ROOT / name).rglob("*")]
    files = {f"glider/{p.relative_to(ROOT)}" for p in tree if p.is_file() and "__pycache__" not in p.parts}
    assert held == files | {"glider/__init__.py", "glider/py.typed"}
    asked = {line.removeprefix("Requires-Dist: ") for line in metadata.decode().splitlines() if "Requires-Dist" in line}
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert {Requirement(line) for line in asked if "extra ==" not in line} == {Requirement(line) for line in declared}


@pytest.mark.slow
def test_packages_called_hal_and_tools_are_neither_shadowed_nor_in_the_way(wheel, tmp_path):
    """Beside stand-ins of others' packages, as robotpy's `hal`, a mission is flown and both import as before."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    for name in PACKAGES:
        (tmp_path / "site" / name).mkdir()
        (tmp_path / "site" / name / "__init__.py").write_text("OWNER = 'somebody else'\n")
    program = (
        "import firmware, hal, sim_backend, tools\n"
        "assert {one.OWNER for one in (firmware, hal, sim_backend, tools)} == {'somebody else'}\n"
        "import glider.tools.cli.main as command\n"
        "command.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "fly", "--mission", "spiral", "--log", "flight.mcap"], cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "site")}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "flight.mcap").stat().st_size > 100_000
