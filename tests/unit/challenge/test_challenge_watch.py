"""The blind test of `gap watch`: what its vehicles go through, and how each figure is counted."""

import json

import numpy as np
import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.verify.challenge.make import make
from glider.tools.verify.challenge.seal import open_answers
from glider.tools.verify.challenge.watch_answer import read_watch
from glider.tools.verify.challenge.watch_cases import draw_vehicle
from glider.tools.verify.challenge.watch_make import WatchOrder
from glider.tools.verify.challenge.watch_plan import (
    CHANGED,
    EPISODE,
    GROWING,
    OUTSIDE,
    STEP,
    UNCHANGED,
    WatchCounts,
    watch_plan,
)
from glider.tools.verify.challenge.watch_score import NEEDED, Watched, score_watches


def test_counts_courses_and_spans():
    counts = WatchCounts()
    plans = watch_plan(3, counts)
    kinds = [plan.kind for plan in plans]
    assert [kinds.count(kind) for kind in (UNCHANGED, CHANGED, OUTSIDE)] == [10, 24, 6]
    assert {plan.course for plan in plans if plan.label} == {STEP, EPISODE, GROWING}
    assert sum(plan.mocap for plan in plans) == 20
    for plan in plans:
        strengths = plan.strengths(counts.judged)
        if plan.label is None:
            assert not strengths.any()
            continue
        inside = np.flatnonzero(strengths)
        assert inside[0] == plan.first
        assert inside[-1] == (counts.judged - 1 if plan.last is None else plan.last)
        assert strengths.max() == 1.0
        assert (np.diff(strengths[inside]) > 0.0).all() == (plan.course == GROWING)
        assert (plan.course == EPISODE) == (plan.last is not None and plan.last < counts.judged - 1)
    assert watch_plan(3, counts) == plans != watch_plan(4, counts)


@pytest.mark.slow
def test_only_the_changed_runs_have_the_change():
    counts = WatchCounts(vehicles=12, unchanged=2, runs=8, reference=3)
    plan = next(p for p in watch_plan(5, counts) if p.course == EPISODE)
    made = draw_vehicle(5, plan, counts, load_vehicle("roughie"))
    changed = [bool((made.trial.shapes != flight.F).any()) for flight in made.flights]
    assert changed == [False] * 3 + [bool(share) for share in plan.strengths(counts.judged)]
    assert made.visible >= 1.8


def test_made_sealed_and_opened(tmp_path, monkeypatch, capsys):
    counts = WatchCounts(vehicles=1, unchanged=1, runs=5, reference=2)
    order = WatchOrder(tmp_path / "blind", 2, counts, tmp_path / "blind" / "answers.zip")
    assert make(order, jobs=1) == (1, [])
    assert len(load_case(order.cases / "case000").runs) == 3
    assert len(load_case(order.held / "case000").runs) == 2
    assert open_answers(order.archive, NEEDED).cases["case000"]["kind"] == UNCHANGED
    assert "unchanged" not in (order.out / "manifest.json").read_text()
    said = tmp_path / "said" / "case000"
    said.mkdir(parents=True)
    runs = [{"run": f"run{n:02d}", "verdict": "none", "causes": []} for n in range(3)]
    (said / "watch.json").write_text(json.dumps({"runs": runs, "events": []}))

    def score() -> int:
        command = ["score", "--watch", "--cases", order.out, "--answers", order.archive, "--diagnoses", said.parent]
        monkeypatch.setattr("sys.argv", ["glider", "gap", "challenge", *map(str, command), "--json"])
        return report_errors(cli)

    assert score() == 0
    figures = json.loads(capsys.readouterr().out)["figures"]
    assert figures["unchanged_called"]["value"] == 0.0
    assert figures["label"]["value"] is None
    (order.held / "case000" / "case.toml").write_text("changed")
    assert score() == 2
    assert "changed" in capsys.readouterr().err


TRUTH = {
    "case": "case000", "kind": CHANGED, "label": "net_buoyancy", "secret": None, "course": STEP, "from_run": 2,
    "to_run": None, "strengths": [0.0, 0.0, 1.0, 1.0], "values": [0.03], "runs": 4,
}  # fmt: skip


def said(tmp_path, first="run02", last=None, label="net_buoyancy", ci90=(0.02, 0.04), verdicts="nncc"):
    words = {"n": "none", "c": "cause", "u": "unknown"}
    runs = [{"run": f"run{n:02d}", "verdict": words[v], "causes": []} for n, v in enumerate(verdicts)]
    event = {"label": label, "group": ["net_buoyancy"] if label == "drag" else [], "from_run": first, "to_run": last,
             "probability": 0.9, "size": 0.03, "ci90": ci90}  # fmt: skip
    path = tmp_path / "watch.json"
    path.write_text(json.dumps({"runs": runs, "events": [event]}))
    return read_watch(path)


def figures(answer) -> dict[str, float | None]:
    return {figure.key: figure.value for figure in score_watches([Watched("case000", TRUTH, answer)]).figures}


def test_a_right_answer(tmp_path):
    found = figures(said(tmp_path))
    assert found["unchanged_called"] == 0.0
    assert all(found[key] == 1.0 for key in ("changed_found", "bounds", "label", "group", "size"))


def test_each_figure_by_itself(tmp_path):
    assert figures(said(tmp_path, first="run01"))["bounds"] == 1.0
    assert figures(said(tmp_path, first="run00"))["bounds"] == 0.0
    assert figures(said(tmp_path, last="run02"))["bounds"] == 1.0
    wrong = figures(said(tmp_path, label="drag"))
    assert (wrong["label"], wrong["group"], wrong["size"]) == (0.0, 1.0, None)
    assert figures(said(tmp_path, ci90=(0.031, 0.04)))["size"] == 0.0
    runs = figures(said(tmp_path, verdicts="cnnc"))
    assert (runs["unchanged_called"], runs["changed_found"]) == (0.5, 0.5)
    nothing = figures(None)
    assert (nothing["unchanged_called"], nothing["changed_found"], nothing["label"]) == (1.0, 0.0, 0.0)


def test_an_answer_that_is_none(tmp_path):
    (tmp_path / "watch.json").write_text('{"runs": [{"run": "run00", "verdict": "maybe", "causes": []}], "events": []}')
    with pytest.raises(InputError, match="verdict"):
        read_watch(tmp_path / "watch.json")
