"""The command `glider simulate`: its files, its exit codes, its one line for what it cannot use."""

import errno
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.flight.simulate import COLUMNS
from tests.support.commands import glider

FLIGHT = Path(__file__).resolve().parents[1] / "data" / "reference" / "down_and_up.csv"
HEADER = ",".join(COLUMNS)
START = "0,0,-0.02,0.1,0,0,5,0,0,0.3,0.2,0,0,0,0,0,0,0,0"
ROW = "0.1,0,-0.02,0.1"


@pytest.fixture
def simulate(tmp_path, monkeypatch, capsys):
    """simulate(text, *options) -> exit code, standard error, rows written (None: no file)."""

    def run(text: str, *options: str):
        commands, out = tmp_path / "commands.csv", tmp_path / "flight.csv"
        commands.write_text(text, encoding="utf-8")
        monkeypatch.setattr(sys, "argv", ["glider", "simulate", str(commands), "--out", str(out), *options])
        code = report_errors(cli)
        captured = capsys.readouterr()
        assert captured.out == ""
        return code, captured.err, np.genfromtxt(out, delimiter=",", names=True) if out.exists() else None

    return run


def refused(result, *words: str) -> None:
    """Exit code 2, nothing written, one line that holds all of `words`."""
    code, message, rows = result
    assert code == 2
    assert rows is None
    assert message.count("\n") == 1, message
    for word in words:
        assert word in message


def test_same_columns_at_same_times(simulate):
    code, message, rows = simulate(FLIGHT.read_text(encoding="utf-8"))
    given = np.genfromtxt(FLIGHT, delimiter=",", names=True)
    assert (code, message) == (0, "")
    assert rows.dtype.names == given.dtype.names == COLUMNS
    for name in COLUMNS[:4]:
        np.testing.assert_array_equal(rows[name], given[name])
    for name in COLUMNS[4:]:
        assert rows[name][0] == pytest.approx(given[name][0], abs=1e-15)


def test_states_are_needed_in_the_first_row_only(simulate):
    lines = FLIGHT.read_text(encoding="utf-8").splitlines()
    short = [*lines[:2], *(",".join(line.split(",")[:4]) for line in lines[2:])]
    empty = [*lines[:2], *(line.rsplit(",", 15)[0] + "," * 15 for line in lines[2:])]
    whole = simulate("\n".join(lines))[2]
    assert (simulate("\n".join(short))[2] == whole).all()
    assert (simulate("\r\n".join(empty) + "\r\n\r\n")[2] == whole).all()


def test_columns_may_stand_in_any_order_among_others(simulate):
    lines = [line.split(",") for line in FLIGHT.read_text(encoding="utf-8").splitlines()]
    turned = [",".join([*line[::-1], "note" if k == 0 else "x"]) for k, line in enumerate(lines)]
    ordered = simulate("\n".join(",".join(line) for line in lines))[2]
    assert (simulate("\ufeff" + "\n".join(turned))[2] == ordered).all()


def test_water_carries_the_flight_along(simulate):
    text = FLIGHT.read_text(encoding="utf-8")
    still, moving = simulate(text)[2], simulate(text, "--water", "-0.12,0.07")[2]
    np.testing.assert_allclose(moving["X"] - still["X"], -0.12 * still["t_s"], atol=1e-9)
    np.testing.assert_allclose(moving["Y"] - still["Y"], 0.07 * still["t_s"], atol=1e-9)
    for name in COLUMNS[6:]:
        np.testing.assert_allclose(moving[name], still[name], atol=1e-9)


def test_another_vehicle_flies_another_way(simulate, tmp_path):
    shipped = Path(__file__).resolve().parents[2] / "firmware" / "model" / "vehicles" / "roughie.toml"
    heavy_nosed = tmp_path / "other.toml"
    heavy_nosed.write_text(shipped.read_text(encoding="utf-8").replace("K_M = -17.0", "K_M = -12.0"), encoding="utf-8")
    text = FLIGHT.read_text(encoding="utf-8")
    usual, same, other = (
        simulate(text, *options)[2] for options in ((), ("--vehicle", str(shipped)), ("--vehicle", str(heavy_nosed)))
    )
    assert (usual == same).all()
    assert abs(usual["theta"] - other["theta"]).max() > 0.01


