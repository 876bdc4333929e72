"""What a user's model declares, and ten mistakes in one: each a line that names it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.own.cases import own_vehicle
from glider.tools.own.check import check_model, load_own
from glider.tools.own.decision import log_odds
from glider.tools.own.declare import DeclarationError, Output, column_of, declaration, with_groups
from glider.tools.own.driven import driven_inputs, held_inputs
from glider.tools.own.effects import effects_of, moved, nominal_point, standard_effects
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun, load_own_run, load_own_runs
from glider.tools.own.skeleton import write_skeleton

MODEL = """
import numpy as np
inputs = {"push": "N"}
outputs = {"depth": "m"}
parameters = [("drag", "N s2/m2", 4.0, 1.0)]
states = {"z": "m", "speed": "m/s"}
noises = {"heave": "m/s2"}
def derivative(x, u, w, theta):
    return np.array([x[1], u[0] - theta[0] * abs(x[1]) * x[1] + w[0]])
def measure(x, u, theta):
    return np.array([x[0]])
"""
MISTAKES = {
    "wrong shape": ("np.array([x[0]])", "np.array([x[0], x[1]])", "measure: expected shape (1,)"),
    "not a number": ("np.array([x[0]])", "np.array([x[0] * float('nan')])", "measure: not a finite number for depth"),
    "unit": ('{"depth": "m"}', '{"depth": "cm"}', "units are SI: m, not cm"),
    "hidden state": (
        "def measure(x, u, theta):",
        "seen = []\ndef measure(x, u, theta):\n    seen.append(x[0])\n    return np.array([x[0] + sum(seen)])",
        "measure: not the same twice",
    ),
    "step not pure": (
        "def measure(x, u, theta):",
        "random = np.random.default_rng()\ndef measure(x, u, theta):\n    return np.array([random.normal()])",
        "measure: not the same twice",
    ),
    "argument changed": (
        "    return np.array([x[1], u[0]", "    x[0] = 0.5\n    return np.array([x[1], u[0]", "changes its argument x",
    ),
    "raises": ("np.array([x[0]])", "np.array([x[7]])", "IndexError"),
    "syntax": ("def measure(x, u, theta):", "def measure(x, u, theta)", "import: expected ':'"),
    "name twice": ('{"z": "m", "speed": "m/s"}', '[("z", "m"), ("z", "m")]', "states[1]: z stands twice"),
    "no outputs": ('outputs = {"depth": "m"}', "", "outputs: not declared"),
    "out of range": (
        '("drag", "N s2/m2", 4.0, 1.0)', '{"name": "drag", "value": 4.0, "low": 5.0}', "drag: 4 is outside 5 to inf",
    ),
    "no motion": ("def derivative(x, u, w, theta):", "def motion(x, u, w, theta):", "none of step, derivative"),
}  # fmt: skip


@pytest.fixture
def vehicle(tmp_path):
    """A vehicle file of a model with something replaced."""

    def make(old: str = "", new: str = "", extra: str = ""):
        assert old in MODEL
        (tmp_path / "sinker.py").write_text(MODEL.replace(old, new) if old else MODEL)
        (tmp_path / "sinker.toml").write_text(f'format = 1\nmodel = "sinker"\n{extra}')
        return tmp_path / "sinker.toml"

    return make


@pytest.mark.parametrize("mistake", MISTAKES, ids=[name.replace(" ", "-") for name in MISTAKES])
def test_a_mistake_in_a_model_is_one_line_that_names_it(vehicle, mistake):
    old, new, said = MISTAKES[mistake]
    with pytest.raises(InputError) as error:
        load_own(vehicle(old, new))
    assert said in str(error.value)
    assert "sinker.py" in str(error.value)
    assert "\n" not in str(error.value)


def test_an_answer_that_depends_on_earlier_calls_is_a_hidden_state(vehicle):
    memory = (
        "last = [0.0, 0]\ndef measure(x, u, theta):\n    if last[0] != x[0]:\n"
        "        last[:] = [float(x[0]), last[1] + 1]\n    return np.array([x[0] + last[1]])\ndef other():"
    )
    with pytest.raises(InputError, match="hidden state"):
        load_own(vehicle("def measure(x, u, theta):", memory))


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        ("[parameters.drog]\nvalue = 1.0\n", "sinker.toml:3: parameters.drog: "),
        ("[parameters.drag]\nvalue = 'x'\n", "parameters.drag.value"),
        ("[sensors.depth]\nnoise = -1.0\n", "sensors.depth.noise"),
        ("[start]\ndeep = { value = 0.0, uncertainty = 0.1 }\n", "start.deep: "),
        ("[parameters.drag]\nlow = 9.0\n", "parameters.drag.value: 4 is outside 9 to inf"),
        (
            "[parameters.drag]\nscope = 'runs'\n",
            "parameters.drag.scope: invalid enum value 'runs' (it is vehicle or run)",
        ),
        ("[groups]\nhull = ['drag', 'drog']\n", "sinker.toml:4: groups.hull: no input, output or parameter"),
        ("[groups]\nhull = ['drag', 'depth']\n", "groups.hull: drag is of the parameters, depth is not"),
        ("[groups]\ndepth = ['drag', 'drag']\n", "groups.depth: a name stands twice"),
        ("[odds]\ndepth_drift = 0\nfin_gain = 1\n", "sinker.toml:5: odds.fin_gain: the model has no such label"),
    ],
)
def test_a_mistake_in_a_vehicle_file_names_key_and_line(vehicle, extra, said):
    with pytest.raises(ConfigError) as error:
        load_own(vehicle(extra=extra))
    assert said in str(error.value)


def test_a_parameter_may_not_be_called_as_a_cause_of_an_input_is():
    model = SimpleNamespace(inputs={"fin": "rad"}, outputs={"roll": "rad"}, parameters=[("fin_offset", "rad", 0.0)],
                            rollout=lambda x0, t, u, theta: None)  # fmt: skip
    with pytest.raises(DeclarationError, match="parameters: fin_offset is what a cause of fin is called"):
        declaration(model)


def test_what_all_inputs_have_alike_is_no_name_of_one():
    rollout = {"outputs": {"roll": "rad"}, "rollout": lambda x0, t, u, theta: None}
    with pytest.raises(DeclarationError, match="inputs: inputs means all inputs"):
        declaration(SimpleNamespace(inputs={"inputs": "rad"}, parameters=[], **rollout))
    with pytest.raises(DeclarationError, match="inputs_delay is what a cause of all inputs is called"):
        declaration(SimpleNamespace(inputs={"fin": "rad"}, parameters=[("inputs_delay", "s", 0.0)], **rollout))


def test_a_delay_of_all_inputs_is_each_one_s():
    rollout = {"outputs": {"roll": "rad"}, "rollout": lambda x0, t, u, theta: None}
    model = SimpleNamespace(inputs={"fin": "rad", "motor": "N"}, parameters=[], **rollout)
    declared = replace(declaration(model), effects={"inputs_delay": 0.2, "fin_delay": 0.1})
    has = effects_of(declared, nominal_point(declared))
    assert has == pytest.approx({"fin_delay": 0.3, "motor_delay": 0.2})
    t = np.arange(20.0)
    runs = [OwnRun("run00", t, np.column_stack([np.sin(t), np.cos(t)]), np.zeros((20, 1)))]
    every = {one.label: one for one in standard_effects(declared, runs, np.ones(1))}
    assert every["fin_delay"].low * every["fin_delay"].spread == pytest.approx(-0.3)
    both = moved(declared, nominal_point(declared), [every["inputs_delay"]], np.array([-1.0]))
    assert effects_of(declared, both) == pytest.approx({"fin_delay": 0.1})
    assert driven_inputs(runs[0], declared, both)[:, 1] == pytest.approx(runs[0].inputs[:, 1])
    still = [replace(runs[0], inputs=runs[0].inputs * [1.0, 0.0])]
    assert "inputs_delay" not in {one.label for one in standard_effects(declared, still, np.ones(1))}


def test_a_group_is_its_members_alike():
    model = SimpleNamespace(
        inputs={"fin": "rad", "motor": "N"}, outputs={"x": "m", "y": "m", "roll": "rad"},
        parameters=[("drag", "kg/m", 4.0, 1.0), ("lift", "kg/m", -2.0, 1.0), ("trim", "rad", 0.0, 0.1)],
        rollout=lambda x0, t, u, theta: None,
    )  # fmt: skip
    groups = {"gps": ["x", "y"], "supply": ["fin", "motor"], "hull": ["drag", "lift"]}
    declared = replace(with_groups(declaration(model), groups), effects={"gps_delay": 0.2}, odds={"hull": 0.0})
    t = np.arange(20.0)
    run = OwnRun("run00", t, np.column_stack([np.sin(t), np.cos(t)]), np.zeros((20, 3)))
    every = {one.label: one for one in standard_effects(declared, [run], np.ones(3))}
    assert {f"{name}_{kind}" for name in ("gps", "supply") for kind in ("gain", "lag", "delay")} <= set(every)
    assert every["gps_delay"].low * every["gps_delay"].spread == pytest.approx(-0.2)
    assert log_odds(every["hull"]) == -np.inf
    labels, sizes = ["gps_delay", "supply_gain", "hull"], np.array([0.1, -0.3, 0.4])
    spreads = np.array([every[label].spread for label in labels])
    there = moved(declared, nominal_point(declared), [every[label] for label in labels], sizes / spreads)
    assert there.theta == pytest.approx([5.6, -2.8, 0.0])
    has = effects_of(declared, there)
    assert has == pytest.approx({"x_delay": 0.3, "y_delay": 0.3, "fin_gain": -0.3, "motor_gain": -0.3})
    for wrong, said in (({"hull": ["drag", "trim"]}, "trim is 0"), ({"x": ["fin", "motor"]}, "that nothing else has"),
                        ({"fin": ["x", "y"]}, "that nothing else has"),
                        ({"inputs_lag": ["drag", "lift"]}, "that nothing else has")):  # fmt: skip
        with pytest.raises(DeclarationError, match=said):
            with_groups(declaration(model), wrong)


def test_missing_samples_of_an_interpolated_input_are_drawn_in_straight(vehicle, tmp_path):
    (tmp_path / "run0.csv").write_text(
        "t_s,push_n,depth_m\n" + "".join(f"{t},{'' if t == 3 else t},0\n" for t in range(9))
    )
    held = load_own(vehicle()).declared
    drawn = load_own(vehicle(extra="[inputs.push]\ninterpolated = true\n")).declared
    assert load_own_run(tmp_path / "run0.csv", held).inputs[3, 0] == 2.0
    run = load_own_run(tmp_path / "run0.csv", drawn)
    assert run.inputs[3, 0] == 3.0
    on_the_way = held_inputs(drawn, run.inputs)
    assert on_the_way[:, 0, 0] == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.0])
    assert on_the_way[:, 1, 0] == pytest.approx(run.inputs[:, 0])
    assert held_inputs(held, run.inputs)[:, 0, 0] == pytest.approx(run.inputs[:, 0])


def test_a_column_of_all_other_runs_and_a_heading_in_degrees_are_named_with_their_file(tmp_path):
    file = tmp_path / "mine.toml"
    write_skeleton(file)
    declared = load_own(file).declared
    head, rows = (
        "t_s,thrust_n,rudder_rad,depth_m,yaw_rad,r_rad_s\n",
        [f"{0.1 * k},1,0,2,{350 + k % 20},0\n" for k in range(40)],
    )
    for n in range(3):
        (tmp_path / f"run{n:02d}.csv").write_text(head + "".join(row.replace(",3", ",0.") for row in rows))
    load_own_runs(tmp_path, declared)
    (tmp_path / "run01.csv").write_text(
        head.replace("depth_m", "Depth") + "".join(row.replace(",3", ",0.") for row in rows)
    )
    with pytest.raises(InputError, match=r"run01.csv: depth_m: the other runs have it; here is 'Depth'"):
        load_own_runs(tmp_path, declared)
    turned = "".join(f"{0.1 * k:.1f},1,0,2,{(0.2 * k + 3.0) % 6.2832 - 3.1416:.4f},0\n" for k in range(40))
    (tmp_path / "run01.csv").write_text(head + turned)
    assert not observer_of(load_own(file), load_own_runs(tmp_path, declared)).notes
    model = file.with_name("mine_model.py")
    model.write_text(model.read_text().replace(', "angle": True', ""))
    notes = observer_of(load_own(file), load_own_runs(tmp_path, load_own(file).declared)).notes
    assert notes == ["yaw jumps by more than half a turn: an angle that wraps is declared with `angle`"]
    (tmp_path / "run01.csv").write_text(head + "".join(rows))
    with pytest.raises(InputError, match=r"run01.csv: yaw_rad: up to 369 rad, not by turning: degrees\?"):
        load_own_runs(tmp_path, declared)


def test_a_model_that_is_nowhere_is_named(tmp_path):
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "nowhere:Thing"\n')
    with pytest.raises(ConfigError, match=r"v.toml:2: model: .*nowhere.py"):
        load_own(tmp_path / "v.toml")


def test_a_missing_column_is_named_with_its_file(vehicle, tmp_path):
    declared = load_own(vehicle()).declared
    (tmp_path / "run0.csv").write_text("t_s,depth_m\n" + "".join(f"{t},0\n" for t in range(9)))
    with pytest.raises(InputError, match=r"run0.csv: push_n: .* push "):
        load_own_run(tmp_path / "run0.csv", declared)


def test_a_parameter_with_a_threshold_is_noted(vehicle):
    found = load_own(vehicle("u[0] - theta[0] * abs", "(1.0 if theta[0] > 4.0005 else 0.0) + u[0] - theta[0] * abs"))
    assert any("smooth" in note and "drag" in note for note in check_model(found))


@pytest.mark.parametrize(("old", "new", "dead"), [
    ("u[0] - theta[0] * abs", "u[0] - 4.0 * abs", "drag"), ("u[0] - theta", "- theta", "push"),
    (" + w[0]", "", "heave"), ("u[0] - theta", "max(u[0] - 300.0, 0.0) - theta", ""), ("", "", ""),
], ids=["parameter", "input", "noise", "an input with a threshold", "none"])  # fmt: skip
def test_what_changes_nothing_anywhere_is_noted(vehicle, old, new, dead):
    notes = [note for note in load_own(vehicle(old, new)).notes if "changes nothing" in note]
    assert [note.split()[0] for note in notes] == ([dead] if dead else [])


ENERGY = """

