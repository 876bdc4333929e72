"""Vehicle files with effects, readings and assumptions of their own: strict, and what models and fits make of them."""

import msgspec
import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.water import water_wrench
from glider.firmware.model.vehicle import decode_vehicle
from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.data.tomltext import toml_text
from glider.tools.diagnose.cautions import cautions
from glider.tools.diagnose.diagnosis import never_identified
from glider.tools.inference.model import effects_in, nominal_model, vehicle_model
from glider.tools.inference.parameters import nuisance_parameters
from glider.tools.inference.problem import problem_of
from glider.tools.inference.vehicle_parameters import parameters
from tests.support.cases import make_case


def text(**tables) -> str:
    """The shipped vehicle's file with more tables."""
    return toml_text(msgspec.to_builtins(load_vehicle("roughie")) | tables, inline=("sensors", "assumed"))


def test_effects_and_readings_of_a_vehicle_reach_its_model_and_come_back():
    vehicle = decode_vehicle(
        text(effects={"slider_scale": {"scale": -0.4}}, readings={"depth_with_ballast": -0.8}), "v.toml"
    )
    F = vehicle_model("v", vehicle).F
    assert F[ef.SLIDER_SCALE] == -0.4
    assert F[ef.GAUGE_TANK] == -0.8
    assert effects_in(F) == {"slider_scale": {"scale": -0.4}}
    assert vehicle_model("r", load_vehicle("roughie")).F is None


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({"effects": {"slider_shale": {"scale": 1.0}}}, "effects.slider_shale"),
        ({"effects": {"slider_scale": {"scale": 9.0}}}, "effects.slider_scale"),
        ({"assumed": {"x_b": {}}}, "factor or range"),
        ({"assumed": {"x_b": {"factor": 0.5}}}, "assumed"),
        ({"assumed": {"x_b": {"range": [0.5, 0.1]}}}, "low < high"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tables, says):
    with pytest.raises(ConfigError) as error:
        vehicle_model("v", decode_vehicle(text(**tables), "v.toml"))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def case_with(folder, **tables):
    """A small case of a vehicle with more tables."""
    made = make_case(folder, np.zeros(ef.N_F), seed=5, runs=1)
    (folder / "vehicle.toml").write_text(text(**tables))
    return load_case(made.folder, str(folder / "vehicle.toml"))


def test_an_assumed_number_is_as_free_as_it_says(tmp_path):
    case = case_with(tmp_path, assumed={"x_b": {"factor": 1.5}, "slider_scale": {"range": [-0.3, 0.3]}})
    problem = problem_of(case)
    for free in (parameters(problem).free, nuisance_parameters(problem)):
        by_place = {(one.vector, one.entry): one for one in free}
        tank, x_b = by_place["P", layout.X_B], problem.model.P[layout.X_B]
        assert tank.moved(x_b, 1.0) == pytest.approx(1.5 * x_b)
        assert tank.moved(x_b, -1.0) == pytest.approx(x_b / 1.5)
        assert tank.value(x_b, tank.moved(x_b, 0.7)) == pytest.approx(0.7)
        wire = by_place["F", ef.SLIDER_SCALE]
        assert wire.spread == pytest.approx(0.3 / 1.645)
        assert wire.low * wire.spread == pytest.approx(-0.3)
    assert len({(f.vector, f.entry) for f in nuisance_parameters(problem)}) == len(nuisance_parameters(problem))


def test_values_go_to_si_and_back_however_a_number_is_free(tmp_path):
    said = {"J_y": {"factor": 2.0}, "K_q": {"factor": 3.0}, "slider_scale": {"factor": 1.5}}
    problem = problem_of(case_with(tmp_path, assumed=said))
    free = parameters(problem)
    values = np.clip(np.linspace(-0.9, 0.9, len(free.free)), [f.low for f in free.free], [f.high for f in free.free])
    si = free.si(values)
    np.testing.assert_allclose(free.values(dict(zip(free.names, si, strict=True))), values, atol=1e-9)
    P, F, _ = free.place(problem.model, values)
    at = dict(zip(free.names, values, strict=True))
    assert P[layout.J_YY] == pytest.approx(problem.model.P[layout.J_YY] * 2.0 ** at["J_y"])
    assert P[layout.K_Q] == pytest.approx(problem.model.P[layout.K_Q] * 3.0 ** at["K_q"])
    assert 1.0 + F[ef.SLIDER_SCALE] == pytest.approx(1.5 ** at["slider_scale"])
    np.testing.assert_allclose(free.si(np.stack([values, 0.0 * values])), [si, free.nominal])


def test_a_guessed_vehicle_is_not_its_files_and_the_diagnosis_says_so(tmp_path):
    guessed = case_with(tmp_path / "a", assumed={"K_D0": {"factor": 2.0}, "J_y": {"factor": 2.0}})
    wires = case_with(tmp_path / "b", assumed={"slider_scale": {"factor": 1.5}})
    assert never_identified(guessed)
    assert not never_identified(wires)
    said = [line for line in cautions(problem_of(guessed)) if "assumed" in line]
    assert len(said) == 1
    assert "inertia" in said[0]
    assert not [line for line in cautions(problem_of(wires)) if "assumed" in line]


def test_what_was_identified_is_assumed_no_more(tmp_path):
    found = {
        "data": "0", "runs": 1, "revision": "", "date": "", "from_vehicle": "", "parameters": ["x_b"],
        "covariance": [[1e-6]],
    }  # fmt: skip
    assumed = {"x_b": {"factor": 1.5}, "J_y": {"factor": 2.0}}
    assert set(case_with(tmp_path, assumed=assumed, identified=found).assumed) == {"J_y"}


@pytest.mark.parametrize(
    ("assumed", "says"),
    [
        ({"tank": {"factor": 2.0}}, "no such number"),
        ({"net_mass": {"factor": 2.0}}, "is 0"),
        ({"x_b": {"range": [1.0, 2.0]}}, "own value"),
    ],
)
def test_an_assumption_of_nothing_names_its_key(tmp_path, assumed, says):
    problem = problem_of(case_with(tmp_path, assumed=assumed))
    with pytest.raises(ConfigError, match=says) as error:
        nuisance_parameters(problem)
    assert f"assumed.{next(iter(assumed))}" in str(error.value)


def test_a_case_s_own_vehicle_gives_way_to_the_named_one(tmp_path):
    case = case_with(tmp_path, trim={"net_mass": 0.01})
    assert nominal_model(case).P[layout.NET_MASS] == 0.01


def test_linear_damping_is_there_at_rest_and_nothing_unless_said():
    P = load_vehicle("roughie").vector()
    flow = (0.3, 0.01, -0.02, 0.1, 0.2, -0.3)
    before = np.array(water_wrench(P, *flow))
    P[layout.D_P : layout.D_R + 1] = -0.1, -1.0, -2.0
    change = np.array(water_wrench(P, *flow)) - before
    np.testing.assert_allclose(change, [0.0, 0.0, 0.0, -0.01, -0.2, 0.6], atol=1e-12)
