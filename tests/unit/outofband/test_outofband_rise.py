"""Row 18 as the out-of-band process judges it: stories in simulated time, and what holds for any of them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.hal.outofband.rise import AscentStage, Rise

PATIENCE, STEP, SURFACE = 30.0, 0.3, 0.4
PERIOD = 0.5


def told(depths, period=PERIOD):
    """The stages of a way up, one a round."""
    rise = Rise(PATIENCE, STEP, SURFACE)
    return [rise.look(period * i, depth) for i, depth in enumerate(depths)]


def first(stages, stage):
    """When a stage was first told, s."""
    return PERIOD * stages.index(stage)


def test_a_vehicle_that_rises_is_let_alone_and_its_arrival_seen():
    depths = [max(20.0 - 0.1 * PERIOD * i, 0.05) for i in range(500)]
    stages = told(depths)
    assert set(stages) == {AscentStage.RISING, AscentStage.SURFACED}
    assert stages[-1] == AscentStage.SURFACED
    assert depths[stages.index(AscentStage.SURFACED)] == pytest.approx(SURFACE, abs=0.1)


def test_one_that_stays_down_is_pumped_again_and_then_given_to_the_hardware():
    stages = told([10.0] * 200)
    assert first(stages, AscentStage.AGAIN) == PATIENCE
    assert first(stages, AscentStage.HARDWARE) == 2 * PATIENCE
    assert stages[-1] == AscentStage.HARDWARE


def test_it_may_sink_on_at_first_and_has_to_rise_from_its_deepest():
    """10 s of sinking are part of the time; less than a step above the deepest is no rise."""
    depths = [10.0 + 0.1 * i for i in range(20)] + [12.0 - STEP * 0.9] * 200
    stages = told(depths)
    assert first(stages, AscentStage.AGAIN) == PATIENCE


def test_pumping_again_that_helps_takes_it_back():
    stages = told([10.0] * 80 + [10.0 - 0.1 * i for i in range(100)])
    assert AscentStage.AGAIN in stages
    assert AscentStage.HARDWARE not in stages
    assert stages[-1] == AscentStage.SURFACED


def test_what_went_to_the_hardware_is_not_taken_back():
    stages = told([10.0] * 200 + [5.0, 0.1, 0.1] + [None] * 200)
    assert set(stages[stages.index(AscentStage.HARDWARE) :]) == {AscentStage.HARDWARE}


def test_without_a_depth_nothing_is_concluded():
    assert set(told([None] * 1000)) == {AscentStage.BLIND}
    # One that fell silent is waited for, then its silence is told; heard again, the time begins anew.
    stages = told([10.0] * 10 + [None] * 100 + [10.0] * 50)
    assert stages[10] == AscentStage.RISING
    assert stages[10 + 62] == AscentStage.BLIND
    assert AscentStage.AGAIN not in stages


def test_a_vehicle_that_sinks_again_after_the_surface_is_seen():
    stages = told([0.1] * 10 + [0.1 + 0.1 * i for i in range(20)] + [2.0] * 200)
    assert stages[9] == AscentStage.SURFACED
    assert stages[9 + 4] == AscentStage.SURFACED  # a wave
    assert stages[25] == AscentStage.RISING
    assert stages[-1] == AscentStage.HARDWARE


@given(st.lists(st.none() | st.floats(-1.0, 100.0), max_size=300))
def test_whatever_is_read_a_vehicle_is_given_time(depths):
    """AGAIN never before the patience is over, HARDWARE never before twice that, and never at the surface."""
    stages = told(depths)
    for i, (stage, depth) in enumerate(zip(stages, depths, strict=True)):
        if stage == AscentStage.AGAIN:
            assert PERIOD * i >= PATIENCE
        if stage == AscentStage.HARDWARE:
            assert PERIOD * i >= 2 * PATIENCE
        if depth is not None and depth < SURFACE and AscentStage.HARDWARE not in stages[: i + 1]:
            assert stage == AscentStage.SURFACED
