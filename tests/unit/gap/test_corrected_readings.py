"""What the readings say goes into the model where an effect stands for it, else into the runs."""

from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.gap.corrected import correct_readings, fix_axes_signs_units
from glider.tools.inference.model import nominal_model
from tests.support.cases import make_case


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A case without a gap."""
    return make_case(tmp_path_factory.mktemp("plain"), np.zeros(ef.N_F), seed=41, runs=2)


def changed(case, **columns):
    """The case with columns made from each run's own: name=function of the run's columns."""
    runs = [replace(run, columns=run.columns | {k: f(run.columns) for k, f in columns.items()}) for run in case.runs]
    return replace(case, runs=runs)


def test_a_clean_case_is_left_alone(plain):
    found = correct_readings(plain, nominal_model(plain))
    assert found.added == []
    assert found.model.F is None
    assert found.runs is plain.runs


def test_one_scale_of_three_axes_is_the_model_s(plain):
    case = changed(plain, **{f"{a}_rad_s": lambda c, a=a: 0.4 * c[f"{a}_rad_s"] for a in "pqr"})
    found = correct_readings(case, nominal_model(case))
    assert found.labels == ["gyro_scale"]
    assert found.model.F[ef.GYRO_SCALE] == pytest.approx(-0.6, abs=0.02)
    size, low, high = found.scale
    assert low < size < high
    assert found.runs is case.runs  # what was recorded stays


def test_exchanged_axes_are_put_right_in_the_runs(plain):
    case = changed(plain, q_rad_s=lambda c: c["r_rad_s"], r_rad_s=lambda c: c["q_rad_s"])
    found = correct_readings(case, nominal_model(case))
    right = fix_axes_signs_units(case.runs, found.findings)
    for run, mended_run, was in zip(found.runs, right, plain.runs, strict=True):
        for name in ("q_rad_s", "r_rad_s"):
            assert np.nanmax(np.abs(run.columns[name] - was.columns[name])) < 1e-9
            assert np.nanmax(np.abs(mended_run.columns[name] - was.columns[name])) < 1e-9


def test_one_axis_that_reads_half_is_put_right_for_identification_and_left_to_the_search(plain):
    case = changed(plain, q_rad_s=lambda c: 0.5 * c["q_rad_s"])
    found = correct_readings(case, nominal_model(case))
    assert found.added == ["q_rad_s scale"]
    assert fix_axes_signs_units(case.runs, found.findings) is case.runs
