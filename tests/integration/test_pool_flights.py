"""Two real flights in a pool: a vehicle identified from one of them flies the other (docs/reference/figures.md)."""

import json
import shutil

import pytest

from glider.tools.data.runs.case import load_case
from glider.tools.diagnose.staged import staged
from glider.tools.verify.figures.steady import moved
from tests.support.commands import glider

pytestmark = pytest.mark.computes(seconds=110)

NAMES = ("run00", "run01")


@pytest.fixture(scope="module")
def flights(shared, tmp_path_factory):
    """A folder with a case of each flight, called as its run."""
    data = shared / "data" / "roughie2015"
    if not data.is_dir():
        pytest.skip("no data/roughie2015 in the shared folder")
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


def test_the_stages_do_not_hang_on_the_last_digit(shared):
    data = shared / "data" / "roughie2015"
    if not data.is_dir():
        pytest.skip("no data/roughie2015 in the shared folder")
    case = load_case(data)
    own, other = staged(case), staged(moved(case, seed=40))
    assert own.selected == other.selected == ["gyro_scale", "pressure_lever"]
    assert [stage.name for stage in own.stages] == [stage.name for stage in other.stages]
    for one, two in zip(own.stages, other.stages, strict=True):
        assert two.total == pytest.approx(one.total, rel=0.02)
    assert own.stages[-1].total < 3.3
