"""The blind test of the watch on missions of ocean gliders: what its missions are, and how each figure is counted."""

import json

import numpy as np
import pytest

from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case
from glider.tools.verify.challenge.diagnose_all import MISSION, commands
from glider.tools.verify.challenge.make import make
from glider.tools.verify.challenge.ocean_cases import example_mission
from glider.tools.verify.challenge.ocean_make import OceanOrder
from glider.tools.verify.challenge.ocean_plan import (
    CHANGES,
    CRAFTS,
    LIFT_SHOWS,
    MISSIONS,
    OUTSIDE_CHANGES,
    OUTSIDE_SHOWS,
    ocean_plan,
)
from glider.tools.verify.challenge.ocean_score import NEEDED_OF_A_MISSION, judge_missions, score_missions, speeds_held
from glider.tools.verify.challenge.seal import open_answers
from glider.tools.verify.challenge.watch_answer import read_watch
from glider.tools.verify.challenge.watch_plan import CHANGED, EPISODE, GROWING, OUTSIDE, STEP, UNCHANGED, WatchCounts
from glider.tools.verify.challenge.watch_score import Watched

FEW = WatchCounts(vehicles=2, unchanged=1, runs=6, reference=2)


def test_every_change_as_often_half_of_them_with_speed():
    plans = ocean_plan(3, MISSIONS)
    assert len(plans) == 60
    assert [sum(plan.kind == kind for plan in plans) for kind in (UNCHANGED, CHANGED, OUTSIDE)] == [12, 39, 9]
    changes = [(plan.label, plan.course == GROWING) for plan in plans if plan.kind == CHANGED]
    assert all(changes.count(change) in (6, 7) for change in CHANGES)
    strange = [plan for plan in plans if plan.kind == OUTSIDE]
    assert all(sum(plan.label == label for plan in strange) in (2, 3) for label in OUTSIDE_CHANGES)
    assert {plan.vehicle_class for plan in strange} == set(OUTSIDE_SHOWS)
    for label in [None, *dict(CHANGES), *OUTSIDE_CHANGES]:
        own = [plan for plan in plans if plan.label == label]
        assert abs(sum(plan.speed for plan in own) - len(own) / 2) <= 0.5
    assert {plan.course for plan in plans if plan.label == "lift"} == {STEP, EPISODE}
    assert {plan.vehicle_class for plan in plans if plan.label == "lift"} == {LIFT_SHOWS}
    assert {plan.vehicle_class for plan in plans if plan.label == "drag"} == set(CRAFTS)
    assert ocean_plan(3, MISSIONS) == plans != ocean_plan(4, MISSIONS)


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> OceanOrder:
    out = tmp_path_factory.mktemp("missions") / "blind"
    order = OceanOrder(out, 2, FEW, out / "answers.zip")
    assert make(order, jobs=1) == (2, [])
    return order


def test_missions_are_run_data_of_a_shipped_vehicle_and_do_not_tell(made):
    answers = open_answers(made.archive, NEEDED_OF_A_MISSION).cases
    for name, truth in answers.items():
        case = load_case(made.cases / name)
        assert case.vehicle.name == truth["craft"]
        assert len(case.runs) == 4
        assert len(load_case(made.held / name).runs) == 2
        assert all(run.has(names.DEPTH, names.OIL, names.DENSITY) for run in case.runs)
        assert case.runs[0].has(names.SPEED) == truth["speed"]
        assert [len(one) for one in truth["horizontal_mm_s"]] == [
            pytest.approx(run.t[-1] / truth["every_s"], abs=1.01) for run in case.runs
        ]
    assert sorted(truth["kind"] for truth in answers.values()) == ["changed", "unchanged"]
    assert "drag" not in (made.out / "manifest.json").read_text()


def answer(folder, order, name, shift):
    """A watch that says nothing, and the true velocity moved by so many of its sigmas."""
    truth = open_answers(order.archive, NEEDED_OF_A_MISSION).cases[name]
    velocity = folder / name / "velocity"
    velocity.mkdir(parents=True)
    runs = [{"run": f"run{n:02d}", "verdict": "none", "causes": []} for n in range(4)]
    (folder / name / "watch.json").write_text(json.dumps({"runs": runs, "events": []}))
    for n, true in enumerate(truth["horizontal_mm_s"]):
        lines = [f"{60 * k},{1e-3 * u + shift * 0.01},0.01" for k, u in enumerate(true)]
        (velocity / f"run{n:02d}.csv").write_text("t_s,u_m_s,sd_u_m_s\n" + "\n".join([*lines, "1e6,0.9,0.2"]) + "\n")


def test_velocity_is_held_to_the_truth(made, tmp_path):
    for shift, held in ((1.5, 1.0), (1.8, 0.0)):
        folder = tmp_path / str(shift)
        for name in ("case000", "case001"):
            answer(folder, made, name, shift)
        score = judge_missions(made.out, made.archive, folder)
        found = next(figure for figure in score.figures if figure.key == "velocity")
        muted = sum(not changed for case in score.cases for changed in case.changed)
        assert (found.value, found.of) == (held, muted)


