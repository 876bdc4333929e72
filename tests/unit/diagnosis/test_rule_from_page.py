"""The decision rule of docs/explanation/against-healthy.md, computed from the page's formulas alone.

Compared with the program on ten small cases: tables of hypotheses with the mean squares that they leave.
"""

import math

import numpy as np
import pytest

from glider.tools.diagnose.against_healthy import Comparison, FreeForm, Healthy, HealthyHypothesis, weigh
from glider.tools.inference.corrected import LINKS

EFFECTS = 46  # M
SHAPES = ("one", "depth", "rate")


def student(x, freedom):
    """Density of Student's distribution."""
    scale = math.gamma((freedom + 1) / 2) / (math.sqrt(freedom * math.pi) * math.gamma(freedom / 2))
    return scale * (1 + np.square(x) / freedom) ** (-(freedom + 1) / 2)


def normal(x, sigma):
    return np.exp(-0.5 * np.square(x / sigma)) / (sigma * math.sqrt(2 * math.pi))


def by_the_page(n, level, s, runs, most, table):
    """Probabilities of the main causes: table of (effects, shapes of the free form, mean square q)."""
    nu = n
    scatter2 = ((n - 1) * s**2 + 0.5**2) / nu
    N = min(2 * runs / scatter2, most)
    tau = math.sqrt(scatter2 * (1 / n + 1 / runs) + 0.25**2)
    q0 = next(q for effects, k, q in table if not effects and not k)
    S, known, unknown = 0.15, {}, 0.0
    for effects, k, q in table:
        if (effects or k) and q >= q0:
            continue
        A = -0.5 * (nu + N) * math.log(1 + N * q / nu)

        def z(x, q=q):
            return (math.log(q) - np.log(x)) / tau

        if effects:
            a = np.linspace(0.005, 0.995, 100)
            w = normal(a, 0.2) / normal(a, 0.2).sum()
            x = math.exp(level) + a**2 * max(q0 - math.exp(level), 0.0)
            u = (w * student(np.maximum(0, z(x)), nu)).sum()
            m = student(z(x), nu).mean()
        else:
            y = np.linspace(0, 6, 121)
            u = float(student(max(0.0, float(z(math.exp(level)))), nu))
            m = (2 * normal(y, 1.5) * student(z(np.exp(level + y)), nu)).sum() * (y[1] - y[0])
        u, m, C = u * (1 - S), m * S, 18.0 ** -(k > 0) * 11.0**-k
        own = math.exp(A) * C * ((0.5 / EFFECTS) ** len(effects) if effects else 0.5)
        name = effects[0] if effects else "none"
        if k and not effects:
            unknown += own * S * (u + m)
        elif k:
            q_j = next(q for other, shapes, q in table if other == effects and not shapes)
            r = math.sqrt(min(max((q_j - q) / (q0 - q), 0.0), 1.0))
            known[name] = known.get(name, 0.0) + own * u * 2 * (1 - S) * normal(r, 0.2)
            unknown += own * (S * u + m)
        else:
            known[name] = known.get(name, 0.0) + own * u
            unknown += own * m
    whole = sum(known.values()) + unknown
    return {name: value / whole for name, value in known.items()} | {"unknown": unknown / whole}


class Given(Comparison):
    """A comparison whose mean squares are given, in place of flights."""

    def __init__(self, healthy: Healthy, runs: int, most: float, bare: float):
        self.healthy, self.runs, self.most, self.bare = healthy, runs, most, bare
        self.places = {f"e{n}": np.zeros(1, dtype=int) for n in range(EFFECTS)}

    @property
    def independent(self) -> float:
        return min(self.healthy.independent * self.runs, self.most)


def by_the_program(n, level, s, runs, most, table):
    def hypothesis(effects, k, q):
        form = FreeForm(LINKS[0], SHAPES[:k]) if k else None
        nothing = np.zeros(1)
        return HealthyHypothesis(effects, nothing, np.full(runs, q / runs), np.zeros((runs, 1)), nothing, form)

    healthy = Healthy([f"run{i}" for i in range(n)], {}, n, level, s)
    return weigh(Given(healthy, runs, most, table[0][2]), [hypothesis(*row) for row in table]).probabilities()


def case(seed):
    """A small case: healthy flights, and hypotheses that leave drawn mean squares."""
    rng = np.random.default_rng(seed)
    q0 = float(np.exp(rng.uniform(0.0, 3.0)))
    share = np.append(rng.uniform(0.1, 0.95, 1), rng.uniform(0.1, 1.1, 5))
    table = [
        ((), 0, q0), (("e1",), 0, q0 * share[0]), (("e2",), 0, q0 * share[1]), (("e1", "e3"), 0, q0 * share[2]),
        ((), 2, q0 * share[3]), (("e1",), 1, q0 * share[0] * share[4] / 1.1), (("e4",), 0, q0 * share[5]),
    ]  # fmt: skip
    runs, healthy = int(rng.integers(2, 7)), int(rng.integers(3, 13))
    return healthy, rng.normal(0.0, 0.1), rng.uniform(0.2, 0.9), runs, rng.uniform(15.0, 200.0), table


def test_the_page_has_the_programs_number_of_links():
    assert len(LINKS) == 18


@pytest.mark.parametrize("seed", range(10))
def test_the_rule_of_the_page_is_the_programs(seed):
    page, program = by_the_page(*case(seed)), by_the_program(*case(seed))
    for name in page.keys() | program.keys():
        assert program.get(name, 0.0) == pytest.approx(page.get(name, 0.0), abs=1e-9)


def test_the_ten_cases_have_more_than_one_verdict():
    verdicts = [max(found, key=found.get) for found in (by_the_page(*case(seed)) for seed in range(10))]
    assert len(set(verdicts)) > 1
