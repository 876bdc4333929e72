"""Two answers side by side: what is compared, what is printed, what is refused."""

import json

import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.report.compare import compare, lines


def cause(label, probability, **parameters):
    return {
        "label": label, "probability": probability, "group": [label],
        "parameters": {name: {"estimate": one, "ci90": [low, high], "unit": unit}
                       for name, (one, low, high, unit) in parameters.items()},
    }  # fmt: skip


def answer(folder, name, causes, selected, after=0.5):
    """A folder with a diagnosis as far as a comparison reads it."""
    gap = {which: {"depth": value, "total": value} for which, value in (("before", 2.0), ("after", after))}
    table = {"verdict": "cause" if selected else "none", "causes": causes, "selected": selected, "gap": gap}
    path = folder / name
    path.mkdir()
    (path / "diagnosis.json").write_text(json.dumps(table))
    return path


@pytest.fixture
def pair(tmp_path):
    """Drag of 0.50 +- 0.08 and of 0.90 +- 0.08 (90 %)."""
    sizes = [{"scale": (0.5, 0.42, 0.58, "1")}, {"scale": (0.9, 0.82, 0.98, "1")}]
    return [
        answer(tmp_path, name, [cause("drag", p, **size), cause("none", 1.0 - p)], ["drag"], after)
        for name, p, size, after in zip("ab", (0.95, 0.7), sizes, (0.5, 0.25), strict=True)
    ]


def test_sizes_are_compared_with_the_spread_of_their_difference(pair):
    (row,) = compare(*pair)["parameters"]
    assert row["difference"] == pytest.approx(0.4)
    assert row["sd"] == pytest.approx(2.0**0.5 * 0.08 / 1.645, rel=1e-3)
    assert row["differs"] is True
    (back,) = compare(pair[0], pair[0])["parameters"]
    assert (back["difference"], back["differs"]) == (0.0, False)


def test_labels_of_one_answer_only_have_nothing_on_the_other_side(pair, tmp_path):
    other = answer(tmp_path, "c", [cause("lift", 0.9, scale=(0.2, 0.1, 0.3, "1")), cause("drag", 0.004)], ["lift"])
    found = compare(pair[0], other / "diagnosis.json")  # a file and a folder
    assert {one["label"]: (one["a"], one["b"]) for one in found["labels"]} == {
        "drag": (0.95, 0.004), "lift": (None, 0.9), "none": (pytest.approx(0.05), None),
    }  # fmt: skip
    assert [(one["label"], one["a"] is None, one["b"] is None, one["differs"]) for one in found["parameters"]] == [
        ("drag", False, True, None), ("lift", True, False, None),
    ]  # fmt: skip


def test_a_terminal_has_both_sides(pair, capsys):
    assert report_errors(lambda **kept: cli(["gap", "compare", *map(str, pair)], **kept)) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines() == lines(compare(*pair))
    assert next(line for line in shown.splitlines() if "drag scale" in line).endswith("differs")
    assert "2.00 -> 0.50" in shown
    columns = {line.index("2.00 -> 0.25") for line in shown.splitlines() if "2.00 -> 0.25" in line}
    assert len(columns) == 1  # one under the other


def test_json_is_what_the_function_returns(pair, capsys):
    assert report_errors(lambda **kept: cli(["gap", "compare", *map(str, pair), "--json"], **kept)) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(compare(*pair)))


@pytest.mark.parametrize(
    ("text", "message"),
    [(None, "no such"), ("{", "b.json"), ('{"runs": []}', "missing required field"), ("\xff", "b.json")],
)
def test_a_wrong_file_is_one_line_and_exit_2(pair, tmp_path, capsys, text, message):
    wrong = tmp_path / "b.json"
    if text is not None:
        wrong.write_bytes(text.encode("latin-1"))
    assert report_errors(lambda **kept: cli(["gap", "compare", str(pair[0]), str(wrong)], **kept)) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
    assert "b.json" in line
