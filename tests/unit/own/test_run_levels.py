"""A rough day among calm ones: it counts for as little as it says, and calm runs are held against calm ones."""

import pytest

from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own, plain, verdict_of
from glider.tools.own.identified import VEHICLE, write
from glider.tools.own.identified import plain as identified_plain
from glider.tools.own.identify import identify
from glider.tools.own.runs import OwnRun
from tests.support.turner import TRUE, turned, written

ROUGH = 6.0  # times the disturbances of a calm day


def day(model, seed: int, rough: float, push: float = 1.0) -> list[OwnRun]:
    """Four runs of a day."""
    return turned(model, seed, count=4, push=push * TRUE["push"], rough=rough)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder, the model, and what a calm, a rough and a calm day identify."""
    folder = tmp_path_factory.mktemp("days")
    model = written(folder)
    sessions = [day(model, 1, 1.0), day(model, 2, ROUGH), day(model, 3, 1.0)]
    found = identify(load_own(folder / "turner.toml"), sessions)
    write(found, folder / "identified")
    return folder, model, found


def test_numbers_are_those_of_the_calm_days(made):
    folder, model, found = made
    alone = identify(load_own(folder / "turner.toml"), [day(model, 1, 1.0), day(model, 3, 1.0)])
    for k, (name, value) in enumerate(TRUE.items()):
        one = next(row for row in identified_plain(found)["parameters"] if row["name"] == name)
        assert one["mean"] == pytest.approx(value, abs=max(3.0 * one["sd"], 0.01 * value))
        assert found.covariance[k, k] < 2.0**2 * alone.covariance[k, k]


def test_every_session_has_gaps_of_its_own(made):
    *_, found = made
    calm, rough, again = identified_plain(found)["sessions"]
    assert [one["runs"] for one in (calm, rough, again)] == [4, 4, 4]
    assert rough["after"]["total"] > 3.0 * max(calm["after"]["total"], again["after"]["total"])


def test_a_calm_day_is_none(made):
    folder, model, _ = made
    found, _ = diagnose_own(load_own(folder / "identified" / VEHICLE), day(model, 4, 1.0))
    assert verdict_of(found.chances) == "none"


def test_another_rough_day_has_no_constant_cause(made):
    folder, model, _ = made
    found, _ = diagnose_own(load_own(folder / "identified" / VEHICLE), day(model, 4, ROUGH))
    of_noise = ("none", "unknown", "moment_noise", "moment_oscillation")
    assert sum(found.chances.get(label, 0.0) for label in of_noise) > 0.9


def test_a_weaker_motor_on_a_calm_day_is_not_hidden_by_the_rough_one(made):
    folder, model, _ = made
    vehicle = load_own(folder / "identified" / VEHICLE)
    found, observer = diagnose_own(vehicle, day(model, 5, 1.0, push=0.93))
    answer = plain(vehicle, observer, found, "weaker")
    assert answer["verdict"] == "cause"
    assert {"push", "motor_gain"} & set(answer["causes"][0]["group"])
