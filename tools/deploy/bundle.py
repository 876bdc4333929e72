"""A release: all that is brought to the glider's computer, in one folder under check sums.

RELEASE       what it is and for which computer, KEY=VALUE
install.sh    what installs it there
units/        services, rules, settings
wheels/       the project and all it needs
SHA256SUMS    of everything above
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from glider.tools.data.remote import file_digest
from glider.tools.data.version import COMMIT_FILE
from glider.tools.deploy.wheels import ROOT, Target, own_wheel, version, wheelhouse

SUMS = "SHA256SUMS"
# Left out of the wheel that goes onboard: verification, and what a laptop computes after a flight.
NOT_ONBOARD = (
    "sim_backend/foreign", "tools/diagnose", "tools/gap", "tools/identify", "tools/inference", "tools/readings",
    "tools/report", "tools/study", "tools/verify", "tools/watch",
)  # fmt: skip
UNITS = ("glider-outofband.service", "glider-flight@.service", "60-glider.rules", "flight.env")


def release_name(root: Path = ROOT) -> str:
    """What is committed, by version and commit: the same name is the same release."""
    return f"{version(root)}-{_git(root, 'rev-parse', '--short=12', 'HEAD')}"


def make_release(target: Target, folder: Path, root: Path = ROOT) -> Path:
    """The release of what is committed in `root`, for one computer, in a folder of `folder`; made once."""
    name = release_name(root)
    release = folder / f"glider-{name}-{target}"
    if (release / SUMS).exists():
        return release
    wheels = wheelhouse(root, target, folder / "wheels")
    fresh = release.with_name(release.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    shutil.copytree(wheels, fresh / "wheels")
    with tempfile.TemporaryDirectory() as place:
        tree = Path(place, "tree")
        tree.mkdir()
        archived(root, name.rpartition("-")[2], tree)
        (tree / "glider" / COMMIT_FILE).write_text(name.rpartition("-")[2][:7] + "\n")
        copy_files(tree, fresh)
        take_out(tree)
        own_wheel(tree, fresh / "wheels")
    lines = {"release": name, "version": version(root), "machine": target.machine, "python": target.python}
    (fresh / "RELEASE").write_text("".join(f"{key}={text}\n" for key, text in lines.items()))
    files = sorted(path for path in fresh.rglob("*") if path.is_file())
    sums = [f"{file_digest(path)}  {path.relative_to(fresh)}\n" for path in files]
    (fresh / SUMS).write_text("".join(sums))
    shutil.rmtree(release, ignore_errors=True)
    fresh.rename(release)
    return release


def take_out(tree: Path) -> None:
    """Remove from a tree what does not go onboard (NOT_ONBOARD)."""
    for name in NOT_ONBOARD:
        path = tree / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def copy_files(tree: Path, release: Path) -> None:
    """Script, units, and the files that a first vehicle begins with."""
    (release / "units").mkdir()
    (release / "first").mkdir()
    deploy = tree / "tools" / "deploy"
    shutil.copy(deploy / "install.sh", release)
    for name in UNITS:
        shutil.copy(deploy / name, release / "units")
    for name, path in (
        ("board.toml", "hal/boards/roughie.toml"),
        ("vehicle.toml", "firmware/model/vehicles/roughie.toml"),
        ("sawtooth.toml", "firmware/guidance/missions/sawtooth.toml"),
    ):
        shutil.copy(tree / path, release / "first" / name)


def archived(root: Path, commit: str, folder: Path, *paths: str) -> None:
    """What a commit holds, all of it or some paths, into a folder."""
    command = ["git", "-C", str(root), "archive", commit, *paths]
    archive = subprocess.run(command, capture_output=True, check=True).stdout
    subprocess.run(["tar", "x", "-C", str(folder)], input=archive, check=True)


def written(release: Path) -> dict[str, str]:
    """What a release says of itself: release, version, machine, python."""
    lines = (release / "RELEASE").read_text().splitlines()
    return {key: text for key, _, text in (line.partition("=") for line in lines)}


def uncommitted(root: Path = ROOT) -> list[str]:
    """Files that are not as committed, and so do not go with a release."""
    return _git(root, "status", "--porcelain", "--untracked-files=no").splitlines()


def _git(root: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", os.fspath(root), *words], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{root}: {done.stderr.strip()}: a release is made of what git has")
    return done.stdout.strip()
