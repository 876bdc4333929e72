"""`python -m tools.deploy.emulated FOLDER`: does a release install and fly on a 64-bit ARM computer?

From nothing: Debian for arm64 (mmdebstrap), run by an emulator of the processor (qemu-user), a release of what is
committed installed in it by its own script, from its wheels alone; its self-check; and flights compared with the same
here. As root, with mmdebstrap, qemu-user-static and arch-test; elsewhere it says what is missing. The result as JSON.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tools.cli.common import DONE, FAILED, print_json, say
from tools.data.log.reader import read_log
from tools.deploy.bundle import make_release, release_name
from tools.deploy.selfcheck import PLUNGE
from tools.deploy.wheels import ROOT, Target

SUITE = "bookworm"  # as 64-bit Raspberry Pi OS 12
PACKAGES = ("python3", "coreutils", "dash", "sed", "grep", "findutils", "libc-bin", "libstdc++6", "util-linux")
BINFMT = Path("/proc/sys/fs/binfmt_misc")
EMULATOR = "/usr/bin/qemu-aarch64-static"
# The kernel's way to know such a program (ELF, 64 bits, little-endian, machine 183); F: the emulator is opened now.
MAGIC = (
    ":qemu-aarch64:M::" + r"\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00" + ":"
    + r"\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff" + f":{EMULATOR}:F"
)  # fmt: skip
VEHICLE = "/vehicle"  # what is installed into, in there
# Largest difference of a state over a reference flight: position (m), angles (rad), speeds, actuators
# (tests/integration/test_reference_flights.py flies them here).
BOUNDS = (
    (("X", "Y", "Z"), 2e-5),
    (("phi", "theta", "psi"), 5e-5),
    (("u", "v", "w", "p", "q", "r"), 1e-4),
    (("servo_rad", "slider_m", "ballast_kg"), 5e-5),
)
CURRENT = {"uneven_in_current": "-0.08,0.15"}  # m/s, north and east, of the flights that have one
KILLED_S = 20.0  # of a flight in there, before it is killed
# Times and what the host says of itself: different in any two flights.
OF_THE_CLOCK = ("lateness_s", "duration_s")


def missing() -> str:
    """What this computer lacks for it; empty where it lacks nothing."""
    if os.geteuid() != 0:
        return "root"
    for program in ("mmdebstrap", EMULATOR, "arch-test", "chroot"):
        if shutil.which(program) is None:
            return program
    return ""


@contextmanager
def arm_programs() -> Iterator[None]:
    """The kernel runs programs of arm64, by the emulator; as it was before afterwards."""
    mounted = (BINFMT / "register").exists()
    if not mounted:
        subprocess.run(["mount", "-t", "binfmt_misc", "binfmt_misc", str(BINFMT)], check=True)
    known = (BINFMT / "qemu-aarch64").exists()
    if not known:
        (BINFMT / "register").write_text(MAGIC)
    try:
        yield
    finally:
        if not known:
            (BINFMT / "qemu-aarch64").write_text("-1")
        if not mounted:
            subprocess.run(["umount", str(BINFMT)])


class Arm:
    """A root file system of the other processor."""

    def __init__(self, root: Path, release: str):
        self.root, self.release = root, release

    def make(self) -> None:
        """Debian's packages of Python and a shell, unpacked: none of their scripts has to run in the emulator."""
        command = ["mmdebstrap", "--quiet", "--arch=arm64", "--variant=extract", f"--include={','.join(PACKAGES)}"]
        command += ["--hook-dir=/usr/share/mmdebstrap/hooks/merged-usr", SUITE, str(self.root)]
        subprocess.run(command, check=True, stdout=sys.stderr)
        for name in ("proc", "sys", "dev", "root", "tmp"):
            (self.root / name).mkdir(exist_ok=True)
        (self.root / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")

    def call(self, *words: str, **more: Any) -> subprocess.CompletedProcess:
        """A program in there."""
        return subprocess.run(self.command(*words), text=True, **more)

    def command(self, *words: str) -> list[str]:
        cache = f"{VEHICLE}/var/lib/glider/cache/{self.release}"  # where the self-check's kernels are
        settings = ["PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root", f"GLIDER_CACHE_DIR={cache}",
                    "GLIDER_STATE_DIR=/root/state", "GLIDER_RUN_DIR=/root/run"]  # fmt: skip
        return ["chroot", str(self.root), "/usr/bin/env", "-i", *settings, *words]

    def glider(self, *words: str, **more: Any) -> subprocess.CompletedProcess:
        return self.call(f"{VEHICLE}/opt/glider/current/bin/glider", *words, **more)

    @contextmanager
    def mounted(self) -> Iterator[None]:
        """With what the kernel shows programs."""
        for name in ("proc", "dev", "sys"):
            subprocess.run(["mount", "--rbind", f"/{name}", str(self.root / name)], check=True)
            subprocess.run(["mount", "--make-rslave", str(self.root / name)], check=True)
        try:
            yield
        finally:
            for name in ("proc", "dev", "sys"):
                subprocess.run(["umount", "--recursive", "--lazy", str(self.root / name)])


def install(arm: Arm, release: Path) -> dict[str, Any]:
    """By the release's own script, from its wheels; its self-check compiles the kernels and flies."""
    inside = arm.root / "root" / release.name
    shutil.rmtree(inside, ignore_errors=True)
    shutil.copytree(release, inside)
    begin = time.monotonic()
    done = arm.call("env", f"ROOT={VEHICLE}", "sh", f"/root/{release.name}/install.sh", stdout=sys.stderr)
    return {"pass": done.returncode == 0, "seconds": round(time.monotonic() - begin)}


def same_flight(arm: Arm, folder: Path, mission: str, seed: int, *, compiled: bool) -> dict[str, Any]:
    """A mission on the simulated board, there and here: which numbers of the logs differ, and by how much at most.

    As plain Python (GLIDER_JIT=0) none has to: a compiler may contract a product and a sum into one rounding, and each
    processor's does so in places of its own.
    """
    words = ["fly", "--seed", str(seed), "--json"]
    logs_of = (arm.root / "root/flight.mcap", folder / "here.mcap")
    for log in logs_of:
        log.unlink(missing_ok=True)
    for place in (arm.root / "root", folder):
        (place / "selfcheck.toml").write_text(PLUNGE)
    jit = f"GLIDER_JIT={int(compiled)}"
    names = [(f"{place}/selfcheck.toml" if mission == "selfcheck" else mission) for place in ("/root", folder)]
    there = arm.call(
        "env", jit, f"{VEHICLE}/opt/glider/current/bin/glider", *words, "--mission", names[0], "--log",
        "/root/flight.mcap", stdout=subprocess.PIPE,
    )  # fmt: skip
    command = [sys.executable, "-m", "tools.cli.main", *words, "--mission", names[1], "--log", str(logs_of[1])]
    environment = {**os.environ, "GLIDER_JIT": str(int(compiled)), "PYTHONPATH": str(ROOT)}
    here = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True)
    if there.returncode or here.returncode:
        return {"mission": mission, "pass": False, "codes": [there.returncode, here.returncode]}
    logs = [read_log(path).topics["/tick"] for path in logs_of]
    worst = {}
    for field in logs[0].fields:
        columns = [np.asarray(log.column(field.name)) for log in logs]
        if field.name in OF_THE_CLOCK or columns[0].shape != columns[1].shape:
            continue
        if columns[0].tobytes() != columns[1].tobytes():
            worst[field.name] = float(np.nanmax(np.abs(columns[0] - columns[1])))
    ticks = [log.count for log in logs]
    return {
        "mission": mission, "compiled": compiled, "pass": ticks[0] == ticks[1] and (compiled or not worst),
        "ticks": ticks, "fields": len(logs[0].fields),
        "bit_for_bit": not worst, "largest_differences": dict(sorted(worst.items(), key=lambda item: -item[1])[:8]),
    }  # fmt: skip


