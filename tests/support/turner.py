"""A vehicle that a motor turns, of a user's own: its model, its file, and runs of it with a lag or in rough weather."""

from pathlib import Path
from types import ModuleType

import numpy as np

from glider.tools.own.runs import OwnRun
from tests.support.own_vehicle import flown, module_of

FILE = {"damping": (0.5, 0.2), "push": (1.0, 0.3)}
TRUE = {"damping": 0.4, "push": 1.2}
MODEL = f"""
import numpy as np
inputs = {{"motor": "1"}}
outputs = [
    {{"name": "heading", "unit": "rad", "noise": 0.003, "tolerance": 0.03}},
    {{"name": "rate", "unit": "rad/s", "column": "r_rad_s", "noise": 0.003, "tolerance": 0.03}},
]
parameters = [(name, "1", *known) for name, known in {FILE}.items()]
states = [("psi", "rad"), ("r", "rad/s")]
noises = [("moment", "rad/s2", 0.01)]
def derivative(x, u, w, theta):
    return np.array([x[1], theta[1] * u[0] - theta[0] * x[1] + w[0]])
def measure(x, u, theta):
    return np.array([x[0], x[1]])
"""


def written(folder: Path) -> ModuleType:
    """turner.py and turner.toml in a folder, and the model."""
    (folder / "turner.py").write_text(MODEL)
    (folder / "turner.toml").write_text('format = 1\nmodel = "turner"\n')
    return module_of(folder / "turner.py")


def turned(
    model: ModuleType, seed: int, lag: float = 0.0, count: int = 6, damping: float = TRUE["damping"],
    push: float = TRUE["push"], rough: float = 1.0,
) -> list[OwnRun]:  # fmt: skip
    """Runs of a minute each under steps of the motor, which the vehicle follows with a lag, s; rough: times the usual
    disturbances."""
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        t = 0.1 * np.arange(601)
        asked = np.repeat(rng.uniform(-0.5, 0.5, 21), 30)[:601, None]
        follows = asked.copy()
        for row in range(1, len(t) if lag else 0):
            follows[row] = follows[row - 1] + (asked[row - 1] - follows[row - 1]) * -np.expm1(-0.1 / lag)
        outputs = flown(model, np.array([damping, push]), t, follows, np.zeros(2), rng, rough)
        found.append(OwnRun(f"run{k}", t, asked, outputs + 0.003 * rng.normal(size=outputs.shape), None))
    return found
