"""A vehicle's numbers in other simulators' forms: evaluated by their own formulas, they are the vehicle's forces."""

import ast
import json
import tomllib
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from click.testing import CliRunner

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.motion import solve_mass_matrix
from glider.firmware.core.vehicle.water import water_wrench
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.hydrodynamics import extra_wrench
from glider.tools.cli.export import export
from glider.tools.data.errors import InputError
from glider.tools.inference.corrected import corrected_text
from glider.tools.inference.numbers_out import load_numbers
from glider.tools.inference.simulators import SIGNS, fossen, left_out, mass_matrices, sdf, stonefish

SPEED, SMALL = 0.3, np.radians(6.0)
EFFECTS = {
    "drag": {"scale": 0.5, "induced": 0.0}, "lift": {"scale": -0.2}, "linear_drag": {"k": 0.4},
    "pitch_damping": {"scale": 0.3, "across": 0.2}, "net_buoyancy": {"mass": 0.02},
}  # fmt: skip


@pytest.fixture(scope="module")
def corrected(tmp_path_factory) -> str:
    """A corrected model of the shipped vehicle: a number refitted, effects added."""
    from glider.sim_backend.core.effects.catalogue import catalogue

    P = load_numbers("roughie").P
    changed = P.copy()
    changed[layout.K_MY] *= 1.1
    effects = {label: {p.name: 0.0 for p in catalogue()[label].parameters} for label in EFFECTS}
    for label, values in EFFECTS.items():
        first = next(iter(effects[label]))
        effects[label] |= {name: v for name, v in values.items() if name in effects[label]} or {first: 0.02}
    effects["tether"] = catalogue()["tether"].usual
    path = tmp_path_factory.mktemp("model") / "corrected.toml"
    path.write_text(corrected_text("roughie", P, changed, np.zeros(ef.N_F), effects))
    return str(path)


def motions(count: int = 200) -> np.ndarray:
    """Motions (count, 6) near straight flight: alpha and beta within 6 degrees, rates within 0.1 rad/s."""
    rng = np.random.default_rng(5)
    alpha, beta = rng.uniform(-SMALL, SMALL, (2, count))
    u = SPEED * np.cos(alpha) * np.cos(beta)
    v, w = SPEED * np.sin(beta), SPEED * np.sin(alpha) * np.cos(beta)
    return np.column_stack([u, v, w, *rng.uniform(-0.1, 0.1, (3, count))])


def wrench(numbers, nu: np.ndarray) -> np.ndarray:
    """The vehicle's own forces of the water, (6,), without those that no other form can hold."""
    P, F = numbers.effective, numbers.F.copy()
    F[[ef.TETHER, ef.TETHER_GROWTH]] = 0.0
    return np.array(water_wrench(P, *nu)) + np.array(extra_wrench(P, F, 0.0, 0.0, *nu))


def plugin_wrench(plugin: xml.Element, nu: np.ndarray) -> np.ndarray:
    """What Gazebo's hydrodynamics plugin computes of its elements: linear, |.| and plain quadratic terms, (6,)."""
    found = np.zeros(6)
    for i, force in enumerate("xyzkmn"):
        for j, first in enumerate("UVWPQR"):
            found[i] += float(plugin.findtext(f"{force}{first}", "0")) * nu[j]
            for k, second in enumerate("UVWPQR"):
                found[i] += float(plugin.findtext(f"{force}{first}abs{second}", "0")) * nu[j] * abs(nu[k])
                found[i] += float(plugin.findtext(f"{force}{first}{second}", "0")) * nu[j] * nu[k]
    return found


@pytest.mark.parametrize("which", ["roughie", "corrected"])
def test_gazebo_s_plugin_computes_the_vehicle_s_forces(which, corrected):
    numbers = load_numbers(corrected if which == "corrected" else which)
    plugin = xml.fromstring(sdf(numbers, SPEED)).find("model/plugin")
    known = {"link_name"} | {
        f"{force}{first}{tail}"
        for force in "xyzkmn" for first in "UVWPQR"
        for tail in ("", *(f"{middle}{second}" for middle in ("", "abs") for second in "UVWPQR"))
    }  # fmt: skip
    assert {element.tag for element in plugin} <= known
    own = np.array([wrench(numbers, nu) for nu in motions()])
    others = np.array([plugin_wrench(plugin, nu * SIGNS) * SIGNS for nu in motions()])
    size = np.abs(own).max(axis=0)
    assert (np.abs(others - own).max(axis=0) <= 0.03 * np.array([*3 * [size[:3].max()], *3 * [size[3:].max()]])).all()


