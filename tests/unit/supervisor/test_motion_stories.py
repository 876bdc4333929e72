"""What the vehicle does: against itself, too deep, not up, not on, too steep (rows 13, 17 to 19, 21).

Each row as a story: all is well, something breaks, it is noticed in time, and what follows.
"""

import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.model.supervisor_settings import Limits
from tests.support.stories import ABORT, COARSE, HW, NOTHING, OOB, TWO_TICKS, WARN, flying, rising


# --- row 13 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("nose", [1, -1])
def test_pitch_and_depth_rate_that_disagree_make_the_controller_cautious(nose):
    man = flying()
    man.pitch, man.sinks = -0.3 * nose, -0.2 * nose
    man.depth = 3.0
    man.G[sup.JUMP] = man.G[sup.JUMP + 1] = 10.0
    begin = man.t
    if nose == -1:
        man.pitch = 0.3
    assert man.until(WARN, 7.0) >= 4.0
    assert man.supervisor.row == sup.FAULT_DISAGREE
    assert man.supervisor.noticed(sup.FAULT_DISAGREE) - begin < 4.8 + 2.0
    man.step()
    assert man.ap[ctl.CAUTIOUS] == 1.0
    man.sinks *= -1
    man.seconds(3.0)
    assert man.supervisor.reaction == NOTHING
    assert man.ap[ctl.CAUTIOUS] == 0.0


@pytest.mark.parametrize(("pitch", "sinks"), [(0.1, 0.2), (0.3, 0.03), (-0.3, 0.2)])
def test_a_flat_or_slow_glide_does_not_disagree(pitch, sinks):
    man = flying(dt=COARSE)
    man.G[sup.JUMP + 1] = 10.0
    man.pitch, man.sinks = pitch, sinks
    assert man.seconds(10.0) == NOTHING


# --- row 17 ---------------------------------------------------------------------------------------------------------
def test_deeper_than_the_working_depth_aborts_and_at_risk_goes_out_of_band():
    man = flying(limits=Limits(working_depth_m=4.0, at_risk_depth_m=5.0))
    man.depth = 3.9
    man.sinks = 0.05
    while man.depth < 4.0:
        man.step()
    assert man.supervisor.reaction == NOTHING
    assert man.until(ABORT, 1.0) <= 1.0
    assert man.supervisor.row == sup.FAULT_TOO_DEEP
    man.depth, man.sinks = 5.0, 0.2
    man.G[sup.JUMP + 6] = 1e6
    assert man.until(OOB, 0.2) <= 0.2
    assert man.supervisor.row == sup.FAULT_TOO_DEEP


def test_a_spike_of_depth_is_not_too_deep():
    man = flying(limits=Limits(working_depth_m=4.0))
    man.depth = 3.9
    man.sinks = 0.0
    man.seconds(1.0)
    for _ in range(5):
        man.depth = 4.05
        man.step(10)
        man.depth = 3.95
        man.step(10)
    assert man.supervisor.worst(sup.FAULT_TOO_DEEP) == NOTHING


def test_without_a_working_depth_the_sites_counts():
    man = flying(site=6.0)
    man.depth = 6.05
    man.sinks = 0.0
    man.G[sup.JUMP + 6] = 1e6
    assert man.until(ABORT, 1.0) <= 1.0
    man.depth = 6.65
    assert man.until(OOB, 0.2) <= 0.2


# --- row 18 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", [ctl.COMPLETED, ctl.ABORTED])
def test_no_ascent_goes_out_of_band_then_to_the_hardware(mode):
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = mode
    man.sinks = 0.0
    took = man.until(OOB, 30.0 + TWO_TICKS)
    assert took > 29.0
    assert man.supervisor.row == sup.FAULT_NO_ASCENT
    man.seconds(25.0)
    assert man.supervisor.reaction == OOB
    man.until(HW, 10.0)
    assert man.supervisor.row == sup.FAULT_NO_ASCENT
    assert man.seconds(5.0) == HW


def test_an_ascent_however_slow_is_one():
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = ctl.ABORTED
    man.seconds(5.0)  # sinks on for a while
    man.sinks = -0.02
    man.seconds(200.0)
    assert man.supervisor.worst(sup.FAULT_NO_ASCENT) == NOTHING


