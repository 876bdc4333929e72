"""The worked example of docs/explanation/velocity.md, from the page's formulas and by the program."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from glider.sim_backend.ocean.core import layout as at
from glider.tools.gap.velocity import mean_speed, of_run

PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "velocity.md"


def stated() -> list[list[float]]:
    text = PAGE.read_text(encoding="utf-8").split("## Worked example")[1].split("\n## ")[0]
    rows = [line.split("|")[2] for line in text.splitlines() if line.startswith("| ")][1:]
    return [[float(one) for one in re.findall(r"-?\d+\.\d+", row)] for row in rows]


class Part:
    """A run whose filter gives level flight at the speeds that a model is."""

    def __init__(self, rows: int):
        self.seen = np.zeros(at.Y_SPEED + 1, dtype=bool)
        self.recording = SimpleNamespace(inputs=np.zeros((rows, max(at.U_UNSTEADY, at.U_YAW) + 1)))
        self.runs = [None]

    def filter(self, speeds, F):
        X = np.zeros((len(speeds), max(at.X_SPEED, at.X_GLIDE, at.X_WATER) + 1))
        X[:, at.X_SPEED] = speeds
        return SimpleNamespace(X=X, path=np.zeros((len(speeds), 2)))


def test_the_worked_example_follows_from_the_formulas_and_from_the_program():
    u, *moves, (mean, sigma), interval = map(np.array, stated())
    assert mean == pytest.approx(u.mean(), abs=5e-5)
    wanted = np.sqrt(sum(move.mean() ** 2 for move in moves))
    assert sigma == pytest.approx(wanted, abs=5e-5)
    assert interval == pytest.approx(u.mean() + 1.645 * wanted * np.array([-1.0, 1.0]), abs=5e-5)
    found = of_run(Part(len(u)), (u, None), [(u + move, None) for move in moves])
    assert found.sd_mean_u == pytest.approx(wanted)
    said = mean_speed(found)
    assert said["u_m_s"] == pytest.approx(u.mean())
    assert said["ci90"] == pytest.approx(u.mean() + 1.645 * wanted * np.array([-1.0, 1.0]), abs=5e-6)
