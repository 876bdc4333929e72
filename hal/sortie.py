"""The sortie of a vehicle as one state machine: which state follows which, on what trigger, and who may cause it.

A sortie lasts from arming until a person or the next arming. Three parties move it: the flight (`glider fly`), the
operator (`--acknowledge`) and the watch (the out-of-band process). The state is published in the heartbeat and kept on
the disk (state_file); what each party does follows from it. `TRANSITIONS` is searched from the top: the first entry
with the state, the trigger and the party that no blocker holds back is taken. Standard library alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum


class SortieState(IntEnum):
    """States, mildest first: of two copies that differ the larger counts."""

    ASHORE = 0  # no sortie
    ENDED = 1  # ended in order: afloat, ballast at its light end
    HELD = 2  # ended after a fault: afloat likewise, and a person looks before the next sortie
    SURFACED = 3  # afloat, ballast measured at its light end; the flight's process is closing
    ARMED = 4  # actuators are live, no tick yet
    DIVING = 5  # the mission is flown
    ASCENDING = 6  # the mission is over, and the flight brings the vehicle up
    ABORTED = 7  # no flight brings it up: the out-of-band process has to
    UNKNOWN = 8  # a copy on the disk cannot be trusted

    @property
    def may_arm(self) -> bool:
        """Whether a mission may begin."""
        return self <= SortieState.ENDED

    @property
    def at_rest(self) -> bool:
        """Whether nobody has to bring the vehicle up."""
        return self <= SortieState.HELD

    @property
    def must_ascend(self) -> bool:
        """Whether the vehicle may be under water; without a flight, the watch has to bring it up."""
        return not self.at_rest

    @property
    def beats(self) -> bool:
        """Whether the flight's loop runs, so that its heartbeat is expected every tick."""
        return self in (SortieState.DIVING, SortieState.ASCENDING)


class Party(Enum):
    """Who moves a sortie."""

    FLIGHT = "flight"
    OPERATOR = "operator"
    WATCH = "watch"


class Trigger(Enum):
    """What a party may ask for."""

    ARM = "arm for a mission"
    RECOVER = "arm for an ascent alone"
    DISARM = "leave before the first tick"
    START = "first tick"
    FINISH = "mission completed or given up"
    SURFACE = "shallow for the held time, and ballast measured at its light end"
    END = "process closes"
    HAND_OVER = "pump given up, no ascent, or the process breaks off"
    LOSE = "process gone, heartbeat too old, or found under way at boot"
    ACKNOWLEDGE = "a person has looked"


@dataclass(frozen=True)
class Facts:
    """What blockers look at."""

    flight_under_way: bool = False  # another process holds the heartbeat
    being_brought_up: bool = False  # the out-of-band process ascends, and has not found the surface
    fault: bool = False  # a reaction of ABORT or more in this flight, or an ascent after one that broke off


@dataclass(frozen=True)
class Blocker:
    """A reason to hold a transition back."""

    text: str
    holds: Callable[[Facts], bool]


UNDER_WAY = Blocker("a flight is under way", lambda facts: facts.flight_under_way)
BROUGHT_UP = Blocker(
    "the out-of-band process is bringing the vehicle up; with the vehicle in hand, stop that process first",
    lambda facts: facts.being_brought_up,
)
FAULT = Blocker("a fault ended the dive", lambda facts: facts.fault)


@dataclass(frozen=True)
class Transition:
    """From any of `sources`, on `trigger` by `party`, to `target`, unless a blocker holds."""

    sources: tuple[SortieState, ...]
    trigger: Trigger
    party: Party
    target: SortieState
    blockers: tuple[Blocker, ...] = ()


_MUST_ASCEND = tuple(state for state in SortieState if state.must_ascend)
_FLOWN = (SortieState.ARMED, SortieState.DIVING, SortieState.ASCENDING, SortieState.SURFACED)
TRANSITIONS = (
    Transition(
        (SortieState.ASHORE, SortieState.ENDED), Trigger.ARM, Party.FLIGHT, SortieState.ARMED, (UNDER_WAY, BROUGHT_UP)
    ),
    Transition(_MUST_ASCEND, Trigger.RECOVER, Party.FLIGHT, SortieState.ASCENDING, (UNDER_WAY, BROUGHT_UP)),
    Transition((SortieState.ARMED,), Trigger.DISARM, Party.FLIGHT, SortieState.ASHORE),
    Transition((SortieState.ARMED,), Trigger.START, Party.FLIGHT, SortieState.DIVING),
    Transition((SortieState.ASCENDING,), Trigger.START, Party.FLIGHT, SortieState.ASCENDING),
    Transition((SortieState.DIVING, SortieState.ASCENDING), Trigger.FINISH, Party.FLIGHT, SortieState.ASCENDING),
    Transition((SortieState.ASCENDING,), Trigger.SURFACE, Party.FLIGHT, SortieState.SURFACED),
    Transition((SortieState.SURFACED,), Trigger.END, Party.FLIGHT, SortieState.ENDED, (FAULT,)),
    Transition((SortieState.SURFACED,), Trigger.END, Party.FLIGHT, SortieState.HELD),
    Transition(_FLOWN, Trigger.HAND_OVER, Party.FLIGHT, SortieState.ABORTED),
    Transition(_MUST_ASCEND, Trigger.LOSE, Party.WATCH, SortieState.ABORTED),
    Transition(tuple(SortieState), Trigger.ACKNOWLEDGE, Party.OPERATOR, SortieState.ASHORE, (UNDER_WAY, BROUGHT_UP)),
)


class SortieRefused(RuntimeError):
    """A transition that is blocked or not in the table; str() says why."""


def follow(state: SortieState, trigger: Trigger, party: Party, facts: Facts) -> SortieState:
    """Return the state that follows; Refused where none does."""
    reason = f"{party.value}: '{trigger.value}' is not possible in state {state.name.lower()}"
    for row in TRANSITIONS:
        if state not in row.sources or trigger is not row.trigger or party is not row.party:
            continue
        blocker = next((blocker for blocker in row.blockers if blocker.holds(facts)), None)
        if blocker is None:
            return row.target
        reason = blocker.text
    raise SortieRefused(reason)
