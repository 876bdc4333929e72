"""An emulated 64-bit ARM computer: Debian for arm64 in a folder, its programs run by qemu-user.

What it needs of the kernel (the emulator registered, /proc and /dev shown in there) is done in namespaces of its own,
and is gone with the last of its processes, however they end: /proc/sys/fs/binfmt_misc stays as it was.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

SUITE = "bookworm"  # as 64-bit Raspberry Pi OS 12
PACKAGES = ("python3", "coreutils", "dash", "sed", "grep", "findutils", "libc-bin", "libstdc++6", "util-linux")
BINFMT = Path("/proc/sys/fs/binfmt_misc")
EMULATOR = "/usr/bin/qemu-aarch64-static"
# The kernel's way to know such a program (ELF, 64 bits, little-endian, machine 183); F: the emulator is opened now.
MAGIC = (
    ":qemu-aarch64:M::" + r"\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00" + ":"
    + r"\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff" + f":{EMULATOR}:F"
)  # fmt: skip
PROGRAMS = ("mmdebstrap", EMULATOR, "arch-test", "chroot", "unshare", "setpriv")
FREE_DISK, FREE_MEMORY = 2e9, 2e9  # bytes; Debian, wheels and a release take 0.7e9, a process in there 0.4e9
# Users, mounts and processes of its own; when the first of these ends, by whatever, all of them do. `sh` stays the
# first process, and collects those whose parents were killed.
ALONE = (
    "setpriv", "--pdeathsig", "KILL", "unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork",
    "--kill-child", "sh", "-c", 'mount -t proc proc /proc && "$@"; exit $?', "sh",
)  # fmt: skip


class EmulationUnavailable(RuntimeError):
    """This computer cannot do it; str() says in a line why."""


def look() -> None:
    """A program, a right, or room is missing."""
    if os.geteuid() != 0:
        raise EmulationUnavailable("root is missing")
    for program in PROGRAMS:
        if shutil.which(program) is None:
            raise EmulationUnavailable(f"{program} is missing")
    (available,) = re.findall(r"^MemAvailable: *(\d+) kB", Path("/proc/meminfo").read_text(), re.MULTILINE)
    memory = 1024.0 * float(available)
    if memory < FREE_MEMORY:
        raise EmulationUnavailable(f"{memory / 1e9:.1f} GB of memory free, {FREE_MEMORY / 1e9:.0f} wanted")
    mount = ("mount", "-t", "binfmt_misc", "binfmt_misc", str(BINFMT))
    done = subprocess.run([*ALONE, *mount], capture_output=True, text=True)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise EmulationUnavailable(f"no emulator can be registered (a namespace's own wants Linux 6.7): {said}")


class Arm:
    """A root file system of the other processor, and the release in it. `plain`: no kernel is compiled in there."""

    def __init__(self, root: Path, release: str, *, plain: bool):
        self.root, self.release, self.plain = root, release, plain
        self.vehicle = "/plain" if plain else "/vehicle"  # what is installed into, in there
        self.cache = f"{self.vehicle}/var/lib/glider/cache/{release}"  # where the self-check's kernels are
        self.plunge = f"{self.cache}/selfcheck.mcap"  # the self-check's flight as plain Python

    def make(self) -> None:
        """Debian's packages of Python and a shell, unpacked: none of their scripts has to run in the emulator."""
        if (self.root / "usr/bin/python3").exists():
            return
        if shutil.disk_usage(self.root.parent).free < FREE_DISK:
            raise EmulationUnavailable(f"{self.root.parent}: less than {FREE_DISK / 1e9:.0f} GB free")
        fresh = self.root.with_name(self.root.name + ".new")
        shutil.rmtree(fresh, ignore_errors=True)
        command = ["mmdebstrap", "--quiet", "--arch=arm64", "--variant=extract", f"--include={','.join(PACKAGES)}"]
        command += ["--hook-dir=/usr/share/mmdebstrap/hooks/merged-usr", SUITE, str(fresh)]
        if subprocess.run(command, stdout=sys.stderr).returncode:
            raise EmulationUnavailable(f"Debian {SUITE} for arm64 cannot be had")
        for name in ("proc", "sys", "dev", "root", "tmp"):
            (fresh / name).mkdir(exist_ok=True)
        (fresh / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
        fresh.rename(self.root)

    def start(self) -> None:
        """In namespaces of its own (`ALONE`): programs of arm64 run, and see the kernel."""
        try:
            _mount("-t", "binfmt_misc", "binfmt_misc", str(BINFMT))
            (BINFMT / "register").write_text(MAGIC)
            for name in ("proc", "dev", "sys"):
                _mount("--rbind", f"/{name}", str(self.root / name))
        except OSError as error:
            raise EmulationUnavailable(f"no emulator can be registered: {error}") from None
        done = self.call("python3", "-c", "import platform; print(platform.machine())", capture_output=True)
        if done.stdout != "aarch64\n":
            raise EmulationUnavailable(f"no program of arm64 runs here: {done.stdout}{done.stderr}".strip())

    def call(self, *words: str, **more: Any) -> subprocess.CompletedProcess:
        """A program in there."""
        return subprocess.run(self.command(*words), text=True, **more)

    def command(self, *words: str) -> list[str]:
        settings = ["PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root", f"GLIDER_CACHE_DIR={self.cache}",
                    "GLIDER_STATE_DIR=/root/state", "GLIDER_RUN_DIR=/root/run"]  # fmt: skip
        if self.plain:
            settings += ["GLIDER_JIT=0", "PYTHONWARNINGS=ignore"]  # NumPy's, of numbers of 64 bits that run over
        return ["chroot", str(self.root), "/usr/bin/env", "-i", *settings, *words]

    def glider(self, *words: str) -> list[str]:
        """The words of a `glider` command in there, for `call` and `command`."""
        return [f"{self.vehicle}/opt/glider/current/bin/glider", *words]


def _mount(*words: str) -> None:
    done = subprocess.run(["mount", *words], capture_output=True, text=True)
    if done.returncode:
        raise EmulationUnavailable(done.stderr.strip())
