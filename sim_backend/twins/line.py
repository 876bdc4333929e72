"""A virtual serial line: a pseudo-terminal under a name of its own, at the speed of the line, that can be pulled out.

Bytes leave when the last of them would have passed a real line. 8N1 and no modem lines: pseudo-terminals have neither
parity nor RTS/CTS.
"""

import asyncio
import contextlib
import os
import tty
from collections.abc import Callable
from pathlib import Path

from glider.hal.units import BITS

CHUNK = 4096


def open_pty() -> tuple[int, int, str]:
    """Master, slave (kept open: the master outlives its users) and the slave's path; raw, master not waiting."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    return master, slave, os.ttyname(slave)


class Line:
    """The far end of a serial port. `link` is the name under which programs open it."""

    def __init__(self, link: Path, baud: int, received: Callable[[bytes], None]):
        self.link, self.baud = link, baud
        self.bytes_in = 0
        self._received = received
        self._master = self._slave = -1
        self._free_at = 0.0

    @property
    def byte_s(self) -> float:
        return BITS / self.baud

    @property
    def plugged(self) -> bool:
        return self._master >= 0

    def plug(self) -> None:
        """Make the port, and its name."""
        if self.plugged:
            return
        self._master, self._slave, path = open_pty()
        with contextlib.suppress(FileNotFoundError):
            self.link.unlink()
        self.link.symlink_to(path)
        asyncio.get_running_loop().add_reader(self._master, self._readable)

    def unplug(self) -> None:
        """Take the port away under whoever uses it."""
        if not self.plugged:
            return
        asyncio.get_running_loop().remove_reader(self._master)
        for fd in (self._master, self._slave):
            os.close(fd)
        self._master = self._slave = -1
        with contextlib.suppress(FileNotFoundError):
            self.link.unlink()

    def _readable(self) -> None:
        try:
            data = os.read(self._master, CHUNK)
        except OSError:
            return
        self.bytes_in += len(data)
        self._received(data)

    def send(self, data: bytes, delay: float = 0.0) -> None:
        """Put bytes on the line `delay` s from now, or once it is free; they arrive when the last has passed."""
        loop = asyncio.get_running_loop()
        begin = max(loop.time() + delay, self._free_at)
        self._free_at = begin + len(data) * self.byte_s
        loop.call_at(self._free_at, self._write, data)

    def _write(self, data: bytes) -> None:
        if not self.plugged:
            return
        with contextlib.suppress(OSError):  # nobody reads
            os.write(self._master, data)
