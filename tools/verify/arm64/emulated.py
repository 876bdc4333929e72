"""`python -m glider.tools.verify.arm64.emulated FOLDER`: does a release install and fly on a 64-bit ARM computer?

From nothing: Debian for arm64 (mmdebstrap), run by an emulator of the processor (qemu-user), a release of what is
committed installed in it by its own script, from its wheels alone; its self-check; and flights compared with the same
here, flown from the release's own sources. As root, with mmdebstrap, qemu-user-static and arch-test; elsewhere it says
what is missing. The result as JSON.

With --quick all of it flies as plain Python: nothing is compiled, which is what takes an emulator long.
"""

import argparse
import contextlib
import functools
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.cli.common import DONE, FAILED, print_json, say
from glider.tools.data.log.reader import read_log
from glider.tools.data.plain import as_plain
from glider.tools.deploy.bundle import archived, make_release, written
from glider.tools.deploy.selfcheck import PLUNGE, flight_command
from glider.tools.deploy.wheels import ROOT, Target
from glider.tools.verify.arm64.arm import ALONE, Arm, EmulationUnavailable, look
from glider.tools.verify.arm64.compared import Here, compared, same_maths

RESULT = "result.json"
# Largest difference of a state over a reference flight: position (m), angles (rad), speeds, actuators
# (tests/integration/test_reference_flights.py flies them here).
BOUNDS = (
    (("X", "Y", "Z"), 2e-5),
    (("phi", "theta", "psi"), 5e-5),
    (("u", "v", "w", "p", "q", "r"), 1e-4),
    (("servo_rad", "slider_m", "ballast_kg"), 5e-5),
)
CURRENT = {"uneven_in_current": "-0.08,0.15"}  # m/s, north and east, of the flights that have one
QUICK_FLIGHT = "steep"  # the one that --quick flies
KILLED_S, KILLED_QUICK_S = 20.0, 5.0  # of a flight in there, before it is killed
LAST_BITS = 1e-9  # SI: a plunge whose sines differ in the last bit came to 1e-12 at most


def install(arm: Arm, release: Path) -> dict[str, Any]:
    """By the release's own script, from its wheels; its self-check compiles the kernels and flies."""
    inside = arm.root / "root" / release.name
    shutil.rmtree(inside, ignore_errors=True)
    shutil.copytree(release, inside)
    begin = time.monotonic()
    # pip's name for it: 0 is no bytecode made ahead, half of what installing takes an emulator
    settings = [f"ROOT={arm.vehicle}", *(["PIP_NO_COMPILE=0"] if arm.plain else [])]
    done = arm.call("env", *settings, "sh", f"/root/{release.name}/install.sh", stdout=sys.stderr)
    return {"pass": done.returncode == 0, "seconds": round(time.monotonic() - begin)}


def same_plunge(arm: Arm, here: Here) -> dict[str, Any]:
    """The flight of the self-check as plain Python, there and here: bit for bit.

    No number has to differ, compiled (`firmware/core/jit.py`) or not. Where the C libraries differ, `LAST_BITS`.
    """
    mission, there, log = arm.root / "root/selfcheck.toml", arm.root / arm.plunge[1:], here.folder / "selfcheck.mcap"
    mission.write_text(PLUNGE)
    log.unlink(missing_ok=True)
    if not there.exists():  # its self-check flew it, where that flew as plain Python
        words = flight_command("/root/selfcheck.toml", arm.plunge)
        arm.call("env", "GLIDER_JIT=0", *arm.glider(*words), stdout=subprocess.DEVNULL)
    here.call("-m", "glider.tools.cli.main", *flight_command(str(mission), str(log)), compiled=False)
    found = compared("selfcheck", [there, log])
    found["same_maths"] = same_maths(arm, here)
    if not found["bit_for_bit"]:
        found["pass"] &= not found["same_maths"] and found["largest"] < LAST_BITS
    return found


