"""The blind test on vehicles of another form: its plan, what is asked of a case, and how each figure is counted."""

import json
from pathlib import Path

import numpy as np
import pytest

from glider.sim_backend.foreign import foreign_layout as fo
from glider.tools.data.sources import load_vehicle
from glider.tools.verify.challenge import form_score
from glider.tools.verify.challenge.design import POOL
from glider.tools.verify.challenge.diagnose_all import FORM, commands
from glider.tools.verify.challenge.diagnosis import read_diagnosis
from glider.tools.verify.challenge.form_cases import draw_healthy
from glider.tools.verify.challenge.form_fit import fit_flights, fit_forces, residual
from glider.tools.verify.challenge.form_plan import BY_LABEL, CHANGES, OUTSIDE, FormCounts, form_plan
from glider.tools.verify.challenge.form_score import closed_change
from glider.tools.verify.challenge.forms import FORMS
from glider.tools.verify.challenge.plan import NONE, SINGLE, UNKNOWN
from glider.tools.verify.challenge.score import ScoredCase, score_forms
from glider.tools.verify.challenge.trial import total

VEHICLE = load_vehicle("roughie")


def test_counts_and_capture():
    counts = FormCounts()
    assert (counts.changed, counts.unchanged, counts.outside, counts.total) == (30, 20, 10, 60)
    plans = form_plan(4, counts)
    kinds = [plan.kind for plan in plans]
    assert [kinds.count(kind) for kind in (SINGLE, NONE, UNKNOWN)] == [30, 20, 10]
    assert sum(plan.mocap for plan in plans) == 30
    assert all(plan.mocap for plan in plans if plan.label and BY_LABEL[plan.label].by_mocap)
    labels = [plan.label for plan in plans if plan.kind == SINGLE]
    assert len(set(labels)) == 30  # no label twice while others wait
    assert plans == form_plan(4, counts) != form_plan(5, counts)


def test_changes_have_labels_and_what_is_outside_has_none():
    assert {form.label for form in CHANGES} <= {form.label for form in FORMS.values() if form.known}
    assert not any(form.known for form in OUTSIDE)
    assert [BY_LABEL[name].places for name in ("x_flooded_wing", "x_loose_mass")] == [
        (("mass", "net"), ("mass", "lateral")),
        (("mass", "longitudinal"),),
    ]


@pytest.fixture(scope="module")
def healthy():
    found = draw_healthy(np.random.default_rng(2), VEHICLE, 3)
    assert found is not None
    return found


def test_no_vehicle_of_equation_4_fits_but_the_nearest_is_far_nearer_than_the_file(healthy):
    trial, flights = healthy
    perfect = total(trial.channels(flights, trial.P, trial.shapes, plain=False))
    file = residual(trial, flights, VEHICLE.vector())
    forces = fit_forces(trial, flights)
    nearest = residual(trial, flights, fit_flights(trial, flights, forces))
    assert nearest < residual(trial, flights, forces)
    assert 3.0 * perfect < nearest < 0.5 * file


@pytest.mark.parametrize("form", [*CHANGES[:3], *OUTSIDE], ids=lambda form: form.label)
def test_what_changes_the_body_is_nothing_at_0_and_something_at_1(healthy, form):
    trial, flights = healthy
    sizes, _ = form.draw(np.random.default_rng(1))
    lacking = {}
    for strength in (0.0, 1.0):
        F = trial.shapes.copy()
        F[list(form.entries)] = sizes * strength
        flown = trial.fly(F, 1)
        assert np.isfinite(flown[0].X).all()
        lacking[strength] = np.abs(flown[0].X[:600, :16] - flights[0].X[:600, :16]).max()
    assert lacking[0.0] == 0.0
    assert lacking[1.0] > 1e-3


def test_a_flooded_wing_drains_and_a_loose_mass_follows_the_pitch(healthy):
    trial, _ = healthy
    F = trial.shapes.copy()
    F[fo.FS_LOOSE] = 0.004
    X = trial.fly(F, 1)[0].X
    diving, climbing = X[:, 2] > np.roll(X[:, 2], 30), X[:, 2] < np.roll(X[:, 2], 30)
    assert X[60:, fo.X_LOOSE][diving[60:]].mean() > 0.3 > -0.3 > X[60:, fo.X_LOOSE][climbing[60:]].mean()
    assert trial.site is POOL


def test_a_case_is_identified_then_diagnosed_against_its_healthy_runs():
    case, part = Path("cases/case003"), Path("answer")
    identify, diagnose = commands(case, part, ("--json",), FORM)
    reference, vehicle = Path("reference/case003"), part / "identified" / "identified.toml"
    assert identify == ["identify", reference, "--out", part / "identified"]
    words = ["--vehicle", vehicle, "--reference", reference, "--out", part, "--json"]
    assert diagnose == ["gap", "diagnose", case, *words]


def said(tmp_path: Path, verdict: str, label: str, probability: float):
    causes = [{"label": label, "probability": probability}, {"label": "other", "probability": 1.0 - probability}]
    where = [{"subsystem": "mass", "element": "net", "probability": 1.0}]
    path = tmp_path / "diagnosis.json"
    path.write_text(
        json.dumps({"format": 1, "verdict": verdict, "where": where, "causes": causes, "selected": []})
    )  # fmt: skip
    return read_diagnosis(path)


def test_figures_by_their_definition(tmp_path):
    places = [[["mass", "net"]]]
    cases = [
        ScoredCase("a", {"labels": [], "places": []}, said(tmp_path, "cause", "drag", 0.9)),
        ScoredCase("b", {"labels": [], "places": []}, said(tmp_path, "unknown", "unknown", 0.7)),
        ScoredCase("c", {"labels": [], "places": []}, said(tmp_path, "none", "none", 0.9)),
        ScoredCase("d", {"labels": ["drag"], "places": places}, said(tmp_path, "cause", "drag", 0.9), closed=0.5),
        ScoredCase("e", {"labels": ["lift"], "places": places}, None, closed=0.0),
        ScoredCase("f", {"labels": ["unknown"], "places": places}, said(tmp_path, "unknown", "unknown", 0.9)),
    ]
    found = score_forms(cases, [(4.0, 1.0), (4.0, 5.0)]).plain()["figures"]
    counts = {key: (figure.get("count"), figure["of"]) for key, figure in found.items() if "count" in figure}
    assert counts == {
        "unchanged_called_cause": (1, 3), "unchanged_called_unknown": (1, 3), "right_cause_first": (1, 2),
        "within_group": (1, 2), "in_first_three": (1, 2), "known_called_unknown": (0, 2),
        "unknown_called_unknown": (1, 1), "sure_and_wrong": (2, 6), "identified_worse": (1, 2),
    }  # fmt: skip
    assert (found["closed"]["value"], found["healthy_identified"]["value"]) == (0.25, 3.0)


def test_closed_is_counted_in_what_the_change_adds(tmp_path, monkeypatch):
    vehicle, model = tmp_path / "identified.toml", tmp_path / "corrected.toml"
    totals = {"nominal": 5.0, model: 3.0}
    monkeypatch.setattr(form_score, "held_total", lambda runs, wanted, vehicle: totals[wanted])
    assert closed_change([], 1.0, vehicle, model) == 0.0  # no corrected model
    model.touch()
    assert closed_change([], 1.0, vehicle, model) == 0.5
    assert closed_change([], 4.95, vehicle, model) is None  # the change adds next to nothing
