"""ROUGHIE and ocean gliders by the door that users' vehicles come in by, held against the tree's own observers."""

import itertools
from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.ocean.core import layout as at
from glider.tools.data.runs.case import write_case
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import fly_windows_from, observe
from glider.tools.inference.problem import cut, problem_of
from glider.tools.own.check import load_own
from glider.tools.own.driven import forces, held_inputs
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import load_own_runs
from tests.support.flights import World, fly_case
from tests.support.ocean import as_case, fly_dives


def test_both_are_entry_points():
    assert {one.name for one in metadata.entry_points(group="glider.vehicles")} >= {"roughie", "ocean_glider"}


def by_the_door(folder, name, cases):
    """The observer that is made for an entry point's model over a case's runs, on every row."""
    (folder / f"{name}.toml").write_text(f'format = 1\nmodel = "{name}"\n')
    vehicle = load_own(folder / f"{name}.toml")
    return observer_of(vehicle, load_own_runs(cases, vehicle.declared), every_row=True)


def flown(observer, n, starts, ends, states):
    """Windows of run n from given states (windows, states), open loop: (rows, outputs), NaN elsewhere."""
    run, point, out = observer.runs[n], observer.point, np.full(observer.runs[n].outputs.shape, np.nan)
    observer.vehicle.kernels.fly_run(
        run.t, held_inputs(observer.declared, run.inputs), starts, ends, states, point.theta, point.own,
        point.reading, forces(observer.declared, point, run.t, run.inputs), observer.kinds, observer.angles,
        observer.parts, out,
    )  # fmt: skip
    return out


@pytest.fixture(scope="module")
def roughie(tmp_path_factory):
    folder = tmp_path_factory.mktemp("roughie")
    case, _ = fly_case(World(bias=0.0), 3, runs=2)
    about = dict(vehicle="roughie", site="made", log_rate_hz=10.0, water_density_kg_m3=998.0, motion_capture=False)
    write_case(folder / "case", case.runs, **about)
    problem = problem_of(case)
    gains = observe(problem, problem.model.P, np.zeros(ef.N_F))
    return problem, gains, by_the_door(folder, "roughie", folder / "case")


def test_roughie_flies_as_its_own_kernels_have_it(roughie):
    problem, gains, observer = roughie
    theirs = fly_windows_from(problem, problem.model.P, np.zeros(ef.N_F), gains)
    windows, bounds = cut(problem), problem.recording.bounds
    for n in range(2):
        own = windows.run_of == n
        first, last = windows.first[own] - bounds[n], windows.last[own] - bounds[n]
        found = flown(observer, n, first - 1, last, gains.X[bounds[n] + first - 1, :16])
        for a, b in zip(first, last, strict=True):
            error = found[a:b] - theirs[bounds[n] + a : bounds[n] + b, :9]
            assert np.abs(error / observer.tolerances).max() < 1e-10


def test_the_generated_filter_of_roughie_stands_where_its_own_does(roughie):
    problem, gains, observer = roughie
    bounds = problem.recording.bounds
    for n in range(2):
        by = observer.filter(n, observer.point)
        theirs = gains.X[bounds[n] : bounds[n + 1], :16]
        settled = observer.runs[n].t - observer.runs[n].t[0] > 5.0
        rms = np.sqrt(np.mean((by.states - theirs)[settled] ** 2, axis=0))
        # of what no reading holds (north, east) the filter's own spread is decimetres
        assert (rms < [0.1, 0.1, 0.003, *4 * [0.004], *6 * [0.004], *3 * [1e-5]]).all()


@pytest.fixture(scope="module")
def ocean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ocean")
    case = as_case(folder / "case", fly_dives(2, speed=True).runs)
    problem = problem_of(case)
    gains = problem.filter(nominal_model(case).P, np.zeros(at.N_F))
    return problem, gains, by_the_door(folder, "ocean_glider", folder / "case")


def test_an_ocean_glider_flies_as_its_own_kernels_have_it(ocean):
    problem, gains, observer = ocean
    theirs = fly_windows_from(problem, problem.model.P, np.zeros(at.N_F), gains)
    windows, bounds, observer.parts = cut(problem), problem.recording.bounds, 1  # the rows' own steps
    for n in range(2):
        own = windows.run_of == n
        first, last = windows.first[own] - bounds[n], windows.last[own] - bounds[n]
        x = gains.X[bounds[n] + first - 1]
        found = flown(observer, n, first - 1, last, x[:, [at.X_DEPTH, at.X_SPEED, at.X_WATER, at.X_ROLL]])
        for a, b in zip(first, last, strict=True):
            error = found[a:b, [0, 2]] - theirs[bounds[n] + a : bounds[n] + b][:, [at.Y_DEPTH, at.Y_SPEED]]
            assert np.abs(error).max() < 1e-10


def test_the_generated_filter_of_an_ocean_glider_stands_where_its_own_does(ocean):
    """The same readings; stretches of unsteady flight, of which users' models know nothing, taken as the others."""
    problem, _, observer = ocean
    problem.recording.inputs[:, at.U_UNSTEADY] = 0.0
    gains = problem.filter(problem.model.P, np.zeros(at.N_F))
    observer.parts = 1
    for n, (begin, end) in enumerate(itertools.pairwise(problem.recording.bounds)):
        observer.runs[n] = replace(
            observer.runs[n], outputs=problem.z[begin:end][:, [at.Y_DEPTH, at.Y_ROLL, at.Y_SPEED]]
        )
        by = observer.filter(n, observer.point)
        settled = observer.runs[n].t - observer.runs[n].t[0] > 600.0
        theirs = gains.X[begin:end][:, [at.X_DEPTH, at.X_SPEED, at.X_WATER, at.X_ROLL]]
        # m, m/s, m/s, rad: what differences in place of derivatives, and the depth's share of the water's walk, come to
        assert (np.abs(by.states - theirs)[settled].max(axis=0) < [0.02, 5e-4, 5e-4, 2e-3]).all()
