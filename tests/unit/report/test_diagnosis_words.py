"""The verdict as a sentence, for every kind of verdict; numbers and units as a person reads them."""

import numpy as np
import pytest

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.sim_backend.ocean.catalogue import catalogue as ocean_catalogue
from glider.tools.diagnose.cautions import ASSUMED_NUMBERS
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE
from glider.tools.diagnose.record import (
    AnswerRecord,
    CauseRecord,
    CorrectionRecord,
    Data,
    Details,
    DiagnosisRecord,
    EstimateRecord,
    FindingRecord,
    Gap,
    Interval,
    NextRun,
    Noise,
    Place,
    StepRecord,
    Unexplained,
)
from glider.tools.inference.kind import ROUGHIE
from glider.tools.report import words
from glider.tools.report.diagnosis import report_html
from tests.support.golden import check_golden

THRESHOLDS = {"evidence": 12.0, "tie": 6.0, "sigma": 6.0, "left": 0.1, "matters": 0.1}
FAR = {"before": 4.0, "recalibrated": 3.0, "after": 0.5, "floor": 0.4}


def record(
    probabilities, selected=(), groups=None, findings=(), noise=None, where=(), runs=3, sizes=None, stages=(), **far
) -> DiagnosisRecord:
    """A diagnosis of these numbers, as its folder would hold it; sizes: by label, parameters."""
    ranked = sorted(({"none": 0.0, "unknown": 0.0} | probabilities).items(), key=lambda item: -item[1])
    causes = [
        CauseRecord(label, p, (groups or {}).get(label, [label]), (sizes or {}).get(label, {}))
        for label, p in [*ranked, *((label, 0.0) for label in selected if label not in dict(ranked))]
    ]
    tables = ({"total": value} for value in (FAR | far).values())
    none = Interval(None, (None, None))  # of one run nothing can be left out
    shares = (Interval(0.875, (0.81, 0.93)), Interval(0.97, (0.9, 1.0))) if runs > 1 else (none, none)
    gap = Gap(*tables, *shares)
    main = causes[0].label
    answer = AnswerRecord(
        1, main if main in ("none", "unknown") else "cause", [Place(*one) for one in where], causes, list(selected),
        gap, Unexplained(), [], NextRun("a dive", [], None, "next_run.toml"), stages=list(stages),
    )  # fmt: skip
    data = Data("case", "roughie", "pond", runs, 180.0, 10.0, False, [], [])
    evidence = dict.fromkeys(selected, 50.0)
    details = Details(1, "0", data, evidence, bool(selected), noise, [], list(findings), [], THRESHOLDS)
    return DiagnosisRecord(answer, details, [])


def test_every_label_has_plain_words():
    assert set(words.PLAIN) == {*catalogue(), *ocean_catalogue()}
    assert set(words.AXES) == {reading.name for reading in ROUGHIE.readings}


PARTS_OF_NOTHING = ("left out", "unknown to unknown", "unknown %", "closed", "nan", "not checked on it")


def test_a_file_of_guesses_is_named_before_the_verdict():
    plain, guessed = (record({"drag": 0.97}, ["drag"]) for _ in range(2))
    guessed.answer.cautions.append(f"{ASSUMED_NUMBERS} (J): identify first")
    first, rest = words.sentence(guessed).split(words.sentence(plain))
    assert first.startswith("Identify")
    assert not rest


def of_one_run() -> list[DiagnosisRecord]:
    """A diagnosis of one run for every kind of verdict, and one of a vehicle that had to be identified."""
    none = Interval(None, (None, None))
    correction = CorrectionRecord("heave force", "N", {"depth": 0.1}, "data_driven.toml", {"total": 1.0}, none)
    learned = record({"unknown": 0.9}, runs=1)
    learned.answer.unknown = Unexplained(correction)
    steps = [StepRecord("nominal", [], {"total": 6.0}), StepRecord("identified", [], {"total": 2.0})]
    return [
        record({"none": 0.98}, runs=1), record({"none": 0.98}, runs=1, floor=2.0),
        record({"drag": 0.98}, ["drag"], runs=1), record({"turbulence": 0.9}, ["turbulence"], runs=1),
        learned, record({"unknown": 0.9}, runs=1, stages=steps),
    ]  # fmt: skip


@pytest.mark.parametrize("found", of_one_run())
def test_of_one_run_nothing_is_left_out(found):
    for text in (words.sentence(found), report_html(found)):
        assert not any(part in text for part in PARTS_OF_NOTHING)
    assert "of this run" in words.sentence(found)


