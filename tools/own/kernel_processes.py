"""The kernels of a model in plain Python run in other processes (kernel_server.py), as threads wait for each other."""

import contextlib
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.own.compiled import NEAR, RUNS, Kernels
from glider.tools.own.kernel_messages import receive, send

SERVER = "glider.tools.own.kernel_server"
START_AFTER = 5.0  # s in kernels, from which on it is worth it to start others


class _Processes:
    """Processes that have loaded a vehicle file; started when enough time has been spent without them."""

    def __init__(self, path: Path) -> None:
        self.path, self.seconds, self.count, self.here = path, 0.0, 0, threading.Lock()
        self.free = queue.SimpleQueue[subprocess.Popen[bytes]]()

    def at_once(self, wanted: int) -> int:
        """How many of `wanted` calls run side by side."""
        if wanted > max(1, self.count) and self.seconds > START_AFTER:
            command = [sys.executable, "-m", SERVER, str(self.path.resolve())]
            pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
            for _ in range(wanted - self.count):  # Ctrl-C is for this process, whose end they notice
                self.free.put(subprocess.Popen(command, start_new_session=True, **pipes))
            self.count = wanted
        return min(wanted, self.count or 1)

    def calling(self, name: str, kernel: Callable[..., Any]) -> Callable[..., Any]:
        """A kernel called in a process; here before there are any, and where one cannot."""

        def call(*given: Any) -> Any:
            with contextlib.suppress(queue.Empty):
                one = self.free.get_nowait()
                with contextlib.suppress(OSError, EOFError):
                    value, written = _asked(one, name, given)
                    self.free.put(one)
                    if written is not None:
                        _copy(written, given[-1])
                        return value
            with self.here:  # one at a time: the user's functions are called with the same arrays
                begun = time.perf_counter()
                try:
                    return kernel(*given)
                finally:
                    self.seconds += time.perf_counter() - begun

        return call


def _asked(process: "subprocess.Popen[bytes]", name: str, given: tuple[Any, ...]) -> tuple[Any, Any]:
    """What a kernel returned in a process, and what it wrote into its last argument; None, None: it raised."""
    assert process.stdin is not None
    assert process.stdout is not None
    send(process.stdin, (name, *given))
    value, written = receive(process.stdout)
    return value, written


def _copy(written: Any, to: Any) -> None:
    """Arrays, or tuples of them, into those that a kernel was given."""
    if isinstance(to, tuple):
        for one, other in zip(written, to, strict=True):
            _copy(one, other)
    else:
        np.copyto(to, written)


def side_by_side(kernels: Kernels, path: Path) -> Kernels:
    """The kernels of a vehicle file's model, run in processes once that is worth it."""
    processes = _Processes(path)
    called: dict[str, Any] = {name: processes.calling(name, getattr(kernels, name)) for name in (*RUNS, *NEAR)}
    return replace(kernels, at_once=processes.at_once, **called)
