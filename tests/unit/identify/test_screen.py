"""Runs that cannot be fitted are named with file and column; sound ones pass."""

import numpy as np
import pytest

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.design import make_runs
from glider.tools.identify.screen import clock_offset, despiked, screen


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return make_runs(load_vehicle("roughie"), 3, [0, 7, 16, 25, 33, 41])[0]


def changed(run: Run, **columns) -> Run:
    return Run(run.name, run.path, run.columns | columns, run.extra)


def reason(run: Run) -> str:
    kept, out = screen([run], mocap=True)
    assert not kept
    return str(out[0])


def test_sound_runs_pass(runs):
    kept, out = screen(runs, mocap=True)
    assert len(kept) == len(runs)
    assert out == []


@pytest.mark.parametrize("n", range(6))
def test_degrees_and_millimetres(runs, n):
    run = runs[n]
    turned = {name: np.degrees(run.columns[name]) for name in names.MOCAP_ATTITUDE}
    assert "degrees?" in reason(changed(run, **turned))
    longer = {name: 1000.0 * run.columns[name] for name in names.MOCAP_POSITION}
    assert "millimetres?" in reason(changed(run, **longer))


@pytest.mark.parametrize(("a", "b"), [("mocap_x_m", "mocap_y_m"), ("mocap_roll_rad", "mocap_pitch_rad")])
def test_swapped_axes(runs, a, b):
    run = runs[0]
    assert "axes swapped" in reason(changed(run, **{a: run.columns[b], b: run.columns[a]}))


def test_depth_counted_upwards(runs):
    assert "signs turned" in reason(changed(runs[0], mocap_z_m=-runs[0].columns["mocap_z_m"]))


def test_frozen_capture(runs):
    columns = {name: runs[1].columns[name].copy() for name in names.MOCAP}
    for values in columns.values():
        values[300:360] = values[300]
    assert "frozen" in reason(changed(runs[1], **columns))


def test_a_capture_of_another_time_is_missed(runs):
    nothing = {name: np.full(runs[0].rows, np.nan) for name in names.MOCAP}
    assert "clock far" in reason(changed(runs[0], **nothing))


def test_clocks_apart_are_found_with_their_uncertainty(runs):
    run, late = runs[0], 3.0
    rng = np.random.default_rng(1)
    onboard = {
        names.DEPTH: np.interp(run.t + late, run.t, run.columns["mocap_z_m"]) + 0.004 * rng.standard_normal(run.rows),
        "pitch_rad": np.interp(run.t + late, run.t, run.columns["mocap_pitch_rad"]),
    }
    both = changed(run, **onboard)
    found = clock_offset(both)
    assert found is not None
    assert found[0] == pytest.approx(late, abs=0.1)
    assert "the clocks" in reason(both)


def test_spikes_go_and_nothing_else(runs):
    x = runs[2].columns["mocap_x_m"].copy()
    x[100] += 0.4
    cleaned, count = despiked(changed(runs[2], mocap_x_m=x))
    assert count == 1
    assert np.isnan(cleaned.columns["mocap_x_m"][100])
    assert despiked(runs[2])[1] == 0
