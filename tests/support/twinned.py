"""Twins in a process of their own, and flights and out-of-band processes on them: what each is killed without."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from tests.support.patience import patient_vehicle

# Down and on down: only being brought up ends it.
DIVE = """
format = 1
name = "dive"
time_limit_s = 600.0
[site]
name = "deep water"
depth_m = 100.0
[[leg]]
duration_s = 500.0
pitch_deg = -20.0
ballast_kg = 0.12
"""


class Twins:
    """`glider twin` in a folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.board = folder / "board.toml"

    def control(self, command: str) -> str:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
            line.settimeout(10.0)
            line.connect(str(self.folder / "control"))
            line.sendall(command.encode() + b"\n")
            return line.makefile().readline().strip()

    def state(self) -> dict:
        return json.loads(self.control("state"))


@contextmanager
def twins(folder: Path, *extra: str):
    command = [sys.executable, "-m", "glider.tools.cli.main", "twin", "--dir", str(folder), *extra]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert process.stdout.readline(), "the twins did not start"
        yield Twins(folder)
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)


ARMING_TRIES = 3


@contextmanager
def flying(board: Path, mission: Path, folder: Path, *extra: str):
    """`glider fly` on the twins, armed or refused; killed at the end if it still runs, and so is what it left behind.

    Where a device of the twins, kept waiting by a busy machine, was silent in the moment of arming, it is tried again.
    """
    log = Path(extra[extra.index("--log") + 1]) if "--log" in extra else folder / "flight.mcap"
    command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--board", str(board), "--mission", str(mission)]
    command += ["--vehicle", str(patient_vehicle(folder))]
    command += ["--yes", "--state", str(folder / "state"), "--log", str(folder / "flight.mcap"), "--json", *extra]
    try:
        for _ in range(ARMING_TRIES):
            with (folder / "stdout").open("w") as out, (folder / "stderr").open("a") as err:
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err)
            # what does not arm leaves no log
            until(lambda process=process: log.exists() or process.poll() is not None, 120.0)
            last = (folder / "stderr").read_text().rstrip().rpartition("\n")[2]
            if log.exists() or "not armed: devices" not in last:
                break
        yield process
    finally:
        process.kill()
        process.wait()
        end_guard(folder / "state")


def guard_pid(folder: Path) -> int:
    """The out-of-band process that stamps a heartbeat."""
    from glider.hal.heartbeat import W_GUARD_PID, Heartbeat

    pulse = Heartbeat.open(folder)
    pid = pulse.words[W_GUARD_PID]
    pulse.close()
    return pid


def end_guard(folder: Path) -> None:
    """Stop the out-of-band process that stamps a heartbeat, if one does."""
    try:
        pid = guard_pid(folder)
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except (OSError, ValueError):
        return
    if b"glider.hal.outofband" in command:
        os.kill(pid, signal.SIGTERM)
        until(lambda: not Path(f"/proc/{pid}").exists(), 5.0)


def until(condition, seconds: float, every: float = 0.02) -> float:
    """Wait for a condition, asked `every` so many s; how long it took. AssertionError where it does not come."""
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < seconds, "waited in vain"
        time.sleep(every)
    return time.monotonic() - begin
