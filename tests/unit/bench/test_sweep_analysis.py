"""A sweep finds what an actuator was made with: lag, backlash, dead band, travel time."""

import math

import numpy as np
import pytest

from glider.tools.bench import record, sweep
from glider.tools.bench.calibrate import fit
from glider.tools.bench.client import BenchError

STEP = 0.01


def actuator(plan, rate, lag, backlash, dead_band, noise=0.0):
    """Times, commands and positions of an actuator that follows `lag` s late, with play and a dead band."""
    times = np.arange(0.0, plan.seconds, STEP)
    starts = np.array([t for t, _ in plan.targets])
    values = np.array([v for _, v in plan.targets])
    command = values[np.clip(np.searchsorted(starts, times, side="right") - 1, 0, None)]
    late = values[np.clip(np.searchsorted(starts, times - lag, side="right") - 1, 0, None)]
    motor = position = 0.0
    out = np.zeros(len(times))
    for i, wanted in enumerate(late):
        if abs(wanted - motor) > dead_band:
            motor += np.clip(wanted - motor, -rate * STEP, rate * STEP)
        position = min(max(position, motor - backlash / 2), motor + backlash / 2)
        out[i] = position
    return times, command, out + noise * np.random.default_rng(1).standard_normal(len(times))


@pytest.mark.parametrize("lag", [0.05, 0.3])
@pytest.mark.parametrize("backlash", [0.0, 0.6])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_lag_backlash_and_travel_time_are_found(lag, backlash, noise):
    plan = sweep.plan(-40.0, 40.0, 20.0)
    record_ = actuator(plan, 20.0, lag, backlash, 0.0, noise)
    result = sweep.analyse(sweep.SweepResult("slider", "mm", -40.0, 40.0), plan, *record_)
    assert result.travel_s == pytest.approx(4.0, abs=0.1)
    assert result.lag_s == pytest.approx(lag, abs=0.02)
    assert result.backlash == pytest.approx(backlash, abs=0.12)
    assert result.noise == pytest.approx(noise, abs=0.03)


@pytest.mark.parametrize(("dead_band", "found"), [(0.0, 0.0), (0.3, 0.4), (0.9, 1.6)])
def test_the_dead_band_is_the_largest_reversal_that_did_not_show(dead_band, found):
    """An actuator that rests within 0.3 mm of its goal on either side shows no reversal below 0.6 mm."""
    plan = sweep.plan(-40.0, 40.0, 20.0)
    result = sweep.analyse(
        sweep.SweepResult("slider", "mm", -40.0, 40.0), plan, *actuator(plan, 20.0, 0.05, 0.0, dead_band)
    )
    assert result.dead_band == found


def test_an_actuator_that_does_not_move_has_no_travel_time():
    plan = sweep.plan(-40.0, 40.0, 20.0)
    times, command, position = actuator(plan, 20.0, 0.05, 0.0, 1e9)
    result = sweep.analyse(sweep.SweepResult("slider", "mm", -40.0, 40.0), plan, times, command, position)
    assert math.isnan(result.travel_s)
    assert result.dead_band == sweep.REVERSALS[-1]


def test_a_plan_stays_within_its_ends_and_never_jumps_in_its_ramps():
    plan = sweep.plan(-10.0, 30.0, 20.0)
    targets = np.array(plan.targets)
    assert targets[:, 1].min() == -10.0
    assert targets[:, 1].max() == 30.0
    assert (np.diff(targets[:, 0]) > 0).all()
    begin, end = plan.parts["slow"]
    inside = targets[(targets[:, 0] > begin) & (targets[:, 0] < end - 0.01), 1]
    assert np.abs(np.diff(inside)).max() < 0.5


def test_a_line_through_places():
    found = fit([-40.0, 0.0, 40.0], [8800.0, 12_000.0, 15_200.0], 5.0)
    assert (found.slope, found.zero) == pytest.approx((80.0, 12_000.0))
    assert found.residual == pytest.approx(0.0, abs=1e-9)
    assert fit([-40.0, 0.0, 40.0], [8800.0, 12_080.0, 15_200.0], 5.0).residual == pytest.approx(0.667, abs=0.01)


@pytest.mark.parametrize("places", [[], [1.0], [1.0, 2.0], [3.0, 3.0, 3.0]])
def test_places_too_near_each_other_are_no_line(places):
    with pytest.raises(BenchError, match=" 5 apart"):
        fit(places, [float(i) for i in range(len(places))], 5.0)


def test_a_record_is_run_data(tmp_path):
    from glider.tools.data.runs.case import load_case

    rows = [[100.0 + 0.01 * i, None, 0.001 * i, None, 0.0, 0.0, 0.001 * i, 0.0, None, None] for i in range(50)]
    record.write_case(tmp_path / "case", record.table(rows), "roughie")
    (run,) = load_case(tmp_path / "case").runs
    assert run.rows == 50
    assert "cmd_servo_rad" not in run.columns
    assert run.columns["cmd_slider_m"][-1] == pytest.approx(0.049)
