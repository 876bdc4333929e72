"""The state machine of a sortie: what may never happen, whatever the table says; docs/explanation/supervisor.md has
the same."""

import dataclasses
import itertools
import re
from pathlib import Path

import pytest

from glider.hal import sortie
from glider.hal.sortie import TRANSITIONS, Facts, Party, SortieRefused, SortieState, Trigger, follow

FACTS = [Facts(*values) for values in itertools.product((False, True), repeat=3)]
EVERY = list(itertools.product(SortieState, Trigger, Party, FACTS))
DOCS = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "supervisor.md"


def after(state, trigger, party, facts):
    """The state that follows, None where that is refused."""
    try:
        return follow(state, trigger, party, facts)
    except SortieRefused:
        return None


def violations():
    """What may never happen: steps of the table as it is that break one of the rules below."""
    found = []
    for state, trigger, party, facts in EVERY:
        to = after(state, trigger, party, facts)
        busy = facts.flight_under_way or facts.being_brought_up
        if to is None:
            must = [  # one of these holds: it should not have been refused
                # A vehicle that may be under water: the watch can always take over, the flight always hand it over.
                party is Party.WATCH and trigger is Trigger.LOSE and state.must_ascend,
                party is Party.FLIGHT and trigger is Trigger.HAND_OVER and state in FLOWN,
                # Where nobody else is at it, a person who has looked is believed, and a flight can bring it up.
                party is Party.OPERATOR and trigger is Trigger.ACKNOWLEDGE and not busy,
                party is Party.FLIGHT and trigger is Trigger.RECOVER and state.must_ascend and not busy,
                party is Party.FLIGHT and trigger is Trigger.ARM and state.may_arm and not busy,
                party is Party.FLIGHT and (state, trigger) in COURSE,
            ]
            found += [(state, trigger, party, facts)] if any(must) else []
            continue
        may_not = [
            # To rest from under way: closed at the surface, disarmed before the first tick, or a person who looked.
            state.must_ascend and to.at_rest and (state, trigger) not in TO_REST and party is not Party.OPERATOR,
            party is Party.OPERATOR and (busy or trigger is not Trigger.ACKNOWLEDGE),
            party is Party.WATCH and to is not SortieState.ABORTED,
            # After a fault only a person makes the vehicle ready again; nobody arms over another.
            state is SortieState.HELD and to is not SortieState.HELD and party is not Party.OPERATOR,
            to is SortieState.ENDED and facts.fault,
            to is SortieState.HELD and not facts.fault,
            to is SortieState.ARMED and (busy or not state.may_arm),
            trigger is Trigger.RECOVER and busy,
            to is SortieState.SURFACED and state is not SortieState.ASCENDING,
            to is SortieState.DIVING and state is not SortieState.ARMED,
            to not in (TARGETS[trigger], SortieState.ASCENDING if trigger is Trigger.START else SortieState.HELD),
            to is SortieState.HELD and trigger is not Trigger.END,
            # Nothing but arming, or a person, moves a vehicle at rest.
            state.at_rest and trigger is not Trigger.ARM and party is not Party.OPERATOR,
        ]
        found += [(state, trigger, party, facts)] if any(may_not) else []
    return found


FLOWN = (SortieState.ARMED, SortieState.DIVING, SortieState.ASCENDING, SortieState.SURFACED)
TARGETS = {
    Trigger.ARM: SortieState.ARMED, Trigger.RECOVER: SortieState.ASCENDING, Trigger.DISARM: SortieState.ASHORE,
    Trigger.START: SortieState.DIVING, Trigger.FINISH: SortieState.ASCENDING, Trigger.SURFACE: SortieState.SURFACED,
    Trigger.END: SortieState.ENDED, Trigger.HAND_OVER: SortieState.ABORTED, Trigger.LOSE: SortieState.ABORTED,
    Trigger.ACKNOWLEDGE: SortieState.ASHORE,
}  # fmt: skip
TO_REST = ((SortieState.SURFACED, Trigger.END), (SortieState.ARMED, Trigger.DISARM))
COURSE = (
    (SortieState.ARMED, Trigger.DISARM), (SortieState.ARMED, Trigger.START), (SortieState.ASCENDING, Trigger.START),
    (SortieState.DIVING, Trigger.FINISH), (SortieState.ASCENDING, Trigger.FINISH), (SortieState.ASCENDING,
    Trigger.SURFACE), (SortieState.SURFACED, Trigger.END),
)  # fmt: skip


