"""`glider gap diagnose` from a shell's point of view: files written, models flown, none said where there is none."""

import json

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs import columns as names
from glider.tools.gap.measure import run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.corrected import LINKS
from glider.tools.inference.load import load_model
from glider.tools.inference.predict import predict
from tests.support.cases import make_case
from tests.support.commands import glider as run_glider

pytestmark = pytest.mark.computes(seconds=40)


def glider(*words: object) -> int:
    """The command line's exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["glider", *map(str, words)])
        return report_errors(cli)


@pytest.fixture(scope="module")
def lateral(tmp_path_factory):
    F = np.zeros(ef.N_F)
    F[ef.CG_OFFSET_Y] = 0.0015
    folder = tmp_path_factory.mktemp("lateral")
    case = make_case(folder, F, seed=11, runs=2)
    assert glider("gap", "diagnose", case.folder, "--out", folder / "out") == 0
    return case, folder / "out", json.loads((folder / "out" / "diagnosis.json").read_text())


def test_the_cause_is_found_and_its_size(lateral):
    _, out, answer = lateral
    assert answer["verdict"] == "cause"
    assert "cg_lateral" in answer["causes"][0]["group"]
    assert answer["causes"][0]["label"] == "cg_lateral"
    offset = answer["causes"][0]["parameters"]["offset"]
    assert offset["estimate"] == pytest.approx(0.0015, abs=3e-4)
    assert offset["unit"] == "m"
    assert sum(c["probability"] for c in answer["causes"]) == pytest.approx(1.0, abs=1e-6)
    assert answer["where"][0] | {"probability": 0} == {"subsystem": "mass", "element": "lateral", "probability": 0}
    assert (out / "report.html").stat().st_size > 10_000


def test_the_gap_shrinks_on_runs_left_out(lateral):
    _, _, answer = lateral
    gap = answer["gap"]
    assert gap["after"]["total"] < 0.3 * gap["before"]["total"]
    assert gap["after"]["total"] < gap["recalibrated"]["total"]
    assert gap["closed"]["value"] > 0.9
    low, high = gap["shrinkage"]["ci90"]
    assert low <= gap["shrinkage"]["value"] <= high


def test_the_corrected_model_predicts_without_looking_ahead(lateral):
    case, out, _ = lateral
    model = load_model(str(out / "corrected.toml"), case)
    run = case.runs[0]
    whole = predict(case, model, [run])[0]
    late = run.t - run.t[0] > 22.5
    for name in (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES):
        run.columns[name] = np.where(late, np.nan, run.columns[name])
    blanked = predict(case, model, [run])[0]
    second = (run.t - run.t[0] >= 22.0) & (run.t - run.t[0] < 40.0)
    scored = [0, 1, 2, 3, 4, 5, 6, 7, 8]
    assert np.array_equal(whole[second][:, scored], blanked[second][:, scored])


def test_the_next_run_is_a_mission_that_check_accepts(lateral):
    _, out, answer = lateral
    assert answer["next_run"]["mission"] == "next_run.toml"
    assert glider("check", "--mission", out / "next_run.toml") == 0


@pytest.fixture(scope="module")
def nothing(tmp_path_factory):
    """A vehicle as its file has it, and what is said of it."""
    folder = tmp_path_factory.mktemp("nothing")
    case = make_case(folder, np.zeros(ef.N_F), seed=12, runs=2)
    assert glider("gap", "diagnose", case.folder, "--out", folder / "out") == 0
    return case, json.loads((folder / "out" / "diagnosis.json").read_text())


def test_no_effect_is_called_none(nothing):
    _, answer = nothing
    assert answer["verdict"] == "none"
    assert answer["selected"] == []


def test_a_case_that_is_not_there_is_one_line_and_exit_2(tmp_path, capsys):
    assert glider("gap", "diagnose", tmp_path / "nothing", "--out", tmp_path / "out") == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    """The running pump pitches the hull, which no effect of the catalogue does."""
    F = np.zeros(ef.N_F)
    F[ef.LINK], F[ef.SHAPE + ef.SHAPES.index("pump running")] = 1 + LINKS.index("pitch moment"), 0.15
    folder = tmp_path_factory.mktemp("pushed")
    case = make_case(folder, F, seed=21, runs=2)
    assert glider("gap", "diagnose", case.folder, "--out", folder / "out") == 0
    return case, folder / "out", json.loads((folder / "out" / "diagnosis.json").read_text())


def test_an_effect_outside_the_catalogue_is_unknown_and_described(pushed):
    _, _, answer = pushed
    assert answer["verdict"] == "unknown"
    assert answer["causes"][0]["label"] == "unknown"
    found = answer["unknown"]["correction"]
    assert found["link"] == "pitch moment"
    assert next(iter(found["goes_with"])) == "pump running"
    assert found["coefficients"]["pump running"] == pytest.approx(0.15, rel=0.1)


def test_a_correction_learned_from_the_data_shrinks_the_gap_of_runs_left_out(pushed):
    case, out, answer = pushed
    found = answer["unknown"]["correction"]
    assert found["gap"]["total"] < 0.4 * answer["gap"]["before"]["total"]
    assert found["gap"]["total"] < answer["gap"]["after"]["total"]
    model = load_model(str(out / found["model"]), case)
    flown = [
        run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t)).total
        for run, Y in zip(case.runs, predict(case, model, case.runs), strict=True)
    ]
    assert max(flown) < answer["gap"]["before"]["total"]


def test_what_is_selected_beside_the_unknown_does_not_make_it_worse(pushed):
    _, _, answer = pushed
    assert answer["gap"]["after"]["total"] <= answer["gap"]["recalibrated"]["total"]


def test_a_vehicle_that_does_not_fit_is_to_be_identified_first(tmp_path, capsys):
    """One run of another vehicle, without commands: not `none`."""
    F = np.zeros(ef.N_F)
    F[ef.CG_OFFSET_X], F[ef.NET_MASS_OFFSET], F[ef.DRAG_0], F[ef.PITCH_TRIM], F[ef.LIFT] = 0.004, 0.08, 2.0, 1.5, -0.8
    case = make_case(tmp_path, F, seed=14, runs=1)
    run = case.folder / "run00.csv"
    lines = [line.split(",") for line in run.read_text().splitlines()]
    keep = [n for n, name in enumerate(lines[0]) if not name.startswith("cmd_")]
    run.write_text("".join(",".join(line[n] for n in keep) + "\n" for line in lines))
    assert glider("gap", "diagnose", case.folder, "--out", tmp_path / "out", "--json") == 0
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert answer["verdict"] != "none"
    assert "no commands" in said.err
    assert "one run" in said.err
    for share in ("shrinkage", "closed"):  # of runs left out, of which there is none
        assert answer["gap"][share] == {"value": None, "ci90": [None, None]}
    page = (tmp_path / "out" / "report.html").read_text()
    for text in (*answer["cautions"], page, said.err):
        assert "left out" not in text
        assert "without run00" not in text
    assert answer["stages"][0]["stage"] == "nominal"
    assert answer["stages"][-1]["gap"]["total"] < 0.5 * answer["stages"][0]["gap"]["total"]


def test_the_first_diagnosis_of_the_readme_contradicts_itself_nowhere(tmp_path):
    """One flight of the shipped vehicle: 25 Hz sensors in a log of 50 Hz, afloat on its tail in the end."""
    for words in (
        ("fly", "--mission", "spiral"), ("log", "export", "spiral-001.mcap"),
        ("gap", "diagnose", "spiral-001", "--out", "answer"),
    ):  # fmt: skip
        done = run_glider(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    sentence, *verdict = done.stdout.splitlines()
    assert sentence.startswith("No gap: ")  # the whole: tests/data/golden/diagnosis_words.txt
    assert verdict[0] == "verdict: none"
    assert verdict[1].endswith("  none")
    assert "verdict: none (" in done.stderr
    answer = json.loads((tmp_path / "answer" / "diagnosis.json").read_text())
    assert [one["finding"] for one in answer["readings"]] == ["not_flying"]
    assert answer["gap"]["shrinkage"]["value"] is None
    page = (tmp_path / "answer" / "report.html").read_text()
    for text in (sentence, done.stderr, page, *answer["cautions"]):
        for wrong in ("runs left out", "without this run", "without it", "missing", "unknown to", "closed"):
            assert wrong not in text


def test_time_that_runs_back_is_one_line_with_its_place(tmp_path, capsys):
    case = make_case(tmp_path, np.zeros(ef.N_F), seed=15, runs=1)
    run = case.folder / "run00.csv"
    lines = run.read_text().splitlines()
    lines[50], lines[51] = lines[51], lines[50]
    run.write_text("\n".join(lines) + "\n")
    assert glider("gap", "diagnose", case.folder, "--out", tmp_path / "out") == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "run00.csv:52: t_s" in line


def test_without_a_test_of_what_is_left_nobody_is_sure_that_it_is_unknown(pushed, tmp_path):
    """What is left was not asked about: unknown is then no more probable than a label that earned no place."""
    case, _, whole = pushed
    assert glider("gap", "diagnose", case.folder, "--out", tmp_path, "--without", "whiteness") == 0
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    sure, unsure = (
        next(cause["probability"] for cause in one["causes"] if cause["label"] == "unknown") for one in (whole, answer)
    )
    assert whole["verdict"] == "unknown"
    assert unsure < 0.2 < 0.8 < sure
    labels = [cause["probability"] for cause in answer["causes"] if cause["label"] not in ("unknown", "none")]
    assert max(labels) >= 0.9 * unsure


@pytest.mark.parametrize("part", ["nuisance", "evidence"])
def test_without_a_part_nothing_is_given_a_cause(nothing, tmp_path, part):
    """docs/explanation/diagnosis.md, What each part is worth."""
    case, whole = nothing
    assert glider("gap", "diagnose", case.folder, "--out", tmp_path, "--without", part) == 0
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    assert answer["verdict"] != "none"
    assert answer["gap"]["before"] == whole["gap"]["before"]
    assert answer["causes"] != whole["causes"]


def test_without_the_splice_errors_that_last_for_seconds_are_left(lateral, tmp_path):
    """On commands alone, what the disturbance did stays in the flight, and in what is fitted to it; held to the
    recording, what is left is white."""
    case, _, whole = lateral
    assert glider("gap", "diagnose", case.folder, "--out", tmp_path, "--without", "splice") == 0
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    assert whole["selected"] == ["cg_lateral"]
    held = max(abs(test["sigma"]) for test in whole["left"])
    free = max(test["sigma"] for test in answer["left"] if test["goes_with"] == "lag 11-60")  # samples, ten a second
    assert held < 5.0 < free
    assert answer["gap"]["after"]["total"] > whole["gap"]["after"]["total"]
    assert answer["gap"]["before"] == whole["gap"]["before"]
