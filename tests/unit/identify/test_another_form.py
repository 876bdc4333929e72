"""A vehicle of another form than equation (4), identified from its captured runs: found, and worth flying with."""

import numpy as np
import pytest

from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.files import VEHICLE, write
from glider.tools.identify.pipeline import Identified, identify
from glider.tools.verify.challenge.form_cases import draw_healthy, write_flights
from glider.tools.verify.figures.form_identify import gaps_of, with_total

pytestmark = pytest.mark.computes(seconds=30)

FITTED = 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("form")
    trial, flights = draw_healthy(np.random.default_rng(2), load_vehicle("roughie"), FITTED + 1)
    write_flights(folder / "fitted", trial, flights[:FITTED])
    write_flights(folder / "later", trial, flights[FITTED:])
    return folder


@pytest.fixture(scope="module")
def found(folder) -> Identified:
    found = identify(load_case(folder / "fitted"))
    write(found, folder / "identified")
    return found


def test_later_flights_are_flown_far_better_than_by_the_file(folder, found):
    after = with_total(gaps_of(folder / "later", str(folder / "identified" / VEHICLE)))
    before = with_total(gaps_of(folder / "later", None))
    assert after["total"] < 0.4 * before["total"]
    assert after["roll"] < 0.5 * before["roll"]


def test_runs_left_out_say_so_before(found):
    held = found.held.plain()
    assert held["handed_out"] == "prediction error"
    assert held["after"]["total"] < min(held["candidates"]["likelihood"]["total"], 0.4 * held["before"]["total"])
    assert held["floor"]["total"] < held["after"]["total"]


def test_wings_damp_roll_far_more_than_the_file_s_hull(found):
    assert dict(zip(found.free.names, found.free.si(found.best), strict=True))["K_p"] < -6.0


def test_what_the_form_leaves_is_no_disturbance(folder, found):
    vehicle = load_case(folder / "later", str(folder / "identified" / VEHICLE)).roughie
    assert vehicle.disturbance == found.case.roughie.disturbance
    assert vehicle.form.gaps["all"]["total"] == pytest.approx(found.held.chosen.total, rel=0.01)
