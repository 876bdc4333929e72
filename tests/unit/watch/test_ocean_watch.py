"""`glider gap watch`, `gap diagnose` and other commands on missions of ocean gliders that another simulator flew."""

import json
from dataclasses import replace

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.sim_backend.ocean.catalogue import NOT_ASKED, ONE_ON_DEPTH, catalogue
from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.vehicle import shipped_vehicles
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case
from glider.tools.data.runs.run import Run, load_run
from glider.tools.data.sources import load_any_vehicle
from glider.tools.gap.velocity import mean_speed, velocities
from glider.tools.identify.ocean.files import corrected_text, vehicle_text
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.inference.model import effect_vector, nominal_model, vehicle_model
from glider.tools.inference.ocean_inputs import unsteady
from glider.tools.watch.usable import usable_dive
from glider.tools.watch.watch import watch
from tests.support.ocean import Dives, as_case, fly_dives, without

pytestmark = pytest.mark.computes(seconds=20)

DIVES, FIRST, SIZE = 8, 4, 0.5
OTHER_SEED = 2


@pytest.fixture(scope="module", params=[False, True], ids=["depth alone", "with speed"])
def stepped(request, tmp_path_factory):
    """A mission whose drag steps up, watched; whether its speed was measured."""
    folder = tmp_path_factory.mktemp("step") / "case"
    return watch(as_case(folder, stepped_dives(request.param).runs)), request.param


def stepped_dives(speed: bool) -> Dives:
    return fly_dives(DIVES, ("drag", SIZE, FIRST), speed=speed)


@pytest.fixture(scope="module")
def unchanged(tmp_path_factory):
    return as_case(tmp_path_factory.mktemp("same") / "case", fly_dives(DIVES, speed=True).runs)


def test_a_step_of_drag_is_found_in_its_dive(stepped):
    found, speed = stepped
    event = max(found.events, key=lambda one: one.probability)
    assert len(found.events) == 1
    assert abs(int(event.from_run.removeprefix("run")) - FIRST) <= 1
    assert (event.to_run, event.course) == (None, "step")
    called = [run.verdict == "cause" for run in found.runs]
    assert sum(a != (n >= FIRST) for n, a in enumerate(called)) <= 1
    assert event.label in (["drag"] if speed else ONE_ON_DEPTH)
    if event.label == "drag":
        low, high = event.sized.ci90
        assert low < SIZE < high


def steady_speed(run: Run, true: np.ndarray) -> float:
    """Mean of the true speed (every 60 s) where the glider flies steadily, m/s."""
    return float(np.interp(run.t, 60.0 * np.arange(len(true)), true)[~unsteady(run)].mean())


def test_each_dive_has_its_mean_speed_with_what_changed(stepped):
    found, speed = stepped
    dives = stepped_dives(speed)
    true = [steady_speed(run, flown) for run, flown in zip(dives.runs, dives.truth, strict=True)]
    said = [run.velocity for run in found.runs]
    held = [one["ci90"][0] < value < one["ci90"][1] for one, value in zip(said, true, strict=True)]
    assert sum(held) >= DIVES - 1
    widths = [(one["ci90"][1] - one["ci90"][0]) / one["u_m_s"] for one in said]
    assert max(widths[:FIRST]) < 0.3  # of the speed
    if speed:
        assert max(widths[FIRST:]) < 0.3
    else:  # drag, lift or pitch scale: each would be another speed
        assert 2.0 * max(widths[:FIRST]) < min(widths[FIRST:]) < max(widths[FIRST:]) < 0.6


def test_dives_as_before_have_the_speed_of_gap_velocity(tmp_path):
    case = as_case(tmp_path / "case", fly_dives(DIVES).runs)
    (tmp_path / "own.toml").write_text(vehicle_text(identify_ocean(case)))
    own = load_case(case.folder, str(tmp_path / "own.toml"))
    found = watch(own)
    assert not found.events
    for run, one in zip(found.runs, velocities(own, nominal_model(own)), strict=True):
        flagged = mean_speed(one)
        assert run.velocity["u_m_s"] == pytest.approx(flagged["u_m_s"], abs=1e-5)
        assert run.velocity["ci90"] == pytest.approx(flagged["ci90"], abs=1e-4)


def test_without_speed_drag_lift_and_pitch_scale_are_one(stepped):
    found, speed = stepped
    group = found.events[0].group
    assert group[0] == found.events[0].label
    if speed:  # drag and lift differ by little in so few dives; a pitch that is wrong does not
        assert set(group) <= {"drag", "lift"}
    else:
        assert set(group) == set(ONE_ON_DEPTH)


def test_of_nothing_that_changed_nothing_is_said(unchanged):
    found = watch(unchanged)
    assert found.events == []
    assert [run.verdict for run in found.runs] == ["none"] * DIVES


