"""Of all reactions asked for the highest wins: every pair of rows, every level, every reaction before; the limits."""

import ast
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.supervision.supervisor import highest
from glider.firmware.faults import ABORT, FAULT_TABLE, FAULTS, NEVER, WARN, Reaction, markdown_rows
from glider.hal.ports import SLOTS, Validity
from glider.tools.verify.faults.flights import flown
from tests.support.examples import examples
from tests.support.watchman import BALLAST_RANGE, DT, SLIDER_RANGE, Watchman

ROOT = Path(__file__).resolve().parents[3]
LEVELS = [float(level) for level in Reaction]
ON = np.ones(sup.N_ROWS)


def expected(asked: dict[int, float], before: float) -> float:
    """The rule, said once more: the highest, and never below what was latched from ABORT on."""
    top = max(asked.values(), default=0.0)
    return max(top, before) if before >= Reaction.ABORT else top


def test_every_pair_of_rows_at_every_level_over_every_reaction_before():
    asked = np.zeros(sup.N_ROWS)
    for first, second in itertools.combinations(range(1, sup.N_ROWS), 2):
        for a, b in itertools.product(LEVELS, LEVELS):
            asked[first], asked[second] = a, b
            for before in LEVELS:
                reaction, row = highest(asked, ON, before)
                assert reaction == expected({first: a, second: b}, before)
                if reaction > before or (before < Reaction.ABORT and reaction > 0.0):
                    assert row == (first if a >= b else second)
                else:
                    assert row == 0
        asked[first] = asked[second] = 0.0


@examples(300)
@given(st.lists(st.sampled_from(LEVELS), min_size=len(FAULTS), max_size=len(FAULTS)),
       st.lists(st.booleans(), min_size=len(FAULTS), max_size=len(FAULTS)),
       st.sampled_from(LEVELS))  # fmt: skip
def test_any_rows_at_once_and_rows_switched_off(levels, on, before):
    asked, enabled = np.array([6.0, *levels]), np.array([1.0, *map(float, on)])
    reaction, row = highest(asked, enabled, before)
    heard = {i: asked[i] for i in range(1, sup.N_ROWS) if enabled[i]}
    assert reaction == expected(heard, before)
    assert row == 0 or asked[row] == reaction


def documented() -> dict[int, list[str]]:
    """Rows of the fault table in docs/explanation/supervisor.md: name, seen by, within, reaction, cleared by."""
    lines = (ROOT / "docs" / "explanation" / "supervisor.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| ")]
    return {int(row[0]): row[1:] for row in rows if len(row) == 6 and row[0].isdigit()}


def test_the_documented_table_is_the_one_that_flies():
    document = (ROOT / "docs" / "explanation" / "supervisor.md").read_text(encoding="utf-8").splitlines()
    rows = markdown_rows()
    assert [line for line in document if line in rows] == rows
    assert sorted(documented()) == list(FAULTS)
    assert f" {len(FAULTS)} rows" in "\n".join(document)


def test_levels_of_a_row_rise_and_what_is_below_abort_says_what_ends_it():
    for fault in FAULT_TABLE.values():
        reactions = [level.reaction for level in fault.levels]
        assert reactions == sorted(set(reactions)), fault
        assert len(reactions) <= sup.N_LEVELS
        for level in fault.levels:
            assert level.clear_after == NEVER or (level.reaction < ABORT and fault.well), fault


