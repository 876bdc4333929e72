"""A dive flown from a terminal: confirmed by a person, disturbed by noise, the terminal torn out; it flies on."""

import os
import signal
import sys
import time

import pexpect
import pytest

from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from tests.support.patience import patient_vehicle
from tests.support.twinned import DIVE, end_guard, twins, until

pytestmark = pytest.mark.realtime(seconds=40)
NOISE = bytes(letter for letter in range(1, 256) if letter != 3) + b"\nenable\nabort\nyes\n\x1a\x1c\x13"


def test_neither_noise_nor_the_loss_of_its_terminal_ends_a_dive(tmp_path):
    (tmp_path / "dive.toml").write_text(DIVE)
    state = tmp_path / "state"
    with twins(tmp_path / "t") as sea:
        command = [
            "-m",
            "glider.tools.cli.main",
            "fly",
            "--board",
            str(sea.board),
            "--mission",
            str(tmp_path / "dive.toml"),
        ]
        command += ["--vehicle", str(patient_vehicle(tmp_path)), "--state", str(state)]
        child = pexpect.spawn(sys.executable, [*command, "--log", str(tmp_path / "dive.mcap")], timeout=300)
        try:
            child.expect("hands and cables clear", timeout=60)
            assert not (tmp_path / "dive.mcap").exists()
            child.sendline("yes")
            until(lambda: sea.state()["z_m"] > 1.0 or not child.isalive(), 300.0, every=0.1)
            child.send(NOISE)
            time.sleep(2.0)
            null = os.open(os.devnull, os.O_RDWR)
            os.dup2(null, child.child_fd)  # the terminal's other end is gone
            os.close(null)
            deeper = sea.state()["z_m"] + 0.5
            until(lambda: sea.state()["z_m"] > deeper or not child.isalive(), 60.0, every=0.1)
            pulse = Heartbeat.open(state).look()
            assert (pulse.state, pulse.guard) == (SortieState.DIVING, Guard.WATCHING)
            assert StateFile(state).read().state == SortieState.DIVING
            for _ in range(2):  # two of them together: given up, and not left
                os.kill(child.pid, signal.SIGINT)
                time.sleep(0.05)
            until(lambda: not child.isalive(), 180.0, every=0.1)
            assert StateFile(state).read().state == SortieState.ENDED
            assert sea.state()["z_m"] < 0.35
        finally:
            child.kill(signal.SIGKILL)
            end_guard(state)
