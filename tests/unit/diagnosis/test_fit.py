"""Fits: bounded steps against scipy, least misfit found, evidence against a closed form."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.fit import SIDE_STEPS, Fitter, bounded_step
from glider.tools.inference.parameters import effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case


def test_steps_within_limits_are_those_of_bounded_least_squares():
    rng = np.random.default_rng(4)
    for _ in range(50):
        A, b = rng.standard_normal((12, 5)), rng.standard_normal(12)
        low, high = -rng.uniform(0.0, 0.5, 5), rng.uniform(0.0, 0.5, 5)
        step = bounded_step(A.T @ A, A.T @ b, low, high)
        assert (step >= low - 1e-9).all()
        assert (step <= high + 1e-9).all()
        best = lsq_linear(A, -b, (low - 1e-12, high + 1e-12), tol=1e-14)
        reached = 0.5 * ((A @ step + b) ** 2).sum()
        assert reached == pytest.approx(best.cost, rel=1e-6)


@pytest.fixture(scope="module")
def fitter(tmp_path_factory):
    F = np.zeros(ef.N_F)
    F[ef.PITCH_BIAS] = 0.04
    problem = problem_of(make_case(tmp_path_factory.mktemp("fit"), F, seed=2))
    gains = problem.filter(problem.model.P, np.zeros(ef.N_F), process_noise_scale=20.0, begin=True)
    return Fitter(problem, gains, nuisance_parameters(problem), temper=True)


def test_the_fit_of_the_true_label_finds_its_size(fitter):
    free = effect_parameters(fitter.problem)["imu_pitch_bias"]
    hypothesis = fitter.hypothesis(("imu_pitch_bias",), free)
    for _ in range(5):
        fitter.advance([hypothesis])
    P, F = model_at(fitter.problem, [*fitter.nuisance, *free], np.concatenate([hypothesis.nuisance, hypothesis.values]))
    gains = fitter.problem.filter(P, F, begin=True)
    fine = Fitter(fitter.problem, gains, fitter.nuisance, hypothesis, temper=True)
    again = fine.hypothesis(hypothesis.labels, free, hypothesis.values, hypothesis.nuisance)
    for _ in range(4):
        fine.advance([again])
    # the bias of the sensor itself (0.15 deg) is part of what is read
    assert again.values[0] * free[0].spread + again_bias(fine, again) == pytest.approx(0.04, abs=0.008)


def again_bias(fitter, hypothesis) -> float:
    """The nuisance pitch bias of a fit, rad."""
    return sum(f.spread * v for f, v in zip(fitter.nuisance, hypothesis.nuisance, strict=True) if f.name == "bias[1]")


def test_log_evidence_is_that_of_a_linear_gaussian_model(fitter):
    """With nothing beside what is allowed, -misfit/2 - log det/2 is the Gaussian marginal up to a constant."""
    null = fitter.hypothesis((), [])
    fitter.measure([null])
    fitter.linearise([null])
    e, J = fitter.e0, fitter.J
    one_step = null.misfit - null.expected_fall()
    # |e|^2 - b' A^-1 b with b = J e: the exponent of N(e; 0, I + J'J / tight)
    b = J @ e
    closed = e @ e - b @ np.linalg.solve(J @ J.T + fitter.prior_weight * np.eye(len(J)), b)
    held = np.abs(null.full_step) >= 3.5 - 1e-9
    assert one_step >= closed - 1e-6
    if not held.any():
        assert one_step == pytest.approx(closed, rel=1e-9)
    _, logdet = np.linalg.slogdet(J @ J.T / fitter.prior_weight + np.eye(len(J)))
    assert fitter.occam == pytest.approx(logdet, rel=1e-9)


def test_only_delays_are_tried_aside_and_only_where_they_might_win(fitter):
    known = effect_parameters(fitter.problem)
    free = [*known["command_delay"], *known["drag"]]
    hypothesis = fitter.hypothesis(("command_delay", "drag"), free)
    fitter.linearise([hypothesis])
    assert [f.delays for f in free] == [True] + [False] * (len(free) - 1)
    assert len(hypothesis.side_steps(hopeful=False)) == len(free)
    assert len(hypothesis.side_steps(hopeful=True)) == len(free) + 2 * len(SIDE_STEPS)
