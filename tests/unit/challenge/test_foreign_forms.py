"""The foreign plant: nominal without effects; every effect nothing at strength 0 and something at strength 1."""

import re

import numpy as np
import pytest

from glider.firmware.core.vehicle.flight import nominal_run
from glider.firmware.core.vehicle.layout import N_X
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.foreign_flight import fly_foreign, fly_on
from glider.tools.data.sources import load_vehicle
from glider.tools.verify.challenge.design import LAKE, POOL, draw_runs
from glider.tools.verify.challenge.forms import FORMS, KNOWN, SECRET, blank, draw_shapes, draw_waves
from glider.tools.verify.challenge.trial import Trial, draw_trial, flyable, predictable, total, with_effect

VEHICLE = load_vehicle("roughie")


@pytest.fixture(scope="module")
def trial() -> Trial:
    """A pool trial that is flyable without effects: two runs."""
    for seed in range(20):
        found = draw_trial(np.random.default_rng(seed), VEHICLE, POOL)
        found.designs = found.designs[:2]
        if flyable(found.fly(found.shapes), POOL):
            return found
    raise AssertionError("no flyable trial in twenty")


def test_without_effects_it_is_the_nominal_flight():
    rng = np.random.default_rng(3)
    design = draw_runs(rng, LAKE, draw_waves(rng))[0]
    P, F = VEHICLE.vector(), draw_shapes(rng, 100.0, LAKE.depths)
    rows = 600
    commands, X, Y = np.zeros((rows, 3)), np.zeros((rows, fo.N_FX)), np.zeros((rows, fo.N_FR))
    fly_foreign(
        P,
        F,
        design.waves,
        np.zeros((2, fo.N_FR)),
        0.0,
        0.0,
        design.seed,
        design.start.copy(),
        design.legs,
        commands,
        X,
        Y,
    )
    x, work = design.start[:N_X].copy(), np.zeros((5, N_X))
    for row in range(rows - 1):
        nominal_run(P, x, *commands[row], 0.0, 0.0, 0.0, 0.005, 20, work)
        np.testing.assert_allclose(X[row + 1, :N_X], x, atol=2e-3)
    assert np.ptp(X[:, 2]) > 1.0  # it did fly


def test_windows_flown_on_without_noise_repeat_the_flight(trial):
    F, design = trial.shapes, trial.designs[0]
    rows = 300
    commands, X, Y = np.zeros((rows, 3)), np.zeros((rows, fo.N_FX)), np.zeros((rows, fo.N_FR))
    fly_foreign(
        trial.P, F, design.waves, np.zeros((2, fo.N_FR)), 0.0, 0.0, design.seed, design.start.copy(), design.legs,
        commands, X, Y,
    )  # fmt: skip
    Xw, Yw = np.zeros((1, 100, fo.N_FX)), np.zeros((1, 100, fo.N_FR))
    fly_on(trial.P, F, design.waves, design.seed, commands, X, np.array([100]), np.array([200]), Xw, Yw)
    np.testing.assert_array_equal(Xw[0], X[100:200])
    np.testing.assert_array_equal(Yw[0], Y[100:200])


@pytest.mark.parametrize("label", FORMS)
def test_an_effect_is_nothing_at_0_and_matters_at_1(trial, label):
    form = FORMS[label]
    sizes, most = form.draw(np.random.default_rng(7))
    plain = trial.fly(trial.shapes)
    none = trial.fly(with_effect(trial.shapes, form, sizes, 0.0))
    strength = min(1.0, most)
    F = with_effect(trial.shapes, form, sizes, strength)
    flown = trial.fly(F)
    assert np.isfinite(flown[0].X).all()
    for a, b in zip(plain, none, strict=True):
        for name, values in a.run.columns.items():
            np.testing.assert_array_equal(values, b.run.columns[name])
    perfect = trial.channels(flown, trial.P, predictable(F), plain=False)
    if form.scatter:
        calm = total(trial.channels(plain, trial.P, trial.shapes, plain=False))
        assert total(perfect) > 1.3 * calm
    else:
        without = trial.channels(flown, trial.P, trial.shapes, plain=True)
        ratios = [b[name] / a[name] for a, b in zip(perfect, without, strict=True) for name in a]
        assert max(ratios) > 2.0
        # and a perfect model keeps to what noise and disturbance leave
        floor = trial.channels(plain, trial.P, trial.shapes, plain=False)
        assert total(perfect) < 1.6 * total(floor)


# Labels of the second vehicle kind and of readings, which neither the catalogue nor the blind test have yet.
LATER = ("density_bias",)


def test_the_labels_are_those_of_the_contract(shared):
    text = (shared / "GAP.md").read_text()
    table = text[text.index("| where | labels |") : text.index("Beside the labels")]
    labels = {}
    for line in table.splitlines()[2:]:
        if line.count("|") < 3:
            continue
        where, listed = line.strip("|").split("|")[:2]
        subsystem, *elements = where.replace("/", " ").split()
        if len(elements) == 1:
            for label in re.findall(r"[a-z]+(?:_[a-z]+)*", re.sub(r"\([^)]*\)", "", listed)):
                labels[label] = (subsystem, elements[0])
    labels |= {"cg_lateral": ("mass", "lateral"), "cg_vertical": ("mass", "vertical"), "inertia": ("mass", "inertia")}
    labels |= {"command_delay": ("timing", "command")}
    labels |= {name: ("timing", "mocap") for name in ("mocap_delay", "clock_skew")}
    for label in LATER:
        del labels[label]
    assert {form.label: form.places[0] for form in KNOWN} == labels


def test_what_is_secret_has_no_label_of_the_catalogue():
    assert len(SECRET) >= 6
    assert not {form.label for form in SECRET} & {form.label for form in KNOWN}
    assert all(form.places for form in SECRET)
    taken = [entry for form in FORMS.values() for entry in form.entries]
    assert len(set(taken)) == len(taken)


def test_blank_holds_no_strength():
    assert not blank()[: fo.N_STRENGTH].any()
    assert not draw_shapes(np.random.default_rng(1), 60.0, POOL.depths)[: fo.N_STRENGTH].any()
