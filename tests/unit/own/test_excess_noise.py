"""Excess noise and an oscillation as causes: of a boat that was identified, in runs of another simulation of it."""

import numpy as np
import pytest

from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own, plain
from glider.tools.own.identified import write
from glider.tools.own.identify import identify
from glider.tools.own.runs import OwnRun

pytestmark = pytest.mark.computes(seconds=25)

MODEL = """
import numpy as np
inputs = {"thrust": "N", "rudder": "rad"}
outputs = [("speed", "m/s", "speed_m_s", 0.01), ("rate", "rad/s", "rate_rad_s", 0.005)]
parameters = [("damping", "1/s", 0.4, 0.1), ("steering", "1/s2", 0.3, 0.1)]
states = [("v", "m/s"), ("r", "rad/s")]
noises = [("surge", "m/s2", 0.02), ("turn", "rad/s2", 0.02)]
def derivative(x, u, w, theta):
    return np.array([u[0] - theta[0] * x[0] + w[0], theta[1] * u[1] - 0.5 * x[1] + w[1]])
def measure(x, u, theta):
    return np.array([x[0], x[1]])
"""


def flights(count: int, seed: int, noise: float = 1.0, swing: float = 0.0, gain: float = 1.0) -> list[OwnRun]:
    """noise: times the surge's; swing (rad/s2): of an oscillation of 4 s in the turn; gain: of the thrust."""
    random, runs, h = np.random.default_rng(seed), [], 0.02
    t = np.arange(0.0, 40.0, 0.1)
    for n in range(count):
        u = np.repeat(np.column_stack([random.uniform(0.1, 0.3, 8), random.uniform(-0.5, 0.5, 8)]), 50, axis=0)
        x, out, phase = np.array([0.4, 0.0]), [], random.uniform(0.0, 6.3)
        for row in range(len(t)):
            out.append(x + random.normal(0.0, [0.01, 0.005]))
            for k in range(5):
                w = random.standard_normal(2) * 0.02 / np.sqrt(h) * [noise, 1.0]
                w[1] += swing * np.sin(2.0 * np.pi * (t[row] + k * h) / 4.0 + phase)
                x = x + h * (np.array([gain * u[row, 0] - 0.45 * x[0], 0.25 * u[row, 1] - 0.5 * x[1]]) + w)
        runs.append(OwnRun(f"run{n}", t, u, np.array(out)))
    return runs


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noise")
    (folder / "boat.py").write_text(MODEL)
    (folder / "boat.toml").write_text('format = 1\nmodel = "boat"\n[windows]\nseconds = 10.0\n')
    write(identify(load_own(folder / "boat.toml"), [flights(8, 3)]), folder / "out")
    return load_own(folder / "out" / "identified.toml")


@pytest.mark.parametrize(
    ("changes", "first"),
    [
        ({}, "none"),
        ({"noise": 5.0}, "surge_noise"),
        ({"swing": 0.25}, "turn_oscillation"),
        ({"gain": 1.4}, "thrust_gain"),
    ],
    ids=["healthy", "noise", "oscillation", "gain"],
)
def test_it_is_named_where_it_is(vehicle, changes, first):
    found, observer = diagnose_own(vehicle, flights(4, 11, **changes), print)
    answer = plain(vehicle, observer, found, "case")
    assert first in [answer["causes"][0]["label"], *answer["causes"][0]["group"]]  # a linear boat: gains act alike
    assert answer["causes"][0]["probability"] > 0.4
    if first == "surge_noise":
        assert answer["causes"][0]["parameters"][first]["estimate"] == pytest.approx(0.1, rel=0.4)
        assert answer["gap"]["shrinkage"]["value"] is None
    if first == "turn_oscillation":
        assert answer["causes"][0]["parameters"][first]["estimate"] == pytest.approx(0.25 / np.sqrt(2.0), rel=0.4)
