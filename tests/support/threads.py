"""Every kernel whose loop is shared out over threads, called with one thread and with two: do the bits agree?

Run by a Python of its own, since Numba takes the number of threads once, from its environment: `python -m
tests.support.threads FOLDER` prints as JSON, by what was done, whether two threads gave the bits of one.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

from glider.firmware.core.maths.wide import LANES
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.fleet import fly_fleet
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.compose import build_flight
from glider.tools.identify.design import make_runs
from glider.tools.identify.sampler import sample, whiten
from glider.tools.identify.statistics import collect
from glider.tools.inference.predict import fly_near, fly_windows_from
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case

THREADS = 2


def fleet(folder: Path) -> list[np.ndarray]:
    """Closed-loop flights beside each other, in two groups."""
    flights = [build_flight(mission="spiral", seed=seed) for seed in range(LANES + 1)]
    worlds, pilots = [flight.board.world for flight in flights], [flight.autopilot for flight in flights]
    found = fly_fleet(worlds, pilots, max_seconds=20.0, trace_every=1.0)
    return [found.states, found.traces]


def open_loop(folder: Path) -> list[np.ndarray]:
    """Flights of commands alone."""
    runs, _ = make_runs(load_vehicle("roughie"), 6, [0, 6])
    return [values for run in runs for values in run.columns.values()]


def chains(folder: Path) -> list[np.ndarray]:
    """Chains of Metropolis-Hastings, and the posterior at their draws."""
    rng = np.random.default_rng(4)
    J, e = rng.standard_normal((3, 60)), rng.standard_normal(60)
    quadratic = collect(np.zeros(3), np.full(3, -np.inf), e, J, np.arange(60) % 2, ("one", "two"))
    found = sample(quadratic, seed=5, draws=200)
    points = np.concatenate([found.flat, found.levels.reshape(-1, 2)], axis=1)
    return [found.values, found.levels, whiten(quadratic).log_densities(points)]


def observer(folder: Path) -> list[np.ndarray]:
    """A case made up and filtered, models followed with the filter's gains, and their windows flown both ways."""
    problem = problem_of(make_case(folder, np.zeros(ef.N_F), seed=3, runs=2))
    P, F = problem.model.P, np.zeros(ef.N_F)
    gains = problem.filter(P, F, begin=True)
    models = [(P * (1.0 + share), F) for share in (0.0, 0.001, -0.001)]
    windows = [fly_windows_from(problem, P, F, gains), fly_near(problem, models)]
    return [problem.z, gains.E, gains.X, gains.misfit, problem.follow(models, gains), *windows]


WORK: tuple[Callable[[Path], list[np.ndarray]], ...] = (fleet, open_loop, chains, observer)


def main() -> None:
    found = {}
    for work in WORK:
        results = []
        for threads in (1, THREADS):
            numba.set_num_threads(threads)
            results.append(work(Path(sys.argv[1], f"{work.__name__}-{threads}")))
        found[work.__name__] = all(np.array_equal(*pair, equal_nan=True) for pair in zip(*results, strict=True))
    print(json.dumps(found))


if __name__ == "__main__":
    main()
