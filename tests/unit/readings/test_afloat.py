"""A flight that ends afloat: what comes after it is up for good is no flight, and is said to be left out."""

import re
from dataclasses import replace

import numpy as np
import pytest

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.readings.stretches import flying, judge_stretches, states, under_water

T = 0.02 * np.arange(3500)  # 70 s of 50 Hz


def dive(every: int = 1, last: float = 0.0) -> Run:
    """Down to 5 m and up again in 60 s, then afloat at `last` m; the depth is read in every `every`-th row."""
    depth = np.maximum(5.0 - np.abs(T - 30.0) / 6.0, 0.0)
    depth = np.where(T > 60.0, last, depth)
    pitch = np.where(T > 60.0, 1.5, -0.4 * np.sign(30.0 - T) + 0.05 * np.sin(T))
    depth[np.arange(len(T)) % every != 0] = np.nan
    return Run("run00", None, {names.TIME: T, names.DEPTH: depth, names.ATTITUDE[1]: pitch})


@pytest.mark.parametrize("every", [1, 2, 5])
def test_the_end_afloat_is_no_flight_however_often_the_depth_is_read(every):
    run = dive(every)
    state = states(run)["afloat at the end"]
    assert state[-1]
    assert T[state][0] == pytest.approx(58.5, abs=0.15)  # 0.25 m
    assert not flying(run)[state].any()
    (said,) = [one.text for one in judge_stretches([run]) if "afloat" in one.text]
    assert re.findall(r"\d+", said) == ["00", "11", f"{T[state][0]:.0f}", "70"]
    kept = under_water(run)
    assert kept.rows == len(T) - state.sum()
    assert kept.t[-1] < T[state][0]


def test_a_flight_that_ends_under_water_is_whole():
    run = dive(last=0.3)
    assert not states(run)["afloat at the end"].any()


def test_a_few_seconds_at_the_surface_between_two_dives_stay():
    run = dive()
    again = np.where(T > 65.0, 0.3, run.columns[names.DEPTH])
    run = replace(run, columns=run.columns | {names.DEPTH: again})
    assert not states(run)["afloat at the end"].any()


def test_a_vehicle_that_never_dived_is_not_left_out():
    shallow = replace(dive(), columns={names.TIME: T, names.DEPTH: 0.1 + 0.05 * np.sin(T)})
    assert not states(shallow)["afloat at the end"].any()
