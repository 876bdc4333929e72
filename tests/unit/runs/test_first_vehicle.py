"""A first vehicle file: defaults are the shipped vehicle, answers scale it, and the questions can be gone through."""

import io
import math

import msgspec
import pytest
from click.testing import CliRunner

from glider.firmware.model.vehicle import decode_vehicle
from glider.tools.cli.vehicle import interview, vehicle
from glider.tools.data.errors import InputError
from glider.tools.data.first_vehicle import ASKED, QUESTIONS, FirstVehicle, in_words
from glider.tools.data.sources import load_vehicle

GIVEN_WIRES = {"apart": 0.6, "wires": 2.0}


def read(answers=None):
    return decode_vehicle(FirstVehicle(answers or {}).text("mine"), "mine")


def period(inertia, mass=13.0):
    """Of a swing on two wires, by the formula of a small swing."""
    return 4.0 * math.pi / GIVEN_WIRES["apart"] * math.sqrt(inertia * GIVEN_WIRES["wires"] / (mass * 9.80665))


def test_no_answer_at_all_is_the_shipped_vehicle_by_every_key():
    made, shipped = (msgspec.to_builtins(one) for one in (read(), load_vehicle("roughie")))
    for table in set(shipped) - {"name", "uncertainty", "assumed"}:
        assert made[table] == shipped[table], table
    assert all(made["uncertainty"][key] >= size for key, size in shipped["uncertainty"].items())


def test_what_nobody_measured_is_assumed_and_what_was_is_not():
    answers = {"m_t": 12.9, "x_b": 0.36, "pitch_period": 2.0, "pitch_apart": 0.6, "pitch_wires": 2.0}
    without, with_some = read().assumed, read(answers).assumed
    assert {"m_t", "x_b", "J_x", "J_y", "J_z", "added_mass_z", "K_D0", "K_M0"} <= set(without)
    assert set(without) - set(with_some) == {"m_t", "x_b", "J_y", "J_z"}
    assert without["J_y"].factor == 2.0
    assert in_words(["J_x", "J_y", "m_t", "slider_scale"]) == "inertia, masses, slider_scale"


def test_a_vehicle_twice_as_large_scales():
    big = read({"m_t": 8 * 13.0, "length": 2.4}).mass
    small = load_vehicle("roughie").mass
    assert list(big.J) == pytest.approx([32.0 * J for J in small.J], rel=1e-4)
    assert big.added_mass == pytest.approx([8.0 * A for A in small.added_mass], rel=1e-4)
    assert big.added_inertia == pytest.approx([32.0 * B for B in small.added_inertia], rel=1e-4)
    assert (big.m_s, big.x_b, big.R_s) == pytest.approx((16.0, 0.7, 0.04), rel=1e-4)


def test_swings_of_the_shipped_vehicle_give_its_inertia():
    """Both moving masses at the middle, the centre of gravity 5 mm below the axis."""
    parts, low = 2.0 * 0.015**2 + 2.0 * 0.020**2, 13.0 * (0.07 / 13.0) ** 2
    answers = {f"{axis}_{what}": size for axis in ("pitch", "roll") for what, size in GIVEN_WIRES.items()}
    answers |= {"pitch_period": period(1.5), "roll_period": period(0.04 + parts - low)}
    J = read(answers).mass.J
    assert J[0] == pytest.approx(0.04, rel=1e-3)
    assert J[1:] == pytest.approx([1.5, 1.5], rel=2e-3)
    with pytest.raises(InputError, match="roll swing"):
        read(answers | {"roll_period": period(0.0001)})


def test_a_pipe_answers_one_line_each(tmp_path):
    lines = {"m_t": "12.5", "length": "1,3", "pitch_period": "3.1", "pitch_apart": "0.6", "pitch_wires": "2"}
    said = [lines.get(one.key, "") for one in QUESTIONS if one.key not in ("roll_apart", "roll_wires")]
    out = tmp_path / "mine.toml"
    done = CliRunner().invoke(vehicle, ["new", str(out)], input="\n".join(said) + "\n")
    assert done.exit_code == 0, done.output
    made = decode_vehicle(out.read_text(), "mine")
    assert made.mass.m_t == 12.5
    assert "J_y" not in made.assumed
    assert "J_x" in made.assumed
    assert f"3/{len(QUESTIONS)} Mass of" in done.output
    assert "shipped vehicle" in done.output


@pytest.mark.parametrize(
    ("said", "line"),
    [
        ("abc\n", "question 1/21, "),
        ("1e9\n", "expected 0.5 to 2000 kg"),
        ("13\n\n14\n", " 13 kg"),
        ("13\n1.2\n", "question 3/21"),
        ("<\n", "first question"),
    ],
)
def test_a_wrong_line_of_a_pipe_is_one_line(said, line):
    with pytest.raises(InputError) as error:
        interview(io.StringIO(said), person=False)
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_a_person_goes_back_and_is_asked_again(capsys):
    rest = [""] * (len(QUESTIONS) - 2 - 4)
    said = ["12", "abc", "<", "<", "15", "1.5", *rest]
    found = interview(io.StringIO("\n".join(said) + "\n"), person=True)
    assert found.answers == {"m_t": 15.0, "length": 1.5}
    shown = capsys.readouterr().err
    assert "'abc'" in shown
    assert "first question" in shown
    assert "[12, your answer]" in shown
    assert "valid" not in shown


def test_wires_of_a_swing_have_no_default():
    found = FirstVehicle({"pitch_period": 2.0})
    assert [found.asks(key) for key in ("pitch_apart", "roll_apart")] == [True, False]
    assert found.value("pitch_apart") is None
    with pytest.raises(InputError, match=ASKED["pitch_apart"].words):
        found.text("mine")
