"""Faults of what is written: a disk that is full, a log and a state file that are torn."""

import random
import resource
import time
from pathlib import Path

import numpy as np

from glider.hal import state_file
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile, StateRecord
from glider.tools.data.errors import InputError
from glider.tools.data.log.framing import CHUNK_HEAD, Scan
from glider.tools.data.log.reader import Topic, read_log
from glider.tools.verify.faults.cases import DAMAGE, SAFE, GroundOutcome, observed


class UncheckedScan(Scan):
    """Takes a chunk's content, whatever its check sum says."""

    @staticmethod
    def chunk_content(body: bytes) -> tuple[bytes | None, str]:
        return (body[CHUNK_HEAD.size + 8 :], "") if len(body) > CHUNK_HEAD.size + 8 else (None, "short")


class Trusting(StateFile):
    """Reads a copy without its check: the state is the first name that can be found."""

    @staticmethod
    def decode(block: bytes) -> StateRecord:
        names = [state for state in SortieState if state.name.encode() in block]
        return StateRecord(names[0] if names else SortieState.ASHORE)


def full_disk(disabled: bool, folder: Path) -> GroundOutcome:
    """The disk takes no more (a limit on file size) while records come; flying and recording go on."""
    from glider.firmware.telemetry import TICK
    from glider.hal.recorder.recorder import Recorder

    path = folder / "full.mcap"
    recorder = Recorder(path, (TICK,))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        recorder.start()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    channel, noticed, refused, committed = recorder.channel("/tick"), None, None, 0
    begin = time.monotonic()
    while time.monotonic() - begin < 8.0 and noticed is None:
        for _ in range(20):
            channel.values[:] = committed
            committed += channel.commit(0.02 * committed)
        time.sleep(0.01)
        if refused is None and path.stat().st_size > 150_000:
            refused = time.monotonic()
        if not disabled and recorder.watch().level > 0 and refused is not None:
            noticed = time.monotonic() - refused
    recorder.close()
    return noticed, "LOG" if noticed is not None else "none", SAFE


def cut_log(disabled: bool, folder: Path) -> GroundOutcome:
    """A log with a torn sector at 300 places: what is read has to be what was written, all of it up to there."""
    from glider.firmware.telemetry import TICK
    from glider.hal.recorder import disk
    from glider.hal.recorder.logfile import LogFile

    path = folder / "whole.mcap"
    fd = disk.create(str(path))
    file, rows, ends = disk.DiskFile(fd), 2000, []
    log = LogFile(file, [TICK], attachments={}, metadata={})
    for number in range(rows):
        log.record(0, number + 1, 0.02 * number, np.full(TICK.width, float(number)).tobytes())
        if number % 25 == 24:
            log.flush()
            ends.append(file.tell())
    log.finish({})
    file.sync()
    disk.close(fd, str(path), keep=True)
    whole, rng, wrong, lost = path.read_bytes(), random.Random(5), 0, 0.0
    torn = folder / "torn.mcap"
    for cut in np.linspace(400, len(whole), 300).astype(int):
        tail = bytearray(whole[cut : cut + 40_000])
        for _ in range(3):
            if tail:
                tail[rng.randrange(min(512, len(tail)))] ^= 1 << rng.randrange(8)
        torn.write_bytes(whole[:cut] + tail)
        topic = _ticks(torn, UncheckedScan if disabled else Scan)
        data = np.zeros((0, TICK.width)) if topic is None or topic.data is None else topic.data
        first = data[:, 0]
        wrong += int(np.any(data != np.round(data[:, :1])) or np.any(np.diff(first) <= 0.0))
        there = 25 * int(np.searchsorted(ends, cut, side="right"))
        lost = max(lost, 0.02 * (there - int(np.sum(first < there))))
    return observed(wrong == 0 and lost <= 1.0, "valid prefix", f"{wrong} damaged, {lost:.1f} s lost", end=DAMAGE)


def _ticks(path: Path, scan: type[Scan]) -> Topic | None:
    """The log's ticks; None where nothing of them is there."""
    try:
        topic = read_log(path, scan).topics.get("/tick")
    except InputError:  # cut before anything of it was there
        return None
    return topic if topic is not None and topic.data is not None else None


def torn_state(disabled: bool, folder: Path) -> GroundOutcome:
    """The power goes at every byte of a write of either copy; what is read has to be as bad as the worse of both."""
    wrong = 0
    for old, new in ((SortieState.ASHORE, SortieState.DIVING), (SortieState.DIVING, SortieState.ASHORE)):
        for copy in (0, 1):
            for cut in range(0, state_file.BLOCK, 7):
                file = StateFile(folder)
                before = file.write(old)
                block = state_file.encode(StateRecord(new, sequence=before.sequence + 1))
                for path in file.paths[:copy]:
                    path.write_bytes(block)
                kept = file.paths[copy].read_bytes()
                torn = block[:cut] + (b"" if cut % 2 else kept[cut:])
                file.paths[copy].write_bytes(torn)
                found = (Trusting if disabled else StateFile)(folder).read()
                untouched = old == SortieState.ASHORE and copy == 0 and torn == kept  # nothing of it has changed yet
                finished = new == SortieState.ASHORE and copy == 1 and torn == block  # all of it has
                wrong += found.state < SortieState.DIVING and not (untouched or finished)
    return observed(not wrong, "the worse wins", f"{wrong} taken for whole")
