"""Wheels of everything that flies, for another computer: nothing is compiled there, and it needs no network.

`python -m glider.tools.deploy.wheels` asks pip, without fetching anything, whether all of it has wheels for a 64-bit
ARM computer; the result as JSON.
"""

import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

from glider.tools.cli.common import DONE, FAILED, print_json

ROOT = Path(__file__).resolve().parents[2]
OLDEST_GLIBC = 17  # of 2.17: manylinux2014, the oldest that wheels are made for today


@dataclass(frozen=True)
class Target:
    """The computer that wheels are for: machine as `uname -m` says it, Python (3, 11), the C library's (2, 36)."""

    machine: str = "aarch64"
    python: str = "3.11"
    glibc: int = 36  # of 2.36: 64-bit Raspberry Pi OS 12, Debian 12

    def __str__(self) -> str:
        return f"{self.machine}-py{self.python}"

    def options(self) -> list[str]:
        """What pip wants to know of it."""
        names = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc, OLDEST_GLIBC - 1, -1)]
        platforms = [f"--platform={name}" for name in (*names, f"manylinux2014_{self.machine}")]
        return ["--only-binary=:all:", "--python-version", self.python, "--implementation", "cp", *platforms]


def wanted(root: Path = ROOT) -> list[str]:
    """The base install's requirements."""
    return tomllib.loads((root / "pyproject.toml").read_text())["project"]["dependencies"]


def wheels(target: Target) -> dict[str, str]:
    """Package -> wheel, for the base install and all it needs; RuntimeError with pip's words where one has none."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        _pip(
            "install", "--dry-run", "--ignore-installed", *target.options(), "--target", str(Path(folder, "none")),
            "--constraint", str(ROOT / "constraints.txt"), "--report", str(report), *wanted(),
        )  # fmt: skip
        items = json.loads(report.read_text())["install"]
    return {item["metadata"]["name"]: item["download_info"]["url"].rsplit("/", 1)[-1] for item in items}


def wheelhouse(root: Path, target: Target, folder: Path) -> Path:
    """The wheels of what a tree's base install needs, and of pip, which installs them, in a folder of `folder` that is
    named by just that."""
    constraints = (root / "constraints.txt").read_text()
    name = hashlib.sha256("\n".join([*wanted(root), constraints, *target.options()]).encode()).hexdigest()[:12]
    wheelhouse_folder = folder / f"{target}-{name}"
    if not wheelhouse_folder.is_dir():
        fresh = wheelhouse_folder.with_name(wheelhouse_folder.name + ".new")
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.mkdir(parents=True)
        _pip(
            "download", *target.options(), "--constraint", str(root / "constraints.txt"), "--dest", str(fresh),
            "pip", *wanted(root),
        )  # fmt: skip
        fresh.rename(wheelhouse_folder)
    return wheelhouse_folder


def own_wheel(root: Path, folder: Path) -> Path:
    """The project's own wheel, of a tree that may be written into, in `folder`."""
    _pip("wheel", "--no-deps", "--wheel-dir", str(folder), str(root))
    (wheel,) = folder.glob("underwater_glider-*.whl")
    return wheel


def version(root: Path) -> str:
    """The project's version as pyproject.toml says it."""
    found = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    if not re.fullmatch(r"[0-9A-Za-z.]+", found):
        raise RuntimeError(f"pyproject.toml: version {found!r}")
    return found


def _pip(*words: str) -> None:
    command = [sys.executable, "-m", "pip", words[0], "--quiet", "--disable-pip-version-check", *words[1:]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or f"pip {words[0]}: exit code {done.returncode}")


def main() -> int:
    """Exit 0 where every package has a wheel."""
    target = Target()
    try:
        found = wheels(target)
    except RuntimeError as error:
        print_json({"target": str(target), "pass": False, "message": str(error)})
        return FAILED
    print_json({"target": str(target), "wheels": found, "pass": True})
    return DONE


if __name__ == "__main__":
    sys.exit(main())
