"""Many cases diagnosed: on a cluster that loses a worker, gone on with, the answers the same as of one at a time."""

import json
import os
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.verify.challenge.diagnose_all import run
from glider.tools.verify.challenge.diagnosis import TIMING
from tests.support.cases import make_case
from tests.support.dask_cluster import dask_cluster

pytestmark = pytest.mark.computes(seconds=25)

# 4 in every run of the tests; `GLIDER_MANY_CASES=100 pytest ...` is how a hundred were tried.
CASES, WORKERS = int(os.environ.get("GLIDER_MANY_CASES", "4")), 4


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> Path:
    """A folder of small cases, drag in every other one."""
    root = tmp_path_factory.mktemp("many")
    for n in range(CASES):
        F = np.zeros(ef.N_F)
        F[ef.DRAG_0] = float(n % 2)
        made = make_case(root / "made" / f"{n}", F, seed=n, runs=1)
        shutil.copytree(made.folder, root / "cases" / f"case{n:03d}")
    return root


def kill_one_that_works(connect, address: str, killed: list[int]) -> None:
    """Kill the process of the first worker that is given something to do."""
    with connect(address, set_as_default=False) as client:
        deadline = time.monotonic() + 60.0
        while not killed and time.monotonic() < deadline:
            busy = [worker for worker, keys in client.processing().items() if keys]
            if busy:
                killed.append(client.run(os.getpid, workers=busy[:1])[busy[0]])
                os.kill(killed[0], signal.SIGKILL)
            time.sleep(0.05)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_every_answer_and_the_same(cases, tmp_path):
    from distributed import Client  # here: two threads cannot import it at once

    far, near = tmp_path / "far", tmp_path / "near"
    assert run(cases, near, only=("case000", "case001")) == (2, [])
    shutil.copytree(near / "case000", far / "case000")  # answered before a stop
    kept, killed = (far / "case000" / TIMING).stat().st_mtime_ns, []
    with dask_cluster(tmp_path, WORKERS) as address:
        killer = threading.Thread(target=kill_one_that_works, args=(Client, address, killed))
        killer.start()
        seen: list[int] = []
        assert run(cases, far, dask=address, advance=seen.append) == (CASES - 1, [])
        killer.join()
    assert killed, "no worker was killed"
    assert sum(seen) == CASES
    assert (far / "case000" / TIMING).stat().st_mtime_ns == kept
    for n in range(CASES):
        assert json.loads((far / f"case{n:03d}" / "diagnosis.json").read_text())["causes"]
    for name in sorted(path.name for path in (near / "case001").iterdir() if path.name != TIMING):
        assert (far / "case001" / name).read_bytes() == (near / "case001" / name).read_bytes(), name
    assert not list(far.glob(".*"))


def test_what_fails_is_named_and_the_others_are_answered(cases, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(cases / "cases" / "case000", broken / "case000")
    (broken / "case000" / "case.toml").write_text("format = 2")
    done, wrong = run(broken, tmp_path / "said", jobs=2)
    assert done == 0
    assert len(wrong) == 1
    assert wrong[0].startswith("case000: exit 2: ")
    assert "case.toml" in wrong[0]
    assert str(tmp_path) not in wrong[0]
    assert not list((tmp_path / "said").iterdir())
