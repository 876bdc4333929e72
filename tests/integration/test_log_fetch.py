"""`glider log fetch` over a real sshd: whole, after a cable was pulled, of a log that still grows, of a foreign one."""

import errno
import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.sshd import NAME, sshd

ROOT = Path(__file__).resolve().parents[2]
LONG = 3_000_000


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with sshd(tmp_path_factory.mktemp("keys")) as found:
        yield found


@pytest.fixture
def aboard(tmp_path):
    """A vehicle's folder: two logs, and what is none."""
    folder = tmp_path / "aboard"
    folder.mkdir()
    (folder / "dive-001.mcap").write_bytes(random.Random(1).randbytes(20_000))
    (folder / "dive-002.mcap").write_bytes(random.Random(2).randbytes(LONG))
    (folder / "notes.txt").write_text("mine\n")
    (folder / "a \x1b[2Jname.mcap").write_bytes(b"steers the terminal")
    return folder


@pytest.fixture
def fetch(server, aboard, tmp_path):
    def call(*words, **cable):
        command = [sys.executable, "-m", "glider.tools.cli.main", "log", "fetch", NAME, *words]
        command += ["--dir", aboard, "--out", tmp_path / "here", "--json"]
        environment = server.reached(**cable) | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
        found = json.loads(done.stdout)
        return done.returncode, {one["name"]: one["became"] for one in found["logs"]}, found["message"]

    return call


def test_all_logs_once_and_nothing_touched_aboard(fetch, aboard, tmp_path):
    before = {path: path.stat().st_mtime_ns for path in [aboard, *aboard.iterdir()]}
    assert fetch() == (0, {"dive-001.mcap": "fetched", "dive-002.mcap": "fetched"}, "")
    for name in ("dive-001.mcap", "dive-002.mcap"):
        assert (tmp_path / "here" / name).read_bytes() == (aboard / name).read_bytes()
    assert fetch("dive-001", "nothing-*") == (0, {"dive-001.mcap": "here"}, "")
    assert {path: path.stat().st_mtime_ns for path in [aboard, *aboard.iterdir()]} == before
    assert sorted(os.listdir(tmp_path / "here")) == ["dive-001.mcap", "dive-002.mcap"]


def test_after_a_cable_was_pulled_it_goes_on_where_it_was(fetch, aboard, tmp_path):
    code, became, message = fetch(back=LONG // 2)
    assert (code, became) == (1, {"dive-001.mcap": "fetched"})
    assert "again" in message
    part = tmp_path / "here" / "dive-002.mcap.part"
    kept = part.stat().st_size
    assert 0 < kept < LONG
    assert part.read_bytes() == (aboard / "dive-002.mcap").read_bytes()[:kept]
    # A cable that would not hold for the whole of it.
    code, became, message = fetch(back=LONG - kept // 2)
    assert (code, became) == (0, {"dive-001.mcap": "here", "dive-002.mcap": "fetched"}), message
    assert (tmp_path / "here" / "dive-002.mcap").read_bytes() == (aboard / "dive-002.mcap").read_bytes()


def test_a_log_that_grew_is_fetched_on_and_a_foreign_one_stays(fetch, aboard, tmp_path):
    fetch("dive-001")
    with (aboard / "dive-001.mcap").open("ab") as file:
        file.write(b"and on")
    assert fetch("dive-001")[1] == {"dive-001.mcap": "grew"}
    (tmp_path / "here" / "dive-001.mcap").write_bytes(b"somebody's own")
    code, became, _ = fetch("dive-001")
    assert (code, became) == (1, {"dive-001.mcap": "refused"})
    assert (tmp_path / "here" / "dive-001.mcap").read_bytes() == b"somebody's own"
    # Damaged on its way, or the beginning of another one: begun anew.
    (tmp_path / "here" / "dive-001.mcap").rename(tmp_path / "here" / "dive-001.mcap.part")
    assert fetch("dive-001")[1] == {"dive-001.mcap": "fetched"}


def test_what_is_not_there_is_said_in_a_line(fetch, aboard):
    assert "spiral-*" in fetch("spiral-*")[2]
    aboard.rename(aboard.with_name("gone"))
    code, became, message = fetch()
    assert (code, became) == (1, {})
    assert os.strerror(errno.ENOENT) in message or "can't cd" in message
