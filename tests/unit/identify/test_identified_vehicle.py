"""Vehicle files that say where they come from: strict reading, and what the diagnosis makes of a covariance."""

import msgspec
import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import decode_vehicle
from glider.hal.strict import ConfigError
from glider.tools.data.sources import load_vehicle
from glider.tools.data.tomltext import toml_text
from glider.tools.inference.model import vehicle_model

NAMES = ["K_D0", "K_L", "added_mass_z", "cg_x"]


def identified(**changed) -> str:
    table = msgspec.to_builtins(load_vehicle("roughie"))
    A = np.array([[0.02, 0.0, 0.0, 0.0], [0.1, 0.3, 0.0, 0.0], [0.0, 0.1, 0.2, 0.0], [0.0, 0.0, 0.0, 1e-5]])
    table["trim"] = {"net_mass": 0.002, "cg": [1e-4, 0.0, -2e-4]}
    table["identified"] = {
        "data": "00ff", "runs": 3, "revision": "glider", "date": "2026-01-01", "from_vehicle": "roughie",
        "parameters": NAMES, "covariance": (A @ A.T).tolist(), **changed,
    }  # fmt: skip
    return toml_text(table, inline=("sensors",))


def test_written_vehicle_reads_back_as_it_was():
    vehicle = load_vehicle("roughie")
    again = decode_vehicle(toml_text(msgspec.to_builtins(vehicle), inline=("sensors",)), "again.toml")
    assert again == vehicle


def test_what_the_form_leaves_is_read_back():
    gaps = {"all": {"total": 0.9, "roll": 1.6}, "turning": {"total": 1.2, "roll": 2.1}}
    table = {"runs": 12, "scatter": 0.5, "noise": 0.2, "gaps": gaps}
    form = decode_vehicle(identified() + toml_text({"form": table}), "v.toml").form
    assert (form.runs, form.scatter, form.noise) == (12, 0.5, 0.2)
    assert form.gaps == gaps
    with pytest.raises(ConfigError, match=r"form\.gaps"):
        decode_vehicle(identified() + toml_text({"form": table | {"gaps": {"all": {"roll": -1.0}}}}), "v.toml")


def test_trim_reaches_the_parameters():
    P = decode_vehicle(identified(), "v.toml").vector()
    assert P[layout.NET_MASS] == 0.002
    assert P[layout.CG_X : layout.CG_Z + 1].tolist() == [1e-4, 0.0, -2e-4]


def test_covariance_becomes_what_the_diagnosis_allows():
    vehicle = decode_vehicle(identified(), "v.toml")
    model = vehicle_model("v", vehicle)
    places = vehicle.identified.places
    assert np.allclose((model.spread.T @ model.spread)[np.ix_(places, places)], vehicle.identified.covariance)
    others_stay = 1.0 / np.sqrt(np.diag(np.linalg.inv(vehicle.identified.covariance)))
    assert model.sigma[layout.K_L] == pytest.approx(others_stay[1], rel=1e-4)
    assert model.sigma[layout.K_L] < 0.95 * np.hypot(0.1, 0.3)
    plain = vehicle_model("r", load_vehicle("roughie"))
    assert plain.spread is None
    assert model.sigma[layout.K_M] == plain.sigma[layout.K_M]  # not named: as [uncertainty] says


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"parameters": ["K_D0", "K_X", "added_mass_z", "cg_x"]}, "no such parameter: 'K_X'"),
        ({"covariance": [[1.0, 0.0], [0.0, 1.0]]}, "expected 4 rows of 4"),
        ({"covariance": (np.eye(4) - 2.0 * np.eye(4)[::-1]).tolist()}, "not symmetric"),
        ({"parameters": ["K_D0", "K_D0", "added_mass_z", "cg_x"]}, "stands there twice"),
    ],
)
def test_a_wrong_provenance_is_refused_in_one_line(changed, says):
    with pytest.raises(ConfigError, match=says) as caught:
        decode_vehicle(identified(**changed), "v.toml")
    assert str(caught.value).startswith("v.toml:")
    assert "\n" not in str(caught.value)
