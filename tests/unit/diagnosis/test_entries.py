"""Numbers to enter: a vehicle file with them is the vehicle with the effect."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest

from glider.firmware.model.vehicle import decode_vehicle
from glider.sim_backend.core.effect_plant import effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.tomltext import toml_text
from glider.tools.diagnose.entries import numbers_to_enter
from glider.tools.inference.model import own_effects

TEXT = files("glider.firmware.model").joinpath("vehicles/roughie.toml").read_text(encoding="utf-8")
VEHICLE = decode_vehicle(TEXT, "roughie.toml")


def sizes_of(label: str) -> dict:
    """Half of a prior's sigma for every parameter, with an interval."""
    found = {}
    for one in catalogue()[label].parameters:
        value = float(np.clip(one.default + 0.5 * one.spread, one.low, one.high))
        value = value if value != one.default else one.default - 0.5 * one.spread
        found[one.name] = {"estimate": value, "ci90": [0.9 * value, 1.1 * value], "unit": one.unit}
    return found


def flown(vehicle) -> tuple[np.ndarray, np.ndarray]:
    """What holds throughout a flight, and the effects that are left to the state: P (N_P,), F (N_F,)."""
    F = own_effects(vehicle)
    F = np.zeros(ef.N_F) if F is None else F
    P = np.empty(len(vehicle.vector()))
    effective_parameters(vehicle.vector(), F, P)
    return P, F


LABELS = [label for label, one in catalogue().items() if all(p.entry >= 0 for p in one.parameters)]


@pytest.mark.parametrize("label", LABELS)
def test_a_file_with_the_numbers_flies_as_the_effect(label):
    sizes = sizes_of(label)
    rows = numbers_to_enter(VEHICLE.vector(), VEHICLE.effects, label, sizes)
    assert {row["parameter"] for row in rows} == set(sizes)
    table = tomllib.loads(TEXT)
    for row in rows:
        *parents, last = row["key"].split(".")
        place = table
        for name in parents:
            place = place.setdefault(name, {})
        name, _, number = last.partition("[")
        if number:
            place = place.setdefault(name, [0.0, 0.0, 0.0])
            assert place[int(number.removesuffix("]"))] == pytest.approx(row["file"])
            place[int(number.removesuffix("]"))] = row["value"]
        else:
            assert place.get(name, 0.0) == pytest.approx(row["file"])
            place[name] = row["value"]
        assert row["ci90"] == sorted(row["ci90"])
        assert row["ci90"][0] <= row["value"] <= row["ci90"][1]
    entered, F = flown(decode_vehicle(toml_text(table), "entered.toml"))
    wanted = np.zeros(ef.N_F)
    for one in catalogue()[label].parameters:
        wanted[one.entry] += sizes[one.name]["estimate"]
    P = np.empty_like(entered)
    effective_parameters(VEHICLE.vector(), wanted, P)
    assert entered == pytest.approx(P, rel=1e-9, abs=1e-12)
    left = {row["parameter"] for row in rows if row["key"].startswith("effects.")}
    entries = [one.entry for one in catalogue()[label].parameters if one.name in left]
    assert F[entries] == pytest.approx(wanted[entries])


def test_coefficients_and_trim_have_their_own_keys():
    keys = {
        label: [row["key"] for row in numbers_to_enter(VEHICLE.vector(), {}, label, sizes_of(label))]
        for label in ("drag", "net_buoyancy", "cg_lateral", "command_delay", "pump_slow")
    }
    assert keys == {
        "drag": ["hydrodynamics.K_D0", "hydrodynamics.K_D"], "net_buoyancy": ["trim.net_mass"],
        "cg_lateral": ["trim.cg[1]"], "command_delay": ["effects.command_delay.delay"],
        "pump_slow": ["actuators.ballast.rate", "actuators.ballast.time_constant"],
    }  # fmt: skip


def test_what_the_file_has_already_is_added_to():
    own = {"gyro_scale": {"scale": 0.1}}
    size = {"scale": {"estimate": 0.2, "ci90": [0.15, 0.25], "unit": "1"}}
    (row,) = numbers_to_enter(VEHICLE.vector(), own, "gyro_scale", size)
    assert (row["file"], row["value"]) == (0.1, pytest.approx(0.3))
    (row,) = numbers_to_enter(VEHICLE.vector(), {"net_buoyancy": {"mass": 0.01}}, "net_buoyancy", {
        "mass": {"estimate": 0.02, "ci90": [0.01, 0.03], "unit": "kg"}
    })  # fmt: skip
    assert (row["key"], row["value"]) == ("effects.net_buoyancy.mass", pytest.approx(0.03))
    assert numbers_to_enter(VEHICLE.vector(), {}, "gyro_scale", {}) == []
    unknown = {"scale": {"estimate": None, "ci90": [None, None], "unit": "1"}}
    assert numbers_to_enter(VEHICLE.vector(), {}, "gyro_scale", unknown) == []
