"""The rule: it reaches what it states, on the vehicle that ships and on others, and the defaults are its gains."""

import msgspec
import numpy as np
import pytest

from glider.firmware.model.gains import Control, DepthGains, PitchGains, ReferenceTable
from glider.tools.data.errors import InputError
from glider.tools.study.tuning import rule
from glider.tools.study.tuning.linear_plant import DESIGN_TRIMS, OTHER_TRIMS, linearise
from glider.tools.study.tuning.loops import Delays
from tests.independent.loops import closed, opened


def margins_by_python_control(vehicle, board, gains, loop):
    """Smallest phase margin (deg) and fastest crossover (rad/s) over the design trims."""
    import control

    omega, found = np.geomspace(0.05, 30.0, 1500), []
    for trim in DESIGN_TRIMS:
        plant = linearise(vehicle.vector(), trim)
        curve = control.frd(opened(vehicle.vector(), plant, Delays.of(board), gains, loop)(1j * omega), omega)
        _, phases, _, _, crossovers, _ = control.stability_margins(curve, returnall=True)
        found.append((np.abs(phases).min(), crossovers.max()))
    return min(phase for phase, _ in found), max(crossover for _, crossover in found)


@pytest.fixture(scope="module")
def ruled(vehicle, board):
    return rule.tune(vehicle, board)


def test_the_stated_phase_margin_at_the_stated_crossover(vehicle, board, ruled):
    phase, crossover = margins_by_python_control(vehicle, board, ruled, "pitch")
    assert phase == pytest.approx(60.0, abs=0.5)  # gains have three digits
    assert crossover == pytest.approx(3.0 * 0.4, rel=0.01)
    phase, crossover = margins_by_python_control(vehicle, board, ruled, "depth")
    assert phase == pytest.approx(60.0, abs=0.5)
    assert 0.25 < crossover < 0.3  # the ballast's rate holds it below three times 0.1
    assert ruled.depth.rate_bandwidth == pytest.approx(10.0 * crossover, rel=0.02)


def test_ti_is_twice_td(ruled):
    for gains in (ruled.pitch, ruled.depth):
        assert gains.kp / gains.ki == pytest.approx(2.0 * gains.kd / gains.kp, rel=0.02)


def test_the_defaults_are_the_rules_gains(ruled):
    """What ships in firmware/model/gains.py is what `glider tune` prints for the vehicle that ships."""
    assert ruled.pitch == PitchGains()
    assert ruled.depth == DepthGains()


def test_every_closed_loop_is_stable(vehicle, board, ruled):
    P, delays = vehicle.vector(), Delays.of(board)
    for trim in (*DESIGN_TRIMS, *OTHER_TRIMS):
        assert closed(P, linearise(P, trim), delays, ruled).poles().real.max() < 0.0


def slower(vehicle, actuator, factor):
    table = getattr(vehicle.actuators, actuator)
    table = msgspec.structs.replace(table, rate=factor * table.rate)
    return msgspec.structs.replace(vehicle, actuators=msgspec.structs.replace(vehicle.actuators, **{actuator: table}))


@pytest.mark.parametrize(("actuator", "loop", "factor"), [("slider", "pitch", 0.15), ("ballast", "depth", 0.5)])
def test_a_slow_actuator_makes_a_slow_loop(vehicle, board, ruled, actuator, loop, factor):
    """Swinging at the crossover, an error of 3 % of the largest step asks for the actuator's whole rate."""
    slow = slower(vehicle, actuator, factor)
    gains = rule.tune(slow, board)
    phase, crossover = margins_by_python_control(slow, board, gains, loop)
    assert phase == pytest.approx(60.0, abs=0.5)
    assert crossover < 0.9 * margins_by_python_control(vehicle, board, ruled, loop)[1]
    table = getattr(gains, loop)
    controller = abs(table.kp + 1j * (table.kd * crossover - table.ki / crossover))
    speed = 0.03 * rule.LARGEST_STEP[loop] * crossover * controller
    assert speed == pytest.approx(getattr(slow.actuators, actuator).rate, rel=0.15)


def test_reference_filters_and_all_other_gains_are_kept(vehicle, board):
    own = Control(pitch=PitchGains(kp=9.0, reference=ReferenceTable(wn=0.3, zeta=0.8)), estimator="measured")
    gains = rule.tune(msgspec.structs.replace(vehicle, control=own), board)
    assert gains.pitch.reference == own.pitch.reference
    assert gains.pitch.kp != 9.0
    assert gains.estimator == "measured"


def test_what_cannot_be_tuned_is_said_in_one_line(vehicle, board):
    fast = Control(pitch=PitchGains(reference=ReferenceTable(wn=10.0)))
    quick = slower(msgspec.structs.replace(vehicle, control=fast), "slider", 1e4)
    with pytest.raises(InputError, match=r" 60 deg at .* rad/s"):
        rule.tune(quick, board)
