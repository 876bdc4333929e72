"""`import glider` costs nothing: what flies imports it with every module."""

import subprocess
import sys
import time

import pytest

import glider
from glider.tools import api

HEAVY = ("numba", "numpy", "scipy", "matplotlib", "msgspec", "click")


def test_the_import_loads_nothing_and_is_quick():
    program = (
        "import sys, time; before = set(sys.modules); began = time.perf_counter(); import glider\n"
        "print(time.perf_counter() - began, *sorted(set(sys.modules) - before))"
    )
    seconds = []
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        took, *loaded = done.stdout.split()
        assert loaded == ["glider"]
        seconds.append(float(took))
    assert min(seconds) < 0.1


def test_a_process_that_outlives_a_flight_gets_no_more_by_the_api():
    program = f"import sys, glider.hal.outofband; print([one for one in {HEAVY} if one in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_is_there_once_and_listed():
    assert sorted(glider.__all__) == sorted(api.__all__)
    assert set(glider.__all__) <= set(dir(glider))
    for name in glider.__all__:
        assert getattr(glider, name) is getattr(api, name)
        assert getattr(glider, name).__doc__
    with pytest.raises(AttributeError, match="'nothing'"):
        glider.nothing  # noqa: B018


def test_names_are_found_in_little_time():
    began = time.perf_counter()
    assert glider.vehicles().names
    assert time.perf_counter() - began < 5.0
