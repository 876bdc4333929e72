"""Kernels compiled ahead: said with progress, once for a version, by one of the processes that ask at the same time."""

import contextlib
import fcntl
import threading
import time

import pytest

from firmware.core import jit
from tools.flight import precompile


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, and a compiler that takes a moment; what was said, and how often it compiled."""
    said, compiled = [], []

    def compile_all(advance):
        compiled.append(1)
        for _ in range(4):
            advance(1)
            time.sleep(0.02)
        precompile._stamp().touch()
        return {"folder": str(tmp_path), "kernels": 4, "seconds": 0.1}

    monkeypatch.setattr(jit, "CACHE_DIR", tmp_path)
    monkeypatch.setattr(precompile, "compile_all", compile_all)
    monkeypatch.setattr(precompile, "count_kernels", lambda: 4)
    return said, compiled


def ask(said: list[str]) -> None:
    @contextlib.contextmanager
    def progress(label, total):
        done = []
        yield done.append
        said.append(f"{label}: {sum(done)}/{total}")

    precompile.ensure_compiled(said.append, progress)


def test_the_first_flight_says_that_it_compiles_the_second_nothing(cache):
    said, compiled = cache
    assert not precompile._stamp().exists()
    ask(said)
    assert [text.split(",")[0] for text in said] == ["compiling the kernels", "compiling: 4/4", "compiled in 0 s"]
    assert precompile._stamp().exists()
    ask(said)
    assert (len(said), len(compiled)) == (3, 1)


def test_of_several_at_once_one_compiles_and_the_others_say_that_they_wait(cache, tmp_path):
    said, compiled = cache
    with open(tmp_path / "compiling.lock", "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        asking = [threading.Thread(target=ask, args=(said,)) for _ in range(3)]
        for one in asking:
            one.start()
        deadline = time.monotonic() + 20.0
        while len(said) < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert said == ["another process is compiling the kernels: waiting for it"] * 3
        assert compiled == []
    for one in asking:
        one.join(timeout=20.0)
    assert len(compiled) == 1


def test_without_a_compiler_there_is_nothing_to_wait_for(cache, monkeypatch):
    monkeypatch.setattr(jit, "CACHE_DIR", None)
    said, compiled = cache
    ask(said)
    assert said == compiled == []
