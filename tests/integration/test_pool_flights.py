"""Two real flights in a pool: a vehicle identified from one of them flies the other (docs/reference/figures.md)."""

import json
import shutil

import pytest

from glider.tools.data.runs.case import load_case
from glider.tools.diagnose import diagnosis
from glider.tools.diagnose.staged import staged
from glider.tools.verify.figures.steady import moved
from tests.support.commands import glider

pytestmark = pytest.mark.computes(seconds=130)

NAMES = ("run00", "run01")


@pytest.fixture(scope="module")
def data(shared):
    folder = shared / "data" / "roughie2015"
    if not folder.is_dir():
        pytest.skip("no data/roughie2015 in the shared folder")
    return folder


@pytest.fixture(scope="module")
def flights(data, tmp_path_factory):
    """A folder with a case of each flight, called as its run."""
    folder = tmp_path_factory.mktemp("pool")
    for name in NAMES:
        (folder / name).mkdir()
        (folder / name / "case.toml").write_text((data / "case.toml").read_text().replace("runs = 2", "runs = 1"))
        shutil.copyfile(data / f"{name}.csv.gz", folder / name / "run00.csv.gz")
    return folder


@pytest.mark.parametrize(("fitted", "other"), [NAMES, NAMES[::-1]])
def test_a_vehicle_identified_from_one_flight_flies_the_other(flights, fitted, other):
    found = glider("identify", fitted, "--out", f"{fitted}-identified", cwd=flights)
    assert found.returncode == 0, found.stderr
    vehicle = f"{fitted}-identified/identified.toml"
    measured = glider("gap", "measure", other, "--vehicle", vehicle, "--json", cwd=flights)
    assert "Warning" not in measured.stderr  # parts of the model that lose such a vehicle are no matter of the user's
    total = json.loads(measured.stdout)["total"]
    nominal = json.loads(glider("gap", "measure", other, "--json", cwd=flights).stdout)["total"]
    assert total < min(3.3, 0.25 * nominal)  # tolerances


@pytest.fixture(scope="module")
def diagnosed(data):
    """The answer to both flights, and the stages on the way to it."""
    found = []

    def kept(*given):
        found.append(staged(*given))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "staged", kept)
        answer = diagnosis.plain(diagnosis.diagnose(load_case(data)))
    (stages,) = found
    return answer, stages


def test_their_gyro_turns_a_sixth_as_far(diagnosed):
    """By the readings it says a sixth of the attitude's own rate."""
    answer, _ = diagnosed
    assert answer["verdict"] == "unknown"
    assert "gyro_scale" in answer["selected"]
    cause = next(one for one in answer["causes"] if one["label"] == "gyro_scale")
    assert cause["parameters"]["scale"]["estimate"] == pytest.approx(-0.83, abs=0.02)


def test_the_stages_do_not_hang_on_the_last_digit(data, diagnosed):
    own, other = diagnosed[1], staged(moved(load_case(data), seed=40))
    assert own.selected == other.selected == ["gyro_scale", "pressure_lever"]
    assert [stage.name for stage in own.stages] == [stage.name for stage in other.stages]
    for one, two in zip(own.stages, other.stages, strict=True):
        assert two.total == pytest.approx(one.total, rel=0.02)
    assert own.stages[-1].total < 3.3
