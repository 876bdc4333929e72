"""The sentence of an ocean glider's diagnosis: one effect, two, and one that no label names."""

import pytest

from glider.tools.diagnose.record import read_as
from glider.tools.report.pooled import _Answer, report_html, sentence
from tests.support.golden import check_golden

GAP = '"before": {"total": 1.0}, "recalibrated": {"total": 0.5}, "after": {"total": 0.2}, "floor": {"total": 0.2}'
SHARE = '{"value": 0.5, "ci90": [0.4, 0.6]}'


def answer(tmp_path, verdict, selected, left="null", runs=8, more="", gap=GAP):
    cause = '{"label": "drag", "probability": 0.9, "group": ["drag"], "parameters": {}}'
    path = tmp_path / "diagnosis.json"
    path.write_text(
        f'{{"case": {{"name": "a", "vehicle": "b", "runs": {runs}}}, "verdict": "{verdict}", "causes": [{cause}], '
        f'"selected": {selected}, "gap": {{{gap}, "shrinkage": {SHARE}, "closed": {SHARE}}}, "stages": [], '
        f'"cautions": [], "skipped": {{}}, "next_run": {{}}, "left": {left}{more or OCEAN}}}'
    )
    return read_as(path, _Answer)


PLACED = '{"channel": "depth", "excess": 0.6, "share": 1.0, "regime": "in deep water", "runs": ["run03"]}'
LEFT = '{"channel": "depth", "excess": 0.6, "share": 1.0, "regime": "", "runs": []}'
OCEAN = ', "kind": "ocean"'
HEALTHY = ', "kind": "reference", "reference": {"count": 5}'


def high(tmp_path, more=""):
    """No change, of runs that leave more than a tolerance unseen."""
    gap = GAP.replace('"floor": {"total": 0.2}', '"floor": {"total": 1.5}')
    return answer(tmp_path, "none", "[]", more=more, gap=gap)


def test_every_kind_of_sentence(tmp_path):
    said = {
        "none": answer(tmp_path, "none", "[]"),
        "one effect": answer(tmp_path, "cause", '["drag"]'),
        "two effects": answer(tmp_path, "cause", '["drag", "net_buoyancy"]'),
        "no label names it, placed": answer(tmp_path, "unknown", "[]", PLACED),
        "one dive": answer(tmp_path, "cause", '["drag"]', runs=1),
        "one run, of healthy ones": answer(tmp_path, "cause", '["drag"]', runs=1, more=HEALTHY),
        "a floor above a tolerance": high(tmp_path),
        "a floor above a tolerance, of healthy runs": high(tmp_path, HEALTHY),
    }
    check_golden("pooled_words.txt", "".join(f"{name}:\n{sentence(found)}\n\n" for name, found in said.items()))


@pytest.mark.parametrize("more", ["", HEALTHY], ids=["dive", "run"])
@pytest.mark.parametrize(
    ("verdict", "selected", "left"),
    [("none", "[]", "null"), ("cause", '["drag"]', "null"), ("unknown", "[]", LEFT)],
)
def test_of_one_run_nothing_is_left_out(tmp_path, verdict, selected, left, more):
    found = answer(tmp_path, verdict, selected, left, runs=1, more=more)
    for text in (sentence(found), report_html(found)):
        assert "left out" not in text


@pytest.mark.parametrize("more", ["", HEALTHY], ids=["dive", "run"])
def test_no_change_is_not_said_below_a_floor_above_a_tolerance(tmp_path, more):
    found = high(tmp_path, more)
    assert " above 1.50 tolerances" in sentence(found)
    assert 'class="verdict blind"' in report_html(found)
