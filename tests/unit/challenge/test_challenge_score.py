"""Scoring by hand-made answers: every figure counted on its fingers."""

import json
import math

import pytest

from glider.tools.data.errors import InputError
from glider.tools.verify.challenge.diagnosis import AnsweredCause, AnswerFile, Where, read_diagnosis
from glider.tools.verify.challenge.score import ScoredCase, by_label, score

SURGE, NET = ["hydrodynamics", "surge"], ["mass", "net"]


def truth(*labels: str, places=(SURGE,), secret=()) -> dict:
    return {"labels": list(labels), "places": [[place] for place in places], "secret": list(secret)}


def said(verdict, *causes, where="hydrodynamics", selected=(), group=()) -> AnswerFile:
    listed = [AnsweredCause(label, probability) for label, probability in causes]
    listed[0].group = list(group)
    return AnswerFile(1, verdict, [Where(where, "surge", 0.9)], listed, list(selected))


@pytest.fixture
def cases() -> list[ScoredCase]:
    """Two without a gap, four single, two pairs, two outside the catalogue."""
    return [
        ScoredCase("a", truth(places=()), said("none", ("none", 0.9), ("drag", 0.1)), seconds=10.0),
        ScoredCase("b", truth(places=()), said("cause", ("drag", 0.85), ("none", 0.15)), seconds=20.0),
        ScoredCase("c", truth("drag"), said("cause", ("drag", 0.5), ("lift", 0.5), selected=["drag"]), closed=0.99),
        ScoredCase("d", truth("drag"), said("cause", ("lift", 0.7), ("drag", 0.3), group=["lift", "drag"]), closed=0.5),
        ScoredCase("e", truth("lift"), said("cause", ("lift", 1.0), where="mass", group=list("abcd")), closed=0.97),
        ScoredCase("f", truth("tether"), said("none", ("none", 0.9), ("a", 0.06), ("b", 0.02), ("tether", 0.02)),
               closed=0.0),
        ScoredCase("g", truth("drag", "net_buoyancy", places=(SURGE, NET)),
               said("cause", ("drag", 0.6), ("net_buoyancy", 0.4), selected=["net_buoyancy", "drag"])),
        ScoredCase("h", truth("drag", "net_buoyancy", places=(SURGE, NET)),
               said("unknown", ("unknown", 0.9), ("drag", 0.1), selected=["drag"])),
        ScoredCase("i", truth("unknown", secret=["x_a"]), said("unknown", ("unknown", 1.0))),
        ScoredCase("j", truth("unknown", secret=["x_a"]), said("cause", ("drag", 0.6), ("unknown", 0.4))),
    ]  # fmt: skip


def counted(cases) -> dict[str, tuple[int | None, int]]:
    return {figure.key: (figure.count, figure.of) for figure in score(cases).figures}


def test_every_share_is_counted_over_its_kind(cases):
    found = counted(cases)
    assert found["no_gap_called_gap"] == (1, 2)
    assert found["effects_seen"] == (7, 8)  # f is not seen
    assert found["right_cause_first"] == (1, 4)  # c; e hides in a group of five
    assert found["within_group"] == (2, 4)  # c, d
    assert found["in_first_three"] == (3, 4)  # not f, where it is fourth
    assert found["right_subsystem"] == (3, 4)  # not e
    assert found["unknown_called_unknown"] == (1, 2)
    assert found["known_called_unknown"] == (1, 6)
    assert found["two_both_named"] == (1, 2)
    assert found["two_one_named"] == (2, 2)
    assert found["sure_and_wrong"] == (3, 10)  # b, f, h


def test_log_loss_closed_and_seconds(cases):
    figures = {figure.key: figure for figure in score(cases).figures}
    p = [0.9, 0.15, 0.5, 0.3, 1.0, 0.02, 1.0, 0.1, 1.0, 0.4]
    assert figures["log_loss"].value == pytest.approx(-sum(map(math.log, p)) / 10)
    assert figures["closed"].value == pytest.approx((0.5 + 0.97) / 2)
    assert (figures["seconds"].value, figures["seconds_median"].value) == (20.0, 15.0)
    assert figures["seconds"].met
    assert not figures["closed"].met


def test_no_answer_is_wrong_wherever_it_counts():
    cases = [ScoredCase("a", truth(places=()), None), ScoredCase("b", truth("drag"), None), ScoredCase("c",
    truth("unknown"), None),
             ScoredCase("d", truth("drag", "net_buoyancy"), None)]  # fmt: skip
    found = counted(cases)
    assert found["no_gap_called_gap"] == (1, 1)
    assert found["effects_seen"] == (0, 3)
    assert found["unknown_called_unknown"] == (0, 1)
    assert found["known_called_unknown"] == (0, 2)
    assert found["two_one_named"] == (0, 1)
    assert found["sure_and_wrong"] == (4, 4)
    assert {figure.key: figure for figure in score(cases).figures}["log_loss"].value == pytest.approx(-math.log(1e-6))


def test_naming_everything_names_nothing():
    pair = truth("drag", "net_buoyancy")
    answer = said("cause", ("drag", 1.0), selected=["drag", "net_buoyancy", "lift", "tether"])
    found = counted([ScoredCase("a", pair, answer)])
    assert found["two_both_named"] == (0, 1)
    assert found["two_one_named"] == (0, 1)


def test_a_label_has_a_line_and_what_it_was_called(cases):
    table = by_label(cases)
    assert table["drag"]["cases"] == 2
    assert (table["drag"]["first"], table["drag"]["group"], table["drag"]["called"]) == (1, 2, {"lift": 1})
    assert table["drag"]["closed"] == pytest.approx((0.99 + 0.5) / 2)
    assert (table["x_a"]["cases"], table["x_a"]["first"]) == (2, 1)
    assert table["none"]["cases"] == 2


GOOD = {"format": 1, "verdict": "cause", "where": [{"subsystem": "mass", "element": "net", "probability": 0.7}],
        "causes": [{"label": "none", "probability": 0.1}, {"label": "drag", "probability": 0.9, "group": ["drag"]}],
        "selected": ["drag"], "gap": {}, "next_run": {}}  # fmt: skip


def test_a_diagnosis_is_read_most_probable_first(tmp_path):
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(GOOD))
    assert [cause.label for cause in read_diagnosis(path).causes] == ["drag", "none"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"verdict": "perhaps"}, "verdict"),
        ({"format": 2}, "format"),
        ({"causes": []}, "causes"),
        ({"causes": [{"label": "drag", "probability": 0.5}]}, "add up to 0.500"),
        ({"causes": [{"label": "drag", "probability": 0.5}, {"label": "drag", "probability": 0.5}]}, "stands twice"),
        ({"causes": [{"label": "drag", "probability": 1.5}]}, "probability"),
        ({"selected": None}, "selected"),
    ],
)
def test_a_wrong_diagnosis_says_what_is_wrong(tmp_path, change, message):
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(GOOD | change))
    with pytest.raises(InputError, match=message) as error:
        read_diagnosis(path)
    assert str(path) in str(error.value)


def test_what_is_no_json_says_so(tmp_path):
    path = tmp_path / "diagnosis.json"
    path.write_bytes(b"\xff{")
    with pytest.raises(InputError):
        read_diagnosis(path)


def test_odds_are_of_the_likeliest_label_against_none(cases):
    found = [case.odds() for case in cases]
    assert found[:2] == pytest.approx([math.log(0.1 / 0.9), math.log(0.85 / 0.15)])
    assert found[2] is None  # none has no probability
    assert ScoredCase("k", truth(), None).odds() is None
