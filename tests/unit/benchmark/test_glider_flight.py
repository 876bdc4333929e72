"""Today's practice as the benchmark has it: its glide solves the equations, its fit finds what flew, its threshold."""

import math

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.core.glide import net_buoyancy, steady_speed
from glider.tools.data.runs import columns as names
from glider.tools.verify.benchmark import ocean as measure
from glider.tools.verify.benchmark.glider_flight import (
    EVEN,
    MOVED,
    Glide,
    even_samples,
    fitted,
    practise,
    rises,
    water_rms,
)
from glider.tools.verify.challenge.ocean_cases import shipped_vehicle
from tests.support.ocean import as_case, fly_dives

DIVES, REFERENCE, FIRST = 10, 5, 7


@pytest.mark.parametrize("vehicle_class", ["slocum", "seaglider", "seaexplorer"])
@pytest.mark.parametrize("pitch", [-0.42, 0.38])
def test_its_glide_is_the_observers_where_that_is_steady(vehicle_class, pitch):
    vehicle = shipped_vehicle(vehicle_class)
    P, nothing, oil = vehicle.vector(), np.zeros(at.N_F), math.copysign(2.2e-4, pitch)
    density = P[at.MASS] / P[at.VOLUME] + 0.2
    glide = Glide(*(np.array([value]) for value in (pitch, density, 14.0, 8e5, oil, 0.0)))
    force = net_buoyancy(P, nothing, 80.0, density, 14.0, oil, 0.0)
    speed, path = steady_speed(P, nothing, pitch, density, force)
    up = rises(vehicle, glide, P[at.DRAG_0], P[at.VOLUME])
    assert abs(up[0]) > 0.08
    assert up[0] == pytest.approx(speed * math.sin(path), rel=5e-3)


def test_the_fit_finds_what_it_was_made_with():
    vehicle, rng = shipped_vehicle("slocum"), np.random.default_rng(2)
    count, volume = 400, vehicle.buoyancy.volume * 1.001
    side = np.where(np.arange(count) < count // 2, -1.0, 1.0)
    density = vehicle.buoyancy.mass / volume + rng.uniform(-0.5, 0.5, count)
    glide = Glide(side * rng.uniform(0.35, 0.5, count), density, np.full(count, 12.0), rng.uniform(1e5, 1.8e6, count),
                  side * 2.3e-4, np.zeros(count))  # fmt: skip
    glide.rise = rises(vehicle, glide, 0.21, volume) + 0.005 * rng.standard_normal(count)
    drag, found = fitted(vehicle, [glide])
    assert drag == pytest.approx(0.21, rel=0.02)
    assert found == pytest.approx(volume, rel=2e-5)


@pytest.fixture(scope="module")
def changed():
    return fly_dives(DIVES, ("drag", 0.5, FIRST))


def test_samples_are_steady_ones(changed):
    run = changed.runs[0]
    glide = even_samples(run)
    assert glide is not None
    assert 0.3 < len(glide.rise) * EVEN / run.t[-1] < 0.95
    assert np.all(glide.rise * glide.pitch > 0.0)
    assert np.all(glide.pressure > 1e5)
    assert len(np.unique(np.sign(glide.oil - np.median(changed.runs[0].columns[names.OIL])))) >= 2
    lacking = {name: values for name, values in run.columns.items() if name != names.OIL}
    assert even_samples(type(run)("run00", None, lacking)) is None
    assert MOVED < 1e-5 * EVEN  # a slow pump is seen


def test_a_dive_is_changed_whose_drag_leaves_the_reference(changed):
    found = practise(shipped_vehicle("slocum"), changed.runs, REFERENCE)
    assert found.volume == pytest.approx(changed.mission.V[foreign.VOLUME], rel=1e-3)
    assert found.changed[FIRST:].all()
    assert not found.changed[:REFERENCE].any()
    more = np.median(found.drag[FIRST:]) / np.median(found.drag[:FIRST])
    assert more == pytest.approx(1.5, rel=0.15)
    rms = water_rms(shipped_vehicle("slocum"), changed.runs[REFERENCE:FIRST], found.reference_drag, found.volume)
    true = np.mean([S[foreign.WATER] for S in changed.mission.seas])
    assert 0.3 * true < rms < 3.0 * true


def test_dives_that_are_too_short_are_none(changed):
    run = changed.runs[0]
    short = type(run)("run00", None, {name: values[:30] for name, values in run.columns.items()})
    found = practise(shipped_vehicle("slocum"), [*changed.runs[:3], short], 3)
    assert list(np.isfinite(found.drag)) == [True, True, True, False]
    assert not found.changed[3]
    none = practise(shipped_vehicle("slocum"), [short, *changed.runs[:2]], 1)
    assert np.isnan(none.drag).all()
    assert not none.changed.any()


def test_both_ways_judge_the_same_dives(changed, tmp_path):
    case = as_case(tmp_path / "case", changed.runs)
    true = np.arange(REFERENCE, DIVES) >= FIRST
    own, practice = measure.ours(case, REFERENCE, true), measure.theirs(case, REFERENCE, true)
    assert own.called.shape == practice.called.shape == true.shape
    assert np.array_equal(own.called, true)
    figures_by_name = measure.figures([own], [practice], "a_")
    assert figures_by_name["a_found"] == figures_by_name["a_practice_found"] == 1.0
    assert figures_by_name["a_false_alarms"] == 0.0
    assert (
        figures_by_name["a_w_rms_cm_s_ratio"]
        == figures_by_name["a_w_rms_cm_s"] / figures_by_name["a_practice_w_rms_cm_s"]
    )
    assert figures_by_name["a_dives"] == DIVES - REFERENCE
    assert 0.2 < figures_by_name["a_w_rms_cm_s"] < 3.0
