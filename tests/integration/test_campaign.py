"""`glider campaign` as it is typed: the same numbers from every backend, interrupted or not; one line for bad input."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from glider.tools.study.campaign.conduct import fly_campaign
from glider.tools.study.campaign.plan import build_plan, load_campaign, with_options
from tests.support import commands
from tests.support.dask_cluster import dask_cluster

pytestmark = pytest.mark.computes(seconds=20)

SMALL = ("--mission", "spiral", "--seeds", "3", "--controller", "law", "--controller", "pid")


@pytest.fixture(scope="module")
def plan():
    options = {"missions": ["spiral"], "seeds": 3, "controllers": ["law", "pid"]}
    return build_plan(with_options(load_campaign("robustness")[0], options))


@pytest.fixture(scope="module")
def alone(plan):
    """The campaign flown in one process, in one chunk."""
    return fly_campaign(plan, jobs=1, chunk=1000).table


def glider(*arguments, cwd, **options):
    command = [sys.executable, "-m", "glider.tools.cli.main", "campaign", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, **options)


@pytest.mark.parametrize("chunk", [1, 4])
def test_two_processes_and_any_chunks_give_the_same_bits(plan, alone, chunk):
    assert np.array_equal(fly_campaign(plan, jobs=2, chunk=chunk).table, alone, equal_nan=True)


def test_a_dask_cluster_gives_the_same_bits(plan, alone, tmp_path):
    with dask_cluster(tmp_path) as address:
        table = fly_campaign(plan, dask=address, chunk=2).table
        assert np.array_equal(table, alone, equal_nan=True)
        far = ("--dask", address, "--chunk", "2", "--json", "--out", "far")
        done = commands.glider("campaign", *SMALL, *far, cwd=tmp_path)
        from distributed import Client

        with Client(address, set_as_default=False) as client:
            names = client.run(os.getpid)
    assert len(set(names.values())) == 2  # two processes, neither of them this one
    assert os.getpid() not in names.values()
    assert done.returncode == 0, done.stderr
    near = commands.glider("campaign", *SMALL, "--jobs", "1", "--json", "--out", "near", cwd=tmp_path)
    assert (tmp_path / "far" / "flights.csv").read_bytes() == (tmp_path / "near" / "flights.csv").read_bytes()
    assert json.loads(done.stdout)["controllers"] == json.loads(near.stdout)["controllers"]


def gone(group, seconds=20.0):
    """True once no process of a group is left."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


@pytest.mark.parametrize("terminal", [True, False])
def test_interrupted_and_resumed_is_the_same_as_flown_through(plan, alone, tmp_path, terminal):
    command = [
        sys.executable,
        "-m",
        "glider.tools.cli.main",
        "campaign",
        *SMALL,
        "--jobs",
        "2",
        "--chunk",
        "2",
        "--out",
        "c",
    ]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    folder, deadline = tmp_path / "c", time.monotonic() + 60
    while not list(folder.glob("chunk-*.npy")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    with contextlib.suppress(ProcessLookupError):
        if terminal:
            os.killpg(process.pid, signal.SIGINT)  # Ctrl-C reaches the workers too
        else:
            process.terminate()
    out, err = process.communicate(timeout=60)
    assert gone(process.pid), "processes of it are left"
    kept = len(list(folder.glob("chunk-*.npy")))
    assert kept >= 1
    if process.returncode != 0:  # else it was done before the signal came
        assert process.returncode == 130
        assert "Traceback" not in err
        assert out == ""
    resumed = fly_campaign(plan, folder, jobs=1)
    assert resumed.fresh == 6 - 2 * kept
    assert np.array_equal(resumed.table, alone, equal_nan=True)
    assert fly_campaign(plan, folder).fresh == 0


def test_what_a_person_sees(tmp_path):
    done = glider(*SMALL, "--jobs", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("controller mission")
    assert len(done.stdout.splitlines()) == 4
    assert "campaign robustness: 6/6" in done.stderr
    names = {path.name for path in (tmp_path / "robustness-campaign").iterdir()}
    assert names == {"campaign.json", "campaign.html", "chunk-000000.npy", "flights.csv", "summary.json"}
    other = glider(*SMALL, "--spread", "2.5", cwd=tmp_path)
    assert other.returncode == 2
    assert other.stderr.count("\n") == 1
    assert "robustness-campaign: " in other.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nope",), "no campaign 'nope'"),
        (("--mission", "nope"), "no mission 'nope'"),
        (("--controller", "nope"), "nope"),
        (("--seeds", "0"), "seeds"),
        (("--waves", "nan"), "finite number"),
        (("--depth", "2", "1"), "depth_m: expected [low, high]"),
        (("--jobs", "-1"), "-1"),
        (("--dask", "127.0.0.1:1"), "Dask scheduler"),
        (("--dask", "nonsense"), "Dask scheduler"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, said, tmp_path):
    done = commands.glider("campaign", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []
