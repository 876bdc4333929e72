"""`glider benchmark`: its measures, its JSON, and the plant's rival in C."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.verify.benchmark import plant_speed as plant
from glider.tools.verify.benchmark.registry import MEASURES, Settings, run
from glider.tools.verify.benchmark.timing import alternate, median, process_seconds, seconds
from tests.independent.flights import fly
from tests.independent.make_reference import VEHICLE
from tests.independent.nominal import Glider

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
STEPS = 5000


@pytest.fixture
def c_file(tmp_path):
    """c_file(text) -> path of a C file."""

    def write(text: str) -> Path:
        path = tmp_path / "other.c"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name", MEASURES)
def test_every_measure_can_be_loaded(name):
    assert callable(MEASURES[name].load())
    assert MEASURES[name].line


def test_an_unknown_measure_is_refused():
    with pytest.raises(InputError, match=r"'speed': .*plant, "):
        run(["speed"], Settings())


@needs_cc
def test_plant_flies_what_c_flies():
    result = plant.measure(Settings(repeats=2), STEPS)
    assert result["steps"] == STEPS
    assert result["max_state_difference"] < 1e-9
    assert result["ratio"] == result["steps_per_s"] / result["c_steps_per_s"]
    batch = result["batch"]
    assert 0.0 <= batch["max_state_difference"] < 1e-9
    assert batch["ratio"] == batch["steps_per_s"] / result["c_steps_per_s"]
    assert batch["ratio_fast"] == batch["steps_per_s"] / batch["c_fast_steps_per_s"]
    assert result["final_state"][5] > 2.0 * np.pi  # heading runs on
    assert "note" not in result


@needs_cc
def test_plant_against_the_shared_c(shared):
    source = shared / "limit" / "plant.c"
    if not source.is_file():
        pytest.skip("no plant.c in the shared folder")
    result = plant.measure(Settings(repeats=1, plant_c=source), STEPS)
    assert result["max_state_difference"] < 1e-9


def test_plants_flight_is_the_independent_ones():
    start = np.zeros(15)
    start[2], start[6] = 1.0, 0.2
    times, commands = np.array([0.0, 10.0]), np.tile(plant.COMMANDS, (2, 1))
    reference = fly(Glider.from_file(VEHICLE), start, times, commands)[-1]
    P = plant.decode_vehicle(VEHICLE.read_text(encoding="utf-8"), "roughie").vector()
    np.testing.assert_allclose(plant.final_state(P, 1000), reference, atol=1e-6)


def test_without_a_compiler_c_is_null_and_says_so(monkeypatch):
    monkeypatch.setattr(plant.shutil, "which", lambda name: None)
    result = plant.measure(Settings(repeats=1), STEPS)
    assert result["ratio"] is result["c_steps_per_s"] is result["max_state_difference"] is None
    assert result["batch"]["ratio"] is result["batch"]["ratio_fast"] is None
    assert min(result["steps_per_s"], result["batch"]["steps_per_s"]) > 0.0
    assert "compiler" in result["note"]


@needs_cc
@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("int main(void) { return wrong; }", "does not compile: .*wrong"),
        ("int main(void) { return 3; }", "exit code 3"),
        ("int main(void) { return 0; }", "expected a speed"),
        ('#include <stdio.h>\nint main(void) { puts("1 2 3"); return 0; }', "15 states"),
    ],
)
def test_a_c_file_that_does_not_fly_gets_one_line(c_file, text, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        plant.measure(Settings(repeats=1, plant_c=c_file(text)), 10)
    assert "\n" not in str(caught.value)


@needs_cc
def test_json_holds_the_result_alone(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["glider", "benchmark", "--only", "startup", "--json", "--repeats", "1"])
    assert report_errors(cli) == 0
    result = json.loads(capsys.readouterr().out)
    assert list(result) == ["startup"]
    assert 0.0 < result["startup"]["help_s"] < 10.0


def test_figures_for_people(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["glider", "benchmark", "--only", "memory,startup,memory", "--repeats", "1"])
    assert report_errors(cli) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["memory.flight_rss_mb", "startup.help_s", "startup.first_tick_s"]


@pytest.mark.parametrize(
    "options", [["--only", "speed"], ["--only", "memory,speed"], ["--repeats", "0"], ["--plant-c", "nowhere.c"]]
)
def test_bad_usage(monkeypatch, capsys, options):
    monkeypatch.setattr(sys, "argv", ["glider", "benchmark", *options])
    assert report_errors(cli) == 2
    assert capsys.readouterr().out == ""


def test_turns_are_taken():
    order: list[str] = []
    a, b = alternate(3, lambda: order.append("a") or 1, lambda: order.append("b") or 2)
    assert (a, b) == ([1, 1, 1], [2, 2, 2])
    assert "".join(order) == "ababab"


def test_times():
    assert median([3.0, 1.0, 2.0]) == 2.0
    assert median([1.0, 2.0]) == 1.5
    assert 0.0 <= seconds(lambda: None) < 1.0
    assert 0.0 < process_seconds([sys.executable, "-S", "-c", "pass"]) < 10.0