def reference(arm: Arm, path: Path) -> dict[str, Any]:
    """A reference flight of the independent model, flown there: within the bounds of the tests?"""
    shutil.copy(path, arm.root / "root/commands.csv")
    (arm.root / "root/flown.csv").unlink(missing_ok=True)
    water = CURRENT.get(path.stem, "0,0")
    done = arm.glider("simulate", "/root/commands.csv", "--out", "/root/flown.csv", f"--water={water}")
    if done.returncode:
        return {"flight": path.stem, "pass": False}
    want, got = (np.genfromtxt(file, delimiter=",", names=True) for file in (path, arm.root / "root/flown.csv"))
    worst = {names[0]: float(max(np.abs(want[n] - got[n]).max() for n in names)) for names, _ in BOUNDS}
    return {"flight": path.stem, "pass": all(worst[names[0]] < bound for names, bound in BOUNDS), "largest": worst}


def killed(arm: Arm) -> dict[str, Any]:
    """A flight in there is killed: what its recorder leaves is read here, whole up to the end or nearly."""
    log = arm.root / "root/killed.mcap"
    log.unlink(missing_ok=True)
    program = f"{VEHICLE}/opt/glider/current/bin/glider"
    words = ["fly", "--mission", "sawtooth", "--realtime", "--log", "/root/killed.mcap"]
    with subprocess.Popen(arm.command(program, *words), stderr=subprocess.DEVNULL) as flight:
        end = time.monotonic() + 10 * KILLED_S
        while not log.exists() and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(KILLED_S)
        flight.kill()
    end = time.monotonic() + KILLED_S
    found = read_log(log)
    while not found.complete and time.monotonic() < end:  # the recording process closes it
        time.sleep(0.5)
        found = read_log(log)
    return {"pass": found.complete and not found.damages, "ticks": found.topics["/tick"].count,
            "ended": found.ending.get("ended", "")}  # fmt: skip