def test_what_all_dives_share_is_no_change(tmp_path):
    """A vehicle whose drag is half as much again as another's from the first dive on."""
    assert watch(as_case(tmp_path / "case", fly_dives(6, ("drag", SIZE, 0)).runs)).events == []


def blanked(run, name: str, value: float):
    return replace(run, columns=run.columns | {name: np.full(run.rows, value)})


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda run: blanked(run, names.PUMP, 1.0), "the engine runs"),
        (lambda run: blanked(run, names.ATTITUDE[1], 0.02), "level or too steep"),
        (lambda run: blanked(run, names.DEPTH, 1.0), "at the surface"),
        (lambda run: blanked(run, names.OIL, np.nan), f"no readings of {names.OIL}"),
        (lambda run: replace(run, columns={n: v[:1] for n, v in run.columns.items()}), "no two samples"),
    ],
)  # fmt: skip
def test_why_a_dive_cannot_be_judged(unchanged, spoil, reason):
    run = unchanged.runs[0]
    assert usable_dive(run) is run
    said = usable_dive(spoil(run))
    assert isinstance(said, str)
    assert reason in said


def test_a_dive_that_cannot_be_judged_is_skipped_with_its_reason(unchanged):
    runs = list(unchanged.runs)
    runs[3] = blanked(runs[3], names.PUMP, 1.0)
    found = watch(replace(without(unchanged, names.DENSITY, (5,)), runs=[
        *runs[:5], without(unchanged, names.DENSITY, (5,)).runs[5], *runs[6:]
    ]))  # fmt: skip
    skipped = {run.run: run.skipped for run in found.runs if run.skipped}
    assert list(skipped) == ["run03", "run05"]
    assert " 100 %" in skipped["run03"]
    assert names.DENSITY in skipped["run05"]
    assert found.events == []


# --- commands ---
@pytest.fixture
def glider(monkeypatch, capsys):
    """Run a command: exit code, output, complaints."""

    def run(*arguments) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["glider", *map(str, arguments)])
        code = report_errors(cli)
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


FIELDS = {"format", "verdict", "where", "causes", "selected", "gap", "next_run"}  # docs/reference/gap.md


def test_a_diagnosis_is_written_as_any_other(unchanged, glider, tmp_path):
    out = tmp_path / "answer"
    code, flagged, _ = glider("gap", "diagnose", unchanged.folder, "--out", out, "--json")
    assert code == 0
    answer = json.loads((out / "diagnosis.json").read_text())
    assert json.loads(flagged) == answer
    assert set(answer) >= FIELDS
    assert answer["verdict"] == "none"
    assert answer["selected"] == []
    labels = [cause["label"] for cause in answer["causes"]]
    assert labels[0] == "none"
    assert set(labels) <= {*catalogue(), "none", "unknown"}
    assert sum(cause["probability"] for cause in answer["causes"]) == pytest.approx(1.0)
    assert all({"group", "parameters"} <= set(cause) for cause in answer["causes"])
    assert all(cause["label"] in cause["group"] for cause in answer["causes"])
    gap = answer["gap"]
    assert set(gap) == {"before", "recalibrated", "after", "floor", "shrinkage", "closed"}
    for name in ("before", "recalibrated", "after", "floor"):
        assert set(gap[name]) == {"depth", "roll", "speed", "total"}
    assert gap["recalibrated"]["total"] < gap["before"]["total"]
    assert answer["not_asked"] == NOT_ASKED
    assert any("Cd0" in caution for caution in answer["cautions"])
    page = (out / "report.html").read_text()
    assert "No effect" in page
    (out / "report.html").unlink()
    assert glider("gap", "report", out)[0] == 0
    assert (out / "report.html").read_text() == page
    run = unchanged.runs[0].path
    predicted = tmp_path / "predicted.csv"
    assert glider("gap", "predict", run, "--model", out / "corrected.toml", "--out", predicted)[0] == 0
    assert np.isfinite(load_run(predicted).columns[names.DEPTH]).any()


def test_a_corrected_vehicle_is_the_model_that_was_found(unchanged, tmp_path):
    """Numbers and effects, written and read back; what is not in the catalogue is named."""
    nominal = vehicle_model("slocum", unchanged.vehicle)
    P, F = nominal.P.copy(), effect_vector(nominal)
    P[at.DRAG_0] *= 1.2
    F[at.F_DRAG], F[at.F_ATTITUDE_LAG] = 0.5, 3.0
    text = corrected_text(unchanged.vehicle, P, F)
    (tmp_path / "corrected.toml").write_text(text)
    again = vehicle_model("corrected", load_any_vehicle(str(tmp_path / "corrected.toml")))
    assert pytest.approx(P, rel=1e-12) == again.P
    assert effect_vector(again).tolist() == F.tolist()
    (tmp_path / "wrong.toml").write_text(text.replace("drag = {", "barnacles = {"))
    with pytest.raises(ConfigError, match=r"effects\.barnacles"):
        vehicle_model("wrong", load_any_vehicle(str(tmp_path / "wrong.toml")))


