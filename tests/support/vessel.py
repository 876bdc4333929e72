"""A computer of the vehicle's own: a container with a real systemd, over this machine's files, as they are.

systemd-nspawn boots on an overlay of the root file system: what is written goes into memory and is gone afterwards.
It needs root and mount rights, not a systemd on this machine. A power cut is the container killed as a whole.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from glider.firmware.core import jit
from glider.tools.data.remote import file_digest
from glider.tools.deploy.bundle import copy_files

ROOT = Path(__file__).resolve().parents[2]
RELEASE = "0.0-trial"
BOOT_S = 60.0
SHOWN = sorted({str(ROOT), sys.prefix, sys.base_prefix})
# This tree and its interpreter may lie where the units look away from (/root, /home, /tmp): shown again, read-only.
DROP_IN = """[Service]
ProtectHome=tmpfs
BindReadOnlyPaths={paths}
"""
PROGRAM = """#!/bin/sh
PYTHONPATH={root} exec {python} {words} "$@"
"""


class Vessel:
    """`boot`, `call` a command in it, `cut` its power."""

    def __init__(self, folder: Path):
        self.folder, self.root = folder, folder / "root"
        self._process: subprocess.Popen | None = None
        self.leader = 0

    def boot(self) -> float:
        """From nothing to a system that is up; how long it took, s."""
        begin = time.monotonic()
        command = ["systemd-nspawn", "--quiet", "--boot", f"--directory={self.root}", "--register=no", "--keep-unit",
                   "--machine=vessel", "--private-network", "--capability=CAP_IPC_LOCK",
                   *(f"--bind-ro={path}" for path in SHOWN)]  # fmt: skip
        with (self.folder / "boot.log").open("a") as log:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        while not self._is_up():
            assert self._process.poll() is None, (self.folder / "boot.log").read_text()[-2000:]
            assert time.monotonic() - begin < BOOT_S, "it does not boot"
            time.sleep(0.1)
        return time.monotonic() - begin

    def _is_up(self) -> bool:
        assert self._process is not None
        children = Path(f"/proc/{self._process.pid}/task/{self._process.pid}/children").read_text().split()
        self.leader = int(children[-1]) if children else 0
        if not self.leader:
            return False
        state = self.call("systemctl", "is-system-running", check=False).stdout.strip()
        return state in ("running", "degraded")

    def call(self, *words: str, check: bool = True, **more) -> subprocess.CompletedProcess:
        """A command as root in the container."""
        command = ["nsenter", "--target", str(self.leader), "--all", "--", *map(str, words)]
        settings = {key: text for key, text in os.environ.items() if not key.startswith("GLIDER_")}  # this machine's
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=settings, **more)
        assert not check or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done

    def shown(self, unit: str, name: str) -> str:
        """A property of a unit."""
        return self.call("systemctl", "show", "--value", f"--property={name}", unit).stdout.strip()

    def said(self, unit: str) -> str:
        """What a unit has written into the journal."""
        return self.call("journalctl", "--no-pager", "--output=cat", "--unit", unit).stdout

    def cut(self) -> None:
        """The power goes: every process of it at once."""
        if self._process is not None:
            if self.leader and self._process.poll() is None:
                os.kill(self.leader, signal.SIGKILL)  # init of its own processes: the kernel kills them all
            try:
                self._process.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process, self.leader = None, 0


@contextmanager
def vessel(folder: Path):
    """A vehicle's computer with a release of this tree, not yet installed. Skips where there can be none."""
    for program in ("systemd-nspawn", "nsenter"):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} here (systemd-container)")
    if os.geteuid() != 0:
        pytest.skip("a container wants root")
    upper = folder / "disk"
    for name in ("root", "disk"):
        (folder / name).mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "disk", upper]).returncode:
        pytest.skip("no mounts allowed here")
    try:
        (upper / "upper").mkdir()
        (upper / "work").mkdir()
        options = f"lowerdir=/,upperdir={upper}/upper,workdir={upper}/work"
        if subprocess.run(["mount", "-t", "overlay", "overlay", "-o", options, folder / "root"]).returncode:
            pytest.skip("no overlay file system here")
        try:
            found = Vessel(folder)
            _furnish(found.root)
            try:
                _first_boot(found)
                yield found
            finally:
                found.cut()
        finally:
            subprocess.run(["umount", "--recursive", folder / "root"])
    finally:
        subprocess.run(["umount", upper])


def _first_boot(found: Vessel) -> None:
    try:
        found.boot()
    except (AssertionError, OSError) as error:
        pytest.skip(f"systemd does not boot in a container here: {str(error)[-300:]}")


def _furnish(root: Path) -> None:
    """Nothing of this machine's services; a release whose program is this tree, with its kernels."""
    system = root / "etc" / "systemd" / "system"
    for folder in system.glob("*.wants"):
        shutil.rmtree(folder)
    for name in ("opt/glider", "var/lib/glider", "etc/glider"):
        shutil.rmtree(root / name, ignore_errors=True)
    for folder in ("run", "tmp"):  # of a machine that is off
        (root / folder).mkdir(exist_ok=True)
    for link in (*system.glob("glider-*"), root / "usr/local/bin/glider"):
        link.unlink(missing_ok=True)
    (root / "etc/hostname").write_text("vessel\n")
    here = root / "opt/glider/releases" / RELEASE
    (here / "bin").mkdir(parents=True)
    for name, words in (("python", ""), ("glider", "-m glider.tools.cli.main")):
        (here / "bin" / name).write_text(PROGRAM.format(root=ROOT, python=sys.executable, words=words))
        (here / "bin" / name).chmod(0o755)
    for unit in ("glider-flight@.service", "glider-outofband.service"):
        (system / f"{unit}.d").mkdir(parents=True)
        (system / f"{unit}.d" / "here.conf").write_text(DROP_IN.format(paths=" ".join(SHOWN)))
    (here / "WHOLE").touch()
    bundle = root / "root/bundle"
    bundle.mkdir(parents=True)
    copy_files(ROOT, bundle)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    release = f"release={RELEASE}\nversion=0.0\nmachine={os.uname().machine}\npython={version}\n"
    (bundle / "RELEASE").write_text(release)
    files = [path for path in sorted(bundle.rglob("*")) if path.is_file()]
    sums = "".join(f"{file_digest(path)}  {path.relative_to(bundle)}\n" for path in files)
    (bundle / "SHA256SUMS").write_text(sums)
    shutil.copytree(bundle / "units", here / "units")
    shutil.copy(bundle / "install.sh", here)
    shutil.copy(bundle / "RELEASE", here)
    for unit in (here / "units").glob("*.service"):
        unit.write_text(unit.read_text().replace("@RELEASE@", RELEASE))
    if jit.CACHE_DIR is not None:  # compiled by this tree already: a minute less
        kernels = root / "var/lib/glider/cache" / RELEASE / jit.CACHE_DIR.name
        shutil.copytree(jit.CACHE_DIR, kernels)
        subprocess.run(["chmod", "-R", "a+rwX", kernels], check=True)  # the user that they are for is not there yet
    for path in SHOWN:
        for parent in Path(path).parents:
            inside = root / parent.relative_to("/")
            if inside.is_dir():
                inside.chmod(inside.stat().st_mode | 0o005)
