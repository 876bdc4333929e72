"""Waves beside an effect: told by their line from a force that nobody knows, and by a second search from the effect."""

from types import SimpleNamespace

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.noise_probes import WAVES
from glider.tools.diagnose.search import run
from glider.tools.diagnose.verdict import conclude
from glider.tools.diagnose.waves import line_share
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case

ROWS = 600


def share(signal) -> float:
    """The line's share of innovations of two runs of a minute: `signal(t)` and white noise in two readings of place."""
    rng, t = np.random.default_rng(3), np.arange(ROWS) / 10.0
    E = np.full((2 * ROWS, ef.N_Y), np.nan)
    E[:, [ef.Y_DEPTH, ef.Y_MOCAP_Z]] = np.tile(signal(t), 2)[:, None] + rng.standard_normal((2 * ROWS, 2))
    recording = SimpleNamespace(t=np.tile(t, 2), bounds=np.array([0, ROWS, 2 * ROWS]))
    return line_share(SimpleNamespace(recording=recording), SimpleNamespace(E=E))


def sea(t, phase=0.0):
    """Five components about 4 s."""
    return sum(np.sin(2.0 * np.pi / 4.0 * f * t + 7.0 * f + phase) for f in (0.87, 0.95, 1.0, 1.06, 1.14))


def test_a_sea_has_a_line_and_what_goes_with_the_legs_has_none():
    assert share(sea) > DIAGNOSIS.wave_share + 0.1
    assert share(lambda t: 0.0 * t) < DIAGNOSIS.wave_share - 0.1
    legs = share(lambda t: 2.0 * np.exp(-np.mod(t, 20.0) / 3.0) * np.where(np.mod(t, 40.0) < 20.0, 1.0, -1.0))
    assert legs < DIAGNOSIS.wave_share - 0.1


def test_small_waves_hide_nothing_beside_them(tmp_path):
    F = np.zeros(ef.N_F)
    F[ef.NET_MASS_OFFSET] = 0.08

    def moved(t: np.ndarray) -> np.ndarray:
        return 0.05 * np.stack([sea(t), sea(t, 1.0), sea(t, 2.0)], axis=1)

    answer = conclude(run(problem_of(make_case(tmp_path, F, seed=9, runs=2, mocap=True, moved=moved))))
    assert answer.noise.probe.name == WAVES
    assert answer.main == "net_buoyancy"
    assert answer.probabilities["unknown"] < 0.2
