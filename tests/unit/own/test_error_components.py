"""What errors of windows are made of, learned from healthy runs: independent after it, and scores as large as said."""

import numpy as np
import pytest

from glider.tools.own.check import load_own
from glider.tools.own.effects import standard_effects
from glider.tools.own.error_components import Components, Whitening, independence, learn_components, patterns
from glider.tools.own.excess_noise import SEGMENTS
from glider.tools.own.healthy import healthy_of
from glider.tools.own.hierarchy import ChannelErrors, expand
from glider.tools.own.identified import VEHICLE, write
from glider.tools.own.identify import identify
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun
from tests.support.boat import MODEL

RUNS, HORIZON = 40, 10.0
WHITE, DENSITY = 0.01, 0.03  # m/s; m/s2 a root of Hz, half more than the model's


def flights(held: float) -> list[OwnRun]:
    """Runs of the model itself under noise and, in each window, a force of 1 sigma `held`."""
    random, t, runs = np.random.default_rng(11), np.arange(0.0, 30.0, 0.1), []
    for n in range(RUNS):
        u, v, out = np.array([random.uniform(0.1, 0.3), 0.0]), 0.5, []
        forces = held * random.standard_normal(4)
        for k in t:
            out.append(v + WHITE * random.standard_normal())
            v += 0.1 * (u[0] - 0.4 * v + forces[int(k // HORIZON)] + DENSITY * random.standard_normal() / np.sqrt(0.1))
        runs.append(OwnRun(f"run{n}", t, np.tile(u, (len(t), 1)), np.array(out)[:, None]))
    return runs


@pytest.fixture(scope="module", params=[0.0, 0.03], ids=["white", "held too"])
def held(request):
    return request.param


@pytest.fixture(scope="module")
def observer(held, tmp_path_factory):
    folder = tmp_path_factory.mktemp("components")
    (folder / "boat.py").write_text(MODEL)
    (folder / "boat.toml").write_text('format = 1\nmodel = "boat"\n[windows]\nseconds = 10.0\n')
    return observer_of(load_own(folder / "boat.toml"), flights(held))


@pytest.fixture(scope="module")
def found(observer):
    return [patterns(observer, n, HORIZON) for n in range(RUNS)]


@pytest.fixture(scope="module")
def learned(observer, found):
    """From every second run."""
    usual = Components(np.sqrt(observer.point.variance) / observer.tolerances, np.ones(1), np.ones(1), 1.0)
    return learn_components(found[::2], usual)


def test_each_is_what_the_runs_were_made_with(observer, learned, held):
    """Rows have what forces held over parts of a window leave of white noise, too: a Brownian bridge of 10 s / 12."""
    bridge = DENSITY * np.sqrt(HORIZON / SEGMENTS / 6.0)
    assert learned.white * observer.tolerances == pytest.approx(np.hypot(WHITE, bridge), rel=0.2)
    density = observer.declared.noises[0].density
    assert density * np.sqrt(learned.forces[0]) == pytest.approx(DENSITY, rel=0.1)
    assert density * np.sqrt(learned.held[0] / HORIZON) == pytest.approx(held, abs=0.007)


def repeats(errors: list[np.ndarray]) -> float:
    """Correlation of successive rows."""
    return float(np.mean([(a[1:] * a[:-1]).mean() / (a**2).mean() for a in errors]))


def test_errors_of_other_runs_are_independent_and_of_variance_1(found, learned):
    raw, white = [one.errors for one in found[1::2]], [Whitening(one, learned)(one.errors) for one in found[1::2]]
    assert repeats(raw) > 0.8
    assert abs(repeats(white)) < 0.3  # twelve forces a window do not follow it from row to row
    assert np.mean([(one**2).mean() for one in white]) == pytest.approx(1.0, abs=0.1)


def test_scores_of_labels_vary_as_their_curvature_says(observer, found, learned):
    """Of every label, in other runs; were errors thought independent, five times as far."""
    effects = [one for one in standard_effects(observer.declared, observer.runs, observer.tolerances)
               if not one.one_sided and one.kind != "delay"]  # fmt: skip
    scales = np.sqrt(np.mean([(one.errors**2).mean(axis=0) for one in found], axis=0))

    def sigmas(whitenings: list[Whitening]) -> np.ndarray:
        errors = ChannelErrors(scales, np.ones(len(scales)), whitenings)
        runs = [expand(observer, n, effects, np.zeros(len(effects)), errors, HORIZON) for n in range(1, RUNS, 2)]
        squares = np.mean([one.slope**2 / np.maximum(np.diag(one.curvature), 1e-12) for one in runs], axis=0)
        return np.sqrt(squares[squares > 1e-6])  # a flap does nothing to the model

    said, independent = sigmas([Whitening(one, learned) for one in found]), sigmas([])
    assert len(said) == len(independent) == 6
    assert 0.6 < said.min() < said.max() < 1.4
    assert independent.min() > 4.0


@pytest.mark.parametrize(("runs", "right", "rejected"), [(4, 0.75, 0.85), (8, 0.8, 0.95), (20, 0.85, 0.99)])
def test_whether_errors_are_independent_runs_say_the_surer_the_more_they_are(runs, right, rejected):
    """Of runs whose errors are independent, and of such that differ by six times that variance."""
    ratios = (np.random.default_rng(2).normal(size=(400, runs)) ** 2).mean(axis=1)
    chances = [np.array([independence(max(1.0, times * one), runs) for one in ratios]) for times in (1.0, 6.0)]
    assert np.mean(chances[0] > 0.5) > right
    assert np.mean(chances[1] < 0.5) > rejected


@pytest.mark.parametrize("differ", [0.0, 0.15], ids=["as the model has it", "each its own damping"])
def test_the_file_has_it_only_where_runs_agree_on_what_they_share(differ, tmp_path):
    """Damping that every run has of its own is no noise of the model: errors are counted as they are."""
    (tmp_path / "boat.py").write_text(MODEL)
    (tmp_path / "boat.toml").write_text('format = 1\nmodel = "boat"\n[windows]\nseconds = 10.0\n')
    random, t, runs = np.random.default_rng(5), np.arange(0.0, 40.0, 0.1), []
    for n in range(12):
        u, damping, v, out = (
            np.repeat(random.uniform(0.1, 0.3, 8), 50),
            0.4 + differ * random.uniform(-1.0, 1.0),
            0.5,
            [],
        )
        for thrust in u:
            out.append(v + WHITE * random.standard_normal())
            v += 0.1 * (thrust - damping * v + 0.02 * random.standard_normal() / np.sqrt(0.1))
        runs.append(OwnRun(f"run{n}", t, np.column_stack([u, 0.0 * u]), np.array(out)[:, None]))
    answer = identify(load_own(tmp_path / "boat.toml"), [runs])
    write(answer, tmp_path / "out")
    healthy = healthy_of(observer_of(load_own(tmp_path / "out" / VEHICLE), runs[:2]))
    assert (answer.components is None) == bool(differ)
    assert len(healthy.errors.whitenings) == (0 if differ else 2)
    assert "probability" in answer.notes[-1]
    assert healthy.run_inflation < 2.0 or differ
