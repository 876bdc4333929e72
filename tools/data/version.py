"""This program's version and commit, as logs, vehicle files and reports record them."""

import functools
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

DISTRIBUTION = "underwater-glider"  # `glider` on the package index is somebody else's program
COMMIT_FILE = "commit.txt"  # in the package of a release, written when its wheel is built


def installed_version() -> str:
    """Return the version of the installed package, or "not installed" for a bare tree."""
    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"


@functools.cache
def commit() -> str:
    """Return the abbreviated commit of a release or a checkout, "" where neither is known."""
    recorded = files("glider").joinpath(COMMIT_FILE)
    if recorded.is_file():
        return recorded.read_text(encoding="ascii").strip()
    tree = Path(str(sys.modules["glider"].__file__)).resolve().parents[1]
    if not (tree / ".git").exists():
        return ""
    command = ["git", "-C", str(tree), "rev-parse", "--short=7", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def release() -> str:
    """Return name and version: "glider 0.1.0"."""
    return f"glider {installed_version()}"


def software() -> str:
    """Return name, version and commit: "glider 0.1.0 (4ea54ce)"."""
    return release() + (f" ({commit()})" if commit() else "")
