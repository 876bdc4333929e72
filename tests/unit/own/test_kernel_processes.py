"""A model in plain Python flown in other processes: the same answers, errors as they are, a process that dies."""

import numba
import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.own import kernel_processes
from glider.tools.own.compiled import PLAIN
from glider.tools.own.load import read_own
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun

CART = """
import math
import numpy as np
inputs = {"push": "N"}
outputs = [("place", "m", "place_m", 0.1)]
parameters = [("damping", "1/s", 0.4, 0.1), ("mass", "kg", 2.0, 0.2)]
states = [("x", "m"), ("v", "m/s")]
noises = [("shove", "m/s2", 0.3)]
def derivative(x, u, w, theta):
    print("flown")
    return np.array([x[1], u[0] / theta[1] - math.sqrt(theta[0]) * x[1] + w[0]])
def measure(x, u, theta):
    return np.array([x[0]])
"""


@pytest.fixture
def observer(tmp_path, monkeypatch):
    monkeypatch.setenv(PLAIN, "1")
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 2)
    (tmp_path / "cart.py").write_text(CART)
    (tmp_path / "cart.toml").write_text('format = 1\nmodel = "cart"\n[windows]\nseconds = 2.0\n')
    t = np.arange(0.0, 6.0, 0.1)
    runs = [OwnRun(f"run{n}", t, np.full((len(t), 1), 0.2 * n), (0.01 * n * t**2)[:, None]) for n in range(4)]
    return observer_of(read_own(tmp_path / "cart.toml"), runs)


@pytest.fixture
def processes(observer, monkeypatch):
    """Those of its kernels, that are started without a wait."""
    monkeypatch.setattr(kernel_processes, "START_AFTER", -1.0)
    started = observer.vehicle.kernels.at_once.__self__
    yield started
    while not started.free.empty():
        started.free.get().kill()


def flown(observer, point=None) -> list[np.ndarray]:
    """Filters and windows of all runs."""
    point = point or observer.point

    def of_run(n: int) -> np.ndarray:
        by = observer.filter(n, point, covariances=True, linear=True)
        return np.concatenate([by.gains.ravel(), by.linear.ravel(), by.covariances.ravel(), [by.value],
                               observer.residuals(n, [point], by, 2.0).ravel()])  # fmt: skip

    return observer.each_run(of_run)


def test_they_answer_as_one_process_does(observer, processes):
    observer.filter(0, observer.point)
    assert processes.count == 0
    before, spent = flown(observer), processes.seconds
    assert processes.count == 2
    assert processes.seconds == spent  # nothing more was flown here
    assert np.isfinite(before).mean() > 0.9  # all but what is before the first row
    for one in (processes.free.get(), processes.free.get()):
        one.kill()
    assert np.array_equal(before, flown(observer), equal_nan=True)
    assert processes.seconds > spent


def test_one_that_died_is_done_without(observer, processes):
    before = flown(observer)
    for _ in range(2):
        one = processes.free.get()
        one.kill()
        one.wait()
        processes.free.put(one)
    assert np.array_equal(before, flown(observer), equal_nan=True)
    assert processes.free.empty()


def test_what_the_model_raises_there_is_said_with_its_line(observer, processes):
    flown(observer)
    point = observer.point.copy()
    point.theta[0] = -1.0
    with pytest.raises(InputError, match=r"cart\.py:11: run\d: ValueError"):
        flown(observer, point)
    assert processes.free.qsize() == 2  # and they go on