def energy(x, theta):
    return 0.5 * (MASS * x[4:10]) @ x[4:10] - theta[4] * x[0] - WEIGHT * CG_Z * np.cos(x[1]) * np.cos(x[2])
"""
SHIP = (Path(__file__).parents[3] / "docs" / "examples" / "fossen_auv" / "remus.py").read_text()
HULL = SHIP.replace(
    "BODY_LIFT, FIN_MOMENT, FIN_DAMPING = 60.0, 55.0, 12.0", "BODY_LIFT, FIN_MOMENT, FIN_DAMPING = 0.0, 0.0, 0.0"
)
BARE = HULL.replace(" - LINEAR * nu - QUADRATIC * nu * np.abs(nu)", "").replace("- theta[3] * nu[0] * abs(nu[0])", "")


@pytest.mark.parametrize(("hull", "old", "new", "noted"), [
    (HULL, "", "", False), (BARE, "", "", False), (HULL, "- LINEAR * nu -", "+ LINEAR * nu -", True),
    (BARE, "force -= cross(turn", "force += cross(turn", True),
    (BARE, "moment -= cross(velocity", "moment += cross(velocity", True),
    (BARE, "moment = WEIGHT *", "moment = -WEIGHT *", True),
])  # fmt: skip
def test_energy_that_comes_from_nowhere_is_noted(tmp_path, hull, old, new, noted):
    assert old in hull
    assert BARE != HULL != SHIP
    (tmp_path / "ship.py").write_text(hull.replace(old, new) + ENERGY)
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "ship"\n')
    assert any("energy grows" in note for note in check_model(load_own(tmp_path / "v.toml"))) == noted


def test_a_file_without_a_model_is_no_vehicle_of_ones_own(tmp_path):
    (tmp_path / "roughie.toml").write_text("format = 1\n")
    assert own_vehicle(tmp_path, str(tmp_path / "roughie.toml")) is None


@pytest.mark.parametrize(
    ("name", "unit", "column"),
    [("depth", "m", "depth_m"), ("r", "rad/s", "r_rad_s"), ("az", "m/s2", "az_m_s2"), ("depth_m", "m", "depth_m"),
     ("gain", "1", "gain"), ("pwm", "us", "pwm_us")],
)  # fmt: skip
def test_columns_are_called_by_name_and_unit(name, unit, column):
    assert column_of(name, unit) == column


def test_a_declaration_may_be_written_in_four_ways():
    forms = [{"depth": "m"}, [("depth", "m")], [{"name": "depth", "unit": "m"}], [Output("depth", "m")]]
    found = [declaration(SimpleNamespace(outputs=one, parameters=[], states=[("z", "m")])).outputs for one in forms]
    assert all(one == found[0] for one in found)
    assert found[0][0].column == "depth_m"


def test_three_states_are_no_quaternion():
    wrong = SimpleNamespace(outputs={"y": "m"}, parameters=[], states=[(f"q{n}", "1", "quaternion") for n in range(3)])
    with pytest.raises(DeclarationError, match="four states"):
        declaration(wrong)


def test_numbers_of_the_file_stand_in_for_the_models(vehicle):
    declared = load_own(
        vehicle(extra="[parameters.drag]\nvalue = 6.0\nscope = 'run'\n[noise.heave]\ndensity = 0.5\n")
    ).declared
    assert (declared.parameters[0].value, declared.parameters[0].scope, declared.noises[0].density) == (6.0, "run", 0.5)
    assert np.isinf(declared.parameters[0].high)


def test_a_rollout_with_a_derivative_of_its_own_and_no_measure_is_a_black_box():
    model = {"inputs": {"fin": "rad"}, "outputs": {"roll": "rad"}, "parameters": [], "derivative": lambda x, u: x,
             "rollout": lambda x0, t, u, theta: None}  # fmt: skip
    assert declaration(SimpleNamespace(**model)).states == ()
    with pytest.raises(DeclarationError, match="states: not declared"):
        declaration(SimpleNamespace(**model, measure=lambda x, u, theta: x))
