"""A simulator in a process of its own, asked by lines."""

import sys
import textwrap

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.own.check import load_own
from glider.tools.own.healthy import healthy_of
from glider.tools.own.identified import VEHICLE, write
from glider.tools.own.identify import identify
from glider.tools.own.noise_hypotheses import posterior_of
from glider.tools.own.observers import observer_of
from glider.tools.own.posterior import Engine
from glider.tools.own.runs import OwnRun

SIMULATOR = """
import json, math, sys
for line in sys.stdin:
    asked = json.loads(line)
    if asked["ask"] == "declaration":
        answer = {"inputs": {"heat": "W"}, "outputs": [{"name": "warmth", "unit": "K", "tolerance": 0.5}],
                  "parameters": [["loss", "1/s", 0.2, 0.1], ["gain", "K/J", 0.5, 0.0]], "horizon": 20.0}
    else:
        t, u, (loss, gain), y = asked["t"], asked["u"], asked["theta"], asked["x0"]["warmth"]
        rows = []
        for k in range(len(t)):
            rows.append([y])
            if k + 1 < len(t):
                share = math.exp(-loss * (t[k + 1] - t[k]))
                y = share * y + (1.0 - share) * gain * u[k][0] / loss
        answer = {"y": rows}
    print(json.dumps(answer), flush=True)
"""


def runs(count, loss, seed, factor=1.0):
    """A body that warms under steps of heat."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 0.5)
    made = []
    for n in range(count):
        u, y, warmth = np.repeat(random.uniform(0.0, 10.0, 12), 10), [], 0.0
        for k in range(len(t)):
            y.append(warmth)
            share = np.exp(-loss * 0.5)
            warmth = share * warmth + (1.0 - share) * 0.5 * factor * u[k] / loss
        made.append(OwnRun(f"run{n}", t, u[:, None], (np.array(y) + 0.05 * random.standard_normal(len(t)))[:, None]))
    return made


@pytest.fixture
def simulator(tmp_path):
    (tmp_path / "body.py").write_text(textwrap.dedent(SIMULATOR))
    (tmp_path / "body.toml").write_text(f'format = 1\nmodel = "exec:{sys.executable} body.py"\n')
    return tmp_path / "body.toml"


def test_a_black_box_is_identified_and_a_weaker_heater_is_its_gain(simulator):
    vehicle = load_own(simulator)
    assert vehicle.level == 0
    assert [one.name for one in vehicle.declared.parameters] == ["loss", "gain"]
    found = identify(vehicle, [runs(4, 0.3, 1)])
    loss = 0.2 + found.values[0] * found.nuisance[0].spread
    assert loss == pytest.approx(0.3, abs=0.02)
    assert found.better
    write(found, simulator.parent / "identified")
    again = load_own(simulator.parent / "identified" / VEHICLE)
    observer = observer_of(again, runs(3, 0.3, 2, factor=0.7))
    chances = posterior_of(Engine(observer, healthy_of(observer))).chances
    assert sum(chances[label] for label in ("heat_gain", "gain", "warmth_gain")) > 0.8  # from rest they act alike


def test_a_file_that_no_fit_betters_keeps_its_numbers_and_has_what_runs_leave(simulator):
    vehicle = load_own(simulator)
    found = identify(vehicle, [runs(4, 0.2, 1)])
    assert not found.better
    write(found, simulator.parent / "identified")
    again = load_own(simulator.parent / "identified" / VEHICLE)
    loss = again.declared.parameters[0]
    far = found.values[0] * found.nuisance[0].spread
    assert loss.value == 0.2
    assert abs(far) < loss.uncertainty < 0.05  # the file has 0.1
    for factor, right in ((1.0, ("none",)), (0.95, ("heat_gain", "gain", "warmth_gain"))):
        observer = observer_of(again, runs(3, 0.2, 2, factor))
        chances = posterior_of(Engine(observer, healthy_of(observer))).chances
        assert sum(chances[label] for label in right) > 0.8


def test_a_process_that_ends_or_mumbles_is_named(tmp_path):
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "exec:echo hello"\n')
    with pytest.raises(InputError, match=r"JSON.*'hello'"):
        load_own(tmp_path / "v.toml")
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "exec:nothing-of-this-name"\n')
    with pytest.raises(InputError, match="nothing-of-this-name: "):
        load_own(tmp_path / "v.toml")
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "exec:true"\n')
    with pytest.raises(InputError, match="ended"):
        load_own(tmp_path / "v.toml")
