"""Forces that go with inputs: what no run's own force is, learned by identification, kept in its file, flown with."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.own.check import load_own
from glider.tools.own.effects import form_errors, moved, pushes
from glider.tools.own.healthy import healthy_of
from glider.tools.own.hierarchy import ChannelErrors, expand, multiples_of_pushes
from glider.tools.own.identified import write
from glider.tools.own.identify import identify
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun
from tests.support.boat import MODEL

TRUE = -0.15  # m/s2 a radian of flap, of which the model knows nothing


def flights(form: float, count: int, seed: int) -> list[OwnRun]:
    """Runs under thrust and flap that are steady in a run, as the flights of a blimp or a glider are."""
    random = np.random.default_rng(seed)
    t, runs = np.arange(0.0, 30.0, 0.1), []
    for n in range(count):
        u = np.array([random.uniform(0.1, 0.3), random.uniform(-0.5, 0.5)])
        v, out = 0.3, []
        own = 0.005 * random.standard_normal()
        for _ in t:
            out.append(v + 0.01 * random.standard_normal())
            v += 0.1 * (u[0] - 0.45 * v + form * u[1] + own + 0.02 * random.standard_normal() / np.sqrt(0.1))
        runs.append(OwnRun(f"run{n}", t, np.tile(u, (len(t), 1)), np.array(out)[:, None]))
    return runs


@pytest.fixture(scope="module", params=[TRUE, 0.0], ids=["there", "not there"])
def found(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("form")
    (folder / "boat.py").write_text(MODEL)
    (folder / "boat.toml").write_text('format = 1\nmodel = "boat"\n[windows]\nseconds = 10.0\n')
    vehicle = load_own(folder / "boat.toml")
    answer = identify(vehicle, [flights(request.param, 14, 3)])
    write(answer, folder / "out")
    return SimpleNamespace(form=request.param, vehicle=load_own(folder / "out" / "identified.toml"), answer=answer)


def test_it_is_learned_where_it_is_and_nothing_where_not(found):
    assert found.vehicle.declared.form["surge", "flap"] == pytest.approx(found.form, abs=0.03)
    assert abs(found.vehicle.declared.form["surge", "thrust"]) < 0.1
    at = [one.label for one in found.answer.nuisance].index("surge_push")
    assert found.answer.scatter.sizes[at] * 0.02 < 0.02  # what runs differ by is not asked to stand for it


def test_how_much_less_runs_say_than_their_likelihood_stands_in_the_file(found):
    healthy = healthy_of(observer_of(found.vehicle, flights(found.form, 1, 7)))
    assert healthy.run_inflation == pytest.approx(found.answer.run_inflation, rel=1e-6)
    assert healthy.run_inflation >= 1.0


def test_the_identified_file_predicts_with_it(found):
    kept = flights(found.form, 4, 7)
    observer = observer_of(found.vehicle, kept)
    without = observer.point.copy()
    without.form[:] = without.operating[:] = 0.0
    gaps = [np.mean([observer.gaps(n, point, 10.0) for n in range(4)]) for point in (observer.point, without)]
    assert gaps[0] < 0.6
    assert (gaps[0] < 0.6 * gaps[1]) == bool(found.form)


@pytest.mark.parametrize("held", [True, False])
def test_its_derivative_is_what_a_step_of_it_does(found, held):
    """Where an input stays as it is the force is a constant one, and that one's derivative serves."""
    (run,) = flights(found.form, 1, 5)
    if not held:
        run = replace(run, inputs=run.inputs + 0.1 * np.sin(run.t)[:, None])
    observer = observer_of(found.vehicle, [run])
    declared, point = observer.declared, observer.point
    effects = [*pushes(declared), *(one for one in form_errors(declared) if one.at_point is None)]
    assert len(multiples_of_pushes(declared, effects, run.inputs)) == (2 if held else 0)
    one = expand(observer, 0, effects, np.zeros(3), ChannelErrors(np.ones(1), np.ones(1)), 10.0, keep=True)
    by = observer.filter(0, point)
    for k in range(3):
        there = moved(declared, point, effects, 0.01 * np.eye(3)[k])
        here, stepped = observer.residuals(0, [point, there], by, 10.0)
        assert one.derivatives[k] == pytest.approx((stepped - here) / 0.01, rel=1e-3, abs=1e-4)
