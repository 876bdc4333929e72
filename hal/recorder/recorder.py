"""The recorder, seen from the flight: start it, fill and commit records, close it.

The file is written by a process of its own (writer.py); the flight hands its records over through shared memory and
never waits for a disk. What is on the disk is at most half a second and one fsync behind. A recording process that dies
or hangs is replaced by one that writes on into a further file, NAME-part2.mcap and so on (`watch`).
"""

import contextlib
import json
import os
import select
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.hal.recorder import ring
from glider.hal.recorder.condition import FIRST_RETRY_S, HUNG_S, LONGEST_RETRY_S, RecorderCondition, RecorderLevel
from glider.hal.recorder.producer import Producer, RecordChannel
from glider.hal.recorder.schema import RECORDING, RecordSpec, specs_to_json
from glider.hal.spawn import module_command, module_environment

SLOTS = 2048  # twenty seconds of a hundred records a second
SYNC_PERIOD_S = 0.5  # with the time an fsync takes, at most a second is lost when the power goes
START_TIMEOUT_S = 20.0
CLOSE_TIMEOUT_S = 20.0


def part_path(path: Path, part: int) -> Path:
    """The file in which a log goes on: NAME-part2.mcap and so on; the first is `path` itself."""
    return path if part == 1 else path.with_name(f"{path.stem}-part{part}{path.suffix}")


def _shared_text(text: str) -> int:
    """A descriptor of memory that holds a text."""
    data = text.encode()
    fd = ring.create_shared(len(data))
    os.pwrite(fd, data, 0)
    return fd


@dataclass(frozen=True)
class RecorderReport:
    """How a recording ended. `complete`: every record handed over is in a file that is closed and on the disk."""

    written: int = 0
    dropped: int = 0  # found no room
    damaged: int = 0  # never became whole in the shared memory
    disk_errors: int = 0
    error: str = ""  # what the disk said last, if it did not recover
    bytes: int = 0
    complete: bool = True
    parts: int = 1  # files; more than one where a recording process had to be replaced


@dataclass(frozen=True)
class RecorderHealth:
    """A look at a recording under way."""

    pending: int  # records handed over and not yet taken
    written: int
    dropped: int
    damaged: int
    disk_errors: int
    errno: int  # 0 while the disk is well
    alive: bool  # the recording process runs


