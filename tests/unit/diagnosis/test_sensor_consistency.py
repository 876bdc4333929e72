"""Readings that contradict each other, and poses that are moved to their own time."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.search import PROCESS_NOISE_SCALES
from glider.tools.diagnose.sensor_consistency import HOLDS_BELOW, inconsistent_sensors, mean_nis
from glider.tools.inference.parameters import effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.predict import fly
from glider.tools.inference.problem import problem_of
from glider.tools.inference.time_alignment import POSE_LAG_S, aligned, sample_at_row
from tests.support.cases import make_case


def with_effect(folder, entry, value, **about):
    F = np.zeros(ef.N_F)
    F[entry] = value
    return problem_of(make_case(folder, F, seed=5, **about)), F


def rough_nis(problem):
    free = nuisance_parameters(problem)
    gains = problem.filter(
        *model_at(problem, free, np.zeros(len(free))), process_noise_scale=PROCESS_NOISE_SCALES[0], begin=True
    )
    return mean_nis(problem, gains)


@pytest.mark.parametrize(
    ("label", "entry", "value", "mocap"),
    [
        ("gyro_scale", ef.GYRO_SCALE, 1.5, False),
        ("depth_offset", ef.DEPTH_OFFSET, 0.6, True),
        ("imu_roll_bias", ef.ROLL_BIAS, -0.2, True),
        ("mocap_delay", ef.MOCAP_DELAY, 1.7, True),
    ],
)
def test_the_reading_that_is_far_out_is_named(tmp_path, label, entry, value, mocap):
    problem, _ = with_effect(tmp_path, entry, value, mocap=mocap)
    assert rough_nis(problem) > HOLDS_BELOW
    free, spreads = inconsistent_sensors(problem, nuisance_parameters(problem), effect_parameters(problem))[0]
    assert free.label == label
    assert spreads * free.spread == pytest.approx(value, rel=0.6)


@pytest.mark.parametrize(("entry", "value"), [(ef.NET_MASS_OFFSET, 0.1), (ef.DRAG_0, 2.0), (ef.PITCH_TRIM, 0.5)])
def test_forces_make_no_reading_contradict_another(tmp_path, entry, value):
    problem, _ = with_effect(tmp_path, entry, value, mocap=True)
    assert rough_nis(problem) < HOLDS_BELOW


def test_samples_go_to_the_row_of_their_time_once():
    t = np.arange(10) * 0.1
    assert sample_at_row(t, t).tolist() == list(range(10))
    assert sample_at_row(t, t - 0.31).tolist() == [3, 4, 5, 6, 7, 8, 9, -1, -1, -1]
    assert sample_at_row(t, t + 0.2).tolist() == [-1, -1, 0, 1, 2, 3, 4, 5, 6, 7]
    slow = sample_at_row(t, 0.5 * t)  # two samples to a row: the nearer stays
    assert slow.tolist() == [0, 2, 4, 6, 8, -1, -1, -1, -1, -1]
    fast = sample_at_row(t, 2.0 * t)  # every other row has none
    assert fast.tolist() == [0, -1, 1, -1, 2, -1, 3, -1, 4, -1]


@pytest.mark.parametrize("delay", [1.4, 1.45, 1.55])
def test_a_late_clock_s_windows_begin_where_the_vehicle_is(tmp_path, delay):
    """Of a clock that wanders by a third of a second either way, whatever part of a row it is late by."""
    case = make_case(tmp_path, np.zeros(ef.N_F), seed=6, mocap=True, late=lambda t: 1.45 + 0.3 * np.sin(t / 7.0))
    problem, F = problem_of(case), np.zeros(ef.N_F)
    F[ef.MOCAP_DELAY] = delay
    for own_filter in (True, False):
        missed = fly(problem, problem.model.P, F, own_filter)[:, ef.Y_DEPTH] - problem.z[:, ef.Y_DEPTH]
        assert np.sqrt(np.nanmean(missed**2)) < 0.12


@pytest.mark.parametrize("delay", [1.7, -0.8])
def test_poses_moved_to_their_time_are_foreseen(tmp_path, delay):
    """As those of a right clock; an early one shows poses of the future, which no filter foresees by its past."""
    none = np.zeros(ef.N_F)
    right = problem_of(make_case(tmp_path / "right", none, seed=6, mocap=True))
    problem = problem_of(make_case(tmp_path / "late", none, seed=6, mocap=True, late=lambda t: delay))
    F = np.zeros(ef.N_F)
    F[ef.MOCAP_DELAY] = delay
    poses = slice(ef.Y_ONBOARD, ef.N_Y)

    def missed(one, F):
        E = one.filter(one.model.P, F, begin=True).E[:, poses]
        return float(np.nanmean(E**2))

    there = aligned(problem, F)
    assert missed(there, F) == pytest.approx(missed(right, none), rel=0.15)
    if delay < 0.0:
        assert missed(problem, F) > 3.0 * missed(there, F)
    lost = round(abs(delay - POSE_LAG_S) * 10) * len(problem.runs)
    assert problem.valid[:, poses].all(axis=1).sum() - there.valid[:, poses].all(axis=1).sum() == lost
    assert there.as_recorded is problem
    assert aligned(there, np.zeros(ef.N_F)).as_recorded is problem
