"""Worked example and decision rule of docs/explanation/identification.md, from its formulas and by the program."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from glider.tools.gap.measure import RunGap
from glider.tools.identify.core.metropolis import log_density
from glider.tools.identify.held import FILE, LIKELIHOOD, PREDICTION, Candidate, choose
from glider.tools.identify.statistics import LEVEL_WIDTH, collect, inflation

PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "identification.md"
e, J = np.array([1.2, -0.6, 0.9, 0.3]), np.array([[0.8, 0.4, 0.6, -0.2]])
BLOCK = np.array([0, 0, 1, 1])
GAPS = {LIKELIHOOD: (1.0, 1.2, 0.9, 1.1), PREDICTION: (0.7, 0.8, 0.7, 0.9)}


def stated() -> dict[str, str]:
    """The table of the page's worked example."""
    text = PAGE.read_text(encoding="utf-8").split("## Worked example")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return dict(rows[1:])


def numbers(text: str) -> list[float]:
    return [float(one) for one in re.findall(r"-?\d+\.\d+", text)]


def page_inflation(e, J, block):
    """Variance inflation by the page, one parameter or several."""
    values, vectors = np.linalg.eigh(J @ J.T)
    W, m = (vectors / np.sqrt(values)).T, len(values)
    blocks = [np.flatnonzero(block == one) for one in np.unique(block)]
    slopes = sum(float(np.square(W @ (J[:, k] @ e[k])).sum()) for k in blocks)
    traces = sum(float(np.square(W @ J[:, k] @ J[:, k].T @ W.T).sum()) for k in blocks)
    return max(1.0, slopes / max(m - traces, 0.1 * m))


def page_choice(gaps: dict[str, tuple[float, ...]]) -> tuple[float, float, dict[str, float], str]:
    """Mean and error of the fits' differences, the G of each candidate, and the one handed out, by the page."""

    def difference(a, b):
        d = [math.log(y) - math.log(x) for x, y in zip(gaps[a], gaps[b], strict=True)]
        mean = sum(d) / len(d)
        return mean, math.sqrt(0.2**2 + sum((one - mean) ** 2 for one in d)) / len(d)

    G = {name: math.sqrt(sum(one**2 for one in of) / len(of)) for name, of in gaps.items()}
    mean, s = difference(PREDICTION, LIKELIHOOD)
    out = PREDICTION if G[PREDICTION] < G[LIKELIHOOD] and mean > 2.0 * s else LIKELIHOOD
    less, error = difference(FILE, out) if FILE in gaps else (0.0, 1.0)
    return mean, s, G, FILE if FILE in gaps and G[FILE] < G[out] and less > error else out


def program_choice(gaps: dict[str, tuple[float, ...]]) -> str:
    candidates = [Candidate(name, None, "", [RunGap("", {}, total, 1) for total in gaps[name]], []) for name in gaps]
    return choose(candidates)[0].name


def test_the_worked_example_follows_from_the_formulas_and_from_the_program():
    table = list(stated().values())
    A, b = float((J @ J.T)[0, 0]), float((J @ e)[0])
    assert numbers(table[0]) == pytest.approx([A, b], abs=5e-5)
    h = page_inflation(e, J, BLOCK)
    assert inflation(e, J, BLOCK) == pytest.approx(h)
    assert numbers(table[1]) == pytest.approx([h], abs=5e-5)
    found = collect(np.zeros(1), np.full(1, -np.inf), e, J, np.zeros(4, dtype=int), ("depth",))
    for row, factor in ((2, 1.0), (3, h)):
        mode, sigma = -(b / factor) / (A / factor + 1.0), 1.0 / math.sqrt(A / factor + 1.0)
        assert numbers(table[row]) == pytest.approx([mode, sigma], abs=5e-5)
        tempered = found.tempered(factor)
        assert (tempered.mode[0], math.sqrt(tempered.covariance[0, 0])) == pytest.approx((mode, sigma))
    mean, s, G, out = page_choice(GAPS)
    assert numbers(table[4]) == pytest.approx([mean, s], abs=5e-5)
    assert numbers(table[5]) == pytest.approx(list(G.values()), abs=5e-5)
    assert table[6] == out == program_choice({FILE: (5.0, 4.0, 6.0, 5.0), **GAPS})


@pytest.mark.parametrize("seed", range(5))
def test_the_log_posterior_of_the_page_is_the_samplers(seed):
    rng = np.random.default_rng(seed)
    n, groups, h = 3, 2, 1.0 + rng.uniform()
    J, e, at = rng.normal(size=(n, 40)), rng.normal(size=40), rng.normal(size=n)
    group = rng.integers(0, groups, 40)
    q = collect(at, np.full(n, -np.inf), e, J, group, ("a", "b")).tempered(h)

    def page(theta, level):
        total, d = -0.5 * float(theta @ theta), theta - at
        for g in range(groups):
            k = group == g
            A, b, c = J[:, k] @ J[:, k].T, J[:, k] @ e[k], float(e[k] @ e[k])
            square = c + 2.0 * float(b @ d) + float(d @ A @ d)
            total -= k.sum() * level[g] / h + math.exp(-2.0 * level[g]) * square / (2.0 * h)
            total -= 0.5 * (level[g] / 0.5) ** 2
        return total

    def program(theta, level):
        d = theta - at
        A0, b0 = np.eye(n), at
        return log_density(d, level, A0, b0, q.A, q.b, q.c, q.count, LEVEL_WIDTH, np.zeros((0, n)), np.zeros(0))

    points = [(rng.normal(size=n), rng.normal(0.0, 0.3, groups)) for _ in range(4)]
    differences = [page(*point) - program(*point) for point in points]
    assert differences == pytest.approx([differences[0]] * 4)  # but for a constant


def drawn_gaps(seed: int) -> dict[str, tuple[float, ...]]:
    """Gaps of the three candidates on a few flights."""
    rng = np.random.default_rng(seed)
    runs, level = int(rng.integers(1, 6)), rng.uniform(0.3, 1.5, 3)
    names = (FILE, LIKELIHOOD, PREDICTION)
    return {name: tuple((level[k] * np.exp(rng.normal(0.0, 0.15, runs))).tolist()) for k, name in enumerate(names)}


@pytest.mark.parametrize("seed", range(10))
def test_the_rule_of_the_page_is_the_programs(seed):
    assert page_choice(drawn_gaps(seed))[3] == program_choice(drawn_gaps(seed))


def test_the_ten_cases_hand_out_every_candidate():
    assert {page_choice(drawn_gaps(seed))[3] for seed in range(10)} == {FILE, LIKELIHOOD, PREDICTION}


@pytest.mark.parametrize("seed", range(3))
def test_the_variance_inflation_of_the_page_is_the_programs(seed):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(3, 60))
    e = np.repeat(rng.normal(size=12), 5) + 0.3 * rng.normal(size=60)
    block = np.repeat(np.arange(6), 10)
    assert max(1.0, inflation(e, J, block)) == pytest.approx(page_inflation(e, J, block))
