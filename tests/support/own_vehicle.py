"""Cases of a user's vehicle flown by its own model, with noise and something wrong, for tests."""

import importlib.util
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from glider.tools.data.runs import csvfile
from glider.tools.own.declare import declaration


def module_of(path: Path) -> ModuleType:
    """A model's file, imported."""
    spec = importlib.util.spec_from_file_location(f"own_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def flown(
    model: ModuleType, theta: np.ndarray, t: np.ndarray, u: np.ndarray, x: np.ndarray, random, rough: float
) -> np.ndarray:
    """Outputs (rows, outputs) by Runge and Kutta in ten parts a row, with accelerations that wander."""
    declared = declaration(model)
    out = []
    for row in range(len(t)):
        out.append(model.measure(x, u[row], theta))
        if row + 1 == len(t):
            break
        h = (t[row + 1] - t[row]) / 10.0
        density = np.array([one.density for one in declared.noises])
        w = rough * density * random.standard_normal(len(density)) / np.sqrt(10.0 * h)
        for _ in range(10):
            a = model.derivative(x, u[row], w, theta)
            b = model.derivative(x + 0.5 * h * a, u[row], w, theta)
            c = model.derivative(x + 0.5 * h * b, u[row], w, theta)
            d = model.derivative(x + h * c, u[row], w, theta)
            x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return np.array(out)


def write_case(
    folder: Path, model: ModuleType, inputs: Callable[[np.random.Generator, np.ndarray], np.ndarray], *, runs: int,
    seed: int, vehicle: str, seconds: float = 30.0, rate: float = 10.0, rough: float = 1.0, start: Sequence[float] = (),
    changes: Mapping[str, float] | None = None, scatter: float = 0.02,
    driven: Callable[[int, np.ndarray], np.ndarray] = lambda n, u: u,
    read: Callable[[int, np.ndarray], np.ndarray] = lambda n, y: y,
    theta_of: Callable[[int, np.ndarray], np.ndarray] = lambda n, theta: theta,
) -> Path:  # fmt: skip
    """A case: runs with recorded inputs as drawn, flown with what `driven`, `read`, `theta_of` make of them.

    changes: parameters in place of the model's; scatter: of its uncertainty, by which runs differ.
    """
    declared = declaration(model)
    folder.mkdir(parents=True)
    random = np.random.default_rng(seed)
    values = np.array([(changes or {}).get(one.name, one.value) for one in declared.parameters])
    spread = np.array([one.uncertainty for one in declared.parameters])
    noise = np.array([one.noise or 0.0 for one in declared.outputs])
    t = np.arange(0.0, seconds, 1.0 / rate)
    for n in range(runs):
        u = inputs(random, t)
        theta = theta_of(n, values + scatter * spread * random.standard_normal(len(values)))
        x = np.array(start or np.zeros(len(declared.states)), dtype=float)
        y = read(n, flown(model, theta, t, driven(n, u.copy()), x, random, rough))
        y = y + noise * random.standard_normal(y.shape)
        texts = {"t_s": [f"{value:.3f}" for value in t]}
        texts |= {one.column: [f"{v:.6g}" for v in u[:, k]] for k, one in enumerate(declared.inputs)}
        texts |= {one.column: ["" if np.isnan(v) else f"{v:.6g}" for v in y[:, k]]
                  for k, one in enumerate(declared.outputs)}  # fmt: skip
        csvfile.write_table(folder / f"run{n:02d}.csv", texts)
    (folder / "case.toml").write_text(
        f'format = 1\nvehicle = "{vehicle}"\nsite = "simulated"\nlog_rate_hz = {rate}\nruns = {runs}\n'
    )
    return folder
