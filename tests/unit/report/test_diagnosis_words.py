"""The verdict as a sentence, for every kind of verdict; numbers and units as a person reads them."""

import numpy as np
import pytest

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.sim_backend.ocean.catalogue import catalogue as ocean_catalogue
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE
from glider.tools.diagnose.record import (
    AnswerRecord,
    CauseRecord,
    Data,
    Details,
    DiagnosisRecord,
    FindingRecord,
    Gap,
    Interval,
    NextRun,
    Noise,
    Place,
    Unexplained,
)
from glider.tools.inference.kind import ROUGHIE
from glider.tools.report import words

FAR = {"before": 4.0, "recalibrated": 3.0, "after": 0.5, "floor": 0.4}


def record(probabilities, selected=(), groups=None, findings=(), noise=None, where=(), **far) -> DiagnosisRecord:
    """A diagnosis of these numbers, as its folder would hold it."""
    ranked = sorted(({"none": 0.0, "unknown": 0.0} | probabilities).items(), key=lambda item: -item[1])
    causes = [CauseRecord(label, p, (groups or {}).get(label, [label]), {}) for label, p in ranked]
    tables = ({"total": value} for value in (FAR | far).values())
    gap = Gap(*tables, Interval(0.875, (0.81, 0.93)), Interval(0.97, (0.9, 1.0)))
    main = causes[0].label
    answer = AnswerRecord(
        1, main if main in ("none", "unknown") else "cause", [Place(*one) for one in where], causes, list(selected),
        gap, Unexplained(), [], NextRun("a dive", [], None, "next_run.toml"),
    )  # fmt: skip
    data = Data("case", "roughie", "pond", 3, 180.0, 10.0, False, [], [])
    return DiagnosisRecord(answer, Details(1, "0", data, {}, bool(selected), noise, [], list(findings), [], {}), [])


def test_every_label_has_plain_words():
    assert set(words.PLAIN) == {*catalogue(), *ocean_catalogue()}
    assert set(words.AXES) == {reading.name for reading in ROUGHIE.readings}


def test_one_cause_says_what_where_how_sure_and_how_far():
    said = words.sentence(record({"pump_slow": 0.97, "pump_droop": 0.02}, ["pump_slow"]))
    assert said == (
        "The ballast pump is slower than modelled (pump_slow, actuation: ballast; 97 % sure); with that in the model "
        "the gap on runs left out of the fit shrinks by 88 % (90 % interval 81 to 93 %), while refitting the nominal "
        "parameters alone shrinks it by 25 %."
    )


def test_what_cannot_be_told_apart_is_in_the_sentence():
    said = words.sentence(record({"drag": 0.6, "tether": 0.4}, ["drag"], {"drag": ["drag", "tether"]}))
    assert "only 60 % sure, else tether at 40 %), which these data cannot distinguish from tether; with that" in said


def test_doubt_names_the_next_answer():
    said = words.sentence(record({"none": 0.51, "unknown": 0.49}))
    assert "(only 51 % sure, else a gap of another kind at 49 %)" in said
    said = words.sentence(record({"unknown": 0.7, "none": 0.3}))
    assert "(only 70 % sure, else no gap at 30 %)" in said


def test_two_effects_are_both_named():
    said = words.sentence(record({"pump_slow": 0.999}, ["pump_slow", "imu_pitch_bias"], recalibrated=5.0))
    assert said.startswith("Two effects at once: the ballast pump is slower")
    assert "more than 99 % sure), and also measured pitch is off by a constant (imu_pitch_bias, sens" in said
    assert "with these in the model" in said
    assert said.endswith("while refitting the nominal parameters alone makes it 25 % larger.")


def test_no_gap_claims_no_shrinkage():
    said = words.sentence(record({"none": 0.98}, before=0.5, recalibrated=0.45, floor=0.44))
    assert said.startswith("No gap: ")
    assert "(98 % sure)" in said
    assert "shrinks" not in said
    for value in ("0.500", "0.450", "0.440"):
        assert value in said


UNEXPLAINED = [
    FindingRecord("r", "lag 11-60", 40.0), FindingRecord("r", "variance", 30.0), FindingRecord("depth", "speed", -25.0),
    FindingRecord("r", "pump running", 12.0), FindingRecord("q", "time", 3.0),
]  # fmt: skip


