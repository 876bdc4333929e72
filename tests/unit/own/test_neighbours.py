"""A model in more than one file: compiled, seen to change, taken along with what is written elsewhere."""

import json
import subprocess
import sys
import textwrap

import pytest

from glider.tools.data.errors import InputError
from glider.tools.own.check import load_own
from glider.tools.own.compiled import PLAIN
from glider.tools.own.neighbours import neighbours
from tests.support.commands import glider
from tests.support.own_vehicle import module_of, write_case

MODEL = """
    from drags import quadratic
    from parts import units
    inputs = {"thrust": "N"}
    outputs = [{"name": "speed", "unit": "m/s", "noise": 0.01}]
    parameters = [("drag", "N s2/m2", 2.0, 0.5)]
    states = [("v", "m/s")]
    noises = [("surge", "m/s2", 0.01)]
    def derivative(x, u, w, theta):
        return (u - quadratic(theta[0], x[0])) / units.MASS + w[0]
    def measure(x, u, theta):
        return x + 0.0
    def initial(y):
        import numpy
        return numpy.array([y["speed"]]), numpy.array([0.02])
"""
QUADRATIC = "def quadratic(drag, v):\n    return drag * abs(v) * v"
FILES = {
    "boat.py": MODEL,
    "drags.py": """
        import math
        from parts.units import size
        def quadratic(drag, v):
            return size(drag) * math.fabs(v) * v
    """,
    "parts/__init__.py": "",
    "parts/units.py": """
        MASS = 3.0
        def size(drag):
            return drag
    """,
    "other.py": "raise RuntimeError('nobody imports this')",
    "boat.toml": """
        format = 1
        model = "boat"
        [windows]
        seconds = 5.0
    """,
}


@pytest.fixture
def boat(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(textwrap.dedent(text))
    return tmp_path


def inputs(random, t):
    return random.uniform(0.5, 3.0, (len(t) // 50 + 1, 1)).repeat(50, axis=0)[: len(t)]


def test_what_it_imports_from_its_folder_is_known(boat):
    found = [str(one.relative_to(boat)) for one in neighbours(boat / "boat.py")]
    assert sorted(found) == ["drags.py", "parts/__init__.py", "parts/units.py"]


@pytest.fixture
def healthy(boat, monkeypatch):
    """Four runs of a boat that drags more than its file says."""
    monkeypatch.syspath_prepend(boat)
    for name in ("drags", "parts", "parts.units"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return write_case(boat / "healthy", module_of(boat / "boat.py"), inputs, runs=4, seed=1, vehicle="../boat.toml",
                      changes={"drag": 2.4})  # fmt: skip


def test_it_is_compiled_and_a_change_in_any_of_its_files_is_seen(boat, healthy, monkeypatch):
    gaps = []
    for drag, plain in (("drag", ""), ("2.0 * drag", ""), ("2.0 * drag", "1")):
        monkeypatch.setenv(PLAIN, plain)
        (boat / "parts" / "units.py").write_text(f"MASS = 3.0\ndef size(drag):\n    return {drag}\n")
        checked = glider("vehicle", "check", "boat.toml", "--json", cwd=boat)
        assert json.loads(checked.stdout)["compiled"] == (not plain)
        done = glider("gap", "measure", healthy, "--json", cwd=boat)
        assert done.returncode == 0, done.stderr
        gaps.append(sum(one["total"] for one in json.loads(done.stdout)["runs"]))
    assert gaps[1] > 2.0 * gaps[0]
    assert gaps[1] == pytest.approx(gaps[2], rel=1e-6)


def test_an_error_in_one_of_them_names_that_file_and_its_line(boat):
    (boat / "parts" / "units.py").write_text("import math\ndef size(drag):\n    return math.sqrt(-1.0 - drag)\n")
    with pytest.raises(InputError, match=r"units\.py:3: .*ValueError"):
        load_own(boat / "boat.toml")


@pytest.mark.parametrize("linked", [True, False])
def test_a_model_that_lies_elsewhere_is_found_from_where_its_vehicle_is_written(boat, healthy, linked):
    """By a link beside its vehicle, or named by its path."""
    (boat / "vehicles").mkdir()
    text = (boat / "boat.toml").read_text()
    if linked:
        (boat / "vehicles" / "boat.py").symlink_to(boat / "alone.py")
    (boat / "alone.py").write_text(textwrap.dedent(MODEL).replace("from drags import quadratic", QUADRATIC)
                                   .replace("from parts import units", "").replace("units.MASS", "3.0"))  # fmt: skip
    (boat / "vehicles" / "boat.toml").write_text(text if linked else text.replace('"boat"', '"../alone"'))
    done = glider("identify", healthy, "--vehicle", "vehicles/boat.toml", "--out", "deep/identified", cwd=boat)
    assert done.returncode == 0, done.stderr
    asked = glider("gap", "measure", healthy, "--vehicle", "deep/identified/identified.toml", "--json", cwd=boat)
    assert asked.returncode == 0, asked.stderr


def test_all_of_it_is_taken_along_where_a_vehicle_is_written(boat, healthy, tmp_path_factory):
    done = glider("identify", healthy, "--out", "identified", cwd=boat)
    assert done.returncode == 0, done.stderr
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "moved"
    (boat / "identified").rename(elsewhere)
    assert not (elsewhere / "other.py").exists()
    for one in boat.glob("*.py"):
        one.unlink()
    asked = glider("gap", "diagnose", healthy, "--vehicle", "identified.toml", "--out", "said", "--json", cwd=elsewhere)
    assert asked.returncode == 0, asked.stderr
    again = glider("gap", "measure", healthy, "--vehicle", "said/corrected.toml", "--json", cwd=elsewhere)
    assert again.returncode == 0, again.stderr


def test_functions_that_the_user_compiled_and_keeps_are_found_by_a_later_process(boat):
    """Numba's cache names the module that they are of."""
    twice = "@numba.njit(cache=True)\ndef twice(x):\n    return 2.0 * x\ndef derivative"
    text = (boat / "boat.py").read_text().replace("def derivative", twice).replace("units.MASS", "twice(units.MASS)")
    (boat / "boat.py").write_text("import numba\n" + text)
    for _ in range(2):
        words = [sys.executable, "-m", "glider.tools.cli.main", "vehicle", "check", "boat.toml"]
        done = subprocess.run(words, cwd=boat, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