def out_of_band(arm: Arm) -> dict[str, Any]:
    """Row 25 of the fault table in there: a process that flies is killed, or hangs, and the watch notices."""
    done = arm.glider("faults", "--only", "25", "--json", stdout=subprocess.PIPE)
    (row,) = json.loads(done.stdout)["faults"]
    return {"pass": row["pass"], "noticed_s": row["noticed_s"], "allowed_s": row["allowed_s"]}


def main() -> int:
    """Exit 0: all passed, or what it needs is not here (`skipped`); 1: something did not pass."""
    parser = argparse.ArgumentParser(prog="python -m tools.deploy.emulated", description=__doc__)
    parser.add_argument("folder", type=Path, help="for the system and what comes of it; a system that is there is used")
    options = parser.parse_args()
    lacking = missing()
    if lacking:
        print_json({"skipped": f"{lacking} is missing"})
        return DONE
    options.folder.mkdir(parents=True, exist_ok=True)
    arm = Arm(options.folder.resolve() / "root", release_name())
    result: dict[str, Any] = {}
    with arm_programs():
        if not (arm.root / "usr/bin/python3").exists():
            say("Debian for arm64")
            arm.make()
        release = make_release(Target(), options.folder / "build")
        with arm.mounted():
            result["install"] = install(arm, release)
            if result["install"]["pass"]:
                flights = sorted((ROOT / "tests/data/reference").glob("*.csv"))
                result["reference"] = [reference(arm, path) for path in flights]
                result["flights"] = [
                    same_flight(arm, options.folder.resolve(), name, 2, compiled=compiled)
                    for name, compiled in (("selfcheck", False), ("sawtooth", True), ("spiral", True))
                ]
                result["killed"] = killed(arm)
                result["out_of_band"] = out_of_band(arm)
    checks = [item for value in result.values() for item in (value if isinstance(value, list) else [value])]
    result["pass"] = all(item["pass"] for item in checks)
    print_json(result)
    return DONE if result["pass"] else FAILED


if __name__ == "__main__":
    sys.exit(main())
