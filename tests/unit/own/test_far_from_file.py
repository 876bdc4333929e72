"""Identification from a file whose vehicle is far from the one that flew: it tumbles where that did not."""

import numpy as np
import pytest

from glider.tools.own.check import load_own
from glider.tools.own.identify import identify
from glider.tools.own.runs import OwnRun
from tests.support.own_vehicle import flown, module_of

TRUE = {"righting": 2.0, "damping": 0.3, "square": 0.8}
FILE = {"righting": (1.0, 0.6), "damping": (0.1, 0.3), "square": (0.3, 0.3)}
MODEL = f"""
import math
import numpy as np
inputs = {{"torque": "rad/s2"}}
outputs = [
    {{"name": "pitch", "unit": "rad", "noise": 0.003, "tolerance": 0.03, "angle": True}},
    {{"name": "rate", "unit": "rad/s", "column": "q_rad_s", "noise": 0.003, "tolerance": 0.03}},
]
parameters = [(name, "1", *known) for name, known in {FILE}.items()]
states = [("angle", "rad", "angle"), ("q", "rad/s")]
noises = [("moment", "rad/s2", 0.01)]
def derivative(x, u, w, theta):
    drag = theta[1] * x[1] + theta[2] * x[1] * abs(x[1])
    return np.array([x[1], u[0] - theta[0] * math.sin(x[0]) - drag + w[0]])
def measure(x, u, theta):
    return np.array([x[0], x[1]])
"""


def flights(model, rng: np.random.Generator, count: int) -> list[OwnRun]:
    """One minute each under torques that change every five seconds; every third turns the file's vehicle over."""
    found = []
    for k in range(count):
        t, largest = 0.1 * np.arange(601), 1.6 if k % 3 == 0 else 0.56
        torque = np.repeat(rng.uniform(-largest, largest, 13), 50)[:601, None]
        outputs = flown(model, np.array(list(TRUE.values())), t, torque, np.zeros(2), rng, 1.0)
        found.append(OwnRun(f"run{k}", t, torque, outputs + 0.003 * rng.normal(size=outputs.shape), None))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("far")
    (folder / "tumbler.py").write_text(MODEL)
    (folder / "tumbler.toml").write_text('format = 1\nmodel = "tumbler"\n')
    return folder


def test_flights_in_which_the_model_tumbles_do_not_hold_up_the_others(folder):
    runs = flights(module_of(folder / "tumbler.py"), np.random.default_rng(7), 6)
    found = identify(load_own(folder / "tumbler.toml"), [runs])
    assert found.before.max() > 20.0
    assert found.after.max() < 1.0
    for effect, value, sd in zip(found.nuisance, found.values, np.sqrt(np.diag(found.covariance)), strict=True):
        if effect.name in TRUE:
            size = FILE[effect.name][0] + effect.spread * value
            assert size == pytest.approx(TRUE[effect.name], rel=0.05), effect.name
            assert abs(size - TRUE[effect.name]) < 3.0 * effect.spread * sd
