"""The observer's kernels compiled ahead (tools/flight/precompile): once for all models, whose own functions are
compiled when they are loaded."""

import tempfile
from pathlib import Path

import numpy as np

from glider.tools.flight.precompile import Work
from glider.tools.own.load import read_own
from glider.tools.own.near import errors_near
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun
from glider.tools.own.skeleton import write_skeleton

IDLE_ROWS = 50
COMPILED_KERNELS = 120  # kernels, with what of NumPy Numba compiles for them


def _observe_a_moment() -> None:
    """A model as it is begun from, along a run in which nothing happens."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "vehicle.toml")
        write_skeleton(path)
        vehicle = read_own(path)
        t = 0.1 * np.arange(IDLE_ROWS)
        run = OwnRun("run00", t, np.zeros((IDLE_ROWS, len(vehicle.declared.inputs))),
                     np.zeros((IDLE_ROWS, len(vehicle.declared.outputs))))  # fmt: skip
        observer = observer_of(vehicle, [run])
        by = observer.filter(0, observer.point)
        observer.predict(0, observer.point, observer.horizon, observer.follow(0, observer.point, by))
        errors_near(observer, 0, [observer.point, observer.point], by, observer.horizon)


OBSERVER = Work("model", lambda: COMPILED_KERNELS, _observe_a_moment)
