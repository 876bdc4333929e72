"""The sentence of an ocean glider's diagnosis: one effect, two, and one that no label names."""

import pytest

from glider.tools.diagnose.record import read_as
from glider.tools.report.pooled import _Answer, report_html, sentence

GAP = '"before": {"total": 1.0}, "recalibrated": {"total": 0.5}, "after": {"total": 0.2}, "floor": {"total": 0.2}'
SHARE = '{"value": 0.5, "ci90": [0.4, 0.6]}'


def answer(tmp_path, verdict, selected, left="null", runs=8, more="", gap=GAP):
    cause = '{"label": "drag", "probability": 0.9, "group": ["drag"], "parameters": {}}'
    path = tmp_path / "diagnosis.json"
    path.write_text(
        f'{{"case": {{"name": "a", "vehicle": "b", "runs": {runs}}}, "verdict": "{verdict}", "causes": [{cause}], '
        f'"selected": {selected}, "gap": {{{gap}, "shrinkage": {SHARE}, "closed": {SHARE}}}, "stages": [], '
        f'"cautions": [], "skipped": {{}}, "next_run": {{}}, "left": {left}{more}}}'
    )
    return read_as(path, _Answer)


@pytest.mark.parametrize(
    ("verdict", "selected", "said"),
    [
        ("none", "[]", "No effect beyond what the vehicle file allows"),
        ("cause", '["drag"]', "0.200 with that effect"),
        ("cause", '["drag", "net_buoyancy"]', "), and net_buoyancy; the total gap"),
    ],
)
def test_what_is_told(tmp_path, verdict, selected, said):
    assert said in sentence(answer(tmp_path, verdict, selected))


def test_what_no_label_names_is_told_with_its_place(tmp_path):
    left = '{"channel": "depth", "excess": 0.6, "share": 1.0, "regime": "in deep water", "runs": ["run03"]}'
    told = sentence(answer(tmp_path, "unknown", "[]", left))
    assert told == (
        "An effect that no label names: the depth of dives left out is off by 0.600 tolerances beyond what noise "
        "leaves, most of it in deep water, most in run03."
    )


LEFT = '{"channel": "depth", "excess": 0.6, "share": 1.0, "regime": "", "runs": []}'
HEALTHY = ', "kind": "reference", "reference": {"count": 5}'


@pytest.mark.parametrize("more", ["", HEALTHY], ids=["dive", "run"])
@pytest.mark.parametrize(
    ("verdict", "selected", "left"),
    [("none", "[]", "null"), ("cause", '["drag"]', "null"), ("unknown", "[]", LEFT)],
)
def test_of_one_run_nothing_is_left_out(tmp_path, verdict, selected, left, more):
    found = answer(tmp_path, verdict, selected, left, runs=1, more=more)
    told = sentence(found)
    assert f"this {'run' if more else 'dive'}, to which all was fitted, is " in told
    for text in (told, report_html(found)):
        assert "left out" not in text


@pytest.mark.parametrize("more", ["", HEALTHY], ids=["dive", "run"])
def test_no_change_is_not_said_below_a_floor_above_a_tolerance(tmp_path, more):
    high = GAP.replace('"floor": {"total": 0.2}', '"floor": {"total": 1.5}')
    found = answer(tmp_path, "none", "[]", more=more, gap=high)
    assert " above 1.50 tolerances" in sentence(found)
    assert "one below cannot be seen" in sentence(found)
    assert 'class="verdict blind"' in report_html(found)
