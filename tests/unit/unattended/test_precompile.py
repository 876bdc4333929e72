"""Kernels compiled ahead: said with progress, once for a version, by one of the processes that ask at the same time."""

import contextlib
import fcntl
import os
import shutil
import subprocess
import sys
import threading
import time

import pytest
from numba.core import event

from glider.firmware.core import jit
from glider.tools.flight import precompile


@pytest.fixture
def work(tmp_path, monkeypatch):
    """Work with an empty cache whose kernels take a moment to compile, and how often it was asked to."""
    compiled, kernels = [], [object() for _ in range(4)]

    def call():
        compiled.append(1)
        for kernel in kernels:
            event.end_event("numba:compile", {"dispatcher": kernel})
            time.sleep(0.02)

    monkeypatch.setattr(jit, "CACHE_DIR", tmp_path)
    return precompile.Work("moment", lambda: 4, call), compiled


def ask(work: precompile.Work, said: list[str]) -> None:
    @contextlib.contextmanager
    def progress(label, total):
        done = []
        yield done.append
        said.append(f"{label}: {sum(done)}/{total}")

    precompile.ensure_compiled(work, said.append, progress)


def test_the_first_flight_says_that_it_compiles_the_second_nothing(work):
    (work, compiled), said = work, []
    assert not work.stamp().exists()
    ask(work, said)
    heads = [text.split(",")[0] for text in said]
    assert heads[1:] == ["compiling: 4/4", "compiled in 0 s"]
    assert work.stamp().exists()
    ask(work, said)
    assert (len(said), len(compiled)) == (3, 1)


def test_of_several_at_once_one_compiles_and_the_others_say_that_they_wait(work, tmp_path):
    (work, compiled), said = work, []
    with open(tmp_path / "compiling-moment.lock", "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        asking = [threading.Thread(target=ask, args=(work, said)) for _ in range(3)]
        for one in asking:
            one.start()
        deadline = time.monotonic() + 20.0
        while len(said) < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert len(said) == 3
        assert compiled == []
    for one in asking:
        one.join(timeout=20.0)
    assert len(compiled) == 1


def test_without_a_compiler_there_is_nothing_to_wait_for(work, monkeypatch):
    monkeypatch.setattr(jit, "CACHE_DIR", None)
    (work, compiled), said = work, []
    ask(work, said)
    assert said == compiled == []


def test_another_checkout_has_a_stamp_of_its_own(work, tmp_path, monkeypatch):
    """Numba's cache knows kernels by where their source stands."""
    own = work[0].stamp()
    monkeypatch.setattr(jit, "PACKAGES_DIR", tmp_path)
    assert work[0].stamp() != own


def test_what_a_command_compiles_on_the_way_writes_nothing_into_its_result(tmp_path):
    """From a cache that lacks a kernel: the process beside it counts what it compiles to nobody."""
    assert jit.CACHE_DIR is not None
    cache = shutil.copytree(jit.CACHE_DIR, tmp_path / jit.CACHE_DIR.name)
    for lacking in cache.rglob("filter.follow_runs-*"):
        lacking.unlink()
    code = (
        "import subprocess, sys\n"
        "from glider.tools.diagnose import precompile\n"
        "class Stop(Exception): pass\n"
        "def blank(folder):\n"
        "    raise Stop\n"
        "precompile._blank = blank\n"
        "made = []\n"
        "popen = subprocess.Popen\n"
        "subprocess.Popen = lambda *words, **more: made.append(popen(*words, **more)) or made[-1]\n"
        "try:\n"
        "    precompile._diagnose_a_moment()\n"
        "except Stop:\n"
        "    sys.exit(made[0].wait())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "GLIDER_CACHE_DIR": str(tmp_path)}, capture_output=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == b""
    assert list(cache.rglob("filter.follow_runs-*.nbi"))  # something was compiled
