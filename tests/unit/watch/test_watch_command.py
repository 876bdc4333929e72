"""`glider gap watch` on small sets of its own making: what is a change, since when, how large; and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import write_case
from glider.tools.watch.answer import WatchAnswer
from glider.tools.watch.watch import watch
from tests.support.flights import World, case_of, drawn_vehicle, fly

pytestmark = pytest.mark.computes(seconds=15)

WORLD = World(seconds=40.0, bias=0.2)
REFERENCE, WATCHED = 3, 4
COMMON = {layout.K_D0: 0.35, layout.K_L: 0.2, layout.K_MY: -0.15}  # relative: a file that is not right, in all runs
HEAVY, RATE = 0.03, 0.02  # kg, rad/s


def flown(
    changed: dict[int, float], seed: int = 40, turned: dict[int, float] | None = None,
    effects: dict[int, dict[int, float]] | None = None,
):  # fmt: skip
    """Runs of one vehicle that its file does not describe well.

    changed: by run, kg that it is heavier; turned: rad/s that its pitch rate reads too much; effects: entries of F.
    """
    P = drawn_vehicle(WORLD, np.random.default_rng(seed))
    for index, share in COMMON.items():
        P[index] *= 1.0 + share
    runs = []
    for n in range(REFERENCE + WATCHED):
        own = P.copy()
        own[layout.NET_MASS] += changed.get(n - REFERENCE, 0.0)
        run = fly(WORLD, seed + n, P=own, name=f"run{n:02d}", effects=(effects or {}).get(n - REFERENCE)).run
        run.columns[names.RATES[1]] += (turned or {}).get(n - REFERENCE, 0.0)
        runs.append(run)
    return case_of(WORLD, runs[:REFERENCE]), case_of(WORLD, runs[REFERENCE:])


@pytest.fixture(scope="module")
def unchanged() -> WatchAnswer:
    reference, case = flown({})
    short = replace(case.runs[1], columns={name: values[:50] for name, values in case.runs[1].columns.items()})
    return watch(replace(case, runs=[case.runs[0], short, *case.runs[2:]]), reference)


@pytest.fixture(scope="module")
def episode() -> WatchAnswer:
    reference, case = flown({1: HEAVY, 2: HEAVY})
    return watch(case, reference)


@pytest.mark.slow
def test_what_all_runs_share_is_no_change(unchanged):
    assert unchanged.events == []
    assert [run.verdict for run in unchanged.runs] == ["none"] * WATCHED


@pytest.mark.slow
def test_a_run_that_cannot_be_judged_is_skipped_and_says_why(unchanged):
    assert [run.skipped is None for run in unchanged.runs] == [True, False, True, True]
    assert "5 s long" in unchanged.runs[1].skipped
    assert unchanged.runs[1].gap is None


@pytest.mark.slow
def test_an_episode_its_runs_its_label_and_its_size(episode):
    assert [run.verdict for run in episode.runs] == ["none", "cause", "cause", "none"]
    event = episode.events[0]
    assert (event.from_run, event.to_run, event.course) == ("run04", "run05", "episode")
    assert event.label == "net_buoyancy"
    assert event.probability > 0.8
    assert event.sized.unit == "kg"
    low, high = event.sized.ci90
    assert low <= HEAVY <= high
    assert high - low < HEAVY
    assert event.where[0]["subsystem"] == "mass"


@pytest.mark.slow
def test_the_json_is_that_of_the_contract(episode):
    reference_names = json.loads(json.dumps(episode.plain()))
    assert set(reference_names["runs"][0]) == {"run", "verdict", "causes", "gap", "skipped"}
    cause = reference_names["runs"][1]["causes"][0]
    assert set(cause) == {"label", "probability", "group", "size", "ci90", "unit"}
    assert cause["label"] == "net_buoyancy"
    assert {"label", "where", "group", "from_run", "to_run", "probability", "size", "ci90", "unit"} <= set(
        reference_names["events"][0]
    )
    assert all(run["gap"] > 0.0 for run in reference_names["runs"])


@pytest.mark.slow
def test_two_changes_each_with_its_own_first_run():
    reference, case = flown({n: HEAVY for n in (1, 2, 3)}, 60, {2: RATE, 3: RATE})
    found = {event.label: event for event in watch(case, reference).events}
    assert set(found) == {"net_buoyancy", "gyro_bias"}
    assert [found[label].from_run for label in ("net_buoyancy", "gyro_bias")] == ["run04", "run05"]
    assert [event.to_run for event in found.values()] == [None, None]
    low, high = found["gyro_bias"].sized.ci90
    assert low <= RATE <= high


@pytest.mark.slow
def test_a_play_is_named_and_not_taken_for_rough_water():
    play = {ef.SERVO_PLAY: 0.3}
    reference, case = flown({}, 60, effects={n: play for n in (1, 2, 3)})
    event = watch(case, reference).events[0]
    assert (event.label, event.from_run, event.to_run) == ("servo_backlash", "run04", None)


def run(monkeypatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["glider", "gap", "watch", *map(str, arguments)])
    return report_errors(cli)


def written(folder: Path, runs) -> Path:
    write_case(folder, runs, vehicle="roughie", site="made", log_rate_hz=10.0, water_density_kg_m3=998.0)
    return folder


def test_nothing_to_compare_is_one_line_and_exit_2(tmp_path, monkeypatch, capsys):
    one = fly(WORLD, 3).run
    assert run(monkeypatch, written(tmp_path / "one", [one])) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "--reference" in said.err.splitlines()[-1]
    empty = replace(one, columns=dict(one.columns) | {name: np.full(one.rows, np.nan) for name in names.ATTITUDE})
    blind = replace(empty, columns={k: v for k, v in empty.columns.items() if k not in (*names.RATES, names.DEPTH)})
    assert run(monkeypatch, written(tmp_path / "blind", [blind, blind])) == 2
    assert "no readings" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("option", ["--reference", "--vehicle"])
def test_a_reference_or_vehicle_that_is_not_there(tmp_path, monkeypatch, capsys, option):
    case = written(tmp_path / "case", [fly(WORLD, 3).run, fly(WORLD, 4).run])
    assert run(monkeypatch, case, option, tmp_path / "nowhere.toml") == 2
    assert "nowhere" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.slow
def test_the_answer_on_disk_and_on_standard_output(tmp_path, monkeypatch, capsys):
    short = replace(WORLD, seconds=20.0)
    case = written(tmp_path / "case", [fly(short, seed).run for seed in (3, 4)])
    assert run(monkeypatch, case, "--out", tmp_path / "out", "--json") == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == json.loads((tmp_path / "out" / "watch.json").read_text())
    assert "1 run" in said.err
