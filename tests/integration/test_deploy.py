"""`make deploy` over a real sshd: twice, over a cable that breaks, with a release that does not pass, and back again.
By a user of its own, where root runs the tests, into a folder of that user.

What is deployed is a small project of its own, for speed: the script, units and folders are the real ones, its
self-check does as a file beside the vehicle's own says. The real self-check has a test of its own.
"""

import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.sshd import NAME, sshd

pytestmark = pytest.mark.computes(seconds=20)

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = """[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"
[project]
name = "underwater-glider"
version = "{version}"
dependencies = ["pyserial>=3.5"]
[tool.setuptools.packages.find]
include = ["glider*"]
[tool.setuptools.package-data]
"glider.tools" = ["**/ballast"]
"""
# `unfit` beside the vehicle's files: it does not pass; `cut`: the power goes in the middle of it, once.
SELFCHECK = """
import os, pathlib, signal, sys
files = pathlib.Path(sys.argv[sys.argv.index("--files") + 1])
if (files / "cut").exists():
    (files / "cut").unlink()
    os.kill(os.getppid(), signal.SIGKILL)
sys.exit(1 if (files / "unfit").exists() else 0)
"""
BALLAST = 6_000_000  # bytes that no compression makes less; three times what ssh sends ahead


class Dock:
    """A project under git, a computer that ssh reaches, and what came of the last `deploy`."""

    def __init__(self, folder: Path, server):
        self.folder, self.server = folder, server
        self.source, self.vehicle = folder / "source", server.account.home / "vehicle"
        deploy = self.source / "tools" / "deploy"
        shutil.copytree(ROOT / "tools" / "deploy", deploy, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
        package = self.source / "glider"
        package.mkdir()
        (package / "tools").symlink_to("../tools")
        for folder_of_package in (package, deploy.parent, deploy):
            (folder_of_package / "__init__.py").touch()
        (deploy / "selfcheck.py").write_text(SELFCHECK)
        for path in ("hal/boards", "firmware/model/vehicles", "firmware/guidance/missions"):
            shutil.copytree(ROOT / path, self.source / path)
        (self.source / "constraints.txt").touch()
        subprocess.run(["git", "init", "-q", self.source], check=True)

    def commit(self, version: str) -> str:
        """A version of the project; the name of its release."""
        (self.source / "pyproject.toml").write_text(PYPROJECT.format(version=version))
        (self.source / "tools" / "deploy" / "ballast").write_bytes(random.Random(version).randbytes(BALLAST))
        git = ["git", "-C", self.source, "-c", "user.name=t", "-c", "user.email=t@t"]
        subprocess.run([*git, "add", "-A"], check=True)
        subprocess.run([*git, "commit", "-q", "-m", version], check=True)
        commit = subprocess.run([*git, "rev-parse", "--short=12", "HEAD"], check=True, capture_output=True, text=True)
        return f"{version}-{commit.stdout.strip()}"

    def deploy(self, *words: str, cut_after: int = 1 << 60) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "glider.tools.deploy.push", NAME, "--source", self.source]
        command += ["--root", f"{self.server.account.home_there}/vehicle", "--python", self.server.account.python_there]
        command += ["--build", self.folder / "build", *words]
        environment = self.server.reached(there=cut_after) | {"PYTHONPATH": str(ROOT), "PIP_NO_COMPILE": "0"}
        done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=300)
        if "Could not find a version" in done.stderr:
            pytest.skip("no package index to fetch wheels from")
        return done

    @property
    def flies(self) -> str:
        """The release that starts next; its program is whole."""
        link = self.vehicle / "opt" / "glider" / "current"
        found = os.readlink(link).removeprefix("releases/")
        assert (link / "WHOLE").exists()
        assert f"releases/{found}/bin/glider fly" in (link / "units" / "glider-flight@.service").read_text()
        return found

    def everything(self) -> dict[str, tuple[int, int]]:
        """Every file aboard, with size and time of its last change."""
        found = {str(path): path.lstat() for path in self.vehicle.rglob("*")}
        return {path: (stat.st_size, stat.st_mtime_ns) for path, stat in found.items()}