def test_the_page_of_a_cause_names_it_with_its_size(tmp_path, glider):
    case = as_case(tmp_path / "case", fly_dives(DIVES, ("drag", 2.0, 0), speed=True).runs)
    text = vehicle_text(identify_ocean(as_case(tmp_path / "before", fly_dives(DIVES, speed=True).runs)))
    (tmp_path / "identified.toml").write_text(text)
    out = tmp_path / "answer"
    code, _, _ = glider("gap", "diagnose", case.folder, "--vehicle", tmp_path / "identified.toml", "--out", out)
    answer = json.loads((out / "diagnosis.json").read_text())
    assert (code, answer["selected"]) == (0, ["drag"])
    page = (out / "report.html").read_text()
    assert "1 + scale (drag; " in page
    assert "<td>drag, scale</td>" in page
    corrected = load_any_vehicle(str(out / "corrected.toml"))
    assert corrected.effects["drag"]["scale"] == pytest.approx(2.0, rel=0.3)


def test_the_gap_is_measured(unchanged, glider, tmp_path):
    code, flagged, _ = glider("gap", "measure", unchanged.folder, "--json", "--report", tmp_path / "gap.html")
    assert code == 0
    answer = json.loads(flagged)
    assert [run["name"] for run in answer["runs"]] == [run.name for run in unchanged.runs]
    assert set(answer["channels"]) == {"depth", "roll", "speed"}
    places = {(one["subsystem"], one["element"]) for one in answer["where"]}
    assert places <= {effect.place for effect in catalogue().values()} | {(n, n) for n in ("allowed", "unexplained")}
    assert sum(one["share"] for one in answer["where"]) == pytest.approx(1.0)
    assert "<svg" in (tmp_path / "gap.html").read_text()


def test_a_dive_is_predicted(unchanged, glider, tmp_path):
    run, out = unchanged.runs[0], tmp_path / "run00.csv"
    assert glider("gap", "predict", run.path, "--out", out)[0] == 0
    predicted = load_run(out)
    assert set(predicted.columns) == set(run.columns)
    assert np.array_equal(predicted.t, run.t)
    for name, values in predicted.columns.items():
        assert np.isfinite(values).all(), name
    assert np.ptp(predicted.columns[names.DEPTH]) > 50.0
    assert np.array_equal(predicted.columns[names.OIL], run.columns[names.OIL])


def test_watched_by_the_command_and_drawn_again(tmp_path, glider):
    runs = fly_dives(DIVES, ("drag", SIZE, FIRST), speed=True).runs
    case, out = as_case(tmp_path / "case", runs), tmp_path / "watch"
    assert glider("gap", "watch", case.folder, "--out", out)[0] == 0
    answer = json.loads((out / "watch.json").read_text())
    assert [event["label"] for event in answer["events"]] == ["drag"]
    assert len(answer["runs"]) == DIVES
    (out / "report.html").unlink()
    assert glider("gap", "report", out)[0] == 0
    assert (out / "report.html").is_file()


def test_readings_are_asked_of_the_other_kind(unchanged, glider):
    code, flagged, said = glider("gap", "readings", unchanged.folder)
    assert (code, flagged) == (2, "")
    assert "ocean glider" in said.splitlines()[-1]


COMMANDS = "t_s,cmd_servo_rad,cmd_slider_m,cmd_ballast_kg\n0.0,0.0,0.0,0.1\n1.0,0.0,0.0,0.1\n"
ROUGHIE_ONLY = (
    ("fly",), ("simulate", "{commands}", "--out", "{out}"), ("campaign", "--out", "{out}"),
    ("campaign", "--design", "identification", "--out", "{out}"), ("tune",),
    ("reproduce", "fig4", "--out", "{out}"),
)  # fmt: skip


@pytest.mark.parametrize("command", ROUGHIE_ONLY, ids=" ".join)
@pytest.mark.parametrize("named", ["shipped", "file"])
def test_what_flies_a_roughie_refuses_an_ocean_glider_in_a_line(command, named, glider, tmp_path):
    (tmp_path / "commands.csv").write_text(COMMANDS)
    (tmp_path / "mine.toml").write_text(shipped_vehicles()["slocum"])
    vehicle = "slocum" if named == "shipped" else tmp_path / "mine.toml"
    filled = [part.format(commands=tmp_path / "commands.csv", out=tmp_path / "out") for part in command]
    code, flagged, said = glider(*filled, "--vehicle", vehicle)
    assert (code, flagged) == (2, "")
    assert len(said.splitlines()) == 1
    assert "ocean glider" in said
    assert not (tmp_path / "out").exists()
