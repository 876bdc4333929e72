"""`glider gap challenge --form`: a tiny set of vehicles of another form made, identified, diagnosed and scored."""

import json
from pathlib import Path

import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs.case import load_case
from glider.tools.verify.challenge.form_make import FormOrder
from glider.tools.verify.challenge.form_plan import FormCounts
from glider.tools.verify.challenge.make import make
from glider.tools.verify.challenge.seal import open_answers

pytestmark = pytest.mark.computes(seconds=70)

SEED, COUNTS = 3, FormCounts(changed=1, unchanged=1, outside=0, reference=2)
FOLDERS = {"cases": 6, "held": 3, "reference": 2, "healthy": 3}


def command(monkeypatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["glider", "gap", "challenge", *map(str, arguments)])
    return report_errors(cli)


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("form") / "blind"
    with pytest.MonkeyPatch.context() as patch:
        counts = [f"--{name}={getattr(COUNTS, name)}" for name in ("changed", "unchanged", "outside", "reference")]
        assert command(patch, "make", "--form", "--out", out, "--seed", SEED, "--jobs", 1, *counts) == 0
    return out


def test_a_case_holds_healthy_runs_and_later_ones_and_does_not_tell(made):
    for name, truth in open_answers(made / "answers.zip").cases.items():
        for folder, count in FOLDERS.items():
            case = load_case(made / folder / name)
            assert len(case.runs) == count
            assert case.motion_capture == (truth["mocap"] or folder == "reference")
            assert all(run.has_mocap == case.motion_capture for run in case.runs)
        if truth["labels"]:
            assert 1.5 * 0.9 <= truth["size"] <= 6.0 / 0.9
        texts = [(made / folder / name / "case.toml").read_text() for folder in FOLDERS]
        assert not any(label in text for text in texts for label in (*truth["labels"], *truth["secret"]))
        assert truth["residual"] > 0.3  # equation (4) does not fit such a vehicle


def test_the_seed_gives_the_same_bytes_and_another_others(made, tmp_path):
    order = FormOrder(tmp_path / "again", SEED, COUNTS, tmp_path / "again" / "answers.zip")
    assert make(order, jobs=2) == (2, [])
    assert files(order.out) == files(made)
    other = FormOrder(tmp_path / "other", SEED + 1, COUNTS, tmp_path / "other" / "answers.zip")
    make(other, jobs=2)
    mine, others = (files(folder / "reference") for folder in (made, other.out))
    assert not any(mine[name] == others[name] for name in mine if name.endswith(".csv.gz"))


@pytest.mark.slow
def test_identified_diagnosed_and_scored(made, tmp_path, monkeypatch, capsys):
    said, answers = tmp_path / "said", made / "answers.zip"
    assert command(monkeypatch, "run", "--form", "--cases", made, "--out", said, "--only", "case000") == 0
    assert (said / "case000" / "identified" / "identified.toml").is_file()
    assert (said / "case000" / "diagnosis.json").is_file()
    capsys.readouterr()
    score = ("score", "--form", "--cases", made, "--answers", answers, "--diagnoses", said, "--partial")
    assert command(monkeypatch, *score, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    figures = found["figures"]
    assert figures["unchanged_called_cause"]["of"] + figures["right_cause_first"]["of"] == 1
    assert figures["identified_worse"]["of"] == figures["healthy_file"]["of"] == 1
    assert figures["healthy_file"]["value"] > 1.0
    assert figures["identified_worse"]["target"] is figures["identified_worse"]["met"] is None
    assert figures["sure_and_wrong"]["target"] == 0.04
    assert figures["sure_and_wrong"]["met"] == (figures["sure_and_wrong"]["count"] == 0)
    assert command(monkeypatch, *score) == 0
    assert "unchanged, " in capsys.readouterr().out
    # a case of which a healthy run is not the promised one is refused
    run = made / "healthy" / "case000" / "run00.csv.gz"
    content = run.read_bytes()
    run.write_bytes(content[:-1])
    assert command(monkeypatch, *score) == 2
    run.write_bytes(content)


def test_kinds_do_not_mix(made, monkeypatch):
    assert command(monkeypatch, "make", "--form", "--watch", "--out", made, "--seed", 1) == 2
    assert command(monkeypatch, "make", "--form", "--out", made, "--seed", SEED + 1) == 2  # another test is there
