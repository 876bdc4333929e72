"""Which runs can be judged, and why the others cannot: said, never an error."""

from dataclasses import replace

import numpy as np
import pytest

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.watch.usable import readings_of, usable
from tests.support.flights import World, fly


@pytest.fixture(scope="module")
def run() -> Run:
    return fly(World(seconds=60.0), 3).run


def cut(run: Run, rows: slice) -> Run:
    return replace(run, columns={name: values[rows] for name, values in run.columns.items()})


def test_a_flight_is_taken_as_it_is(run):
    assert usable(run) is run


@pytest.mark.parametrize(("rows", "why"), [(slice(0, 1), "two samples"), (slice(0, 60), "6 s long")])
def test_too_short(run, rows, why):
    assert why in usable(cut(run, rows))


def test_readings_that_are_not_there(run):
    empty = dict(run.columns) | {name: np.full(run.rows, np.nan) for name in (*names.ATTITUDE, *names.RATES)}
    assert "no readings" in usable(replace(run, columns=empty))
    less = {name: values for name, values in run.columns.items() if name != names.DEPTH}
    assert "depth_m" in usable(replace(run, columns=less), readings_of([run]))
    rare = dict(run.columns)
    for name in names.ATTITUDE:
        rare[name] = np.where(np.arange(run.rows) % 40 == 0, run.columns[name], np.nan)
    assert "hardly" in usable(replace(run, columns=rare))


def test_a_vehicle_at_the_surface_does_not_fly(run):
    columns = dict(run.columns) | {names.DEPTH: np.full(run.rows, 0.02)}
    assert "the surface" in usable(replace(run, columns=columns))


def test_of_a_run_that_begins_at_the_surface_the_flight_is_taken(run):
    depth = run.columns[names.DEPTH].copy()
    depth[:200] = 0.01
    found = usable(replace(run, columns=dict(run.columns) | {names.DEPTH: depth}))
    assert isinstance(found, Run)
    assert 380 < found.rows < 500
