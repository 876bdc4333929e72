"""Logs as they come out of the water: damaged rows, records over two lines, times that leap; and all of it counted."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

from glider.hal.strict import ConfigError
from glider.tools.cli.import_ import import_
from glider.tools.data.errors import InputError
from glider.tools.data.importers.csvlog import import_csv
from glider.tools.data.importers.mapping import decode_map
from glider.tools.data.importers.resample import longest_increasing, zero_order_hold
from glider.tools.data.runs.case import load_case

MAP = """\
format = 1
vehicle = "roughie"
water_density_kg_m3 = 1000.0
[text]
{text}
[time]
column = "ms"
unit = "ms"
not_increasing = "drop"
[columns.depth_m]
source = "depth"
[columns.pitch_rad]
source = "pitch"
unit = "deg"
"""
ROWS = [f"{100 * n},{n / 10:.1f},{-n}" for n in range(40)]
HEADER = "ms,depth,pitch"


def bring(folder, lines, text, *, strict=False, mapping=MAP):
    """What came of a log of these lines under these keys of [text], and its one run."""
    (folder / "map.toml").write_text(mapping.format(text=text))
    body = "\n".join(lines)
    (folder / "a.csv").write_bytes(body if isinstance(body, bytes) else body.encode("latin-1"))
    imported = import_csv([folder / "a.csv"], str(folder / "map.toml"), folder / "out", strict)
    return imported, load_case(folder / "out").runs[0]


def test_bad_rows_are_left_out_counted_and_said(tmp_path):
    """A row cut short, letters in a number, bytes that are no text, a time far ahead, and the last row half written."""
    lines = [HEADER, *ROWS]
    lines[5], lines[9], lines[12], lines[20] = "400,0.4", "800,0.8,-8x", "1100,1\xff1,-11", "99999999,1.9,-19"
    lines[-1] = lines[-1][:6]
    text = 'broken_rows = "drop"\nbad_fields = "drop"'
    imported, run = bring(tmp_path, lines, text)
    gone = [4, 8, 11, 19, 39]
    kept = np.delete(np.arange(40), gone)
    np.testing.assert_allclose(run.t, kept / 10)
    np.testing.assert_allclose(run.columns["depth_m"], kept / 10)
    assert imported.left_out == [
        {"broken": 2, "with a field that is no number": 2, "whose time does not go on": 1}
    ]  # fmt: skip
    (said,) = [note for note in imported.notes if "left out" in note]
    assert re.findall(r"\d+", said.split("a.csv: ")[1]) == ["5", "40", "2", "6", "2", "10", "1", "21"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("400,0.4", "a.csv:6: "),
        ("400,0.4,x", "a.csv:6: pitch: "),
        ("x,0.4,-4", "a.csv:6: ms: "),
        ("1,0.4,-4", "a.csv:6: ms: time"),
        ("400,0.4,\xff", "a.csv:6: not UTF-8"),
    ],
)
def test_strict_refuses_what_the_mapping_leaves_out(tmp_path, line, said):
    lines = [HEADER, *ROWS]
    lines[5] = line
    text = 'broken_rows = "drop"\nbad_fields = "drop"'
    assert sum(bring(tmp_path, lines, text)[0].left_out[0].values()) == 1
    with pytest.raises(InputError) as error:
        bring(tmp_path, lines, text, strict=True)
    assert said in str(error.value)


def test_the_command_says_and_refuses(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join([HEADER, *ROWS, "4000,4"]))
    (tmp_path / "map.toml").write_text(MAP.format(text='broken_rows = "drop"'))
    command = ["csv", str(tmp_path / "a.csv"), "--map", str(tmp_path / "map.toml"), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(import_, [*command, "--json"], catch_exceptions=False)
    assert json.loads(done.stdout)["left_out"] == [{"broken": 1}]
    assert "1 broken (line 42)" in done.stderr
    assert isinstance(CliRunner().invoke(import_, [*command, "--strict"]).exception, InputError)


def test_a_bad_field_alone_may_be_missing(tmp_path):
    lines = [HEADER, *ROWS]
    lines[5] = "400,0.4,??"
    imported, run = bring(tmp_path, lines, 'bad_fields = "missing"')
    assert run.rows == 40
    assert np.flatnonzero(np.isnan(run.columns["pitch_rad"])).tolist() == [4]
    assert not np.isnan(run.columns["depth_m"]).any()
    assert re.search(r"pitch_rad: 1 .*\(line 6\)$", imported.notes[0])
    assert imported.left_out == [{}]


@pytest.mark.parametrize("broken", ["700,0.7\n-7", "700,0.7,\n-7", "700,0\n.7,-7", "700\n,0.7,-7"])
def test_a_row_that_a_lines_end_broke_is_put_together(tmp_path, broken):
    lines = [HEADER, *ROWS]
    lines[8] = broken
    imported, run = bring(tmp_path, lines, 'broken_rows = "join"')
    np.testing.assert_allclose(run.columns["pitch_rad"], np.deg2rad(-np.arange(40.0)))
    assert imported.left_out == [{}]
    assert "1 rows put together" in imported.notes[0]


OVER_TWO = """\
header = ["of", "ms", "depth", "kind", "pitch"]
[[text.line]]
fields = 3
begins = "D"
[[text.line]]
fields = 2
begins = "P"
"""


@pytest.mark.parametrize(
    ("lost", "left"), [([], []), ([31], [10]), ([60], [20]), ([31, 60], [10, 20]), ([0, 118], [0, 39])]
)
def test_records_over_two_lines_and_those_that_lost_half(tmp_path, lost, left):
    lines = []
    for row in ROWS:
        ms, depth, pitch = row.split(",")
        lines += [f"D,{ms},{depth}", f"P,{pitch}", ""]
    imported, run = bring(tmp_path, np.delete(lines, lost).tolist(), OVER_TWO)
    whole = np.delete(np.arange(40), left)
    np.testing.assert_allclose(run.t, (whole - whole[0]) / 10)
    np.testing.assert_allclose(run.columns["depth_m"], whole / 10)
    np.testing.assert_allclose(run.columns["pitch_rad"], np.deg2rad(-whole))
    assert imported.left_out == [{"broken": len(left)} if left else {}]


def test_a_header_over_two_lines(tmp_path):
    lines = ["ms,depth", "pitch"]
    for row in ROWS:
        ms, depth, pitch = row.split(",")
        lines += [f"{ms},{depth}", pitch]
    imported, run = bring(tmp_path, lines, "[[text.line]]\nfields = 2\n[[text.line]]\nfields = 1")
    np.testing.assert_allclose(run.columns["pitch_rad"], np.deg2rad(-np.arange(40.0)))
    assert imported.left_out == [{}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[text.line]]\nfields = 3\n[[text.line]]\nfields = 3", "line: expected lines"),
        ('[[text.line]]\nfields = 3\nbegins = "D"\n[[text.line]]\nfields = 3', "line: expected lines"),
        ('[[text.line]]\nfields = 3\nbegins = "D"\n[[text.line]]\nfields = 2', "header: missing"),
        ('broken_rows = "mend"', "text.broken_rows"),
    ],
)
def test_lines_that_cannot_be_told_apart_are_refused(text, said):
    with pytest.raises(ConfigError, match=said):
        decode_map(MAP.format(text=text), "map.toml")


def test_remarks_and_marks_of_quotation(tmp_path):
    lines = ["# logger 3", HEADER, *ROWS]
    lines[6], lines[9] = '# "wet"', '700,"0.7,-7'
    imported, run = bring(tmp_path, lines, 'comment = "#"\nquotes = false\nbad_fields = "drop"')
    assert imported.left_out == [{"with a field that is no number": 1}]
    assert run.rows == 38


def test_the_longest_course_of_times():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.1, 1.0, 500))
    wrong = rng.choice(500, 40, replace=False)
    damaged = t.copy()
    damaged[wrong] = rng.uniform(-1e6, 1e6, 40)
    found = longest_increasing(damaged)
    assert (np.diff(damaged[found]) > 0.0).all()
    assert set(np.delete(np.arange(500), wrong)) <= set(found.tolist())
    assert longest_increasing(t).tolist() == list(range(500))
    assert longest_increasing(np.array([3.0, 3.0, 3.0])).size == 1


def test_a_command_is_held_and_never_averaged():
    t, command = np.array([0.0, 0.5, 1.0, 2.2]), np.array([np.nan, 0.1, np.nan, -0.1])
    np.testing.assert_array_equal(zero_order_hold(t, command, np.arange(6) / 2), [np.nan, 0.1, 0.1, 0.1, 0.1, -0.1])
    np.testing.assert_array_equal(zero_order_hold(t, np.full(4, np.nan), np.arange(2.0)), [np.nan, np.nan])