def test_sdf_s_inertia_and_added_mass_accelerate_as_the_vehicle(corrected):
    """About the centre of mass as SDF has it, moved back to the origin and turned: the vehicle's own mass matrix."""
    numbers = load_numbers(corrected)
    inertial = xml.fromstring(sdf(numbers, SPEED)).find("model/link/inertial")
    m = float(inertial.findtext("mass"))
    r = np.array([float(value) for value in inertial.findtext("pose").split()[:3]])
    about = np.zeros((3, 3))
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        about[i, j] = about[j, i] = float(inertial.findtext(f"inertia/i{'xyz'[i]}{'xyz'[j]}"))
    cross = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    M = np.block([[m * np.eye(3), -m * cross], [m * cross, about + m * (r @ r * np.eye(3) - np.outer(r, r))]])
    M += np.diag([float(inertial.findtext(f"fluid_added_mass/{2 * axis}")) for axis in "xyzpqr"])
    M *= np.outer(SIGNS, SIGNS)
    M_RB, M_A = mass_matrices(numbers.effective)
    assert np.allclose(M, M_RB + M_A, rtol=1e-6, atol=1e-7)
    force = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    J = M[3:, 3:]
    own = solve_mass_matrix(
        *np.diag(M)[:3], -M[2, 4], M[2, 3], -M[1, 3], J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2], *force
    )
    assert np.allclose(np.linalg.solve(M, force), own, rtol=1e-6)


def test_fossen_s_damping_matrix_is_the_slope_of_the_forces(corrected):
    numbers = load_numbers(corrected)
    D, straight = np.array(fossen(numbers, SPEED)["D"]), np.array([SPEED, 0.0, 0.0, 0.0, 0.0, 0.0])
    h = 1e-5 * np.eye(6)
    slope = np.array([(wrench(numbers, straight + e) - wrench(numbers, straight - e)) / 2e-5 for e in h]).T
    # K_L0 u w in surge and the like are of the second order at alpha = 0, and no part of D
    slope[0, 2], D[0, 2] = 0.0, 0.0
    assert np.allclose(-D, slope, rtol=1e-3, atol=1e-3 * np.abs(slope).max())
    table = fossen(numbers, SPEED)
    assert table["C"]["X_udot"] == -numbers.effective[layout.A_X]
    assert np.isclose(table["weight_minus_buoyancy_n"], 9.81 * numbers.effective[layout.NET_MASS], rtol=1e-3)
    assert table["left_out"] == ["tether"] == left_out(numbers)


def test_stonefish_has_drag_by_its_own_formula():
    body = xml.fromstring(stonefish(load_numbers("roughie"), 0.02, 998.0))
    assert [element.tag for element in body] == ["mass", "inertia", "cg", "hydrodynamics"]
    cd = float(body.find("hydrodynamics").get("quadratic_drag").split()[0])
    assert np.isclose(0.5 * 998.0 * cd * 0.02, 3.0)  # K_D0
    assert float(body.find("mass").get("value")) == 13.0


@pytest.mark.parametrize("form", ["json", "python", "toml"])
def test_parameters_come_back_as_they_were(form, corrected, tmp_path):
    out = tmp_path / "numbers.txt"
    done = CliRunner().invoke(export, ["parameters", corrected, "--as", form, "--out", str(out)])
    assert done.exit_code == 0, done.output
    text = out.read_text()
    read = {"json": json.loads, "toml": tomllib.loads}.get(form)
    table = read(text) if read else ast.literal_eval(text.removeprefix("VEHICLE = "))
    own = table["parameters"]
    assert own["K_D0"] == {"value": 3.0 * 1.5, "unit": "kg/m"}
    assert np.isclose(own["K_MY"]["value"], 26.0 * 1.1)
    assert own["m_t"] == {"value": 13.0, "unit": "kg"}
    assert set(EFFECTS) <= set(table["effects"])


def test_an_identified_vehicle_s_standard_deviations_are_exported():
    for name in ("slocum", "seaglider"):
        table = load_numbers(name).plain()
        assert table["parameters"]["volume"]["unit"] == "m3"


def test_an_ocean_glider_has_no_matrices():
    for form in (lambda n: fossen(n, SPEED), lambda n: sdf(n, SPEED), lambda n: stonefish(n, None, 1025.0)):
        with pytest.raises(InputError, match="slocum: "):
            form(load_numbers("slocum"))


def test_the_commands_print_one_text(corrected):
    for arguments in (["fossen", corrected], ["sdf", corrected], ["stonefish", "roughie", "--area", "0.02"]):
        done = CliRunner().invoke(export, arguments)
        assert done.exit_code == 0, done.output
        assert done.stdout.startswith(("{", "<"))
    assert ": tether" in CliRunner().invoke(export, ["sdf", corrected]).stderr
