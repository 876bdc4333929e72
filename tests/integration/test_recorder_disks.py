"""The recorder on real file systems that fill up, turn read-only or break: flying goes on, nothing damaged is read.

Each scenario runs in a mount namespace of its own (unshare), where that is allowed.
"""

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from glider.tools.data.log.reader import read_log

pytestmark = pytest.mark.realtime(seconds=30)

HEAD = """
import fcntl, json, os, struct, subprocess, sys, time
from pathlib import Path
import numpy as np
from glider.hal.recorder.condition import RecorderLevel
from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import Field, RecordSpec

TICK = RecordSpec("/tick", "glider/msg/Tick", (Field("n", "1"), Field("filling", "1", "", 200)))
place = Path(sys.argv[1])

def mount(*words):
    subprocess.run(["mount", *words, str(place)], check=True)

def fly(recorder, ticks, begin=0):
    channel = recorder.channel("/tick")
    for number in range(begin, begin + ticks):
        channel.values[:] = number
        channel.commit(number / 50)
        if number % 200 == 199:
            until(lambda: recorder.health().pending < 100)

def until(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)

def tell(report, **more):
    print(json.dumps({"complete": report.complete, "written": report.written, "dropped": report.dropped,
                      "error": report.error, **more}))
"""

FULL_FOR_A_WHILE = """
mount("-t", "tmpfs", "-o", "size=1m", "none")
(place / "ballast").write_bytes(b"x" * 500_000)
with Recorder(place / "x.mcap", [TICK], sync_period_s=0.05) as recorder:
    fly(recorder, 1000)
    until(lambda: recorder.watch().errno)
    full = recorder.condition.level, os.strerror(recorder.condition.errno)
    mount("-o", "remount,size=20m")
    until(lambda: recorder.watch().level == RecorderLevel.OK)
    report = recorder.close()
os.system(f"cp {place}/x.mcap {sys.argv[2]}")
tell(report, full=full)
"""

FULL_FOR_GOOD = """
mount("-t", "tmpfs", "-o", "size=300k", "none")
with Recorder(place / "x.mcap", [TICK], sync_period_s=0.05) as recorder:
    fly(recorder, 1000)
    until(lambda: recorder.watch().errno)
    fly(recorder, 1000, 1000)
    level = recorder.watch().level
    report = recorder.close()
os.system(f"cp {place}/x.mcap {sys.argv[2]}")
tell(report, level=level)
"""

# EXT4_IOC_SHUTDOWN: from now on the file system answers every write with an I/O error.
BROKEN = """
image = place.with_name("image")
image.write_bytes(b"")
os.truncate(image, 8_000_000)
subprocess.run(["mkfs.ext4", "-q", str(image)], check=True)
mount("-o", "loop", str(image))
with Recorder(place / "x.mcap", [TICK], sync_period_s=0.05) as recorder:
    fly(recorder, 400)
    until(lambda: recorder.health().written == 400)
    time.sleep(0.5)
    folder = os.open(place, os.O_RDONLY)
    fcntl.ioctl(folder, 0x8004587D, struct.pack("I", 0))
    fly(recorder, 400, 400)
    until(lambda: recorder.watch().errno)
    level, error = recorder.condition.level, os.strerror(recorder.condition.errno)
    fly(recorder, 400, 800)
    report = recorder.close()
os.close(folder)
subprocess.run(["umount", str(place)], check=True)
mount("-o", "loop", str(image))
os.system(f"cp {place}/x.mcap {sys.argv[2]}")
tell(report, level=level, said=error)
"""

READ_ONLY = """
mount("-t", "tmpfs", "-o", "ro", "none")
try:
    Recorder(place / "x.mcap", [TICK]).start()
except OSError as error:
    print(json.dumps({"errno": error.errno, "said": error.strerror, "file": error.filename}))
"""


def run(scenario, tmp_path):
    """A scenario's answer; skipped where nothing may be mounted."""
    place = tmp_path / "disk"
    place.mkdir()
    probe = f"mount -t tmpfs none {place} && umount {place}"
    for program in ("unshare", "mount", "mkfs.ext4"):
        if (program in scenario or program == "unshare") and shutil.which(program) is None:
            pytest.skip(f"no {program} on this machine")
    if sys.platform != "linux" or subprocess.run(["unshare", "-m", "sh", "-c", probe], capture_output=True).returncode:
        pytest.skip("no right to mount file systems here")
    if "loop" in scenario and not Path("/dev/loop-control").exists():
        pytest.skip("no loop devices here")
    script = tmp_path / "scenario.py"
    script.write_text(HEAD + scenario)
    done = subprocess.run(
        ["unshare", "-m", sys.executable, str(script), str(place), str(tmp_path / "out.mcap")],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def numbers(tmp_path):
    """The numbers of the ticks that are read, and the log."""
    log = read_log(tmp_path / "out.mcap")
    return log.topics["/tick"].column("n").tolist(), log


def test_a_disk_that_is_full_for_a_while_costs_nothing(tmp_path):
    found = run(FULL_FOR_A_WHILE, tmp_path)
    assert found["full"] == [1, os.strerror(errno.ENOSPC)]
    assert (found["complete"], found["dropped"], found["written"]) == (True, 0, 1000)
    read, log = numbers(tmp_path)
    assert read == list(range(1000))
    assert log.whole


def test_a_disk_that_is_full_for_good_leaves_a_whole_prefix(tmp_path):
    found = run(FULL_FOR_GOOD, tmp_path)
    assert (found["complete"], found["level"], found["error"]) == (False, 1, os.strerror(errno.ENOSPC))
    assert found["dropped"] == 0  # kept in memory to the end
    read, log = numbers(tmp_path)
    assert read == list(range(len(read)))
    assert 100 < len(read) < 250  # what 300 kB hold
    assert not log.complete
    assert not log.damages


def test_a_disk_that_breaks_leaves_all_that_was_on_it_before(tmp_path):
    found = run(BROKEN, tmp_path)
    assert not found["complete"]
    assert (found["level"], found["said"]) == (1, "Input/output error")
    read, log = numbers(tmp_path)
    assert read == list(range(len(read)))
    assert len(read) >= 399
    assert not log.damages


def test_a_read_only_disk_is_refused_before_the_flight(tmp_path):
    found = run(READ_ONLY, tmp_path)
    assert found["said"] == os.strerror(errno.EROFS)
    assert found["file"].endswith("x.mcap")


def test_a_flight_goes_on_to_its_end_over_a_full_disk(tmp_path):
    """`glider fly` in simulation, a megabyte for its log of seven: exit code 1, for the log is not complete."""
    scenario = """
mount("-t", "tmpfs", "-o", "size=1m", "none")
from glider.tools.cli.main import main
sys.argv = ["glider", "fly", "--json", "--log", str(place / "x.mcap")]
try:
    main()
except SystemExit as end:
    print(json.dumps({"code": end.code, "size": (place / "x.mcap").stat().st_size}))
os.system(f"cp {place}/x.mcap {place.parent}/out.mcap")
"""
    found = run(scenario, tmp_path)
    assert found["code"] == 1
    assert found["size"] > 500_000
    log = read_log(tmp_path / "out.mcap")
    assert log.topics["/tick"].count > 500
    assert not log.damages
