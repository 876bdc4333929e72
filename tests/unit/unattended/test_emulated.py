"""What the emulated computer is judged by: numbers of two logs, parts that passed, failed or were left out."""

import math

import numpy as np
import pytest

from glider.tools.verify.arm64.compared import compared, difference
from glider.tools.verify.arm64.emulated import passed, shown


def test_the_largest_difference_of_two_columns():
    assert difference(np.array([1.0, np.nan, 3.0]), np.array([1.0, np.nan, 3.5])) == 0.5
    assert difference(np.array([1.0, 2.0]), np.array([1.0, np.nan])) == math.inf
    assert difference(np.array([True, False]), np.array([True, True])) == 1.0
    assert difference(np.array([2], np.uint64), np.array([3], np.uint64)) == 1.0


def test_a_flight_that_left_no_log_does_not_pass(tmp_path):
    found = compared("plunge", [tmp_path / "there.mcap", tmp_path / "here.mcap"])
    assert not found["pass"]
    assert not found["bit_for_bit"]


@pytest.mark.parametrize(
    ("result", "well"),
    [
        ({"install": [{"pass": True}], "flights": [{"pass": True}, {"pass": True}], "ended": True}, True),
        ({"install": [{"pass": True}], "flights": [{"pass": True}, {"pass": False}], "ended": True}, False),
        ({"skipped": "root is missing"}, True),
        ({"install": [{"pass": True}], "skipped": "what was not shown within 5 s"}, True),
        ({"install": [{"pass": False}], "skipped": "what was not shown within 5 s"}, False),
        ({"install": [{"pass": True}]}, False),  # it broke off
        ({}, False),
    ],
)
def test_what_was_left_out_is_no_failure_and_what_broke_off_is_one(result, well):
    assert passed(result) is well


def test_what_fails_beside_others_is_tried_again_alone_and_nothing_else_is(tmp_path):
    beside, tries = tmp_path / "beside", []

    def part(passes, ends=False):
        tries.append(passes)
        if ends:
            beside.unlink()
        return {"pass": passes}

    assert not shown(lambda: part(False), None)["pass"]
    assert not shown(lambda: part(False), beside)["pass"]  # it is gone already
    beside.touch()
    assert shown(lambda: part(True), beside) == {"pass": True}
    assert len(tries) == 3
    assert shown(lambda: part(len(tries) > 3, ends=len(tries) == 3), beside) == {"pass": True, "alone": True}
    assert len(tries) == 5