def test_nothing_happens_that_may_not_and_nothing_is_refused_that_must():
    assert violations() == []


def test_a_sortie_runs_its_course():
    state = SortieState.ASHORE
    for trigger in (Trigger.ARM, Trigger.START, Trigger.FINISH, Trigger.SURFACE, Trigger.END):
        state = follow(state, trigger, Party.FLIGHT, Facts())
    assert state == SortieState.ENDED
    with pytest.raises(SortieRefused, match=r"flight: 'first tick' .* ended"):
        follow(state, Trigger.START, Party.FLIGHT, Facts())


def test_properties_of_states():
    assert [state.name for state in SortieState if state.may_arm] == ["ASHORE", "ENDED"]
    assert [state.name for state in SortieState if state.at_rest] == ["ASHORE", "ENDED", "HELD"]
    assert all(state.must_ascend != state.at_rest for state in SortieState)
    assert [state.name for state in SortieState if state.beats] == ["DIVING", "ASCENDING"]


@pytest.mark.parametrize(
    ("fact", "text"),
    [("flight_under_way", "under way"), ("being_brought_up", "bringing the")],
)
def test_an_acknowledgement_is_refused_while_another_is_at_it(fact, text):
    for state in SortieState:
        with pytest.raises(SortieRefused, match=text):
            follow(state, Trigger.ACKNOWLEDGE, Party.OPERATOR, Facts(**{fact: True}))


def mutants():
    """Tables with one thing changed: an entry gone, a source added or gone, another target or party, a blocker gone."""
    for place, row in enumerate(TRANSITIONS):
        others = [
            *[dataclasses.replace(row, target=state) for state in SortieState if state is not row.target],
            *[dataclasses.replace(row, party=party) for party in Party if party is not row.party],
            *[dataclasses.replace(row, sources=(*row.sources, s)) for s in SortieState if s not in row.sources],
            *[dataclasses.replace(row, sources=tuple(s for s in row.sources if s is not gone)) for gone in row.sources],
            *[
                dataclasses.replace(row, blockers=tuple(b for b in row.blockers if b is not gone))
                for gone in row.blockers
            ],
        ]
        yield (*TRANSITIONS[:place], *TRANSITIONS[place + 1 :])
        for other in others:
            yield (*TRANSITIONS[:place], other, *TRANSITIONS[place + 1 :])


def meaning(table):
    """Which state follows each state, trigger, party and facts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sortie, "TRANSITIONS", table)
        return [after(*case) for case in EVERY], violations()


def test_every_mutant_of_the_table_breaks_a_rule_or_the_page():
    """A mutant that means something else breaks a rule above, or differs from the table of
    docs/explanation/supervisor.md."""
    same = meaning(TRANSITIONS)[0]
    killed = 0
    for table in mutants():
        steps, broken = meaning(table)
        if steps != same:
            killed += 1
            assert broken or rows_of(table) != rows_on_the_page()
    assert killed > 100


def rows_of(table):
    """Rows as docs/explanation/supervisor.md has them: states, trigger, party, target, blockers."""
    return [
        (
            ", ".join(state.name for state in row.sources), row.trigger.value, row.party.value, row.target.name,
            ", ".join(blocker.text for blocker in row.blockers) or "-",
        )
        for row in table
    ]  # fmt: skip


def rows_on_the_page():
    section = DOCS.read_text().split("## States of a sortie", 1)[1].split("\n## ", 1)[0]
    rows = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in section.splitlines() if "|" in line]
    return [row for row in rows if len(row) == 5][2:]  # head and rule


def test_the_page_has_the_table_of_the_code():
    assert rows_on_the_page() == rows_of(TRANSITIONS)


def test_the_picture_has_the_steps_of_the_table():
    section = DOCS.read_text().split("```mermaid\nstateDiagram-v2\n", 1)[1].split("```", 1)[0]
    drawn = set(re.findall(r"^ +(\w+) --> (\w+)", section, re.MULTILINE))
    wanted = {(source.name, row.target.name) for row in TRANSITIONS for source in row.sources}
    assert drawn == {pair for pair in wanted if pair[0] != pair[1]}