def test_what_is_said_of_a_dives_mean_counts_before_its_rows(made, tmp_path):
    answer(tmp_path, made, "case000", 1.5)  # within the rows' interval
    truth = open_answers(made.archive, NEEDED_OF_A_MISSION).cases["case000"]
    case = Watched("case000", truth, read_watch(tmp_path / "case000" / "watch.json"))
    folder = tmp_path / "case000" / "velocity"
    muted = [f"run{n:02d}" for n, changed in enumerate(case.changed) if not changed]
    means = {name: np.mean(truth["horizontal_mm_s"][int(name[3:])]) / 1e3 for name in muted}
    for width in (-1e-3, 1e-3):
        result = {name: {"u_m_s": mean, "ci90": [mean - width, mean + width]} for name, mean in means.items()}
        (folder / "velocity.json").write_text(json.dumps({"runs": result}))
        assert speeds_held(case, folder) == [width > 0.0] * len(muted)
    (folder / "velocity.json").write_text('{"runs": 1}')
    with pytest.raises(InputError, match=r"velocity\.json"):
        speeds_held(case, folder)


def test_scored_by_the_command(made, tmp_path, monkeypatch, capsys):
    for name in ("case000", "case001"):
        answer(tmp_path, made, name, 0.0)

    def score(*more: str) -> int:
        command = ["score", "--watch", "--cases", made.out, "--answers", made.archive, "--diagnoses", tmp_path, *more]
        monkeypatch.setattr("sys.argv", ["glider", "gap", "challenge", *map(str, command)])
        return report_errors(cli)

    assert score("--ocean", "--json") == 0
    figures = json.loads(capsys.readouterr().out)["figures"]
    assert figures["unchanged_called"]["value"] == 0.0
    assert figures["changed_found"]["value"] == 0.0
    (tmp_path / "case000" / "velocity" / "run00.csv").unlink()
    (tmp_path / "case001" / "velocity" / "run00.csv").unlink()
    assert score("--ocean") == 2
    assert " run 0" in capsys.readouterr().err


def truth(label="drag", speed=False):
    return {"case": "case000", "kind": CHANGED, "label": label, "secret": None, "course": STEP, "from_run": 2,
            "to_run": None, "strengths": [0.0, 0.0, 1.0, 1.0], "values": [0.3], "runs": 4, "same_unit": True,
            "speed": speed}  # fmt: skip


def figures(tmp_path, label, group, true, held=()):
    runs = [{"run": f"run{n:02d}", "verdict": "cause" if n > 1 else "none", "causes": []} for n in range(4)]
    event = {"label": label, "group": group, "from_run": "run02", "to_run": None, "probability": 0.9, "size": 0.3,
             "ci90": [0.2, 0.4]}  # fmt: skip
    path = tmp_path / "watch.json"
    path.write_text(json.dumps({"runs": runs, "events": [event]}))
    score = score_missions([Watched("case000", true, read_watch(path))], list(held))
    return {figure.key: figure.value for figure in score.figures}


def test_one_group_on_depth_alone(tmp_path):
    whole = figures(tmp_path, "lift", ["drag", "attitude_scale", "lift"], truth())
    assert (whole["one_group"], whole["label"], whole["label_or_twin"], whole["size"]) == (1.0, 0.0, 1.0, None)
    assert figures(tmp_path, "drag", ["drag", "lift"], truth())["one_group"] == 0.0
    measured = figures(tmp_path, "lift", ["lift"], truth(speed=True))
    assert (measured["one_group"], measured["label_or_twin"]) == (None, 0.0)
    right = figures(tmp_path, "drag", ["drag"], truth(speed=True))
    assert (right["label"], right["size"]) == (1.0, 1.0)
    weight = figures(tmp_path, "density_bias", ["density_bias"], truth("net_buoyancy", speed=True))
    assert (weight["label"], weight["label_or_twin"]) == (0.0, 1.0)


def test_intervals_may_hold_too_often(tmp_path):
    found = figures(tmp_path, "drag", [], truth(), [True] * 9 + [False])
    assert found["velocity"] == found["velocity_most"] == 0.9


def test_a_mission_is_identified_watched_and_asked_for_its_velocity(tmp_path):
    asked = commands(tmp_path / "cases" / "case000", tmp_path / "part", (), MISSION)
    before, vehicle = tmp_path / "reference" / "case000", tmp_path / "part" / "identified" / "identified.toml"
    assert [one[:2] for one in asked] == [["identify", before], ["gap", "watch"], ["gap", "velocity"]]
    assert asked[1][asked[1].index("--reference") + 1] == before
    assert asked[1][asked[1].index("--vehicle") + 1] == asked[2][asked[2].index("--model") + 1] == vehicle


def test_an_example_of_a_mission(tmp_path):
    example_mission(tmp_path / "drag", dives=3, change=("drag", 0.5, 2))
    example_mission(tmp_path / "none", dives=3)
    changed, bare = load_case(tmp_path / "drag").runs, load_case(tmp_path / "none").runs
    same = [np.array_equal(a.columns[names.DEPTH], b.columns[names.DEPTH]) for a, b in zip(changed, bare, strict=True)]
    assert same == [True, True, False]
