"""The sentence of an ocean glider's diagnosis: one effect, two, and one that no label names."""

import pytest

from glider.tools.diagnose.record import read_as
from glider.tools.report.pooled import _Answer, sentence

GAP = '"before": {"total": 1.0}, "recalibrated": {"total": 0.5}, "after": {"total": 0.2}, "floor": {"total": 0.2}'
SHARE = '{"value": 0.5, "ci90": [0.4, 0.6]}'


def answer(tmp_path, verdict, selected, left="null"):
    cause = '{"label": "drag", "probability": 0.9, "group": ["drag"], "parameters": {}}'
    path = tmp_path / "diagnosis.json"
    path.write_text(
        f'{{"case": {{"name": "a", "vehicle": "b", "runs": 8}}, "verdict": "{verdict}", "causes": [{cause}], '
        f'"selected": {selected}, "gap": {{{GAP}, "shrinkage": {SHARE}, "closed": {SHARE}}}, "stages": [], '
        f'"cautions": [], "skipped": {{}}, "next_run": {{}}, "left": {left}}}'
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
