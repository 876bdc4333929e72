"""Random numbers by counting: reproducible, independent of order, and distributed as they should be."""

import numpy as np

from glider.sim_backend.core.noise import gaussian, uniform

SEED = np.uint64(2026)
N = 20_000


def draw(seed, stream, n=N):
    return np.array([gaussian(np.uint64(seed), stream, i) for i in range(n)])


def test_the_same_place_gives_the_same_number():
    assert gaussian(SEED, 3, 17) == gaussian(SEED, 3, 17)
    assert uniform(SEED, 3, 17) == uniform(SEED, 3, 17)


def test_normal_deviates_are_normal():
    from scipy import stats

    values = draw(1, 0)
    assert stats.kstest(values, "norm").pvalue > 1e-3
    assert abs(values.mean()) < 4 / np.sqrt(N)
    assert abs(values.var() - 1) < 4 * np.sqrt(2 / N)


def test_uniform_numbers_are_inside_and_uniform():
    from scipy import stats

    values = np.array([uniform(SEED, 5, i) for i in range(N)])
    assert values.min() > 0.0
    assert values.max() < 1.0
    assert stats.kstest(values, "uniform").pvalue > 1e-3


def test_streams_seeds_and_neighbours_are_uncorrelated():
    a = draw(1, 0)
    limit = 4 / np.sqrt(N)
    assert abs(np.corrcoef(a, draw(1, 1))[0, 1]) < limit
    assert abs(np.corrcoef(a, draw(2, 0))[0, 1]) < limit
    assert abs(np.corrcoef(a[:-1], a[1:])[0, 1]) < limit
