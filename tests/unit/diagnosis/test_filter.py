"""Whitened innovations: white for the true model, the same with kept gains, held against the linear Kalman filter."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.timing import mean_input
from glider.tools.diagnose.residuals import tests as residual_tests
from glider.tools.inference.core.error_layout import N_ERR
from glider.tools.inference.core.step import difference, inject_error
from glider.tools.inference.problem import problem_of
from tests.support.cases import begins, drawn, make_case


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return problem_of(make_case(tmp_path_factory.mktemp("white"), np.zeros(ef.N_F), seed=1, mocap=True))


def test_the_true_model_leaves_white_innovations_of_unit_variance(problem):
    rng = np.random.default_rng(5)
    P, F = drawn(problem, np.zeros(ef.N_F), rng)
    starts = begins(problem, rng)
    problem.z[:] = problem.simulated(P, F, starts, rng)
    gains = problem.filter(P, F, begin=True)
    e = gains.E[problem.valid]
    assert abs((e @ e) / len(e) - 1.0) < 5.0 * np.sqrt(2.0 / len(e))
    strongest = max(abs(f.sigma) for f in residual_tests(problem, gains))
    assert strongest < 5.0


def test_a_wrong_model_does_not(problem):
    F = np.zeros(ef.N_F)
    F[ef.PITCH_BIAS] = 0.05
    gains = problem.filter(problem.model.P, F, begin=True)
    e = gains.E[problem.valid]
    assert (e @ e) / len(e) > 1.5


def test_kept_gains_give_the_filters_own_innovations_for_its_own_model(problem):
    F = np.zeros(ef.N_F)
    gains = problem.filter(problem.model.P, F)
    followed = problem.follow([(problem.model.P, F)], gains)[0]
    # the filter flies by the C library's functions, what is followed by those of several numbers at once
    np.testing.assert_allclose(followed, gains.E[problem.valid], rtol=1e-9, atol=1e-9)


def test_innovations_whiten_the_joint_covariance(problem):
    """W S W' = I with S = R + H cov H': the whitening of the last row, from K~ = cov H' W'."""
    gains = problem.filter(problem.model.P, np.zeros(ef.N_F))
    W, K = gains.W[-1], gains.K[-1]
    on = problem.valid[-1]
    S = np.linalg.inv(W[np.ix_(on, on)].T @ W[np.ix_(on, on)])
    # the innovation covariance minus the measurement noise is what the state may be off by: positive semidefinite
    rest = S - np.diag(problem.R[-1][on])
    assert np.linalg.eigvalsh(0.5 * (rest + rest.T)).min() > -1e-9
    assert K.shape == (N_ERR, ef.N_Y)


def test_difference_undoes_correct():
    rng = np.random.default_rng(2)
    x = rng.standard_normal(ef.N_XF)
    x[3:7] /= np.linalg.norm(x[3:7])
    error = 1e-4 * rng.standard_normal(N_ERR)
    y, back = x.copy(), np.empty(N_ERR)
    inject_error(y, error)
    difference(y, x, back)
    assert np.allclose(back, error, rtol=1e-6, atol=1e-12)
    assert y[ef.X_GEAR_SERVO] - x[ef.X_GEAR_SERVO] == pytest.approx(error[12])


@pytest.mark.parametrize(("since", "until", "expected"), [
    (0.2, 0.3, 3.0), (0.15, 0.25, 2.5), (-5.0, -4.0, 1.0), (-0.05, 0.05, 1.0), (0.05, 0.25, (0.05 + 0.2 + 0.15) / 0.2),
])  # fmt: skip
def test_a_delayed_command_is_its_mean_over_the_step(since, until, expected):
    t = np.arange(5) * 0.1
    inputs = np.array([[1.0], [2.0], [3.0], [4.0], [5.0]])
    assert mean_input(t, inputs, 0, 3, 0, since, until) == pytest.approx(expected)


def test_blanking_what_comes_later_changes_no_earlier_innovation(problem):
    F = np.zeros(ef.N_F)
    whole = problem.filter(problem.model.P, F)
    cut = int(problem.recording.bounds[1]) - 100
    kept = problem.z.copy()
    problem.z[cut : problem.recording.bounds[1]] = np.nan
    try:
        blanked = problem.filter(problem.model.P, F)
    finally:
        problem.z[:] = kept
    assert np.array_equal(whole.E[:cut], blanked.E[:cut], equal_nan=True)
    assert np.array_equal(whole.X[:cut], blanked.X[:cut])


def test_no_call_depends_on_the_calls_before_it(problem):
    """Filters that begin at other speeds, of the problem and of a variant of it, change nothing of what others say."""
    own, other = (problem.model.P, np.zeros(ef.N_F)), (problem.model.P * 1.05, np.zeros(ef.N_F))
    variant = problem.with_extra_noise(np.zeros(problem.kind.n_spectral))

    def asked() -> list[np.ndarray]:
        gains = problem.filter(*own, begin=True)
        return [gains.E, gains.starts, problem.follow([own, other], gains), problem.filter(*own).E]

    first, before = asked(), problem.starts.copy()
    slow, fast = (one.filter(*other, begin=True, speeds=(u,)) for one, u in ((problem, 0.03), (variant, 0.4)))
    assert not np.array_equal(slow.starts, fast.starts)
    np.testing.assert_array_equal(problem.starts, before)
    for one, again in zip(first, asked(), strict=True):
        np.testing.assert_array_equal(one, again)
    # kept gains know where they began: a filter from there is theirs
    for gains in (slow, fast):
        np.testing.assert_array_equal(problem.filter(*other, starts=gains.starts).E, gains.E)
    at_slow, at_fast = (problem.follow([other], gains)[0] for gains in (slow, fast))
    np.testing.assert_allclose(at_slow, slow.E[problem.valid], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(at_fast, fast.E[problem.valid], rtol=1e-9, atol=1e-9)