def test_at_the_surface_nothing_has_to_ascend():
    man = flying(dt=COARSE)
    man.depth, man.sinks, man.ap[ctl.MODE] = 0.3, 0.0, ctl.COMPLETED
    man.G[sup.JUMP + 6] = 1e6
    man.seconds(100.0)
    assert man.supervisor.worst(sup.FAULT_NO_ASCENT) == NOTHING


def test_an_ascent_that_stops_halfway_is_noticed():
    man = flying(dt=COARSE)
    man.ap[ctl.MODE] = ctl.ABORTED
    rising(man)
    man.G[sup.JUMP + 1] = 10.0
    man.seconds(5.0)
    man.sinks = 0.0
    assert man.until(OOB, 30.0 + 1.5) > 28.0


def test_blind_the_out_of_band_process_is_called_but_the_weight_stays_for_long():
    man = flying(dt=COARSE)
    man.silence.add("beacon")
    man.until(ABORT, 1.0)
    assert man.until(OOB, 31.0) > 29.0
    man.seconds(250.0)
    assert man.supervisor.reaction == OOB
    man.until(HW, 60.0)


# --- row 19 ---------------------------------------------------------------------------------------------------------
def test_the_same_depth_for_too_long_aborts():
    man = flying(dt=COARSE)
    man.sinks = 0.0
    assert man.until(ABORT, 121.0) > 115.0
    assert man.supervisor.row == sup.FAULT_OVERTIME


def test_holding_a_depth_that_was_reached_is_meant():
    man = flying(dt=COARSE)
    man.sinks = 0.0
    man.ap[ctl.REACHED] = man.t
    man.seconds(200.0)
    assert man.supervisor.reaction == NOTHING


@pytest.mark.parametrize("sinks", [0.01, -0.01])
def test_a_slow_glide_is_not_the_same_depth(sinks):
    man = flying(dt=COARSE)
    man.pitch, man.sinks = 0.0, sinks
    man.seconds(250.0)
    assert man.supervisor.worst(sup.FAULT_OVERTIME) == NOTHING


@pytest.mark.parametrize(("mode", "reaction"), [
    (ctl.FLYING, ABORT), (ctl.ABORTED, ABORT), (ctl.COMPLETED, NOTHING), (ctl.WAITING, NOTHING),
])  # fmt: skip
def test_overtime(mode, reaction):
    man = flying()
    man.G[sup.MISSION_TIME] = 5.0
    man.ap[ctl.MISSION_START] = man.t - 4.0
    man.ap[ctl.MODE] = mode
    assert man.seconds(0.9) == NOTHING
    man.seconds(0.2)
    assert man.supervisor.reaction == reaction
    assert man.supervisor.row == (19 if reaction else 0)


# --- row 21 ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("what", ["pitch", "roll"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_too_steep_or_rolling_over_flies_the_pid_then_aborts(what, side):
    man = flying()
    man.G[sup.JUMP : sup.JUMP + 3] = 10.0
    setattr(man, what, side * (1.1 if what == "pitch" else 1.4))
    if side * man.pitch > 0:
        man.sinks = 0.0
    assert man.step() == WARN
    assert man.supervisor.row == sup.FAULT_STEEP
    assert man.ap[ctl.CAUTIOUS] == 1.0
    assert man.until(ABORT, 2.0) > 1.5
    assert man.supervisor.row == sup.FAULT_STEEP


def test_a_leg_that_is_meant_to_be_steep_may_be():
    man = flying()
    man.G[sup.JUMP + 1] = 10.0
    man.ap[ctl.REF_PITCH] = -1.2
    man.pitch = -1.3
    assert man.seconds(5.0) == NOTHING
    man.pitch = -1.56
    assert man.step() == WARN


def test_a_vehicle_that_comes_upright_again_flies_on():
    man = flying()
    man.G[sup.JUMP + 1] = 10.0
    man.pitch = -1.1
    man.seconds(1.5)
    man.pitch = -0.3
    assert man.step() == NOTHING
    man.pitch = -1.1
    man.seconds(1.5)
    assert man.supervisor.reaction == WARN


def test_an_ascent_may_be_as_steep_as_it_comes():
    man = flying(mode=ctl.COMPLETED)
    man.G[sup.JUMP + 1] = 10.0
    rising(man)
    man.pitch = 1.5
    man.seconds(5.0)
    assert man.supervisor.worst(sup.FAULT_STEEP) == NOTHING
