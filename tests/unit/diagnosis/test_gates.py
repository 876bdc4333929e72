"""No answer jumps where a figure passes a limit: the probability of unknown, and two answers weighed."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.diagnose.gates import mixed, opened
from glider.tools.diagnose.noise_probes import NoiseProbe, ProbeResult
from glider.tools.diagnose.probabilities import to_none
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.diagnose.search import noise_matches_file
from glider.tools.diagnose.staged_answer import by_gap_left, weighed
from glider.tools.diagnose.unknown import Remainder, probability_unknown
from glider.tools.diagnose.verdict import Answer
from glider.tools.gap.measure import RunGap
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.levels import SENSORS, Levels

GYRO = ProbeResult(NoiseProbe("gyro", "sensor", "sensing", "gyro"), 3e4, 6.0)


def test_a_gate_opens_smoothly_between_its_limits():
    values = np.linspace(1.0, 10.0, 10_000)
    found = np.array([opened(value, 3.0, 8.0) for value in values])
    assert found[0] == 0.0
    assert found[-1] == 1.0
    assert opened(np.sqrt(24.0), 3.0, 8.0) == pytest.approx(0.5)
    assert (np.diff(found) >= 0.0).all()
    assert np.diff(found).max() < 5e-4
    assert opened(0.0, 3.0, 8.0) == 0.0


def figures(**changed) -> dict[str, float]:
    base = {"after": 0.6, "floor": 0.15, "before": 3.0, "left": 2e4, "explained": 8e4, "taken": 9.0, "told": 0.5,
            "next": 1e4, "shows": 8.0}  # fmt: skip
    return base | changed


def unknown(f: dict[str, float], evident: bool = True, asked: bool = True) -> float:
    search = SimpleNamespace(problem=SimpleNamespace(rules=SimpleNamespace(whiteness=True)), well_specified=f["told"])
    missed = SimpleNamespace(before=f["before"], recalibrated=f["before"], after=f["after"], floor=f["floor"])
    servo = ProbeResult(NoiseProbe("servo", "actuator", "actuation", "servo"), f["next"], 6.0)
    left = Remainder(f["explained"], f["left"], [GYRO, servo], opened(f["shows"], 6.0)) if asked else None
    return probability_unknown(search, evident, missed, left, None, f["taken"], [("sensing", "gyro")])


@pytest.mark.parametrize(("name", "low", "high"), [
    ("after", 0.1, 12.0), ("floor", 0.05, 3.0), ("before", 0.5, 20.0), ("left", 1.0, 1e6), ("explained", 1.0, 1e6),
    ("taken", 0.01, 100.0), ("told", 1e-3, 1.0), ("next", 1.0, 1e6), ("shows", 1.0, 100.0),
])  # fmt: skip
@pytest.mark.parametrize("well_specified", [0.0, 1.0])
def test_the_probability_of_unknown_has_no_cliff_in_any_of_its_figures(name, low, high, well_specified):
    for evident, asked in ((True, True), (False, True), (False, False), (True, False)):
        values = np.geomspace(low, high, 4000)
        found = np.array(
            [unknown(figures(well_specified=well_specified) | {name: value}, evident, asked) for value in values]
        )
        assert np.abs(np.diff(found)).max() < 0.02


def test_unknown_is_sure_where_the_vehicle_is_not_the_file_s_and_untouched_where_it_may_be():
    assert unknown(figures(after=DIAGNOSIS.far_full_gap + 0.1)) > 0.99
    near = figures(after=2.0, before=30.0, left=10.0, taken=900.0, well_specified=0.0)
    assert unknown(near) < 0.1


def levels(*logs: float) -> Levels:
    return Levels(tuple(list(SENSORS)[: len(logs)]), np.array(logs), np.full(len(logs), 0.01))


def test_noise_as_the_file_says_is_a_probability_without_a_cliff():
    problem = SimpleNamespace(seen=np.arange(15) < 9)  # five sensors
    said = [noise_matches_file(problem, levels(0.01, -0.02, 0.0, 0.02, log)) for log in np.linspace(0.0, 0.5, 2000)]
    assert said[0] > 0.99
    assert said[-1] < 1e-6
    assert np.abs(np.diff(said)).max() < 0.02
    assert (
        noise_matches_file(problem, levels(0.0, 0.0)) < 0.5 < noise_matches_file(problem, levels(0.0, 0.0, 0.0))
    )  # others say nothing
    logs = np.linspace(-0.5, 0.5, 2000)
    believed = np.array([levels(log).believed(0.0).log[0] for log in logs])
    assert np.abs(np.diff(believed)).max() < 4.0 * np.diff(logs)[0]
    assert abs(believed[np.abs(logs) < 0.03]).max() < 0.01
    assert believed[-1] == pytest.approx(0.5, abs=1e-6)


def test_what_hardly_matters_goes_to_none_by_degrees():
    kept = [to_none({"drag": 0.9, NONE: 0.1}, [], {"drag": far})["drag"] for far in np.geomspace(0.05, 0.5, 4000)]
    assert kept[0] == 0.0
    assert kept[-1] == pytest.approx(0.9)
    assert np.abs(np.diff(kept)).max() < 0.02


def answer(selected: list[str], chances: dict[str, float], after: float) -> Answer:
    empty = {name: None for name in ("search", "hypothesis", "null", "noise")}
    return Answer(
        **empty, selected=selected, main=max(chances, key=lambda name: chances[name]), probabilities=chances,
        groups={label: [label] for label in selected}, findings=[], whiteness=9.0, unexplained=0.5,
        gained=dict.fromkeys(selected, 20.0), negligible={}, probed=[], shrinkage=SimpleNamespace(after=after),
    )  # fmt: skip


def test_of_two_answers_the_one_that_leaves_less_of_runs_left_out_counts_the_more():
    gaps = [RunGap("run00", {"depth": 1.0, "pitch": 1.0}, 1.0, 5)] * 2
    found = SimpleNamespace(stages=[SimpleNamespace(gaps=gaps)])  # 20 residuals
    assert by_gap_left(0.3, found, 4.0, 4.0) == pytest.approx(0.3)
    assert by_gap_left(0.3, found, 4.5, 3.0) > 0.99
    assert by_gap_left(0.3, found, 3.0, 4.5) < 0.01
    assert by_gap_left(0.0, found, 3.0, 1.0) == 0.0
    assert by_gap_left(1.0, found, 9.0, 18.0) == 1.0
    begins = opened(3.0 + 1e-6, DIAGNOSIS.far_gap, DIAGNOSIS.far_full_gap)
    assert by_gap_left(begins, found, 3.0, 1.0) < 1e-2  # where the stages begin to be asked


def test_two_answers_are_weighed_without_a_jump():
    known = answer(["drag", "gyro_scale"], {"drag": 0.9, UNKNOWN: 0.1, NONE: 0.0, "gyro_scale": 0.0}, 4.5)
    far = answer(["gyro_scale", "pressure_lever"], {UNKNOWN: 0.9, "gyro_scale": 0.1, NONE: 0.0}, 1.0)
    assert weighed(known, far, 0.0).selected == ["drag", "gyro_scale"]
    assert weighed(known, far, 0.0).probabilities["drag"] == pytest.approx(0.9)
    assert weighed(known, far, 0.02).selected == ["drag", "gyro_scale"]
    assert weighed(known, far, 0.6).selected == ["gyro_scale"]  # certain in either
    assert weighed(known, far, 1.0).selected == ["gyro_scale", "pressure_lever"]
    assert weighed(known, far, 0.6).main == UNKNOWN
    shares = [weighed(known, far, off).probabilities[UNKNOWN] for off in np.linspace(0.0, 1.0, 1000)]
    assert np.abs(np.diff(shares)).max() < 0.02
    halves = mixed({"drag": 1.0}, {UNKNOWN: 1.0}, 0.5)
    assert halves == {"drag": 0.5, UNKNOWN: 0.5}
