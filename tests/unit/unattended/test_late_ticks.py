"""What a late tick of a flight is put down to: bare loops beside it, and the spans in which they were not woken."""

import os
import shutil

import numpy as np
import pytest

from glider.tools.verify.figures.bare_loop import BareLoop, Punctuality, bare_loop_program
from glider.tools.verify.figures.endurance import PERIOD_S, reasons

pytestmark = pytest.mark.realtime(seconds=2)


def punctual(*late: tuple[float, float]) -> Punctuality:
    """A bare loop that woke late at these moments, (when, how late) in s."""
    return Punctuality(0, 0, 0.0, {}, True, True, np.array(late, float).reshape(-1, 2))


def test_time_lost_is_the_overlap():
    loop = punctual((10.0, 0.03), (20.0, 0.004))
    begin, end = np.array([9.98, 9.0, 19.99]), np.array([9.99, 9.5, 20.01])
    assert loop.lost_s(begin, end) == pytest.approx([0.01, 0.0, 0.004])
    assert (punctual().lost_s(begin, end) == 0.0).all()


def test_each_late_tick_has_one_reason():
    late = np.array([
        [5.0, 0.05, -0.01],  # the bare loop on its core was not woken either: 0.045 of 0.05 s
        [6.0, 0.03, 0.02],  # nobody else was late, and the tick before had lasted too long
        [7.0, 0.03, 0.02],  # too long, but while another core stood still
        [8.0, 0.008, -0.01],
    ])  # fmt: skip
    found = reasons(late, punctual((5.001, 0.046), (8.0, 0.002)), [punctual(), punctual((6.999, 0.025))])
    assert {name: one["ticks"] for name, one in found.items()} == {
        "machine": 1, "other_core": 1, "overrun": 1, "waiting": 1,
    }  # fmt: skip
    assert found["machine"] == {"ticks": 1, "missed": 2, "worst_s": 0.05}
    assert found["waiting"] == {"ticks": 1, "missed": 0, "worst_s": 0.008}
    nothing = reasons(np.zeros((0, 3)), punctual(), [])
    assert sum(one["ticks"] for one in nothing.values()) == 0


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc)")
def test_a_bare_loop_counts_every_deadline():
    core = min(os.sched_getaffinity(0))
    with bare_loop_program() as program:
        found = BareLoop(program, core=core, priority=0, period_s=PERIOD_S, seconds=1.0, late_s=0.0).end()
    assert found.ticks + found.missed == pytest.approx(50, abs=1)
    assert sum(found.lateness.values()) == found.ticks == len(found.late)
    assert not found.real_time
    assert found.late[:, 1].max() == pytest.approx(found.worst_late_s)
    assert (np.diff(found.late[:, 0]) > 0.0).all()
