"""The law of docs/explanation/control.md, computed from the page's formulas alone and compared with the program."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from glider.firmware.core.control.law import OK, decrease_margin, feedback, k2_to_cover, pitch_depth_law
from glider.firmware.core.control.law_plus import JERK_RATE_SHARE

PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "control.md"
PITCH, DEPTH = (0.8, 0.01, 0.8, 0.1), (0.3, 0.05, 0.4, 0.05)  # k1, k2, k3, eps: moderate
INF = math.inf


def sat(x):
    return max(-1.0, min(1.0, x))


def phi(s, g, gains, jerk=INF):
    _, k2, k3, eps = gains
    push = k3 * s + g * k2 * sat(s / eps) * sat(g / eps)
    most = math.sqrt(2.0 * jerk * abs(s)) if jerk < INF else INF
    return max(-most, min(most, push))


def by_the_page(f, G, e, rates, reference, gains, low, high, jerk=(INF, INF)):
    """Both sliding variables and inputs."""
    s = [k[0] * error + rate for k, error, rate in zip(gains, e, rates, strict=True)]
    demand = [
        reference[i] - gains[i][0] * rates[i] - phi(s[i], G[i][i], gains[i], jerk[i]) - f[i] for i in range(2)
    ]  # fmt: skip
    joint = np.linalg.solve(np.array(G), demand)
    short = joint - np.clip(joint, low, high)
    return s, joint, [joint[0] + G[0][1] * short[1] / G[0][0], joint[1] + G[1][0] * short[0] / G[1][1]]


def by_the_program(f, G, e, rates, reference, gains, low, high, jerk=(INF, INF)):
    u_s, u_b, s_t, s_z, status = pitch_depth_law(
        *f, G[0][0], G[0][1], G[1][0], G[1][1], 0.9, e[0], rates[0], reference[0], *gains[0], jerk[0],
        e[1], rates[1], reference[1], *gains[1], jerk[1], low[0], high[0], low[1], high[1],
    )  # fmt: skip
    assert status == OK
    return [s_t, s_z], [u_s, u_b]


F, G = (0.05, 0.002), ((-3.2, -0.7), (-0.05, 0.4))
EXAMPLE = (F, G, (0.2, 0.3), (-0.05, -0.02), (0.0, 0.0), (PITCH, DEPTH))
FREE, HELD = ((-INF, -INF), (INF, INF)), ((-INF, 0.0), (INF, 0.05))


def example() -> list[list[float]]:
    """What the page's table should state, by the formulas."""
    s, joint, _ = by_the_page(*EXAMPLE, *FREE)
    held = by_the_page(*EXAMPLE, *HELD)[2]
    pushes = [phi(s[0], G[0][0], PITCH), phi(s[1], G[1][1], DEPTH)]
    cover = 0.02 / (3.2 * sat(3.2 / PITCH[3]))
    return [s, pushes, list(joint), [held[0]], [cover], [abs(pushes[0]) - abs(-3.2 * -0.001) - 0.02]]


def test_the_worked_example_follows_from_the_formulas():
    text = PAGE.read_text(encoding="utf-8").split("## Worked example")[1].split("\n## ")[0]
    rows = [line.split("|")[2] for line in text.splitlines() if line.startswith("| ")][1:]
    table = [[float(one) for one in re.findall(r"-?\d+\.\d+", row)] for row in rows]
    for row, wanted in zip(table, example(), strict=True):
        assert row == pytest.approx(wanted, abs=5e-6)


def test_the_worked_example_is_the_programs():
    s, pushes, joint, held, cover, margin = example()
    found = by_the_program(*EXAMPLE, *FREE)
    assert [*found[0], *found[1]] == pytest.approx([*s, *joint])
    assert by_the_program(*EXAMPLE, *HELD)[1][0] == pytest.approx(held[0])
    _, k2, k3, eps = PITCH
    assert feedback(s[0], -3.2, k2, k3, eps, INF) == pytest.approx(pushes[0])
    assert k2_to_cover(0.015, 0.005, -3.2, eps) == pytest.approx(cover[0])
    assert decrease_margin(s[0], -3.2, k2, k3, eps, INF, -3.2 * -0.001, 0.015, 0.005) == pytest.approx(margin[0])


@pytest.mark.parametrize("seed", range(10))
def test_the_law_of_the_page_is_the_programs(seed):
    rng = np.random.default_rng(seed)
    G = ((-rng.uniform(1, 4), -rng.uniform(0.2, 1)), (rng.uniform(-0.2, 0.2), rng.uniform(0.2, 0.6)))
    f, e, rates, reference = (tuple(rng.normal(0.0, 0.2, 2)) for _ in range(4))
    gains = (PITCH, DEPTH)
    low, high = tuple(-rng.uniform(0.01, 0.1, 2)), tuple(rng.uniform(0.01, 0.1, 2))
    jerk = (JERK_RATE_SHARE * -G[0][0] * 0.02, JERK_RATE_SHARE * G[1][1] * 0.05) if seed % 2 else (INF, INF)
    s, _, u = by_the_page(f, G, e, rates, reference, gains, low, high, jerk)
    found = by_the_program(f, G, e, rates, reference, gains, low, high, jerk)
    assert [*found[0], *found[1]] == pytest.approx([*s, *u])