def same_flight(arm: Arm, here: Here, mission: str, seed: int) -> dict[str, Any]:
    """A mission on the simulated board, compiled there and here: as many ticks in both."""
    logs = [arm.root / "root/flight.mcap", here.folder / "flight.mcap"]
    for log in logs:
        log.unlink(missing_ok=True)
    words = ["fly", "--seed", str(seed), "--json", "--mission", mission, "--log"]
    arm.call(*arm.glider(*words, "/root/flight.mcap"), stdout=subprocess.DEVNULL)
    here.call("-m", "glider.tools.cli.main", *words, str(logs[1]), compiled=True)
    return compared(mission, logs)


def reference(arm: Arm, path: Path) -> dict[str, Any]:
    """A reference flight of the independent model, flown there: within the bounds of the tests?"""
    shutil.copy(path, arm.root / "root/commands.csv")
    (arm.root / "root/flown.csv").unlink(missing_ok=True)
    water = CURRENT.get(path.stem, "0,0")
    done = arm.call(*arm.glider("simulate", "/root/commands.csv", "--out", "/root/flown.csv", f"--water={water}"))
    if done.returncode:
        return {"flight": path.stem, "pass": False}
    want, got = (np.genfromtxt(file, delimiter=",", names=True) for file in (path, arm.root / "root/flown.csv"))
    worst = {names[0]: float(max(np.abs(want[n] - got[n]).max() for n in names)) for names, _ in BOUNDS}
    return {"flight": path.stem, "pass": all(worst[names[0]] < bound for names, bound in BOUNDS), "largest": worst}


def killed(arm: Arm, seconds: float) -> dict[str, Any]:
    """A flight in there is killed: what its recorder leaves is read here, whole up to the end or nearly."""
    log = arm.root / "root/killed.mcap"
    log.unlink(missing_ok=True)
    words = ["fly", "--mission", "sawtooth", "--realtime", "--log", "/root/killed.mcap"]
    with subprocess.Popen(arm.command(*arm.glider(*words)), stderr=subprocess.DEVNULL) as flight:
        end = time.monotonic() + 10 * KILLED_S
        while not log.exists() and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(seconds)
        flight.kill()
    if not log.exists():
        return {"pass": False, "ended": "no log"}
    end = time.monotonic() + KILLED_S
    found = read_log(log)
    while not found.complete and time.monotonic() < end:  # the recording process closes it
        time.sleep(0.5)
        found = read_log(log)
    ticks = found.topics["/tick"].count if "/tick" in found.topics else 0
    return {"pass": found.complete and not found.damages and ticks > 0, "ticks": ticks,
            "ended": found.ending.get("ended", "")}  # fmt: skip


def out_of_band(arm: Arm) -> dict[str, Any]:
    """Row 25 of the fault table in there: a process that flies is killed, or hangs, and the watch notices.

    The fault table is no part of a release: it is run from the sources of the release's commit, by its Python.
    """
    sources = arm.root / "root/sources"
    if not sources.exists():
        sources.mkdir()
        archived(ROOT, arm.release.rpartition("-")[2], sources)
    python = ["env", "PYTHONPATH=/root/sources", f"{arm.vehicle}/opt/glider/current/bin/python", "-m"]
    done = arm.call(*python, "glider.tools.cli.main", "faults", "--only", "25", "--json", stdout=subprocess.PIPE)
    (row,) = json.loads(done.stdout)["faults"]
    cases = {case["case"]: case["noticed_s"] for case in row["cases"]}
    return {"pass": row["pass"], "noticed_s": cases, "allowed_s": row["cases"][0]["allowed_s"]}


def parts(arm: Arm, here: Here) -> list[tuple[str, Callable[[], dict[str, Any]]]]:
    """What is shown of an installed release, by name, in order."""
    both = [("flights", lambda: same_plunge(arm, here))]
    wanted = [path for path in here.references() if not arm.plain or path.stem == QUICK_FLIGHT]
    both += [("reference", functools.partial(reference, arm, path)) for path in wanted]
    if not arm.plain:
        both += [("flights", functools.partial(same_flight, arm, here, name, 2)) for name in ("sawtooth", "spiral")]
    seconds = KILLED_QUICK_S if arm.plain else KILLED_S
    return [*both, ("killed", lambda: killed(arm, seconds)), ("out_of_band", lambda: out_of_band(arm))]