def test_rows_between_steps_and_a_single_row(simulate):
    text = f"{HEADER}\n{START}\n0.0333,0,-0.02,0.1\n0.1,0,-0.02,0.1\n"
    even = f"{HEADER}\n{START}\n{ROW}\n"
    _, _, between = simulate(text)
    _, _, straight = simulate(even)
    assert between["X"][-1] == pytest.approx(straight["X"][-1], abs=1e-9)
    _, _, alone = simulate(f"{HEADER}\n{START}\n")
    assert alone["Z"] == 5.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("commands.csv", "empty")),
        (f"{HEADER}\n", ("commands.csv", "no samples")),
        (f"{HEADER.replace(',psi', ',heading')}\n{START}", ("commands.csv:1", "psi")),
        (f"{HEADER.replace('theta', 'psi')}\n{START}", ("commands.csv:1", "psi", "twice")),
        (f"{HEADER}\n{START}\n0.1,0,oops,0.1", ("commands.csv:3", "cmd_slider_m", "'oops'")),
        (f"{HEADER}\n{START}\n0.1,0,-0.02", ("commands.csv:3", "cmd_ballast_kg", "no value")),
        (f"{HEADER}\n{START}\n0.1,nan,-0.02,0.1", ("commands.csv:3", "cmd_servo_rad", "'nan'")),
        (f"{HEADER}\n{START}\n0.1,0,-0.02,inf", ("commands.csv:3", "cmd_ballast_kg", "inf")),
        (f"{HEADER}\n{START}\n0.1,0,1_0,0", ("commands.csv:3", "cmd_slider_m", "number")),
        (f"{HEADER}\n{START}\n0,0,-0.02,0.1", ("commands.csv:3", "t_s", "after")),
        (f"{HEADER}\n{START}\n{ROW}\n{ROW}", ("commands.csv:4", "t_s", "after")),
        (f"{HEADER}\n{START.replace('0.3,0.2', '0.3,nan')}\n{ROW}", ("commands.csv:2", "u", "'nan'")),
        (f"{HEADER}\n{START.replace('0.3,0.2', '0.3,')}\n{ROW}", ("commands.csv:2", "u", "no value")),
        (f"{HEADER}\n{START.replace('0.3,0.2', '0.3,200')}\n{ROW}", ("commands.csv:2", "u", "speed of")),
        (f"{HEADER}\n{START[:-4]},-20,0\n{ROW}", ("commands.csv:2", "slider_m", "outside")),
        (f"{HEADER}\n{START},1\n{ROW}", ("commands.csv:2", "expected 19, got 20")),
        (f"{HEADER}\n{START}\n1e13,0,0,0", ("commands.csv:3", "t_s", "steps")),
        (f"{HEADER}\n{START}\n0.1,0,\x00,0", ("commands.csv:3", "cmd_slider_m")),
    ],
)  # fmt: skip
def test_bad_tables_get_one_line(simulate, text, words):
    refused(simulate(text), *words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--dt", "-0.01"), ("--dt", "positive")),
        (("--dt", "0"), ("--dt", "positive")),
        (("--dt", "nan"), ("--dt", "positive")),
        (("--dt", "0.5"), ("--dt", "time constant")),
        (("--vehicle", "nowhere"), ("nowhere", "roughie")),
    ],
)  # fmt: skip
def test_bad_options_get_one_line(simulate, options, words):
    refused(simulate(f"{HEADER}\n{START}\n{ROW}\n", *options), *words)


@pytest.mark.parametrize("water", ["1", "a,b", "nan,0", "0,inf", "1,2,3"])
def test_bad_water_is_bad_usage(simulate, water):
    code, message, rows = simulate(f"{HEADER}\n{START}\n{ROW}\n", "--water", water)
    assert (code, rows) == (2, None)
    assert "--water" in message


def test_a_flight_that_diverges_says_when(simulate):
    text = f"{HEADER}\n{START.replace('0.2,0,0,0,0,0,0,0,0', '40,0,0,0,49,0,0,0,0')}\n{ROW}\n20,0,0,0\n"
    refused(simulate(text, "--dt", "0.1"), "commands.csv:3", "diverges at t = ")


def test_missing_files_get_one_line(tmp_path):
    for arguments in (
        [str(tmp_path / "none.csv"), "--out", str(tmp_path / "out.csv")],
        [str(FLIGHT), "--out", str(tmp_path / "no" / "folder" / "out.csv")],
    ):
        done = glider("simulate", *arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stdout == ""
        assert done.stderr.count("\n") == 1
        assert os.strerror(errno.ENOENT) in done.stderr


def test_binary_input_gets_one_line(simulate, tmp_path, monkeypatch, capsys):
    path = tmp_path / "picture.csv"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    monkeypatch.setattr(sys, "argv", ["glider", "simulate", str(path), "--out", str(tmp_path / "out.csv")])
    assert report_errors(cli) == 2
    assert "not UTF-8" in capsys.readouterr().err
