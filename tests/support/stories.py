"""How the supervisor's stories begin, and the words they are told in."""

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import Reaction
from tests.support.watchman import DT, Watchman

NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = Reaction
TWO_TICKS = 2 * DT + 1e-9
COARSE = 0.1  # s, the step of stories that take long


FLOWN: dict[str, Watchman] = {}


def flying(**more) -> Watchman:
    """Ten seconds into a dive in which all is well."""
    if repr(more) not in FLOWN:
        man = Watchman(**more)
        man.depth = 0.5
        man.wanted = [0.1, 0.01, 0.05]
        assert man.seconds(10.0) == NOTHING
        assert not man.G[sup.FIRST : sup.FIRST + sup.N_ROWS].max() >= 0.0
        FLOWN[repr(more)] = man
    return FLOWN[repr(more)].copy()


def rising(man: Watchman) -> None:
    man.sinks, man.pitch = -0.2, 0.3
