"""The decision rule of docs/explanation/against-healthy.md, computed from the page's formulas alone.

Compared with the program on ten small cases: tables of hypotheses with the mean squares that they leave.
"""

import itertools
import math

import numpy as np
import pytest

from glider.tools.diagnose import healthy_decision
from glider.tools.diagnose.healthy_decision import weigh
from glider.tools.diagnose.healthy_fits import Comparison, FreeForm, HealthyHypothesis
from glider.tools.diagnose.healthy_runs import AsUsual, Healthy
from glider.tools.inference.corrected import LINKS

EFFECTS = 46  # M
SHAPES = ("one", "depth", "rate")
SELDOM = {"e1": -2.0}  # d


def student(x, freedom):
    """Density of Student's distribution."""
    scale = math.gamma((freedom + 1) / 2) / (math.sqrt(freedom * math.pi) * math.gamma(freedom / 2))
    return scale * (1 + np.square(x) / freedom) ** (-(freedom + 1) / 2)


def normal(x, sigma):
    return np.exp(-0.5 * np.square(x / sigma)) / (sigma * math.sqrt(2 * math.pi))


def evidence(mu, sigma, precision, score):
    """E of the page, of one parameter."""
    g = score - precision * mu
    return 0.5 * (g**2 / (1 / sigma + precision) + mu * (2 * g + precision * mu) - math.log(1 + sigma * precision))


@pytest.fixture(autouse=True)
def seldom(monkeypatch):
    """One effect of the cases is one that seldom changes."""
    monkeypatch.setattr(healthy_decision, "SELDOM", SELDOM)


def by_the_page(n, level, s, runs, most, table, usual):
    """Probabilities of the main causes.

    table: (effects, shapes of the free form, mean square q, mean and standard deviation of each effect's parameter).
    usual: by effect the mean and variance of what the file is off by.
    """
    nu = n
    scatter2 = ((n - 1) * s**2 + 0.5**2) / nu
    N = min(2 * runs / scatter2, most)
    tau = math.sqrt(scatter2 * (1 / n + 1 / runs) + 0.25**2)
    q0 = next(q for effects, k, q, _ in table if not effects and not k)
    best = {}

    def log_weights(effects, k, q, gain):
        """Those of what is known, and of what is not."""
        A = -0.5 * (nu + N) * math.log(1 + N * q / nu) + gain

        def z(x):
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
        S = 0.25 if effects else 0.15
        u, m, C = u * (1 - S), m * S, 18.0 ** -(k > 0) * 11.0**-k
        own = C * ((0.5 / EFFECTS) ** len(effects) if effects else 0.5)
        u_named = u * math.exp(sum(SELDOM.get(e, 0.0) for e in effects))
        if k and not effects:
            return -math.inf, A + math.log(own * S * (u + m))
        if k:
            q_j = next(q for other, shapes, q, _ in table if other == effects and not shapes)
            r = math.sqrt(min(max((q_j - q) / (q0 - q), 0.0), 1.0))
            return A + math.log(own * u_named * 2 * (1 - S) * normal(r, 0.2)), A + math.log(own * (S * u + m))
        return A + math.log(own * u_named), A + math.log(own * m)

    for effects, k, q, fits in table:
        if (effects or k) and q >= q0:
            continue
        known = [e for e in effects if e in usual and not k]
        for unchanged in (c for j in range(len(known) + 1) for c in itertools.combinations(known, j)):
            gain = 0.0
            for e in unchanged:
                mean, sd = fits[effects.index(e)]
                precision, score = 1 / sd**2 - 1, mean / sd**2
                gain += evidence(*usual[e], precision, score) - evidence(0.0, 1.0, precision, score)
            rest = tuple(e for e in effects if e not in unchanged)
            one = log_weights(rest, k, q, gain)
            best[rest, k] = max(best.get((rest, k), one), one, key=lambda pair: np.logaddexp(*pair))
    found = {"unknown": 0.0}
    for (effects, _), (known, unknown) in best.items():
        name = effects[0] if effects else "none"
        found[name] = found.get(name, 0.0) + math.exp(known)
        found["unknown"] += math.exp(unknown)
    return {name: value / sum(found.values()) for name, value in found.items()}


class Given(Comparison):
    """A comparison whose mean squares are given, in place of flights."""

    def __init__(self, healthy: Healthy, runs: int, most: float, bare: float):
        self.healthy, self.runs, self.most, self.bare = healthy, runs, most, bare
        self.nuisance = np.zeros(0, dtype=int)
        self.places = {f"e{n}": np.array([n]) for n in range(EFFECTS)}

    @property
    def independent(self) -> float:
        return min(self.healthy.independent * self.runs, self.most)


def by_the_program(n, level, s, runs, most, table, usual):
    def hypothesis(effects, k, q, fits):
        values, sd = np.zeros(EFFECTS), np.array([one[1] for one in fits])
        values[[int(e[1:]) for e in effects]] = [one[0] for one in fits]
        form, nothing = FreeForm(LINKS[0], SHAPES[:k]) if k else None, np.zeros(EFFECTS)
        others, left = np.zeros((runs, EFFECTS)), np.full(runs, q / runs)
        return HealthyHypothesis(effects, values, left, others, nothing, form, np.diag(sd**2))

    off = {label: AsUsual(np.array([mean]), np.array([[variance]])) for label, (mean, variance) in usual.items()}
    healthy = Healthy(n, level, s, usual=off)
    return weigh(Given(healthy, runs, most, table[0][2]), [hypothesis(*row) for row in table]).probabilities()


def case(seed):
    """A small case: healthy flights, hypotheses that leave drawn mean squares, and what the file is off by."""
    rng = np.random.default_rng(seed)
    q0 = float(np.exp(rng.uniform(0.0, 3.0)))
    share = np.append(rng.uniform(0.1, 0.95, 1), rng.uniform(0.1, 1.1, 5))
    table = [
        ((), 0, q0), (("e1",), 0, q0 * share[0]), (("e2",), 0, q0 * share[1]), (("e1", "e3"), 0, q0 * share[2]),
        ((), 2, q0 * share[3]), (("e1",), 1, q0 * share[0] * share[4] / 1.1), (("e4",), 0, q0 * share[5]),
    ]  # fmt: skip
    runs, healthy = int(rng.integers(2, 7)), int(rng.integers(3, 13))
    head = healthy, rng.normal(0.0, 0.1), rng.uniform(0.2, 0.9), runs, rng.uniform(15.0, 200.0)
    usual = {e: (rng.normal(0.0, 0.3), rng.uniform(0.01, 0.1)) for e in ("e1", "e3", "e4")}
    fits = {e: (rng.normal(0.0, 0.8), rng.uniform(0.1, 0.7)) for e in ("e1", "e2", "e3", "e4")}
    return *head, [(*row, [fits[e] for e in row[0]]) for row in table], usual


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


def test_what_healthy_flights_show_of_an_effect_is_no_change():
    *head, table, _ = case(0)
    table = [((), 0, 0.44, []), (("e1",), 0, 0.39, [(0.33, 0.13)])]
    shown, not_shown = (by_the_program(*head, table, {"e1": off}) for off in ((0.3, 0.02), (0.0, 0.001)))
    assert not_shown["e1"] > 5.0 * shown["e1"]
