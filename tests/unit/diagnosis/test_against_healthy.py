"""Diagnosis against healthy runs, on a vehicle that does not obey equation (4)."""

import copy
import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS, PLACES, FormTable, Vehicle
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.data.tomltext import toml_text
from glider.tools.diagnose import against_healthy
from glider.tools.diagnose.against_answer import plain, write
from glider.tools.diagnose.against_healthy import diagnose_against_healthy
from glider.tools.diagnose.gates import form_stands_out
from glider.tools.diagnose.healthy_decision import weigh
from glider.tools.diagnose.healthy_fits import Comparison, FreeForm, HealthyHypothesis
from glider.tools.diagnose.healthy_runs import AsUsual, Healthy, as_the_case_sees, prior_evidence
from glider.tools.inference import hyperparameters
from glider.tools.report.pooled import write_pooled_report
from glider.tools.verify.challenge.form_cases import draw_healthy, write_flights
from glider.tools.verify.challenge.form_fit import fit_flights, fit_forces
from glider.tools.verify.challenge.form_plan import BY_LABEL
from glider.tools.verify.challenge.trial import with_effect

pytestmark = pytest.mark.computes(seconds=125)

HEALTHY, LATER = 5, 3
LABEL, OUTSIDE = "servo_offset", "x_pump_jet"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Healthy runs, later ones of the same vehicle unchanged and with a servo askew, and the nearest file."""
    folder = tmp_path_factory.mktemp("form")
    file = load_vehicle("roughie")
    found = draw_healthy(np.random.default_rng(20), file, HEALTHY + LATER)
    assert found is not None
    trial, flights = found
    sizes, _ = BY_LABEL[LABEL].draw(np.random.default_rng(1))
    later = replace(trial, designs=trial.designs[HEALTHY:])
    askew = later.fly(with_effect(trial.shapes, BY_LABEL[LABEL], sizes, 1.0))
    write_flights(folder / "healthy", trial, flights[:HEALTHY])
    write_flights(folder / "unchanged", trial, flights[HEALTHY:])
    write_flights(folder / "askew", trial, askew)
    slow = later.fly(with_effect(trial.shapes, BY_LABEL["servo_slow"], np.array([8.0]), 1.0))
    write_flights(folder / "slow", trial, slow)
    late = later.fly(with_effect(trial.shapes, BY_LABEL["mocap_delay"], np.array([1.5]), 1.0))
    write_flights(folder / "late", trial, late)
    sizes, _ = BY_LABEL[OUTSIDE].draw(np.random.default_rng(1))
    write_flights(folder / "outside", trial, later.fly(with_effect(trial.shapes, BY_LABEL[OUTSIDE], sizes, 2.0)))
    nearest = vehicle_of(file, fit_flights(trial, flights[:HEALTHY], fit_forces(trial, flights[:HEALTHY])))
    (folder / "nearest.toml").write_text(toml_text(nearest, inline=("sensors",)))
    return folder


def vehicle_of(file: Vehicle, P: np.ndarray) -> dict:
    table = msgspec.to_builtins(file)
    table["hydrodynamics"] |= {name: float(P[PLACES[name]]) for name in COEFFICIENTS}
    table["mass"]["added_mass"] = P[layout.A_X : layout.A_Z + 1].tolist()
    table["mass"]["added_inertia"] = P[layout.B_X : layout.B_Z + 1].tolist()
    return {key: value for key, value in table.items() if value not in (None, {})}


@pytest.fixture(scope="module", autouse=True)
def learned_once():
    """Healthy runs are learned from once for every vehicle file, whichever case then asks: each answer gets a copy."""
    learned: dict = {}

    def learn(case, runs):
        key = (repr(case.vehicle), case.log_rate_hz, *((run.name, name, values.tobytes())
               for run in runs for name, values in sorted(run.columns.items())))  # fmt: skip
        if key not in learned:
            learned[key] = of_runs(case, runs)
        return copy.deepcopy(learned[key])

    of_runs = against_healthy.learn
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(against_healthy, "learn", learn)
        yield


def diagnosed(place, name):
    vehicle = str(place / "nearest.toml")
    return diagnose_against_healthy(load_case(place / name, vehicle), load_case(place / "healthy", vehicle))


@pytest.fixture(scope="module")
def unchanged(place):
    return diagnosed(place, "unchanged")


@pytest.fixture(scope="module")
def by_command(place):
    """The folder that `glider gap diagnose --reference` leaves of the servo askew, and what it diagnosed."""
    found = []

    def kept(*given):
        found.append(diagnose_against_healthy(*given))
        return found[-1]

    words = ["--reference", place / "healthy", "--vehicle", place / "nearest.toml", "--out", place / "answer"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(against_healthy, "diagnose_against_healthy", kept)
        assert command(patch, place / "askew", *words) == 0
    (answer,) = found
    return place / "answer", answer


@pytest.fixture(scope="module")
def askew(by_command):
    return by_command[1]


def test_what_the_form_leaves_is_no_cause(unchanged):
    assert (unchanged.verdict, unchanged.selected) == ("none", [])
    assert unchanged.left["none"] < 2.0  # of what healthy runs leave


def test_a_change_beside_the_wrong_form_is_found_and_shrinks_what_was_left_out(askew):
    assert askew.verdict == "cause"
    assert askew.selected[0] == LABEL
    answer = plain(askew)
    (size,) = next(cause for cause in answer["causes"] if cause["label"] == LABEL)["parameters"].values()
    assert size["ci90"][0] < 0.25 < size["ci90"][1]  # rad, as it was drawn
    assert answer["gap"]["after"]["total"] < 0.7 * answer["gap"]["before"]["total"]
    assert askew.left["none"] > 3.0 > min(askew.left.values())


def test_a_rate_limit_that_does_nothing_until_it_is_reached_is_found(place):
    found = diagnosed(place, "slow")
    assert (found.verdict, found.selected[0]) == ("cause", "servo_slow")
    answer = plain(found)
    causes = next(cause for cause in answer["causes"] if cause["label"] == "servo_slow")
    assert causes["parameters"]["rate"]["ci90"][0] < np.log(33.0) < causes["parameters"]["rate"]["ci90"][1]


def test_poses_that_are_much_later_than_an_observer_holds_shrink_what_is_left(place):
    """With poses in the rows where they were recorded the observer is a loop with a delay, and leaves the vehicle."""
    found = diagnosed(place, "late")
    compared, free = found.compared, found.compared.free
    (k,) = compared.places["mocap_delay"]

    def left(delay):
        point = delay / free[k].spread * np.eye(1, len(free), k)[0]
        return compared.windows.squares([point], compared.windows.gains(point)).sum()

    several = {delay: left(delay) for delay in (0.0, 0.6, 0.8, 1.0, 1.5)}
    assert max(several.values()) < 1.1 * several[0.0]
    assert several[1.5] < 0.7 * several[0.0]
    assert found.left["mocap_delay"] < 0.75 * found.left["none"]
    assert max(found.evidence, key=lambda label: found.evidence[label]) == "mocap_delay"
    place, far = compared.far_clocks["mocap_delay"]
    assert (place, far * free[k].spread) == (k, pytest.approx(1.5, abs=0.8))  # s


def test_what_no_label_names_is_unknown_at_a_link(place):
    found = diagnosed(place, "outside")
    assert (found.verdict, found.selected) == ("unknown", [])
    forms = {name: left for name, left in found.left.items() if name.startswith("unknown at")}
    assert min(forms.values()) < 0.9 * min(left for name, left in found.left.items() if "unknown" not in name)
    where = plain(found)["where"]
    assert sum(place["probability"] for place in where) == pytest.approx(1.0, abs=0.05)
    assert max(found.links, key=lambda link: found.links[link]) == "surge force"
    assert where[0]["element"] == "surge"


def test_a_free_form_finds_the_link_of_a_change_and_what_it_goes_with(askew):
    first = askew.compared.free_forms(askew.nothing)[0]
    assert (first.link, first.shapes[0]) == ("servo", "constant")
    free = askew.compared.fitted((), askew.nothing.values, first)
    assert free.mean_square < 0.5 * askew.nothing.mean_square
    assert free.values.shape == askew.nothing.values.shape


def test_a_selected_label_that_is_no_main_cause_is_in_the_answer_and_the_report_is_drawn(askew, tmp_path):
    second = replace(askew, probabilities={"cg_lateral": 0.9, "unknown": 0.1})
    write(second, tmp_path)
    causes = json.loads((tmp_path / "diagnosis.json").read_text())["causes"]
    assert [one["probability"] for one in causes if one["label"] == LABEL] == [0.0]
    assert write_pooled_report(tmp_path)
    assert LABEL in (tmp_path / "report.html").read_text()


def test_probabilities_add_up_and_a_millionth_of_the_noise_moves_none(place, askew):
    assert sum(askew.probabilities.values()) == pytest.approx(1.0)
    vehicle, rng = str(place / "nearest.toml"), np.random.default_rng(5)
    case = load_case(place / "askew", vehicle)
    for run in case.runs:
        for name in ("pitch_rad", "roll_rad", "yaw_rad", "q_rad_s", "depth_m"):
            run.columns[name] = run.columns[name] + 1e-8 * rng.standard_normal(run.rows)
    again = diagnose_against_healthy(case, load_case(place / "healthy", vehicle))
    assert again.selected == askew.selected
    assert max(abs(again.probabilities[k] - p) for k, p in askew.probabilities.items() if p > 0.01) < 0.02


def test_healthy_runs_are_seen_as_the_case_is(place):
    case = load_case(place / "askew")
    for run in case.runs:
        for name in [name for name in run.columns if name.startswith("mocap")]:
            del run.columns[name]
    seen = as_the_case_sees(load_case(place / "healthy").runs[0], case)
    assert not seen.has_mocap
    assert set(seen.columns) == set(case.runs[0].columns)


def compared(logs: list[float], places: int = 40) -> Comparison:
    """A comparison that nothing is flown for."""
    found = object.__new__(Comparison)
    found.healthy = Healthy(len(logs), 0.0, float(np.std(logs, ddof=1)))
    found.places = {f"label{n}": np.array([n]) for n in range(places)}
    found.bare = 1.0
    return found


@pytest.mark.parametrize(("left", "least", "most"), [(1.0, 0.0, 0.1), (3.0, 0.5, 0.95), (12.0, 0.9, 1.0)])
def test_unknown_is_what_healthy_runs_do_not_leave(left, least, most, monkeypatch):
    monkeypatch.setattr(Comparison, "independent", 40.0)
    at = compared([0.1, -0.2, 0.3, -0.1, 0.0, 0.2, -0.3, 0.05])
    one = HealthyHypothesis((), np.zeros(40), np.full(6, left / 6.0), np.zeros((6, 40)), np.zeros(40))
    assert least <= weigh(at, [one]).probabilities()["unknown"] <= most


def left_by(left: float, labels: tuple[str, ...] = (), form: FreeForm | None = None) -> HealthyHypothesis:
    return HealthyHypothesis(labels, np.zeros(40), np.full(6, left / 6.0), np.zeros((6, 40)), np.zeros(40), form)


@pytest.mark.parametrize(("left", "least", "most"), [(1.0, 0.0, 0.1), (1.6, 0.05, 0.3), (3.5, 0.5, 1.0)])
def test_a_label_that_leaves_much_of_the_change_stands_in_for_something_unknown(left, least, most, monkeypatch):
    monkeypatch.setattr(Comparison, "independent", 40.0)
    at = compared([0.1, -0.2, 0.3, -0.1, 0.0, 0.2, -0.3, 0.05])
    at.bare = 8.0
    found = weigh(at, [left_by(8.0), left_by(left, ("label1",))]).probabilities()
    assert least <= found["unknown"] <= most
    assert found["unknown"] + found["label1"] > 0.99


@pytest.mark.parametrize(("left", "first"), [(0.95, "label1"), (1.0, "label1"), (2.0, "unknown")])
def test_a_label_is_named_where_a_free_form_explains_no_more(left, first, monkeypatch):
    monkeypatch.setattr(Comparison, "independent", 40.0)
    at = compared([0.1, -0.2, 0.3, -0.1, 0.0, 0.2, -0.3, 0.05])
    at.bare = 6.0
    form = FreeForm("slider", ("pitch rate", "climb or dive"))
    listed = [left_by(6.0), left_by(left, ("label1",)), left_by(0.9, (), form), left_by(0.85, ("label1",), form)]
    found = weigh(at, listed).probabilities()
    assert sum(found.values()) == pytest.approx(1.0)
    assert max(found, key=lambda name: found[name]) == first


def test_a_label_that_does_not_shrink_what_was_left_out_is_none(monkeypatch):
    monkeypatch.setattr(Comparison, "independent", 40.0)
    at = compared([0.1, -0.2, 0.3, -0.1])
    nothing, label = (
        HealthyHypothesis(labels, np.zeros(40), np.full(6, left / 6.0), np.zeros((6, 40)), np.zeros(40))
        for labels, left in (((), 1.0), (("label1",), 1.01))
    )
    assert "label1" not in weigh(at, [nothing, label]).probabilities()


def command(monkeypatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["glider", "gap", "diagnose", *map(str, arguments)])
    return report_errors(cli)


def test_a_vehicle_file_that_says_what_its_form_leaves_needs_no_healthy_runs(place, unchanged):
    vehicle = str(place / "nearest.toml")
    unknown = load_case(place / "askew", vehicle)
    assert not form_stands_out(unknown.roughie.form)
    with pytest.raises(InputError, match="form"):
        diagnose_against_healthy(unknown, None)
    learned = unchanged.healthy
    total = float(np.sqrt(np.mean(np.square(list(learned.scales.values())))))
    form = FormTable(HEALTHY, learned.seen, 0.2, {"all": learned.scales | {"total": total}})
    sentences = {name: load_case(place / name, vehicle) for name in ("askew", "unchanged")}
    sentences = {
        name: replace(case, vehicle=msgspec.structs.replace(case.roughie, form=form))
        for name, case in sentences.items()
    }
    assert form_stands_out(sentences["askew"].roughie.form)
    assert diagnose_against_healthy(sentences["unchanged"], None).verdict == "none"
    found = diagnose_against_healthy(sentences["askew"], None)
    assert (found.verdict, found.selected[0]) == ("cause", LABEL)
    assert any("--reference" in line for line in plain(found)["cautions"])


def test_the_command_leaves_answer_model_and_report(by_command):
    folder, found = by_command
    answer = json.loads((folder / "diagnosis.json").read_text())
    assert answer["selected"] == plain(found)["selected"]
    assert answer["gap"]["after"]["total"] < answer["gap"]["before"]["total"]
    assert answer["reference"]["runs"] == [f"run{n:02d}" for n in range(HEALTHY)]
    assert "healthy runs" in (folder / "report.html").read_text()
    assert (folder / "corrected.toml").is_file()


def test_what_does_not_go_together_is_refused(place, tmp_path, monkeypatch, capsys):
    words = [place / "askew", "--reference", place / "healthy", "--without", "splice", "--out", tmp_path]
    assert command(monkeypatch, *words) == 2
    assert "--reference" in capsys.readouterr().err
    assert command(monkeypatch, place / "askew", "--reference", place / "nowhere", "--out", tmp_path) == 2
    assert "nowhere" in capsys.readouterr().err
    assert not (tmp_path / "diagnosis.json").exists()


def test_evidence_is_the_integral_over_the_prior():
    rng, v = np.random.default_rng(3), np.linspace(-12.0, 12.0, 801)
    one, other = np.meshgrid(v, v, indexing="ij")
    points = np.stack([one.ravel(), other.ravel()], axis=1)
    root = rng.normal(size=(2, 2))
    precision, score, mean = root @ root.T + 0.2 * np.eye(2), rng.normal(size=2), np.array([0.3, -0.4])
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    prior = multivariate_normal(mean, covariance).logpdf(points)
    likelihood = points @ score - 0.5 * np.einsum("pi,ij,pj->p", points, precision, points)
    whole = logsumexp(prior + likelihood) + 2.0 * np.log(v[1] - v[0])
    assert prior_evidence(precision, score, mean, covariance) == pytest.approx(whole, abs=1e-6)


def test_what_healthy_runs_say_nothing_of_is_off_by_what_is_usual_and_what_they_show_by_that():
    nothing = AsUsual.learned(np.zeros((1, 1)), np.zeros(1))
    assert nothing.mean == 0.0
    assert np.sqrt(nothing.covariance.item()) == pytest.approx(hyperparameters.HEALTHY.file_error, rel=0.2)
    precision = 1.0 / 0.05**2
    shown = AsUsual.learned(np.array([[precision]]), np.array([0.8 * precision]))
    assert shown.mean == pytest.approx(0.8, rel=0.02)
    assert np.sqrt(shown.covariance.item()) == pytest.approx(0.05, rel=0.02)


def test_a_run_left_out_is_flown_by_a_fit_that_is_better_for_the_others(askew):
    compared = askew.compared
    windows = compared.windows_of(compared.free[: len(compared.nuisance)])
    found = windows.left_out(windows.file_values)
    gains = windows.gains(found.values)
    (whole,) = windows.squares([found.values], gains)
    assert found.runs.shape == (LATER,)
    assert (found.runs >= whole.sum(axis=1)).all()
    for run, values in enumerate(found.others):
        (squares,), kept = windows.squares([values], gains), np.arange(LATER) != run
        assert squares[run] == pytest.approx(found.squares[run])
        (own_observer,) = windows.squares([values], windows.gains(values))
        assert own_observer[run] == pytest.approx(squares[run], rel=0.05)
        assert squares[kept].sum() < 1.02 * whole[kept].sum()