@pytest.fixture(scope="module")
def dock(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dock")
    (folder / "keys").mkdir()
    with sshd(folder / "keys", apart=True) as server:
        yield Dock(folder, server)


def test_a_vehicle_from_its_first_release_to_a_rollback(dock):
    """One story, so that each release is made and installed once."""
    first = dock.commit("1.0")
    done = dock.deploy()
    assert done.returncode == 0, done.stderr
    assert dock.flies == first
    assert {path.lstat().st_uid for path in dock.vehicle.rglob("*")} == {dock.server.account.user}
    assert {path.name for path in (dock.vehicle / "etc" / "glider").iterdir()} == {
        "board.toml", "vehicle.toml", "sawtooth.toml", "flight.env",
    }  # fmt: skip

    # The same again: nothing is sent, nothing is touched. What is not committed is named.
    before = dock.everything()
    (dock.source / "constraints.txt").write_text("# not committed\n")
    done = dock.deploy()
    assert done.returncode == 0
    assert ": constraints.txt\n" in done.stderr
    assert dock.everything() == before

    # The next release, over a cable that is pulled in the middle: the first one still flies.
    second = dock.commit("2.0")
    done = dock.deploy(cut_after=BALLAST * 4 // 6)
    assert done.returncode == 1
    assert dock.flies == first
    assert dock.everything() == before

    # It goes on where it was: less than the whole is enough. Its self-check says that it is not fit.
    (dock.vehicle / "etc" / "glider" / "unfit").touch()
    done = dock.deploy(cut_after=BALLAST * 7 // 6)
    assert done.returncode == 1, done.stderr
    assert re.search(rf"{second} .*{first} ", done.stderr)
    assert dock.flies == first
    (dock.vehicle / "etc" / "glider" / "unfit").unlink()

    # The power goes in the middle of the self-check.
    (dock.vehicle / "etc" / "glider" / "cut").touch()
    done = dock.deploy()
    assert done.returncode != 0
    assert dock.flies == first

    # Now it passes; the vehicle's own files stay as they are.
    (dock.vehicle / "etc" / "glider" / "board.toml").write_text("# mine\n")
    done = dock.deploy()
    assert done.returncode == 0, done.stderr
    assert dock.flies == second
    assert (dock.vehicle / "etc" / "glider" / "board.toml").read_text() == "# mine\n"

    # Back, and forth again.
    assert dock.deploy("--rollback").returncode == 0
    assert dock.flies == first
    assert dock.deploy("--list").stdout.split() == ["*", first, second]
    assert dock.deploy("--rollback").returncode == 0
    assert dock.flies == second


def test_a_damaged_release_is_refused(dock, tmp_path):
    """A file that is not as it was made: nothing is installed."""
    release = next(path for path in (dock.folder / "build").glob("glider-2.0-*") if path.suffix != ".new")
    shutil.copytree(release, tmp_path / "release")
    with (tmp_path / "release" / "units" / "flight.env").open("a") as file:
        file.write("#\n")
    before = dock.flies
    done = subprocess.run(
        ["sh", tmp_path / "release" / "install.sh"], capture_output=True, text=True,
        env={**os.environ, "ROOT": str(dock.vehicle), "PYTHON": sys.executable},
    )  # fmt: skip
    assert done.returncode == 2
    assert "units/flight.env: FAILED" in done.stderr
    assert dock.flies == before


@pytest.mark.parametrize("name", ["-oProxyCommand=touch /tmp/x", "", "two words"])
def test_a_name_that_is_no_host_is_refused(name):
    done = subprocess.run(
        [sys.executable, "-m", "glider.tools.deploy.push", "--root", "/nowhere", "--", name],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.startswith(f"deploy: {name!r}: ")
