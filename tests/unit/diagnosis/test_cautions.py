"""What a case cannot say is said: columns that are not there, holes, one run, no commands."""

from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.diagnose.cautions import below_floor, cautions, not_asked
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Case:
    return make_case(tmp_path_factory.mktemp("plain"), np.zeros(ef.N_F), seed=31, runs=2, mocap=True)


def changed(case: Case, *drop: str, **columns: np.ndarray) -> Case:
    """The case with columns of its first run left out, or others in their place."""
    first, second = case.runs
    kept = {name: values for name, values in first.columns.items() if name not in drop} | columns
    return replace(case, runs=[replace(first, columns=kept), second])


def test_whole_runs_with_everything_recorded_need_no_caution(case):
    assert cautions(problem_of(case)) == []
    assert not_asked(problem_of(case)) == []


@pytest.mark.parametrize(("drop", "said"), [
    ((names.DEPTH,), "no depth in run00"),
    (names.RATES, "no gyro in run00"),
    (names.DRAW_WIRES, "no draw-wires in run00"),
    (names.RATES[:1], "run00: column p_rad_s is missing"),
    (names.COMMANDS, "no commands in run00"),
])  # fmt: skip
def test_a_missing_column_is_named_and_what_it_costs(case, drop, said):
    (line,) = cautions(problem_of(changed(case, *drop)))
    assert line.startswith(said)


def test_a_long_hole_is_named_with_its_column_and_length(case):
    depth = case.runs[0].columns[names.DEPTH].copy()
    depth[100:180] = np.nan
    (line,) = cautions(problem_of(changed(case, **{names.DEPTH: depth})))
    assert line.startswith("run00: depth_m (18 % missing, up to 8 s)")


def test_a_sensor_that_is_slower_than_the_log_is_whole(case):
    """Every second row, and of another one every second or third: their own rates."""
    rows = np.arange(len(case.runs[0].t))
    half, uneven = case.runs[0].columns[names.DEPTH].copy(), case.runs[0].columns[names.DRAW_WIRES[0]].copy()
    half[rows % 2 == 1] = np.nan
    uneven[~np.isin(rows % 5, (0, 2))] = np.nan
    slower = {names.DEPTH: half, names.DRAW_WIRES[0]: uneven}
    assert cautions(problem_of(changed(case, **slower))) == []
    half[100:260] = np.nan
    (line,) = cautions(problem_of(changed(case, **slower)))
    assert line.startswith("run00: depth_m (36 % missing, up to 16 s)")


@pytest.mark.parametrize(
    ("floor", "said"),
    [({"depth": 0.4, "yaw": 0.9, "total": 0.6}, []),
     ({"depth": 0.4, "yaw": 1.3, "total": 0.6}, ["yaw 1.3 tolerances"]),
     ({"depth": 2.4, "yaw": 1.3, "total": 2.18}, [" 2.2 tolerances"])],
)  # fmt: skip
def test_a_floor_above_a_tolerance_is_said(floor, said):
    lines = below_floor(floor)
    assert len(lines) == len(said)
    assert all(begin in line for line, begin in zip(lines, said, strict=True))


def test_short_blind_spells_are_usual(case):
    x = case.runs[0].columns["mocap_x_m"].copy()
    x[100:110] = np.nan
    assert cautions(problem_of(changed(case, mocap_x_m=x))) == []


def test_one_run_leaves_nothing_out(case):
    (line,) = cautions(problem_of(replace(case, runs=case.runs[:1])))
    assert line.startswith("one run")


def test_labels_that_these_runs_cannot_show_are_not_asked(case):
    onboard = [
        replace(run, columns={n: v for n, v in run.columns.items() if not n.startswith(("mocap", "cmd"))})
        for run in case.runs
    ]
    left_out = not_asked(problem_of(replace(case, runs=onboard)))
    assert {"mocap_delay", "clock_skew", "servo_slow", "pump_slow"} <= set(left_out)
    assert not {"drag", "ballast_leak", "waves"} & set(left_out)