class Recorder:
    """Records to a new file `path`; one thread calls it. A context manager: starts on entry, closes on exit."""

    def __init__(
        self,
        path: str | os.PathLike,
        specs: Sequence[RecordSpec],
        *,
        attachments: Mapping[str, str] | None = None,
        metadata: Mapping[str, str] | None = None,
        epoch_ns: int = 0,
        slots: int = SLOTS,
        sync_period_s: float = SYNC_PERIOD_S,
        live_stream: str | os.PathLike | None = None,
    ):
        """`attachments`: name -> text; `metadata`: name -> text; `epoch_ns` is the log time of t = 0; `live_stream`:
        path of the socket for a live view (live_stream.py), None: there is none.

        ValueError where two specs share a topic.
        """
        self.path = Path(path)
        specs = tuple(specs)
        if len({spec.topic for spec in specs}) < len(specs):
            raise ValueError("two kinds of record share a topic")
        payload = max([ring.MIN_PAYLOAD, *(spec.width for spec in specs)])
        layout = ring.Layout(slots, payload)
        self._fd: int | None = ring.create_shared(layout.size)
        self._producer = Producer(self._fd, layout, specs)
        config = {
            "slots": layout.slots,
            "payload": layout.payload,
            "specs": specs_to_json(specs),
            "attachments": dict(attachments or {}),
            "metadata": {**{str(k): str(v) for k, v in (metadata or {}).items()}, RECORDING: os.urandom(8).hex()},
            "epoch_ns": epoch_ns,
            "period_s": sync_period_s,
            "onlookers": os.fspath(live_stream) if live_stream else "",
        }
        self._config_fd: int | None = _shared_text(json.dumps(config))
        self._process: subprocess.Popen[bytes] | None = None
        self._ready = False
        self._report: RecorderReport | None = None
        self.condition = RecorderCondition()
        self._part = 1
        self._heard = b""  # of its answers
        self._retry_at, self._retry_s = 0.0, FIRST_RETRY_S
        self._started_at = 0.0

    def channel(self, topic: str) -> RecordChannel:
        """The channel of a spec's topic; KeyError for another."""
        return self._producer.channels[topic]

    def event(self, time_s: float, severity: int, text: str) -> bool:
        """Record a line of text, with a severity of schema.py; False where there was no room."""
        return self._producer.event(time_s, severity, text)

    def start(self, wait: bool = True) -> None:
        """Start the recording process and wait until the file is there (or call wait_ready later, and do other things
        meanwhile); OSError where it cannot be written, FileExistsError where it is there already."""
        if self._process is not None or self._report is not None:
            raise RuntimeError("this recorder was started before")
        self._launch()
        if wait:
            self.wait_ready()

    @property
    def pid(self) -> int:
        """The recording process's; 0 before it starts."""
        return self._process.pid if self._process is not None else 0

    def _launch(self) -> None:
        """Start a recording process for the current part; a few milliseconds."""
        assert self._fd is not None
        assert self._config_fd is not None
        self._process = subprocess.Popen(
            module_command("glider.hal.recorder.writer"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(self._fd, self._config_fd),
            start_new_session=True,  # what a terminal sends to the flight does not reach it
            env=module_environment(),
        )
        self._started_at = time.monotonic()
        assert self._process.stdin is not None
        start = {
            "path": os.path.abspath(part_path(self.path, self._part)), "fd": self._fd, "config_fd": self._config_fd,
            "part": self._part, "parent": os.getpid(),
        }  # fmt: skip
        try:
            self._process.stdin.write(json.dumps(start).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # whoever waits for it says so

    def wait_ready(self) -> None:
        """Wait until the file is there; OSError as `start`."""
        if self._ready:
            return
        result = self._answer(START_TIMEOUT_S)
        if result is None:
            self._end_process()
            raise OSError(0, "the recording process did not start", str(self.path))
        if "error" in result:
            self._end_process()
            raise OSError(result["error"], result["message"], str(self.path))
        self._ready = True

    def health(self) -> RecorderHealth:
        """How it goes; a few system calls, not for every tick."""
        control = self._producer.control
        return RecorderHealth(
            pending=control[ring.HEAD] - control[ring.TAIL],
            written=control[ring.WRITTEN],
            dropped=control[ring.DROPPED],
            damaged=control[ring.DAMAGED],
            disk_errors=control[ring.DISK_ERRORS],
            errno=control[ring.LAST_ERRNO],
            alive=self._process is not None and self._process.poll() is None,
        )

    def watch(self) -> RecorderCondition:
        """Look at the recording and replace its process where that died or hangs; returns `condition`, updated.

        For once a second: some system calls, and where a process is started a few milliseconds.
        """
        control, condition = self._producer.control, self.condition
        process = self._process
        alive = process is not None and process.poll() is None
        now = time.monotonic()
        dropped = control[ring.DROPPED]
        condition.pending = control[ring.HEAD] - control[ring.TAIL]
        condition.written, condition.damaged = control[ring.WRITTEN], control[ring.DAMAGED]
        condition.disk_errors, condition.errno = control[ring.DISK_ERRORS], control[ring.LAST_ERRNO]
        condition.beat_ns = control[ring.BEAT]
        silent_s = now - max(condition.beat_ns / 1e9, self._started_at)
        if process is None or not (self._ready or self._part > 1) or self._report is not None:
            condition.level = int(RecorderLevel.FAILED)
        elif not alive or silent_s > HUNG_S:
            condition.level = int(RecorderLevel.FAILED)
            self._replace(process, alive, now)
        elif condition.errno or dropped > condition.dropped or condition.beat_ns < self._started_at * 1e9:
            condition.level = int(RecorderLevel.DROPPING)
        else:
            condition.level = int(RecorderLevel.OK)
            if now - self._started_at > LONGEST_RETRY_S:
                self._retry_s = FIRST_RETRY_S
        condition.dropped = dropped
        return condition

    def _replace(self, process: subprocess.Popen[bytes], alive: bool, now: float) -> None:
        """A new process for a dead or hanging one, never beside it: it has to be gone first."""
        if alive:
            process.kill()  # gone by the next look, unless the system holds it
            return
        if now < self._retry_at:
            return
        for pipe in (process.stdin, process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        self._retry_at, self._retry_s = now + self._retry_s, min(2.0 * self._retry_s, LONGEST_RETRY_S)
        self._part += 1
        self._heard = b""
        self.condition.restarts += 1
        # A refusing disk is not held against the new process before it has tried.
        self._producer.control[ring.LAST_ERRNO] = 0
        self._launch()

    def close(self, ending: Mapping[str, str] | None = None) -> RecorderReport:
        """Have everything written and the log closed, with how the flight ended; a second call answers the same."""
        if self._report is not None:
            return self._report
        if self._process is None or not (self._ready or self._part > 1):
            self._report = RecorderReport(complete=False, error="never started")
            self._end_process()
            return self._report
        assert self._process.stdin is not None
        try:
            texts = {str(key): str(value) for key, value in (ending or {}).items()}
            self._process.stdin.write(json.dumps(texts).encode() + b"\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            pass  # it is dead: no answer will come
        result = self._answer(CLOSE_TIMEOUT_S)
        if result == {"ready": True}:  # of a part that nobody waited for
            result = self._answer(CLOSE_TIMEOUT_S)
        health = self.health()
        self._end_process()
        if result is None or "written" not in result:
            self._report = RecorderReport(
                written=health.written,
                dropped=health.dropped + health.pending,
                damaged=health.damaged,
                disk_errors=health.disk_errors,
                error="the recording process died or hung",
                complete=False,
                parts=self._part,
            )
        else:
            # What a process that died had taken and not yet brought to the disk is lost, half a second at most.
            complete = result["complete"] and self._part == 1
            self._report = RecorderReport(**{**result, "complete": complete}, parts=self._part)
        return self._report

    def _answer(self, timeout_s: float) -> dict | None:
        """The next line from the recording process; None where it died or is silent for too long."""
        assert self._process is not None
        assert self._process.stdout is not None
        if self._process.stdout.closed:
            return None
        fd = self._process.stdout.fileno()
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._heard:
            ready, _, _ = select.select([fd], [], [], max(0.0, deadline - time.monotonic()))
            piece = os.read(fd, 65_536) if ready else b""
            if not piece:
                return None
            self._heard += piece
        line, _, self._heard = self._heard.partition(b"\n")
        return json.loads(line)

    def _end_process(self) -> None:
        for fd in (self._fd, self._config_fd):
            if fd is not None:
                os.close(fd)
        self._fd = self._config_fd = None
        if self._process is None:
            return
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> "Recorder":
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class NullChannel:
    """A channel to nowhere."""

    def __init__(self, spec: RecordSpec):
        self.spec = spec
        self.values = np.full(spec.width, np.nan)

    def commit(self, time_s: float) -> bool:
        return True


class NullRecorder:
    """A recorder that records nothing, for flights without a log."""

    path: Path | None = None
    pid = 0

    def __init__(self, specs: Sequence[RecordSpec]):
        self._channels = {spec.topic: NullChannel(spec) for spec in specs}
        self.condition = RecorderCondition()

    def channel(self, topic: str) -> NullChannel:
        return self._channels[topic]

    def event(self, time_s: float, severity: int, text: str) -> bool:
        return True

    def start(self, wait: bool = True) -> None:
        return

    def wait_ready(self) -> None:
        return

    def health(self) -> RecorderHealth:
        return RecorderHealth(pending=0, written=0, dropped=0, damaged=0, disk_errors=0, errno=0, alive=True)

    def watch(self) -> RecorderCondition:
        return self.condition

    def close(self, ending: Mapping[str, str] | None = None) -> RecorderReport:
        return RecorderReport()

    def __enter__(self) -> "NullRecorder":
        return self

    def __exit__(self, *exception: object) -> None:
        return
