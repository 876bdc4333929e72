"""A current that turns with the heading: currents that are known, a mission's fixes, and files that cannot be used."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.data.runs.csvfile import write_table
from glider.tools.data.runs.origin import FIXES_FILE, ORIGIN_FILE, fix_columns, moment_text, read_fixes
from glider.tools.gap.heading import HeadingLeg, coefficients, moved_between
from tests.support.commands import glider
from tests.support.ocean import as_case, fly_dives

SPEED, TURNED = 0.06, 0.03  # share of the speed that a model lacks, rad to starboard
START = 1_600_000_000.0
METRES = 111_132.0  # of a degree of latitude at 45 degrees, by tables of WGS84


def legs(seed: int, count: int = 15, hours: float = 3.0) -> list[HeadingLeg]:
    """Legs on courses that turn by right angles, in a current of 10 cm/s that forgets itself in 36 hours."""
    rng = np.random.default_rng(seed)
    t = hours * np.arange(count)
    spread = np.linalg.cholesky(0.1**2 * np.exp(-np.abs(t[:, None] - t) / 36.0) + 0.03**2 * np.eye(count))
    current = spread @ rng.standard_normal((count, 2)) + rng.normal(0.0, 0.1, 2)
    course = np.cumsum(rng.choice([0.0, 0.5 * np.pi, -0.5 * np.pi], count, p=[0.6, 0.2, 0.2]))
    swum = 0.25 * np.column_stack([np.cos(course), np.sin(course)]) * rng.uniform(0.9, 1.1, (count, 1))
    true = (1.0 + SPEED) * swum + TURNED * np.column_stack([-swum[:, 1], swum[:, 0]])
    return [HeadingLeg(a, 3600.0 * hours, (b + c) * 3600.0 * hours, d * 3600.0 * hours)
            for a, b, c, d in zip(t, true, current, swum, strict=True)]  # fmt: skip


def test_intervals_hold_what_legs_lack_in_nine_of_ten_missions():
    held = []
    for seed in range(40):
        for one, true in zip(coefficients(legs(seed)), (SPEED, TURNED), strict=True):
            held.append(one.quantile(0.05) <= true <= one.quantile(0.95))
    assert 0.8 < np.mean(held) < 0.98  # 80 of them: 0.9 less or more three standard deviations of 0.034


def test_many_legs_are_surer_and_right():
    share, turned = coefficients(legs(3, count=120))
    assert share.quantile(0.95) - share.quantile(0.05) < 0.15
    assert share.below(SPEED) == pytest.approx(0.5, abs=0.49)
    assert share.below(0.0) < 0.3
    assert turned.quantile(0.5) == pytest.approx(TURNED, abs=0.1)
    few = coefficients(legs(3, count=10))[0]
    assert few.quantile(0.95) - few.quantile(0.05) > 2.0 * (share.quantile(0.95) - share.quantile(0.05))


def test_metres_from_fix_to_fix_are_those_of_the_ellipsoid():
    assert moved_between(np.array([44.5, 10.0]), np.array([45.5, 10.0])) == pytest.approx([METRES, 0.0], rel=1e-4)
    assert moved_between(np.array([0.0, 179.9]), np.array([0.0, -179.9])) == pytest.approx([0.0, 22_263.9], rel=1e-5)


@pytest.fixture(scope="module")
def mission(tmp_path_factory) -> Path:
    """Dives of the foreign glider on four courses, in a current of 5 cm/s to the north, with a fix at each end."""
    folder = tmp_path_factory.mktemp("mission") / "case"
    dives = fly_dives(10)
    starts, fixes, at, start = [], [], np.array([45.0, -20.0]), START
    for n, (run, true) in enumerate(zip(dives.runs, dives.truth, strict=True)):
        course = np.pi * (0.5 * n) + 0.1
        run.columns["yaw_rad"] = (run.columns["yaw_rad"] - run.columns["yaw_rad"].mean() + course + np.pi) % (
            2.0 * np.pi
        ) - np.pi
        speed = np.interp(run.t, 60.0 * np.arange(len(true)), true)
        starts.append(moment_text(start))
        fixes.append([start - 60.0, *at])
        north = np.trapezoid(speed * np.cos(run.columns["yaw_rad"]), run.t) + 0.05 * (run.t[-1] + 120.0)
        east = np.trapezoid(speed * np.sin(run.columns["yaw_rad"]), run.t)
        at = at + np.array([north / METRES, east / (METRES * np.cos(np.radians(at[0])))])
        fixes.append([start + run.t[-1] + 60.0, *at])
        start += run.t[-1] + 900.0
    as_case(folder, dives.runs)
    write_table(folder / FIXES_FILE, fix_columns(np.array(fixes)))
    count = len(starts)
    write_table(folder / ORIGIN_FILE, {
        "run": [run.name for run in dives.runs], "start_utc": starts, "latitude": ["45"] * count,
        "longitude": ["-20"] * count, "magnetic_variation_rad": ["0"] * count, "glider": ["own"] * count,
        "files": ["own"] * count,
    })  # fmt: skip
    return folder


def said_of(case: Path, out: Path) -> tuple[dict, str]:
    done = glider("gap", "velocity", case, "--out", out, "--json", cwd=out.parent)
    assert done.returncode == 0, done.stderr
    heading = json.loads(done.stdout)["heading"]
    assert json.loads((out / "velocity.json").read_text())["heading"] == heading
    return heading, done.stderr


def test_a_mission_whose_speed_is_right_is_not_accused(mission, tmp_path):
    found, said = said_of(mission, tmp_path / "out")
    assert found["legs"] == 10
    assert abs(found["along_m_s"]) < 0.03
    assert found["along_ci90"][0] < 0.02
    assert found["along_ci90"][1] > -0.02
    assert "no current" in said


def test_a_compass_that_reads_turned_is_seen(mission, tmp_path):
    case = copied(mission, tmp_path / "case")
    path = case / ORIGIN_FILE
    path.write_text(path.read_text().replace(",0,own,own", ",-0.3,own,own"))  # 17 degrees
    found, said = said_of(case, tmp_path / "out")
    assert found["turned_ci90"][0] < 0.3 < found["turned_ci90"][1]
    assert "deg to starboard" in said


def copied(mission: Path, to: Path) -> Path:
    to.mkdir()
    for path in mission.iterdir():
        (to / path.name).write_bytes(path.read_bytes())
    return to


def test_without_fixes_or_with_a_few_it_says_so(mission, tmp_path):
    case = copied(mission, tmp_path / "case")
    lines = (case / FIXES_FILE).read_text().splitlines(keepends=True)
    (case / FIXES_FILE).write_text("".join(lines[:9]))
    found, _ = said_of(case, tmp_path / "few")
    assert (found["legs"], found["left_out"]) == (4, {"no fix before or behind": 6})
    assert re.findall(r"\d+", found["why"]) == ["4", "8"]
    (case / FIXES_FILE).unlink()
    assert "no fixes.csv" in said_of(case, tmp_path / "none")[1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_utc,latitude\n2020-01-01T00:00:00Z,1\n", "longitude"),
        ("time_utc,latitude,longitude\nnoon,1,2\n", "fixes.csv:2: time_utc: "),
        ("time_utc,latitude,longitude\n2020-01-01T00:00:00Z,95,2\n", "fixes.csv:2: latitude: no sample"),
        (
            "time_utc,latitude,longitude\n2020-01-02T00:00:00Z,5,2\n2020-01-01T00:00:00Z,5,2\n",
            "fixes.csv:3: time_utc: not increasing",
        ),
    ],
)
def test_a_file_of_fixes_that_cannot_be_used(tmp_path, text, said):
    (tmp_path / FIXES_FILE).write_text(text)
    with pytest.raises(InputError) as error:
        read_fixes(tmp_path)
    assert said in str(error.value)
