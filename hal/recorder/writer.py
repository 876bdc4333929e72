"""The recording process: `python -m glider.hal.recorder.writer`, started by recorder.py.

Standard input brings one line of JSON (which shared memory, which configuration, also in shared memory), later one more
(how the flight ended); its end without that means that the flight is dead. Standard output answers {"ready": true} or
{"error": ...}, and with a report at the end. A process that replaces another (`part` above 1) waits for a disk that
refuses, since the flight is under way; the first one says so instead, and does not start. Signals that ask programs to
stop are ignored: the flight decides, and goes on to be recorded while it comes up.
"""

import json
import os
import select
import signal
import sys
import time

from glider.hal.realtime import leave_real_time
from glider.hal.recorder import disk, ring
from glider.hal.recorder.live_stream import LiveStream
from glider.hal.recorder.logfile import PART, LogFile
from glider.hal.recorder.schema import specs_from_json

POLL_S = 0.01
BATCH = 256  # records between two looks at the clock
LAST_TRIES_S = 10.0  # how long a disk that refuses is asked again once the flight is over


class RingInput:
    """Standard input, line by line, without waiting."""

    def __init__(self):
        self._data = b""
        self.ended = False

    def line(self, timeout_s: float) -> bytes | None:
        """The next line if it comes within the timeout; None if not."""
        while b"\n" not in self._data:
            if self.ended:
                time.sleep(timeout_s)
                return None
            ready, _, _ = select.select([0], [], [], timeout_s)
            if not ready:
                return None
            data = os.read(0, 65_536)
            self.ended = not data
            self._data += data
        line, _, self._data = self._data.partition(b"\n")
        return line


def answer(result: dict) -> None:
    """One line of JSON to the flight; it may be gone."""
    try:
        os.write(1, json.dumps(result).encode() + b"\n")
    except OSError:
        return


def complain(message: str) -> None:
    """A line for the person at the terminal, who may be gone too."""
    try:
        os.write(2, f"glider: {message}\n".encode())
    except OSError:
        return


class LogRecording:
    """Takes records out of the ring and brings them to the disk, whatever the disk says."""

    def __init__(self, reader: ring.RingReader, log: LogFile, file: disk.DiskFile, path: str, period_s: float):
        self._reader, self._log, self._file = reader, log, file
        self._path, self._period_s = path, period_s
        self._next_sync = 0.0
        self._complained = False
        self.live_stream: LiveStream | None = None

    def step(self) -> bool:
        """Take what is there, up to a batch; True if there may be more."""
        taken = None
        for _ in range(BATCH):
            # With the disk refusing for long, the ring fills and the flight drops by priority: bounded memory.
            taken = None if self._file.full else self._reader.take()
            if taken is None:
                break
            self._write(taken)
            if self.live_stream is not None:
                self.live_stream.offer(taken)
        if self.live_stream is not None:
            self.live_stream.serve()
        now = time.monotonic()
        self._reader.control[ring.BEAT] = time.monotonic_ns()
        if now >= self._next_sync:
            self._next_sync = now + self._period_s
            self._log.flush()
            self.sync()
        return taken is not None

    def _write(self, taken: ring.RingRecord) -> None:
        if taken.channel == ring.EVENT_CHANNEL:
            severity, length = taken.payload[: 8 * ring.EVENT_HEAD].cast("d")
            start = 8 * ring.EVENT_HEAD
            text = bytes(taken.payload[start : start + int(length)]).decode("utf-8", "ignore")
            self._log.event(taken.sequence, taken.time_s, int(severity) & 0xFF, text)
        else:
            self._log.record(taken.channel, taken.sequence, taken.time_s, taken.payload)
        self._reader.control[ring.WRITTEN] += 1

    def sync(self) -> bool:
        """Bring all of it to the disk; a trouble and its end are each said once."""
        done = self._file.sync()
        self._reader.control[ring.DISK_ERRORS] = self._file.errors
        self._reader.control[ring.LAST_ERRNO] = self._file.last_errno
        if done == self._complained:
            self._complained = not done
            trouble = f"{os.strerror(self._file.last_errno)}; the flight's log is kept in memory"
            complain(f"{self._path}: {'recording again' if done else trouble}")
        return done

    def finish(self, ending: dict[str, str]) -> dict:
        """Empty the ring, close the log; the report."""
        control = self._reader.control
        deadline = time.monotonic() + LAST_TRIES_S
        while self._reader.pending and time.monotonic() < deadline:
            if not self.step():
                time.sleep(POLL_S)
        counts = {"written": control[ring.WRITTEN], "dropped": control[ring.DROPPED], "damaged": control[ring.DAMAGED]}
        lost = self._reader.pending
        counts["dropped"] += lost
        self._log.finish({**{name: str(count) for name, count in counts.items()}, **ending})
        while not self.sync() and time.monotonic() < deadline:
            time.sleep(self._period_s)
        return {
            **counts,
            "disk_errors": self._file.errors,
            "error": os.strerror(self._file.last_errno) if self._file.last_errno else "",
            "bytes": self._file.tell(),
            "complete": self._file.last_errno == 0 and not lost,
        }


def _become_background() -> None:
    """No signal but the last stops it, and it never competes with the flight for a processor."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGXFSZ"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    leave_real_time()
    try:
        os.nice(5)
    except (AttributeError, OSError):
        return


def read_config(start: dict) -> dict:
    """The configuration: the line's own, and what lies in the shared memory that it names."""
    with os.fdopen(start["config_fd"], "rb") as file:
        size = os.fstat(file.fileno()).st_size
        return {**json.loads(os.pread(file.fileno(), size, 0)), **start}


def admit(config: dict) -> LiveStream | None:
    """The socket for a live view, where one was asked for; no recording ends for want of it."""
    if not config["onlookers"]:
        return None
    try:
        return LiveStream(config["onlookers"], json.loads(config["specs"]), config["metadata"])
    except OSError as error:
        complain(f"{config['onlookers']}: {error.strerror or error}: no live view")
        return None


def main() -> int:
    """Exit 0 with the log complete, 1 otherwise."""
    _become_background()
    source = RingInput()
    line = None
    while line is None and not source.ended:
        line = source.line(1.0)
    if line is None:
        return 1
    config = read_config(json.loads(line))
    specs = specs_from_json(config["specs"])
    layout = ring.Layout(config["slots"], config["payload"])
    reader = ring.RingReader(config["fd"], layout, [spec.width for spec in specs])
    try:
        fd = disk.create(config["path"])
    except OSError as error:
        answer({"error": error.errno, "message": error.strerror})
        return 1
    file = disk.DiskFile(fd)
    metadata = {**config["metadata"], **({PART: str(config["part"])} if config["part"] > 1 else {})}
    log = LogFile(file, specs, attachments=config["attachments"], metadata=metadata, epoch_ns=config["epoch_ns"])
    recording = LogRecording(reader, log, file, config["path"], config["period_s"])
    if not recording.sync() and config["part"] == 1:  # no flight starts without room for its log
        disk.close(fd, config["path"], keep=False)
        answer({"error": file.last_errno, "message": os.strerror(file.last_errno)})
        return 1
    recording.live_stream = admit(config)
    answer({"ready": True})

    ending = {"ended": "the flight's process died"}
    while not source.ended and os.getppid() == config["parent"]:
        line = source.line(0.0 if recording.step() else POLL_S)
        if line is not None:
            ending = json.loads(line)
            break
    report = recording.finish(ending)
    if recording.live_stream is not None:
        recording.live_stream.close()
    answer(report)
    return 0 if report["complete"] else 1


if __name__ == "__main__":
    sys.exit(main())
