"""`glider gap challenge`: a tiny blind test made, made again, gone on with, and scored."""

import json
import shutil
from pathlib import Path

import pytest

from glider.firmware.model.library import shipped
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.verify.challenge.make import Order, make, make_one
from glider.tools.verify.challenge.plan import Counts, plan
from glider.tools.verify.challenge.seal import open_answers

pytestmark = pytest.mark.computes(seconds=20)

COUNTS = Counts(single=1, none=1, pairs=0, unknown=1)
SEED = 6


def order(out: Path) -> Order:
    return Order(out, SEED, COUNTS, out / "answers.zip")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("blind") / "test"
    assert make(order(out), jobs=1) == (3, [])
    return out


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def run(monkeypatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["glider", "gap", "challenge", *map(str, arguments)])
    return report_errors(cli)


@pytest.mark.slow
def test_the_seed_gives_the_same_bytes_also_after_a_stop(made, tmp_path):
    again = order(tmp_path / "again")
    for folder in (again.cases, again.held, again.making):
        folder.mkdir(parents=True)
    cases = plan(SEED, COUNTS)
    (again.making / "plan.json").write_text(json.dumps(again.plain))
    assert make_one(again, cases[1], load_vehicle("roughie")) is None
    shutil.copytree(again.cases / cases[1].name, again.cases / cases[0].name)  # as if cut off in the middle
    kept = (again.cases / cases[1].name / "run00.csv.gz").stat().st_mtime_ns
    assert make(again, jobs=2) == (2, [])
    assert files(again.out) == files(made)
    assert (again.cases / cases[1].name / "run00.csv.gz").stat().st_mtime_ns == kept
    assert make(again) == (0, [])  # sealed: nothing to do


@pytest.mark.slow
def test_cases_are_run_data_and_do_not_tell(made):
    for name, answer in open_answers(made / "answers.zip").cases.items():
        fitted, held = load_case(made / "cases" / name), load_case(made / "held" / name)
        assert (len(fitted.runs), len(held.runs)) == (6, 3)
        assert fitted.motion_capture == answer["mocap"]
        for run_ in (*fitted.runs, *held.runs):
            assert 60.0 <= run_.t[-1] <= 150.1
            assert run_.has_mocap == answer["mocap"]
        text = (made / "cases" / name / "case.toml").read_text()
        assert not any(label in text for label in (*answer["labels"], *answer["secret"]))
        assert len(answer["before"]) == len(answer["oracle"]) == 9
        for setting in answer["settings"]:
            assert setting["visible"] >= 2.0
        if not answer["labels"]:
            assert answer["visible"] == 0.0


def diagnosis(label: str, verdict: str, selected: list[str], place: list[str]) -> str:
    where = [{"subsystem": place[0], "element": place[1], "probability": 1.0}]
    causes = [{"label": label, "probability": 0.99, "group": [label]}, {"label": "other", "probability": 0.01}]
    return json.dumps({"format": 1, "verdict": verdict, "where": where, "causes": causes, "selected": selected})