def requested(tree: ast.AST) -> set[tuple[str, str]]:
    """Rows and levels of the calls of `request` by their names; anything but a name or a choice of two is refused."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "request":
            _, row, level = node.args
            for one in (level.body, level.orelse) if isinstance(level, ast.IfExp) else (level,):
                found.add((ast.unparse(row), ast.unparse(one)))
    return found


def test_kernels_request_every_level_of_the_table_and_no_other():
    here = set()
    for path in (ROOT / "firmware" / "core" / "supervision").glob("*.py"):
        here |= requested(ast.parse(path.read_text(encoding="utf-8")))
    names = {value: f"sup.{name}" for name, value in vars(sup).items() if name.startswith("FAULT_")}
    wanted = {
        (names[row], f"sup.LEVEL_{number}")
        for row, fault in FAULT_TABLE.items()
        for number, _ in enumerate(fault.levels, start=1)
    }
    assert here == wanted


def test_the_table_is_copied_into_the_supervisors_vector():
    man = Watchman(law_rest_s=7.0)
    for row, fault in FAULT_TABLE.items():
        start = row * sup.N_LEVELS
        levels = [float(level.reaction) for level in fault.levels]
        found = man.G[sup.REACTION + start : sup.REACTION + start + sup.N_LEVELS]
        assert list(found) == levels + [0.0] * (sup.N_LEVELS - len(levels))
    clear = man.G[sup.CLEAR_AFTER :]
    assert clear[sup.FAULT_NO_ANSWER * sup.N_LEVELS + sup.LEVEL_1] == 7.0
    assert clear[sup.FAULT_NO_ANSWER * sup.N_LEVELS + sup.LEVEL_2] == math.inf
    assert clear[sup.FAULT_LEAK * sup.N_LEVELS + sup.LEVEL_1] == math.inf
    assert clear[sup.FAULT_DISK * sup.N_LEVELS + sup.LEVEL_1] == 0.0


def test_another_table_is_another_reaction():
    """The kernels take the reaction and its clear time from the vector, not from themselves."""
    man = Watchman()
    man.step(5)
    place = sup.FAULT_DISK * sup.N_LEVELS + sup.LEVEL_1
    man.G[sup.REACTION + place], man.G[sup.CLEAR_AFTER + place] = WARN, 0.1
    man.G[sup.RECORDER] = 1.0
    assert man.step() == WARN
    man.G[sup.RECORDER] = 0.0
    assert [man.step() for _ in range(6)] == [WARN] * 4 + [Reaction.NOTHING] * 2


def test_a_milder_request_does_not_replace_one_that_stands():
    man = Watchman()
    man.step(5)
    place = sup.FAULT_DISK * sup.N_LEVELS + sup.LEVEL_2
    man.G[sup.CLEAR_AFTER + place] = 0.1
    man.G[sup.RECORDER] = 2.0
    assert man.step() == WARN
    man.G[sup.RECORDER] = 1.0
    assert [man.step() for _ in range(6)] == [WARN] * 4 + [Reaction.LOG] * 2


def test_what_the_fault_campaign_expects_of_a_row_is_what_is_documented():
    for case in flown():
        assert case.expected.name in documented()[case.row][3], case


@examples(60)
@given(st.lists(st.tuples(st.sampled_from(LEVELS), st.lists(st.floats(width=64), min_size=3, max_size=3)),
                min_size=2, max_size=40))  # fmt: skip
def test_whatever_is_wanted_and_asked_for_what_is_sent_is_finite_within_range_and_rate(story):
    man = Watchman()
    man.step(5)
    low = np.array([-math.pi / 3, SLIDER_RANGE[0], BALLAST_RANGE[0]])
    rate = np.array([1.0, 0.02, 0.03])
    last = man.commands.copy()
    for level, wanted in story:
        man.G[sup.GROWTH] = {4.0: 2.0, 2.0: 1.0}.get(level, 0.0)
        man.wanted = list(wanted)
        man.step()
        sent = man.commands
        assert np.isfinite(sent).all()
        assert (sent >= low * (1 + 1e-4)).all()
        assert (sent <= -low * (1 + 1e-4)).all()
        assert (np.abs(sent - last) <= rate * DT * (1 + 1e-9)).all()
        assert man.ap[ctl.SENT_SERVO : ctl.SENT_SERVO + 3] == pytest.approx(sent, abs=0)
        last = sent.copy()


def test_abort_stays_and_keeps_who_asked():
    man = Watchman()
    man.step(5)
    man.G[sup.GROWTH] = 2.0
    assert man.step() == Reaction.ABORT
    man.G[sup.GROWTH] = 0.0
    man.silence.add("beacon")
    man.seconds(2.0)
    assert man.supervisor.row in (33, 2)
    assert man.pilot.reason.startswith("fault 33: ")
    assert man.ap[ctl.AP_REACTION] == Reaction.ABORT
    assert man.ap[ctl.AP_FAULT_ROW] == man.supervisor.row


def test_a_completed_mission_stays_completed():
    man = Watchman(mode=ctl.COMPLETED)
    man.G[sup.GROWTH] = 2.0
    man.step(2)
    assert man.ap[ctl.MODE] == ctl.COMPLETED
    assert man.supervisor.reaction == Reaction.ABORT


def test_a_row_switched_off_asks_for_nothing():
    for row, place, value in ((33, sup.GROWTH, 2.0), (27, sup.RECORDER, 1.0), (25, sup.RESTARTED, 1.0)):
        man = Watchman()
        man.supervisor.disable(row)
        man.G[place] = value
        assert man.step(3) == Reaction.NOTHING
        assert man.supervisor.noticed(row) is None


def test_news_are_told_once():
    man = Watchman()
    man.step(5)
    man.G[sup.RECORDER] = 1.0
    man.step()
    assert [(reaction, said.split(": ")[0]) for reaction, said in man.supervisor.news()] == [(Reaction.LOG, "fault 27")]
    assert man.G[sup.CHANGED] == 1.0
    man.step()
    assert man.supervisor.news() == []
    assert man.G[sup.CHANGED] == 0.0
    assert man.supervisor.noticed(sup.FAULT_DISK) == pytest.approx(0.1)


# --- waiting --------------------------------------------------------------------------------------------------------
def test_waiting_leaves_actuators_where_they_stand():
    man = Watchman(mode=ctl.WAITING)
    man.follows = False
    man.places = [0.03, -0.1]
    man.silence |= {"slider_wire", "plunger_wire"}
    man.step(3)
    assert np.isnan(man.commands).all()  # nobody knows where they are
    man.silence.clear()
    man.step(2)
    assert math.isnan(man.commands[0])
    man.wanted = [0.0, 0.03, -0.1]  # as the autopilot does: what was sent last
    man.step(2)
    assert man.commands[1:] == pytest.approx([0.03, -0.1], abs=1e-3)
    man.ap[ctl.MODE] = ctl.FLYING
    man.wanted = [0.0, 0.0, 0.0]
    man.step()
    assert man.commands == pytest.approx([0.0, 0.03 - 0.02 * DT, -0.1 + 0.03 * DT], abs=1e-3)


@pytest.mark.parametrize("place", [0.001, -0.001])
def test_what_stands_at_neutral_begins_at_neutral(place):
    man = Watchman(mode=ctl.WAITING)
    man.follows = False
    man.places = [place, place]
    man.step(2)
    assert (man.commands[1:] == 0.0).all()


def test_without_wires_actuators_begin_from_what_was_sent_after_a_while():
    man = Watchman()
    man.silence |= {"slider_wire", "plunger_wire"}
    man.step(20)
    assert np.isnan(man.commands[1:]).all()
    man.step(10)
    assert np.isfinite(man.commands).all()


def test_an_abort_while_waiting_moves_everything_at_once():
    man = Watchman(mode=ctl.WAITING)
    man.step(3)
    man.G[sup.GROWTH] = 2.0
    assert man.step() == Reaction.ABORT
    assert man.ap[ctl.MODE] == ctl.ABORTED
    man.seconds(15.0)
    assert man.commands == pytest.approx([0.0, SLIDER_RANGE[0], BALLAST_RANGE[0]])


@pytest.mark.parametrize("row", [6, 10])
def test_a_sample_is_used_as_it_comes_with_its_row_switched_off(row):
    man = Watchman()
    man.step(10)
    man.supervisor.disable(row)
    man.say["beacon"] = (2e8, 20.0)
    man.late["beacon"] = 0.3 if row == 6 else 0.0
    if row == 6:
        man.say.clear()
    man.step(2)
    assert man.frame[SLOTS["beacon"].validity] == Validity.VALID
    assert man.supervisor.noticed(row) is None


def test_before_the_first_depth_nothing_is_said_of_it():
    man = Watchman(mode=ctl.WAITING)
    man.silence.add("beacon")
    man.est[ctl.EST_BEACON_TIME] = -1.0
    man.est[ctl.NEW_DEPTH] = 5000.0
    man.step(20)
    assert man.supervisor.worst(sup.FAULT_TOO_DEEP) == Reaction.NOTHING
    assert math.isnan(man.supervisor.measured_depth())


def test_depth_is_known_until_the_beacon_is_lost():
    man = Watchman()
    man.step(5)
    assert man.supervisor.measured_depth() == man.est[ctl.NEW_DEPTH]
    assert man.supervisor.surface_depth == 0.4
    man.silence.add("beacon")
    man.seconds(1.0)
    assert math.isnan(man.supervisor.measured_depth())
