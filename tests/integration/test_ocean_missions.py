"""Real missions of ocean gliders, where they are at hand: the water is quiet, what changed is found, nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from glider.tools.data.runs.case import Case, load_case
from glider.tools.identify.ocean.files import VEHICLE, write
from glider.tools.identify.ocean.identify import OceanIdentification, identify_ocean
from glider.tools.watch.answer import WatchAnswer
from glider.tools.watch.watch import watch

pytestmark = pytest.mark.computes(seconds=25)

QUIET = 0.01  # m/s
FIRST = "run015"  # from which on the roll trim is another
MOST_RUNS = 24  # of a mission: the step, and half as many runs again behind it


def judged(shared: Path, name: str, out: Path) -> tuple[OceanIdentification, WatchAnswer, Case]:
    """A case identified and watched with the vehicle that was found."""
    folder = shared / "data" / "ocean" / name
    if not folder.is_dir():
        pytest.skip(f"no mission '{name}' beside the repository")
    found = identify_ocean(load_case(folder))
    write(found, out)
    case = load_case(folder, str(out / VEHICLE))
    case = replace(case, runs=case.runs[:MOST_RUNS])
    return found, watch(case), case


@pytest.fixture(scope="module")
def slocum(shared, tmp_path_factory):
    return judged(shared, "slocum", tmp_path_factory.mktemp("slocum"))


@pytest.fixture(scope="module")
def seaglider(shared, tmp_path_factory):
    return judged(shared, "seaglider", tmp_path_factory.mktemp("seaglider"))


@pytest.mark.slow
def test_the_vertical_water_of_a_quiet_mission(slocum, seaglider):
    for found, _, _ in (slocum, seaglider):
        assert found.water_rms <= QUIET
        assert found.left_out == [] or len(found.left_out) < 0.1 * len(found.case.runs)


@pytest.mark.slow
def test_the_step_of_the_roll_is_found_and_not_called_drag(slocum):
    _, found, case = slocum
    names = [run.name for run in case.runs]
    event = next(one for one in found.events if one.label == "roll_trim")
    assert abs(names.index(event.from_run) - names.index(FIRST)) <= 1
    assert event.to_run is None
    assert abs(event.sized.size) == pytest.approx(0.045, rel=0.25)  # 2.6 deg
    assert "drag" not in event.group


@pytest.mark.slow
def test_nothing_else_is_called(slocum, seaglider):
    _, found, case = slocum
    begin = [run.name for run in case.runs].index(FIRST)
    called = [run for n, run in enumerate(found.runs) if n < begin - 1 and run.verdict != "none"]
    other = [run for run in found.runs if {cause.label for cause in run.causes if cause.probability > 0.1}
             - {"roll_trim"}]  # fmt: skip
    assert len({run.run for run in [*called, *other]}) <= 0.02 * len(found.runs)
    _, muted, _ = seaglider
    assert muted.events == []
    assert [run.verdict for run in muted.runs] == ["none"] * len(muted.runs)
