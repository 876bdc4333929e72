"""A gap has to matter: what is there but moves no window is no gap, and the probabilities agree with the verdict."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.materiality import excess, movements
from glider.tools.diagnose.probabilities import answer_first, mix_in_error_rate, to_none
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.diagnose.search import run
from glider.tools.diagnose.verdict import Answer, conclude
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import problem_of
from tests.support.cases import make_case

SMALL, LARGE = 0.004, 0.2  # s; at 0.3 m/s and 0.15 m of tolerance some 0.008 and 0.4 tolerances


def late(folder, delay: float) -> Answer:
    """The answer to a case whose motion capture is `delay` (s) late."""
    F = np.zeros(ef.N_F)
    F[ef.MOCAP_DELAY] = delay
    return conclude(run(problem_of(make_case(folder, F, seed=5, runs=2, mocap=True))))


def agrees(answer: Answer) -> bool:
    """Whether the most probable entry is the answer, and the probabilities add up to 1."""
    top = max(answer.probabilities, key=lambda name: answer.probabilities[name])
    return top == answer.main and sum(answer.probabilities.values()) == pytest.approx(1.0, abs=1e-12)


def test_a_clock_that_is_hardly_late_is_there_and_no_gap(tmp_path):
    answer = late(tmp_path, SMALL)
    assert answer.main == NONE
    assert answer.selected == []
    assert answer.hypothesis.labels == ()
    assert answer.negligible["mocap_delay"] > 2.0 * DIAGNOSIS.evidence_needed
    assert answer.probabilities[NONE] > 0.9
    assert agrees(answer)


def test_a_clock_that_is_late_enough_to_matter_is_the_cause(tmp_path):
    answer = late(tmp_path, LARGE)
    assert answer.main == "mocap_delay"
    assert answer.selected == ["mocap_delay"]
    assert answer.negligible == {}
    assert movements(answer.search, answer.hypothesis)["mocap_delay"] > DIAGNOSIS.material
    assert agrees(answer)


def test_probability_of_what_does_not_matter_is_that_of_none():
    chances = {"drag": 0.5, "lift": 0.3, "clock_skew": 0.15, NONE: 0.05}
    found = to_none(chances, ["clock_skew"], {"lift": 0.5 * DIAGNOSIS.material, "drag": 2.0 * DIAGNOSIS.material})
    assert found == pytest.approx({"drag": 0.5, "lift": 0.0, "clock_skew": 0.0, NONE: 0.5})


def test_no_label_passes_the_answer():
    chances = mix_in_error_rate({"drag": 0.49, "tether": 0.488, NONE: 0.0, UNKNOWN: 0.022}, "drag", ["tether"])
    assert chances["tether"] > chances["drag"]  # what is mixed in for errors goes to what the search found beside it
    top, found = answer_first(chances, ["drag"])
    assert top == next(iter(found)) == "drag"
    assert max(found.values()) == found["drag"]
    assert sum(found.values()) == pytest.approx(1.0)


def test_a_label_that_was_not_selected_is_not_the_answer():
    assert answer_first({"drag": 0.9, NONE: 0.06, UNKNOWN: 0.04}, [])[0] == NONE


def test_excess_is_that_of_the_worst_channel():
    after = {"depth": 0.5, "pitch": 0.3, "total": 9.0}
    assert excess(after, {"depth": 0.3, "pitch": 0.3, "total": 0.1}) == pytest.approx(0.4)
    assert excess(after, {"depth": 0.6, "pitch": 0.4}) == 0.0
