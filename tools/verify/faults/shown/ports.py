"""Faults of ports: two programs at one."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from glider.hal.transport.port import Busy, SerialPort
from glider.sim_backend.twins.line import open_pty
from glider.tools.verify.faults.cases import GroundOutcome, observed


class SharedPort(SerialPort):
    """Asks for no lock."""

    exclusive = False


def two_programs(disabled: bool, folder: Path) -> GroundOutcome:
    """A port that another program holds."""
    master, slave, path = open_pty()
    first = SerialPort(path, 115_200)
    first.open()
    held = [sys.executable, "-c", f"from glider.hal.transport.port import SerialPort as S; S({path!r}, 9600).open()"]
    try:
        if disabled:
            SharedPort(path, 115_200).open()
            return observed(False, "refused", "opened twice")
        second = subprocess.run(held, capture_output=True, text=True, check=False)
        refused = "Busy" in second.stderr
        with contextlib.suppress(Busy):
            SerialPort(path, 115_200).open()
            refused = False
        return observed(refused, "refused", "opened twice")
    finally:
        first.close()
        for fd in (master, slave):
            os.close(fd)
