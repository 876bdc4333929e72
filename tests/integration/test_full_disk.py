"""Commands on a disk that is full, too small or not to be written to: one line, exit code 2, nothing half written."""

import errno
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.commands import glider

NO_SPACE = os.strerror(errno.ENOSPC)

SCRIPT = """
import json, subprocess, sys
from pathlib import Path
sys.path.insert(0, sys.argv[3])
from commands import glider
place, size = Path(sys.argv[1]), sys.argv[2]
subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)], check=True)
if len(sys.argv) > 5:
    (place / "ballast").write_bytes(bytes(int(sys.argv[5])))
done = [glider(*words, cwd=place.parent) for words in json.loads(sys.argv[4])]
there = sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file() and path.name != "ballast")
print(json.dumps({"codes": [one.returncode for one in done], "err": [one.stderr for one in done], "there": there}))
"""


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """A flight's log of some 2 MB."""
    folder = tmp_path_factory.mktemp("flown")
    done = glider("fly", "--mission", "spiral", "--log", "flight.mcap", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "flight.mcap"


def on_disk(tmp_path: Path, size: str, *calls: list[str], ballast: int = 0) -> dict:
    """What comes of commands whose working directory holds `disk`, a file system of this size; skipped without."""
    place = tmp_path / "disk"
    place.mkdir()
    probe = f"mount -t tmpfs none {place} && umount {place}"
    allowed = ["unshare", "-m", "sh", "-c", probe]
    if shutil.which("unshare") is None or subprocess.run(allowed, capture_output=True).returncode:
        pytest.skip("no right to mount file systems here")
    support = str(Path(__file__).parents[1] / "support")
    words = ["unshare", "-m", sys.executable, "-c", SCRIPT, str(place), size, support, json.dumps(calls)]
    done = subprocess.run(words + ([str(ballast)] if ballast else []), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_disk_without_room_is_named_before_anything_is_computed(tmp_path, log):
    shutil.copy(log, tmp_path / "flight.mcap")
    assert glider("log", "export", "flight.mcap", cwd=tmp_path).returncode == 0
    (tmp_path / "commands.csv").write_text("t_s,cmd_servo_rad,cmd_slider_m,cmd_ballast_kg\n0,0,0,0\n")
    calls = [
        ["log", "export", "flight.mcap", "--out", "disk/case"],
        ["gap", "measure", "flight", "--report", "disk/gap.html"],
        ["gap", "diagnose", "flight", "--out", "disk/answer"],
        ["gap", "watch", "flight", "--out", "disk/answer"],
        ["identify", "flight", "--out", "disk/answer"],
        ["campaign", "--out", "disk/campaign"],
        ["reproduce", "fig5", "--out", "disk"],
        ["gap", "challenge", "make", "--out", "disk/blind", "--seed", "1"],
        ["vehicle", "new", "disk/mine.toml"],
    ]  # fmt: skip
    found = on_disk(tmp_path, "200k", *calls)
    for call, code, err in zip(calls, found["codes"], found["err"], strict=True):
        assert code == 2, call
        assert re.fullmatch(r"glider: disk: 0\.2 MB .* 1 MB: .*\n", err), call
    assert found["there"] == []


def test_a_disk_that_fills_while_it_is_written_to_keeps_nothing_half_written(tmp_path, log):
    shutil.copy(log, tmp_path / "flight.mcap")
    found = on_disk(tmp_path, "1200k", ["log", "export", "flight.mcap", "--out", "disk/case"])
    (err,) = found["err"]
    assert found["codes"] == [2]
    assert err == f"glider: disk/case/run00.csv: {NO_SPACE}\n"
    assert found["there"] == []


def test_a_flight_goes_on_and_says_how_much_of_it_can_be_read(tmp_path, log):
    found = on_disk(tmp_path, "300k", ["fly", "--mission", "spiral", "--log", "disk/flight.mcap"])
    (err,) = found["err"]
    assert found["codes"] == [1]
    assert "completed after" in err
    readable, whole = re.search(rf"\({NO_SPACE}\): ([\d.]+)\D+([\d.]+) s", err).groups()
    assert 1.0 < float(readable) < 0.5 * float(whole)


def test_a_place_that_is_none_is_one_line(tmp_path, log):
    shutil.copy(log, tmp_path / "flight.mcap")
    done = glider("log", "export", "flight.mcap", "--out", "flight.mcap/case", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("glider: flight.mcap: ")


def test_an_empty_log_is_none(tmp_path):
    (tmp_path / "empty.mcap").write_bytes(b"")
    for more in ([], ["--json"]):
        done = glider("log", "info", "empty.mcap", *more, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("glider: empty.mcap: ")
