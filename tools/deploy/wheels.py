"""`python -m tools.deploy.wheels`: does everything that flies install from wheels on a 64-bit ARM computer?

Asks pip, without installing anything, for the base install's packages as that computer would; the result as JSON.
"""

import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from tools.cli.common import DONE, FAILED, print_json

ROOT = Path(__file__).resolve().parents[2]
PLATFORMS = ("manylinux_2_28_aarch64", "manylinux_2_17_aarch64", "manylinux2014_aarch64")
PYTHON = "3.11"  # Raspberry Pi OS 12


def wheels(python: str = PYTHON) -> dict[str, str]:
    """Package -> wheel, for the base install and all it needs; RuntimeError with pip's words where one has none."""
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        command = [
            sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet",
            "--disable-pip-version-check", "--only-binary=:all:", "--python-version", python, "--implementation", "cp",
            "--target", str(Path(folder, "none")), "--constraint", str(ROOT / "constraints.txt"),
            "--report", str(report), *(f"--platform={name}" for name in PLATFORMS), *wanted,
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        items = json.loads(report.read_text())["install"]
    return {item["metadata"]["name"]: item["download_info"]["url"].rsplit("/", 1)[-1] for item in items}


def main() -> int:
    """Exit 0 where every package has a wheel."""
    try:
        found = wheels()
    except RuntimeError as error:
        print_json({"python": PYTHON, "pass": False, "message": str(error)})
        return FAILED
    print_json({"python": PYTHON, "platforms": PLATFORMS, "wheels": found, "pass": True})
    return DONE


if __name__ == "__main__":
    sys.exit(main())
