"""Noise levels: sensors' from their readings alone, the disturbance's at a model that is right."""

from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.cautions import cautions
from glider.tools.diagnose.descent import converge
from glider.tools.diagnose.search import Search, gains_of, level_disturbance, noise_matches_file
from glider.tools.inference import levels
from glider.tools.inference.fit import Fitter
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.parameters import effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.problem import Problem, problem_of
from tests.support.cases import make_case


@pytest.fixture(scope="module")
def calm(tmp_path_factory) -> Problem:
    return problem_of(make_case(tmp_path_factory.mktemp("calm"), np.zeros(ef.N_F), seed=3, mocap=True))


def noisier(problem: Problem, factors: dict[str, float]) -> Problem:
    """The problem with white noise added until a sensor has `factor` times what its file says."""
    rng, z = np.random.default_rng(1), problem.z.copy()
    for name, factor in factors.items():
        part = levels.SENSORS[name]
        z[:, part] += np.sqrt((factor**2 - 1.0) * problem.R[0, part]) * rng.standard_normal(z[:, part].shape)
    return replace(problem, z=z)


def test_every_sensor_s_noise_is_found_whatever_the_others_have(calm):
    found = levels.sensor_noise(noisier(calm, {"gyro": 1.5, "slider": 1.3}), 0.5, 2.0)
    factors = dict(zip(found.names, np.exp(found.log), strict=True))
    assert set(factors) == set(levels.SENSORS)
    for name, factor in factors.items():
        assert factor == pytest.approx({"gyro": 1.5, "slider": 1.3}.get(name, 1.0), rel=0.15)
    applied = found.applied(calm)
    assert np.allclose(applied.R[:, ef.Y_P] / calm.R[:, ef.Y_P], factors["gyro"] ** 2)
    assert np.array_equal(applied.spectral, calm.spectral)


def test_no_more_is_believed_than_the_limits_allow(calm):
    found = levels.sensor_noise(noisier(calm, {"depth": 9.0}), 0.5, 2.0)
    assert np.exp(found.log[found.names.index("depth")]) == pytest.approx(2.0)


def test_held_samples_and_short_runs_say_nothing(calm):
    z = calm.z.copy()
    z[1::2, ef.Y_DEPTH] = z[::2, ef.Y_DEPTH][: len(z[1::2])]
    z[:, ef.Y_Q] = np.nan
    found = levels.sensor_noise(replace(calm, z=z), 0.5, 2.0)
    assert "depth" not in found.names
    assert "gyro" in found.names  # by the two that are there


def searched(problem: Problem) -> Search:
    """A search that stands at the nominal model."""
    free = nuisance_parameters(problem)
    gains = gains_of(problem, model_at(problem, free, np.zeros(len(free))), 1.0)
    fitter = Fitter(problem, gains, free, temper=True)
    null = fitter.hypothesis((), [])
    converge(fitter, null)
    return Search(problem, free, effect_parameters(problem), fitter, null, [null], gains)


@pytest.mark.parametrize("rough", [1.6, 0.6])
def test_the_disturbance_is_found_at_a_model_that_is_right(tmp_path, rough):
    search = searched(problem_of(make_case(tmp_path, np.zeros(ef.N_F), seed=4, runs=6, mocap=True, rough=rough)))
    before = search.problem.spectral.copy()
    assert level_disturbance(search)
    factors = np.sqrt(search.problem.spectral[:6] / before[:6])
    assert factors == pytest.approx(rough, rel=0.2)
    level_disturbance(search)  # from there it moves no more than the last of its steps
    assert np.sqrt(search.problem.spectral[:6] / before[:6]) == pytest.approx(factors, rel=0.2)


def test_where_the_sensors_are_as_told_so_is_the_disturbance(tmp_path, calm):
    well_specified = [
        noise_matches_file(one, levels.sensor_noise(one, 0.5, 2.0)) for one in (calm, noisier(calm, {"gyro": 1.5}))
    ]
    assert well_specified[0] > 0.99
    assert well_specified[1] < 0.01
    held = replace(calm, z=np.repeat(calm.z[::2], 2, axis=0)[: len(calm.z)])  # readings that say nothing of their noise
    assert noise_matches_file(held, levels.sensor_noise(held, 0.5, 2.0)) < 0.01
    search = searched(problem_of(make_case(tmp_path, np.zeros(ef.N_F), seed=4, mocap=True, rough=1.6)))
    search.well_specified = 1.0
    assert not level_disturbance(search)


def test_what_is_far_rougher_is_no_level_of_the_disturbance(tmp_path):
    search = searched(problem_of(make_case(tmp_path, np.zeros(ef.N_F), seed=4, mocap=True, rough=12.0)))
    level_disturbance(search)
    said = problem_of(search.problem.case).spectral[:6]
    assert (search.problem.spectral[:6] <= DIAGNOSIS.noise_factor**2 * said * 1.001).all()


def test_factors_are_counted_from_what_the_case_says(calm):
    found = levels.sensor_noise(noisier(calm, {"gyro": 1.5}), 0.5, 2.0).applied(calm)
    factors = levels.factors(found)
    assert factors["gyro"] == pytest.approx(1.5, rel=0.1)
    assert factors["disturbance_linear"] == pytest.approx(1.0)
    back = levels.as_said(found)
    assert np.allclose(back.R, calm.R)
    assert np.allclose(back.spectral, calm.spectral)


def test_noise_that_is_not_what_the_file_says_is_a_caution(calm):
    assert not any("noise" in line for line in cautions(calm))
    found = levels.sensor_noise(noisier(calm, {"gyro": 1.5}), 0.5, 2.0).applied(calm)
    said = [line for line in cautions(found) if "noise is not what" in line]
    assert len(said) == 1
    assert "gyro 1.5" in said[0]
    assert "depth" not in said[0]


def test_noise_that_is_not_white_says_nothing(calm):
    z = calm.z.copy()
    smoothed = np.convolve(z[:, ef.Y_DEPTH], [0.25, 0.5, 0.25], mode="same")
    z[:, ef.Y_DEPTH] = smoothed
    found = levels.sensor_noise(replace(calm, z=z), 0.5, 2.0)
    assert "depth" not in found.names
    assert "gyro" in found.names


def test_what_is_within_the_estimate_s_own_error_keeps_what_the_file_says(calm):
    noise = levels.sensor_noise(noisier(calm, {"gyro": 1.5}), 0.5, 2.0)
    found = noise.believed(0.0)
    assert np.exp(found.log[found.names.index("gyro")]) == pytest.approx(1.5, rel=0.1)
    assert all(abs(log) < 0.02 for name, log in zip(found.names, found.log, strict=True) if name != "gyro")
    assert np.allclose(noise.believed(0.999).log, 0.001 * found.log)  # all are the file's