def shown(part: Callable[[], dict[str, Any]], beside: Path | None) -> dict[str, Any]:
    """One part; what did not pass beside others, which leave it no time, is tried again when `beside` is gone."""
    busy = beside is not None and beside.exists()
    result = part()
    if busy and not result["pass"]:
        while beside is not None and beside.exists():
            time.sleep(1.0)
        result = part() | {"alone": True}
    return result


def inside(arm: Arm, release: Path, options: argparse.Namespace) -> None:
    """In namespaces of its own: install, fly, compare; RESULT in the folder grows with each part."""
    result: dict[str, Any] = {}

    def note(more: dict[str, Any]) -> None:
        result.update(more)
        fresh = options.folder / f"{RESULT}.new"
        fresh.write_text(json.dumps(as_plain(result)))
        fresh.rename(options.folder / RESULT)

    try:
        arm.start()
        here = Here.of(release, options.folder / "here")
    except (EmulationUnavailable, OSError) as error:
        note({"skipped": str(error)})
        return
    for name, part in [("install", lambda: install(arm, release)), *parts(arm, here)]:
        found = shown(part, options.beside)
        say(f"{name}: {'passed' if found['pass'] else 'FAILED'}")
        note({name: [*result.get(name, []), found]})
        if name == "install" and not found["pass"]:
            break
    note({"ended": True})


def computer(release: Path, options: argparse.Namespace) -> Arm:
    """The computer that a release goes to."""
    return Arm(options.folder / "root", written(release)["release"], plain=options.quick)


def had(options: argparse.Namespace) -> Path:
    """The release; it and Debian are made where they are not there yet; EmulationUnavailable where they cannot be
    had.
    """
    look()
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        release = make_release(Target(), options.folder / "build")
        computer(release, options).make()
    except (RuntimeError, subprocess.CalledProcessError, OSError) as error:  # git's and pip's words; a full disk
        raise EmulationUnavailable(str(error).strip().splitlines()[-1]) from None
    return release


def enter(release: Path, options: argparse.Namespace) -> dict[str, Any]:
    """The rest in namespaces of its own, as long as --limit says. Outcome."""
    found = options.folder / RESULT
    found.write_text("{}")
    command = [
        *ALONE, sys.executable, "-m", "glider.tools.verify.arm64.emulated", *sys.argv[1:], "--inside", str(release),
    ]  # fmt: skip
    try:
        subprocess.run(command, timeout=options.limit, stdout=sys.stderr)
    except subprocess.TimeoutExpired:
        return json.loads(found.read_text()) | {"skipped": f"what was not shown within {options.limit:g} s"}
    return json.loads(found.read_text())


def passed(result: dict[str, Any]) -> bool:
    """No part failed, and all of them came to an end, or were left out for a reason."""
    parts = [part for value in result.values() if isinstance(value, list) for part in value]
    return all(part["pass"] for part in parts) and bool(result.get("ended") or result.get("skipped"))


def main() -> int:
    """Exit 0: all passed, or what it needs is not here (`skipped`); 1: something did not pass."""
    parser = argparse.ArgumentParser(prog="python -m glider.tools.verify.arm64.emulated", description=__doc__)
    parser.add_argument("folder", type=Path, help="for the system and what comes of it; a system that is there is used")
    parser.add_argument("--quick", action="store_true", help="as plain Python all through, and one reference flight")
    parser.add_argument("--beside", type=Path, help="only in time that others leave; they are done when it is gone")
    parser.add_argument("--limit", type=float, help="s; what is not shown by then is skipped")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)  # the release; it calls itself so
    options = parser.parse_args()
    options.folder = options.folder.resolve()
    if options.inside:
        inside(computer(options.inside, options), options.inside, options)
        return DONE
    if options.beside:
        os.nice(19)
        with contextlib.suppress(OSError):  # some containers do not let one
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    begin = time.monotonic()
    try:
        result = enter(had(options), options)
    except EmulationUnavailable as error:
        result = {"skipped": str(error)}
    result |= {"pass": passed(result), "seconds": round(time.monotonic() - begin)}
    print_json(result)
    if "skipped" in result:
        say(f"emulated computer: skipped: {result['skipped']}")
    return DONE if result["pass"] else FAILED


if __name__ == "__main__":
    sys.exit(main())
