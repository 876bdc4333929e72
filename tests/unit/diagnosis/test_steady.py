"""An answer is a smooth function of the readings: a millionth of their noise moves no verdict."""

import re

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs import columns as names
from glider.tools.verify.figures.steady import Said, largest_move, largest_stage_move, line, moved, said
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=15)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    F = np.zeros(ef.N_F)
    F[ef.DRAG_0], F[ef.GYRO_SCALE] = 0.6, 0.08
    return make_case(tmp_path_factory.mktemp("steady"), F, seed=6, runs=2)


def test_a_copy_s_readings_move_by_a_millionth_of_their_noise_and_its_commands_by_nothing(case):
    copy, again, other = moved(case, 3), moved(case, 3), moved(case, 4)
    for run, one, same, apart in zip(case.runs, copy.runs, again.runs, other.runs, strict=True):
        for name in (*names.COMMANDS, names.TIME):
            np.testing.assert_array_equal(one.columns[name], run.columns[name])
        away = one.columns[names.DEPTH] - run.columns[names.DEPTH]
        assert np.std(away) == pytest.approx(1e-6 * case.sensors.depth.noise, rel=0.2)
        np.testing.assert_array_equal(one.columns[names.DEPTH], same.columns[names.DEPTH])
        assert not np.array_equal(one.columns[names.DEPTH], apart.columns[names.DEPTH])


def test_an_answer_stays(case):
    own, copy = said(case), said(moved(case, 1))
    assert copy.verdict == own.verdict
    assert copy.selected == own.selected
    assert largest_move(own, copy)[1] < 0.02


def test_what_is_said_of_copies():
    own = Said("cause", frozenset({"drag"}), {"drag": 0.9, "none": 0.1}, {"nominal": 2.0, "+ drag": 0.5})
    other = Said("none", frozenset(), {"drag": 0.4, "none": 0.5, "unknown": 0.1}, {"nominal": 2.0, "+ drag": 0.55})
    assert largest_move(own, other) == ("drag", pytest.approx(0.5))
    assert largest_stage_move(own, other) == ("+ drag", pytest.approx(0.1))
    text = line("case000", own, [own, other])
    assert re.findall(r"drag|\d+\.\d+|\b\d\b", text) == ["2", "0.900", "drag", "0.5", "1", "1", "drag", "10.00"]