def test_an_unknown_gap_is_placed_and_described():
    found = record(
        {"unknown": 0.95, "yaw_trim": 0.05}, ["yaw_trim"], findings=UNEXPLAINED, where=[("hydrodynamics", "yaw", 0.97)]
    )
    said = words.sentence(found)
    assert said.startswith("A gap that no effect of the catalogue explains (95 % sure), strongest in measured yaw rate")
    assert "and correlated with whether the pump runs" in said  # of the same channel, not the stronger one of another
    assert "most likely in hydrodynamics: yaw (97 %)" in said
    assert "with the nearest known effects in the model (yaw_trim)" in said
    rows = words.described(found)
    assert [row["channel"] for row in rows] == ["yaw rate", "depth"]  # what is weak is not told
    assert rows[0]["shape"] == ["autocorrelated over 1.1 to 6 s (40)"]
    assert rows[0]["correlated"] == ["correlated with whether the pump runs (12)"]
    assert rows[0]["axis"] == "yaw axis"
    assert rows[1]["correlated"] == ["correlated with speed (25)"]


def test_an_unknown_gap_that_is_correlated_elsewhere_says_where():
    found = record({"unknown": 0.9}, findings=UNEXPLAINED[:3])
    assert "strongest in measured yaw rate and, in measured depth, correlated with speed" in words.sentence(found)
    bare = record({"unknown": 0.9})
    assert "strongest" not in words.sentence(bare)
    assert "with nothing added to the model" in words.sentence(bare)


def test_a_clock_that_wanders_is_said_to():
    said = words.sentence(record({"mocap_delay": 0.96}, ["mocap_delay"], noise=Noise(CLOCK, 6.0)))
    assert said.startswith(
        "Motion capture reports late (mocap_delay, timing: mocap; 96 % sure); that clock's delay varies with time; "
    )
    assert "varies" not in words.sentence(record({"mocap_delay": 0.96}, ["mocap_delay"]))


def test_disorder_claims_no_shrinkage():
    said = words.sentence(record({"turbulence": 0.96}, ["turbulence"], noise=Noise(TURBULENCE, 3.6, 5.0, 1.0)))
    assert said.startswith("The water is rougher than the vehicle file says, about 3.6 times as rough (turbulence, env")
    assert "its time course is random, so that knowing it shrinks no gap" in said
    assert "88 %" not in said
    said = words.sentence(record({"waves": 0.96}, ["waves"], noise=Noise("waves", 6.0, 5.0, 1.0)))
    assert said.startswith("Surface waves move the vehicle (waves, environment: water; 96 % sure)")


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1234.5, "1234"), (12.34, "12.3"), (-0.01234, f"{words.MINUS}0.0123"), (-1e-12, "0"),
     (-2.284e-5, f"{words.MINUS}2.28e{words.MINUS}5"), (1e-10, f"1.00e{words.MINUS}10"),
     (np.nan, words.DASH)],
)  # fmt: skip
def test_numbers(value, text):
    assert words.number(value) == text


def test_a_probability_is_never_certain():
    assert [words.sure(p) for p in (1.0, 0.994, 0.5, 0.001)] == ["more than 99 %", "99 %", "50 %", "less than 1 %"]
    assert [words.small_percent(p) for p in (1.0, 0.5, 1e-9)] == ["> 99.9 %", "50.0 %", "< 0.1 %"]


@pytest.mark.parametrize(
    ("values", "unit", "shown"),
    [([np.pi / 180.0], "rad", ([1.0], "deg")), ([0.02, 0.03], "kg", ([20.0, 30.0], "g")), ([1.5], "kg", ([1.5], "kg")),
     ([0.0005], "kg/s", ([0.5], "g/s")), ([0.004], "m", ([4.0], "mm")), ([0.3], "m/s", ([0.3], "m/s")),
     ([0.4], "1", ([0.4], ""))],
)  # fmt: skip
def test_units_that_a_person_reads(values, unit, shown):
    got, name = words.scaled(values, unit)
    assert got == pytest.approx(shown[0])
    assert name == shown[1]


def test_shrinkage_that_is_none():
    assert words.percent(-0.004) == "0 %"
    assert words.percent(-0.12) == f"{words.MINUS}12 %"
    assert words.change(-0.12) == "grows by 12 %"
    assert words.percent(words.left_of(0.0, 0.0)) == "unknown"
