"""Shrinkage and closed: shares of the gap of runs left out, where there is something to shrink or to close."""

import numpy as np
import pytest

from glider.tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, Shrinkage, shrinkage_of
from glider.tools.gap.measure import RunGap


def shares(before, after, floor) -> Shrinkage:
    """Of totals by run."""
    tables = {BEFORE: before, RECALIBRATED: before, AFTER: after, FLOOR: floor}
    runs = {name: [RunGap(f"run{n:02d}", {"depth": v}, v, 3) for n, v in enumerate(t)] for name, t in tables.items()}
    return shrinkage_of(runs, {})


def test_of_several_runs_both_have_a_value_within_its_interval():
    found = shares([4.0, 4.2, 3.8], [0.5, 0.6, 0.4], [0.4, 0.4, 0.4])
    assert found.shrinkage == pytest.approx(1.0 - np.sqrt(0.77 / 48.08), abs=1e-6)
    assert found.ci90[0] < found.shrinkage < found.ci90[1]
    assert found.closed_ci90[0] < found.closed < found.closed_ci90[1]
    assert found.closed == pytest.approx((found.before - found.after) / (found.before - found.floor))


def test_of_a_single_run_there_is_neither():
    found = shares([4.0], [0.5], [0.4])
    assert (found.before, found.after, found.floor) == (4.0, 0.5, 0.4)
    assert np.isnan([found.shrinkage, *found.ci90, found.closed, *found.closed_ci90]).all()


@pytest.mark.parametrize("before", [[0.21, 0.18, 0.2], [0.19, 0.18, 0.19], [0.23, 0.19, 0.2]])
def test_where_there_may_be_nothing_to_close_none_is_closed(before):
    """The floor may be as high as the gap before: a share of the difference would be any number."""
    found = shares(before, [0.15, 0.14, 0.15], [0.2, 0.2, 0.2])
    assert np.isnan([found.closed, *found.closed_ci90]).all()
    assert found.shrinkage > 0.1
