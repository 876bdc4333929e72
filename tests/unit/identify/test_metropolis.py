"""The sampler against posteriors whose moments are known, and against itself."""

import numpy as np
import pytest

from glider.tools.identify.core.metropolis import log_density
from glider.tools.identify.sampler import sample, summarise, whiten
from glider.tools.identify.statistics import collect, inflation


def regression(rng, samples=400, n=5, noise=(1.0, 2.0)):
    """A linear problem with two noise groups: truth, statistics, and columns."""
    truth = rng.normal(0.0, 0.5, n)
    J = rng.normal(0.0, 1.0, (n, samples)) * 10.0 ** rng.uniform(-1.0, 0.5, (n, 1))
    group = np.arange(samples) % 2
    e = -truth @ J + rng.standard_normal(samples) * np.array(noise)[group]
    return truth, collect(np.zeros(n), np.full(n, -np.inf), e, J, group, ("one", "two")), J, e


def test_moments_are_those_of_the_normal_posterior():
    rng = np.random.default_rng(3)
    _, statistics, _, _ = regression(rng, noise=(1.0, 1.0))
    chains = sample(statistics, seed=5, draws=8000)
    scale = np.sqrt(np.diag(statistics.covariance))
    flat = chains.flat
    # levels are free, so that the means move by what their spread allows: a few per cent of a sigma here
    assert np.abs((flat.mean(axis=0) - statistics.mode) / scale).max() < 0.1
    assert np.abs(flat.std(axis=0) / scale - 1.0).max() < 0.1
    assert np.abs(np.cov(flat.T) - statistics.covariance).max() < 0.1 * np.diag(statistics.covariance).max()


def test_noise_levels_are_found():
    _, statistics, _, _ = regression(np.random.default_rng(4), samples=4000, noise=(0.8, 1.5))
    levels = np.exp(sample(statistics, seed=1).levels.mean(axis=(0, 1)))
    assert levels == pytest.approx([0.8, 1.5], rel=0.05)


def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    _, statistics, _, _ = regression(np.random.default_rng(5))
    first, second, third = (sample(statistics, seed, draws=200) for seed in (7, 7, 8))
    assert np.array_equal(first.values, second.values)
    assert np.array_equal(first.levels, second.levels)
    assert not np.array_equal(first.values, third.values)


def test_limits_are_kept():
    rng = np.random.default_rng(6)
    _, statistics, _, _ = regression(rng)
    statistics.low[0] = statistics.mode[0] + 0.5 * np.sqrt(statistics.covariance[0, 0])
    values = sample(statistics, seed=2).values
    assert values[:, :, 0].min() >= statistics.low[0] - 1e-12


def test_density_is_the_formula():
    rng = np.random.default_rng(8)
    _, statistics, J, e = regression(rng)
    white = whiten(statistics)
    y, levels = rng.normal(size=5), rng.normal(0.0, 0.1, 2)
    values = white.mode + white.root @ y
    group = np.arange(len(e)) % 2
    left = (e + values @ J) / np.exp(levels)[group]
    width = white.width
    expected = -0.5 * (left @ left + values @ values + (levels / width) @ (levels / width)) - levels[group].sum()
    nothing = -0.5 * (white.mode @ white.mode)  # the kernel leaves this constant out
    assert log_density(y, levels, *white.arguments) == pytest.approx(expected - nothing, rel=1e-9)


def test_chains_mix_and_say_so():
    _, statistics, _, _ = regression(np.random.default_rng(9))
    chains = sample(statistics, seed=3)
    for one in summarise([f"p{i}" for i in range(5)], 5 * [""], chains.values):
        assert one.rhat < 1.01
        assert one.ess > 2000
        assert one.ci90[0] < one.mean < one.ci90[1]


def test_heat_is_one_for_white_errors_and_more_for_errors_that_last():
    rng = np.random.default_rng(10)
    samples, blocks = 20_000, 200
    J = np.repeat(rng.normal(size=(6, blocks)), samples // blocks, axis=1)
    block = np.repeat(np.arange(blocks), samples // blocks)
    white = rng.standard_normal(samples)
    lasting = np.convolve(rng.standard_normal(samples + 9), np.ones(10) / np.sqrt(10.0), "valid")
    assert inflation(white, J, block) == pytest.approx(1.0, abs=0.25)
    assert inflation(lasting, J, block) > 5.0


def test_centred_statistics_have_their_mode_where_they_were_taken():
    _, statistics, _, _ = regression(np.random.default_rng(11))
    statistics.at[:] = 0.3
    assert np.allclose(statistics.centred().mode, 0.3)
    assert np.allclose(statistics.centred().covariance, statistics.covariance)