@pytest.mark.parametrize("effect", [*catalogue().values(), *ocean_catalogue().values()], ids=lambda one: one.label)
def test_every_effect_has_a_size_in_words(effect):
    """A parameter that is a factor is said as one; the others have their unit."""
    for parameter in effect.parameters:
        value = 0.5 * max(parameter.low, parameter.high, key=abs)
        said = words.size_of(
            effect, {parameter.name: EstimateRecord(value, (0.9 * value, 1.1 * value), parameter.unit)}
        )
        assert ", 90 %: " in said
        if parameter.unit == "1" and f"1 + {parameter.name}" in effect.summary:
            assert words.number(1.0 + value) in said
        elif parameter.unit not in ("1", *words.READABLE):
            assert any(unit in said for unit in (parameter.unit, parameter.unit.removeprefix("k"), "mm"))


UNEXPLAINED = [
    FindingRecord("r", "lag 11-60", 40.0), FindingRecord("r", "variance", 30.0), FindingRecord("depth", "speed", -25.0),
    FindingRecord("r", "pump running", 12.0), FindingRecord("q", "time", 3.0),
]  # fmt: skip


def sizes(label: str, **parameters: EstimateRecord) -> DiagnosisRecord:
    return record({label: 0.97}, [label], sizes={label: parameters})


def sentences() -> dict[str, DiagnosisRecord]:
    """A diagnosis for every kind of sentence."""
    one, unknown = EstimateRecord, {"unknown": 0.95, "yaw_trim": 0.05}
    placed = [("hydrodynamics", "yaw", 0.97)]
    return {
        "one cause": record({"pump_slow": 0.97, "pump_droop": 0.02}, ["pump_slow"]),
        "one cause, one run": record({"pump_slow": 0.97}, ["pump_slow"], runs=1),
        "no gap": record({"none": 0.98}, before=0.5, recalibrated=0.45, floor=0.44),
        "no gap above the floor": record(
            {"none": 0.6, "drag": 0.4}, before=1.9, recalibrated=1.9, after=1.9, floor=2.18
        ),
        "a cause, or no gap above the floor": record({"drag": 0.6, "none": 0.4}, ["drag"], floor=1.2),
        "a factor, larger": sizes("drag", scale=one(0.5, (0.43, 0.57), "1"), induced=one(0.1, (-0.2, 0.4), "1")),
        "a factor, smaller": sizes("drag", scale=one(-0.3, (-0.4, -0.2), "1")),
        "a factor of a part": sizes("inertia", pitch=one(0.742, (0.6, 0.9), "1"), yaw=one(0.0, (-0.2, 0.2), "1")),
        "a divisor": sizes("pump_slow", rate=one(0.6, (0.535, 0.665), "1")),
        "a length with a sign": sizes("cg_longitudinal", offset=one(-0.0015, (-0.002, -0.001), "m")),
        "a mass without an interval": sizes("net_buoyancy", mass=one(0.06, (None, None), "kg")),
        "a factor without a base": sizes("pitch_damping", scale=one(0.3, (0.2, 0.4), "1")),
        "not to be distinguished": record({"drag": 0.6, "tether": 0.4}, ["drag"], {"drag": ["drag", "tether"]}),
        "none, or unknown": record({"none": 0.51, "unknown": 0.49}),
        "unknown, or none": record({"unknown": 0.7, "none": 0.3}),
        "two effects": record({"pump_slow": 0.999}, ["pump_slow", "imu_pitch_bias"], recalibrated=5.0),
        "unknown, placed": record(unknown, ["yaw_trim"], findings=UNEXPLAINED, where=placed),
        "unknown, correlated elsewhere": record({"unknown": 0.9}, findings=UNEXPLAINED[:3]),
        "unknown, nothing found": record({"unknown": 0.9}),
        "a clock that wanders": record({"mocap_delay": 0.96}, ["mocap_delay"], noise=Noise(CLOCK, 6.0)),
        "a clock that does not": record({"mocap_delay": 0.96}, ["mocap_delay"]),
        "turbulence": record({"turbulence": 0.96}, ["turbulence"], noise=Noise(TURBULENCE, 3.6, 5.0, 1.0)),
        "waves": record({"waves": 0.96}, ["waves"], noise=Noise("waves", 6.0, 5.0, 1.0)),
    }


def test_every_kind_of_sentence():
    check_golden("diagnosis_words.txt", "".join(f"{k}:\n{words.sentence(v)}\n\n" for k, v in sentences().items()))


def test_the_report_of_runs_in_which_nothing_can_be_seen_says_no_gap_nowhere():
    found = sentences()["no gap above the floor"]
    assert 'class="verdict blind"' in report_html(found)
    assert "No gap" not in words.sentence(found) + report_html(found)


def test_an_unknown_gap_is_described_by_channel():
    rows = words.described(sentences()["unknown, placed"])
    assert [row["channel"] for row in rows] == ["yaw rate", "depth"]  # what is weak is not told
    assert rows[0]["shape"] == ["autocorrelated over 1.1 to 6 s (40)"]
    assert [row["correlated"][0].split("(")[1] for row in rows] == ["12)", "25)"]
    assert rows[0]["axis"] == "yaw axis"


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
