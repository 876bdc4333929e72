"""What the model lacks in every run, an identified vehicle has; a change is what differs from that."""

import pytest

from glider.tools.own import usual_effects
from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own
from glider.tools.own.identified import plain, write
from glider.tools.own.identify import identify
from tests.support.own_vehicle import module_of
from tests.support.turner import FILE, TRUE, turned, written

LAG = 0.6  # s: of the vehicle's motor


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("late")
    written(folder)
    return folder


@pytest.fixture(scope="module")
def late(folder):
    """A vehicle whose motor is late, identified by a model whose is not."""
    said: list[str] = []
    found = identify(load_own(folder / "turner.toml"), [turned(module_of(folder / "turner.py"), 3, LAG)], said.append)
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
        posterior, _ = diagnose_own(vehicle, turned(model, seed, lag, 3, damping))
        return posterior.chances

    assert asked(11, LAG)["none"] > 0.5
    assert asked(12, LAG, damping=0.7)["damping"] > 0.8
    assert asked(13, 0.1)["motor_lag"] > 0.8  # the motor is nearly as the model has it: less than usual


def test_a_vehicle_as_the_model_has_it_has_none(folder):
    found = identify(load_own(folder / "turner.toml"), [turned(module_of(folder / "turner.py"), 4, 0.0)])
    assert found.effects == []


def test_what_is_not_taken_into_the_vehicle_is_usual_all_the_same(folder, monkeypatch):
    """No label joins the vehicle here: three runs of its motor, late as ever, are no change; another damping is one."""
    monkeypatch.setattr(usual_effects, "MOST_EFFECTS", 0)
    model = module_of(folder / "turner.py")
    found = identify(load_own(folder / "turner.toml"), [turned(model, 3, LAG)])
    assert found.effects == []
    write(found, folder / "without")
    vehicle = load_own(folder / "without" / "identified.toml")
    table = vehicle.file.identified
    assert table is not None
    assert table.label_mean["motor_lag"] == pytest.approx(LAG, abs=0.2)
    for seed, damping, cause in ((11, TRUE["damping"], "none"), (14, TRUE["damping"], "none"), (12, 0.7, "damping")):
        chances = diagnose_own(vehicle, turned(model, seed, LAG, 3, damping))[0].chances
        assert chances[cause] > 0.5, chances
