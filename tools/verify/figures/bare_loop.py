"""What the machine itself can keep: a loop in C that only sleeps to its deadlines (bare_loop.c), on a flight's core."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.runtime import HISTOGRAM_EDGES
from glider.tools.data.errors import InputError
from glider.tools.verify.benchmark.c_program import compiled

TIMEOUT_S = 60.0  # beyond the time it is to run


@dataclass(frozen=True)
class Punctuality:
    """How punctual a bare loop was. late (n, 2): when it woke (s of the monotonic clock) and how late (s)."""

    ticks: int
    missed: int
    worst_late_s: float
    lateness: dict[str, int]
    real_time: bool
    locked: bool
    late: np.ndarray

    def lost_s(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Seconds of each span [begin, end] (n,), s of the monotonic clock, in which the loop was due and not woken."""
        woken, slept = self.late[:, 0], self.late[:, 0] - self.late[:, 1]
        overlap = np.minimum(woken[None, :], end[:, None]) - np.maximum(slept[None, :], begin[:, None])
        return np.clip(overlap, 0.0, None).sum(axis=1)

    def summary(self) -> dict[str, Any]:
        """Its figures, without each late tick."""
        return {
            "ticks": self.ticks, "missed": self.missed, "worst_late_s": self.worst_late_s, "lateness": self.lateness,
            "real_time": self.real_time, "memory_locked": self.locked,
        }  # fmt: skip


class BareLoop:
    """A bare loop under way; `end` waits for its figures."""

    def __init__(self, program: Path, *, core: int, priority: int, period_s: float, seconds: float, late_s: float):
        command = [program, core, priority, round(1e9 * period_s), seconds, round(1e9 * late_s)]
        self._process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, text=True)
        self._seconds = seconds

    def end(self) -> Punctuality:
        """Its figures, once it is through."""
        text, _ = self._process.communicate(timeout=self._seconds + TIMEOUT_S)
        head, *late, counts = text.splitlines()
        ticks, missed, worst, real_time, locked = (int(word) for word in head.split())
        edges = [f"<{edge:g}" for edge in HISTOGRAM_EDGES[1:]]
        return Punctuality(
            ticks, missed, worst / 1e9, dict(zip(edges, map(int, counts.split()[1:]), strict=True)),
            bool(real_time), bool(locked), np.array([line.split() for line in late], float).reshape(-1, 2) / 1e9,
        )  # fmt: skip

    def kill(self) -> None:
        """Give it up."""
        self._process.kill()
        self._process.wait()


@contextmanager
def bare_loop_program() -> Iterator[Path]:
    """bare_loop.c, compiled; InputError where there is no C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise InputError("no C compiler (cc) to compile the bare loop with")
    with (
        as_file(files("glider.tools.verify.figures") / "bare_loop.c") as source,
        compiled(source, compiler) as program,
    ):
        yield program


def stolen_s(core: int) -> float:
    """Seconds that the machine's host has kept a core from it since it started; nan where the system does not say."""
    try:
        lines = Path("/proc/stat").read_text().splitlines()
    except OSError:
        return float("nan")
    for line in lines:
        words = line.split()
        if words[0] == f"cpu{core}":
            return int(words[8]) / os.sysconf("SC_CLK_TCK")
    return float("nan")
