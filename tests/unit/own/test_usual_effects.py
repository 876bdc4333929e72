"""What the model lacks in every run, an identified vehicle has; a change is what differs from that."""

import numpy as np
import pytest

from glider.tools.own import usual_effects
from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own
from glider.tools.own.identified import plain, write
from glider.tools.own.identify import identify
from glider.tools.own.runs import OwnRun
from tests.support.own_vehicle import flown, module_of

FILE = {"damping": (0.5, 0.2), "push": (1.0, 0.3)}
TRUE = {"damping": 0.4, "push": 1.2}
MODEL = f"""
import numpy as np
inputs = {{"motor": "1"}}
outputs = [
    {{"name": "heading", "unit": "rad", "noise": 0.003, "tolerance": 0.03}},
    {{"name": "rate", "unit": "rad/s", "column": "r_rad_s", "noise": 0.003, "tolerance": 0.03}},
]
parameters = [(name, "1", *known) for name, known in {FILE}.items()]
states = [("psi", "rad"), ("r", "rad/s")]
noises = [("moment", "rad/s2", 0.01)]
def derivative(x, u, w, theta):
    return np.array([x[1], theta[1] * u[0] - theta[0] * x[1] + w[0]])
def measure(x, u, theta):
    return np.array([x[0], x[1]])
"""
LAG = 0.6  # s: of the vehicle's motor


def runs(model, seed: int, lag: float, count: int = 6, damping: float = TRUE["damping"]) -> list[OwnRun]:
    """One minute each under steps of the motor, which the vehicle follows with a lag."""
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        t = 0.1 * np.arange(601)
        asked = np.repeat(rng.uniform(-0.5, 0.5, 21), 30)[:601, None]
        follows = asked.copy()
        for row in range(1, len(t) if lag else 0):
            follows[row] = follows[row - 1] + (asked[row - 1] - follows[row - 1]) * -np.expm1(-0.1 / lag)
        outputs = flown(model, np.array([damping, TRUE["push"]]), t, follows, np.zeros(2), rng, 1.0)
        found.append(OwnRun(f"run{k}", t, asked, outputs + 0.003 * rng.normal(size=outputs.shape), None))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("late")
    (folder / "turner.py").write_text(MODEL)
    (folder / "turner.toml").write_text('format = 1\nmodel = "turner"\n')
    return folder


@pytest.fixture(scope="module")
def late(folder):
    """A vehicle whose motor is late, identified by a model whose is not."""
    said: list[str] = []
    found = identify(load_own(folder / "turner.toml"), [runs(module_of(folder / "turner.py"), 3, LAG)], said.append)
    write(found, folder / "late")
    return found, said


def test_a_lag_of_every_run_is_the_vehicles_own_and_its_numbers_are_right(late):
    found, said = late
    assert any("motor_lag" in note for note in plain(found)["notes"])
    assert found.effects == ["motor_lag"], said
    by = {one.label: one.spread * value for one, value in zip(found.nuisance, found.values, strict=True)}
    assert by["motor_lag"] == pytest.approx(LAG, abs=0.1)
    for name in TRUE:
        assert FILE[name][0] + by[name] == pytest.approx(TRUE[name], rel=0.05), name


def test_written_and_read_it_flies_and_asks_beside_that(late, folder):
    _found, _ = late
    vehicle = load_own(folder / "late" / "identified.toml")
    assert vehicle.declared.effects["motor_lag"] == pytest.approx(LAG, abs=0.1)
    model = module_of(folder / "turner.py")

    def asked(seed: int, lag: float, damping: float = TRUE["damping"]) -> dict[str, float]:
        posterior, _ = diagnose_own(vehicle, runs(model, seed, lag, 3, damping))
        return posterior.chances

    assert asked(11, LAG)["none"] > 0.5
    assert asked(12, LAG, damping=0.7)["damping"] > 0.8
    assert asked(13, 0.1)["motor_lag"] > 0.8  # the motor is nearly as the model has it: less than usual


def test_a_vehicle_as_the_model_has_it_has_none(folder):
    found = identify(load_own(folder / "turner.toml"), [runs(module_of(folder / "turner.py"), 4, 0.0)])
    assert found.effects == []


def test_what_is_not_taken_into_the_vehicle_is_usual_all_the_same(folder, monkeypatch):
    """No label joins the vehicle here: three runs of its motor, late as ever, are no change; another damping is one."""
    monkeypatch.setattr(usual_effects, "MOST_EFFECTS", 0)
    model = module_of(folder / "turner.py")
    found = identify(load_own(folder / "turner.toml"), [runs(model, 3, LAG)])
    assert found.effects == []
    write(found, folder / "without")
    vehicle = load_own(folder / "without" / "identified.toml")
    table = vehicle.file.identified
    assert table is not None
    assert table.label_mean["motor_lag"] == pytest.approx(LAG, abs=0.2)
    for seed, damping, cause in ((11, TRUE["damping"], "none"), (14, TRUE["damping"], "none"), (12, 0.7, "damping")):
        chances = diagnose_own(vehicle, runs(model, seed, LAG, 3, damping))[0].chances
        assert chances[cause] > 0.5, chances
