"""Held-out flights of the examples without a gap: starts found against starts known (`before` of their answers)."""

import json

import numpy as np
import pytest

from glider.tools.data.runs.case import load_case
from glider.tools.gap.assess import assess

pytestmark = pytest.mark.computes(seconds=20)


def no_gap_cases(shared) -> list[str]:
    answers = sorted((shared / "gap" / "answers").glob("*.json"))
    return [path.stem for path in answers if not json.loads(path.read_text())["labels"]]


def test_the_gap_is_at_most_half_as_large_again_as_from_known_starts(shared):
    names = no_gap_cases(shared)
    assert names
    for name in names:
        answer = json.loads((shared / "gap" / "answers" / f"{name}.json").read_text())
        known = answer["before"][answer["runs"] :]
        found = assess(load_case(shared / "gap" / "held" / name))
        assert [set(run.channels) for run in found.runs] == [set(run) for run in known]
        reference = np.sqrt(np.mean([np.mean(np.square(list(run.values()))) for run in known]))
        assert found.total <= 1.5 * reference, f"{name}: {found.total:.3f} against {reference:.3f}"
        # actuators follow from the commands alone, so that these two differ by the bias in the start alone
        for run, expected in zip(found.runs, known, strict=True):
            assert run.channels["slider"] == pytest.approx(expected["slider"], abs=0.05)
            assert run.channels["ballast"] == pytest.approx(expected["ballast"], abs=0.05)


@pytest.mark.parametrize(("name", "part"), [("case010", "mass net"), ("case031", "actuation ballast")])
def test_a_plain_fault_is_found_in_its_place(shared, name, part):
    found = assess(load_case(shared / "gap" / "cases" / name))
    assert f"{found.where[0].subsystem} {found.where[0].element}" == part
    assert found.where[0].share > 0.8


def test_the_real_flights_are_measured_on_their_draw_wires(shared):
    found = assess(load_case(shared / "data" / "roughie2015"))
    assert set(found.channels) == {"depth", "pitch", "roll", "yaw", "rates"}
    assert [run.windows for run in found.runs] == [4, 6]
    assert all(np.isfinite(Y).all() for Y in found.predictions)
    # from the first sample to the last, though the vehicle lies at the surface for the first seconds
    assert found.total == pytest.approx(18.3, abs=0.3)  # the nominal vehicle is not that one