@pytest.mark.slow
def test_right_answers_score_full_marks(made, tmp_path, monkeypatch, capsys):
    for name, answer in open_answers(made / "answers.zip").cases.items():
        label = (answer["labels"] or ["none"])[0]
        verdict = label if label in ("none", "unknown") else "cause"
        place = answer["places"][0][0] if answer["places"] else ["mass", "net"]
        folder = tmp_path / name
        folder.mkdir()
        (folder / "diagnosis.json").write_text(diagnosis(label, verdict, [label] * (verdict == "cause"), place))
        (folder / "corrected.toml").write_text(shipped("model/vehicles")["roughie"])
        (folder / "timing.json").write_text('{"seconds": 5.0}')
    common = ("--cases", made, "--answers", made / "answers.zip", "--diagnoses", tmp_path)
    assert run(monkeypatch, "score", *common, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    figures = found["figures"]
    for key in ("effects_seen", "right_cause_first", "within_group", "in_first_three", "right_subsystem"):
        assert figures[key]["value"] == 1.0
        assert figures[key]["met"]
    assert figures["no_gap_called_gap"]["count"] == figures["sure_and_wrong"]["count"] == 0
    assert figures["unknown_called_unknown"]["count"] == figures["unknown_called_unknown"]["of"] == 1
    # a model that is the nominal one closes nothing, measured by flying both
    assert figures["closed"]["value"] == pytest.approx(0.0, abs=1e-9)
    assert figures["seconds"]["value"] == 5.0
    result = tmp_path / "single-6.json"
    assert run(monkeypatch, "score", *common, "--no-closed", "--out", result, "--commit", "1234567") == 0
    assert "cause first" in capsys.readouterr().out
    assert json.loads(result.read_text())["figures"]["right_cause_first"]["count"] == 1


@pytest.mark.slow
def test_one_that_says_nothing_is_wrong_unless_partial(made, tmp_path, monkeypatch, capsys):
    (tmp_path / "case000").mkdir()
    (tmp_path / "case000" / "diagnosis.json").write_text(diagnosis("none", "none", [], ["mass", "net"]))
    common = ("--cases", made, "--answers", made / "answers.zip", "--diagnoses", tmp_path, "--no-closed", "--json")
    assert run(monkeypatch, "score", *common) == 0
    assert json.loads(capsys.readouterr().out)["unanswered"] == ["case001", "case002"]
    assert run(monkeypatch, "score", *common, "--partial") == 0
    found = json.loads(capsys.readouterr().out)
    assert sum(found["cases_by_kind"].values()) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["score", "--cases", "{made}", "--answers", "nowhere", "--diagnoses", "{made}"], "no such"),
        (["score", "--cases", "nowhere", "--answers", "x", "--diagnoses", "y"], "no such folder"),
        (["score", "--cases", "{made}", "--answers", "{zip}", "--diagnoses", "nowhere"], "no such folder"),
        (["score", "--cases", "{made}", "--answers", "{zip}", "--diagnoses", "{made}"], "no diagnosis.json"),
        (["score", "--cases", "{made}", "--answers", "{zip}", "--diagnoses", ".", "--manifest", "no"], "--manifest"),
        (["run", "--cases", "nowhere", "--out", "{out}"], "no such folder"),
        (["run", "--cases", "{made}", "--out", "{out}", "--only", "case999"], "no case case999"),
        (["make", "--out", "{made}", "--seed", "7", "--single", "1"], "another blind test"),
        (["make", "--out", "{out}", "--seed", "-1"], "--seed"),
        (["make", "--out", "{out}", "--seed", "1", "--single", "0", "--none", "0", "--pairs", "0", "--unknown", "0"],
         "no cases"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_line_and_exit_2(made, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    names = {"made": made, "zip": made / "answers.zip", "out": tmp_path / "out"}
    before = files(made)
    assert run(monkeypatch, *(argument.format(**names) for argument in arguments)) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert files(made) == before


@pytest.mark.slow
def test_a_case_that_cannot_be_diagnosed_is_told_and_the_rest_kept(made, tmp_path, monkeypatch, capsys):
    cases = tmp_path / "cases"
    for name in ("case000", "case001"):
        (cases / name).mkdir(parents=True)
        (cases / name / "case.toml").write_text("format = 1\nsides = 3\n")
    done = tmp_path / "out" / "case000"
    done.mkdir(parents=True)
    (done / "diagnosis.json").write_text("kept")
    assert run(monkeypatch, "run", "--cases", cases, "--out", tmp_path / "out") == 1
    error = capsys.readouterr().err
    assert "case001: exit 2" in error
    assert "case000:" not in error
    assert (done / "diagnosis.json").read_text() == "kept"
    assert not (tmp_path / "out" / "case001").exists()
