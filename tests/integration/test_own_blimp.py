"""The gliding blimp's real flights, where they are at hand: identified on some, the others asked about."""

import json

import pytest

from tests.support.commands import glider
from tests.support.real_vehicles import BLIMP as VEHICLE
from tests.support.real_vehicles import copied, recorded

pytestmark = pytest.mark.computes(seconds=430)


@pytest.fixture(scope="module")
def flights(shared, tmp_path_factory):
    """The folder, the flights for identification and those kept from it, and the identified vehicle."""
    data = shared / "data" / "rgblimp"
    if not data.is_dir():
        pytest.skip("no data/rgblimp in the shared folder")
    folder = tmp_path_factory.mktemp("blimp")
    cases = [recorded(case) for case in sorted(data.iterdir()) if case.is_dir()]
    kept = [path for case in cases for path in case[1::2]]
    copied(folder / "healthy", [path for case in cases for path in case[::2]])
    done = glider("identify", "healthy", "--vehicle", VEHICLE, "--out", "identified", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, kept


def total(folder, case, vehicle):
    return json.loads(glider("gap", "measure", case, "--vehicle", vehicle, "--json", cwd=folder).stdout)["total"]


def first_cause(folder, case):
    vehicle = "identified/identified.toml"
    done = glider("gap", "diagnose", case, "--vehicle", vehicle, "--out", f"{case}-said", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    return answer["verdict"], answer["causes"][0]


def test_flights_kept_are_predicted_better_than_by_the_published_numbers(flights):
    folder, kept = flights
    copied(folder / "kept", kept)
    assert total(folder, "kept", "identified/identified.toml") < 0.6 * total(folder, "kept", VEHICLE)


def test_what_was_done_to_the_data_is_found_with_its_size(flights):
    folder, kept = flights
    copied(folder / "same", kept[::3])
    assert first_cause(folder, "same")[0] == "none"
    for name, third, off in (("mass", 1, 0.02), ("mass-2", 2, 0.01)):
        copied(folder / name, kept[third::3], "mass_x_m", lambda value, off=off: value - off)
        verdict, first = first_cause(folder, name)
        assert (verdict, first["label"]) == ("cause", "mass_x_offset")
        assert first["parameters"]["mass_x_offset"]["estimate"] == pytest.approx(off, abs=0.003)
    copied(folder / "gyro", kept[2::6], "r_rad_s", lambda value: 1.3 * value)
    verdict, first = first_cause(folder, "gyro")
    assert (verdict, first["label"]) == ("cause", "r_gain")
    assert first["parameters"]["r_gain"]["estimate"] == pytest.approx(0.3, abs=0.03)


@pytest.mark.xfail(
    strict=True, reason="roll inertia and cm_alpha, which break a correlation of the numbers, say as much"
)
def test_a_centimetre_of_the_mass_is_found_in_six_flights_that_hardly_part_it(flights):
    folder, kept = flights
    copied(folder / "mass-1", kept[1::3], "mass_x_m", lambda value: value - 0.01)
    verdict, first = first_cause(folder, "mass-1")
    assert (verdict, first["label"]) == ("cause", "mass_x_offset")
    assert first["parameters"]["mass_x_offset"]["estimate"] == pytest.approx(0.01, abs=0.003)
