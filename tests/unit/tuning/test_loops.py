"""Margins: of loops whose margins are known, against python-control, and against what they promise."""

import math

import msgspec
import numpy as np
import pytest

from glider.firmware.model.gains import Control
from glider.tools.study.tuning.linear_plant import DESIGN_TRIMS, OTHER_TRIMS, linearise
from glider.tools.study.tuning.loops import OMEGA, Delays, depth_terms, margins, open_loop, pitch_terms
from tests.independent.loops import closed, opened

TRIMS = [*DESIGN_TRIMS, *OTHER_TRIMS]
FACTOR = {"pitch": "slider", "depth": "ballast"}


def loop_of(vehicle, board, trim, loop, gains=None, omega=OMEGA):
    P, delays, plant, gains = vehicle.vector(), Delays.of(board), linearise(vehicle.vector(), trim), gains or Control()
    if loop == "pitch":
        return open_loop(gains.pitch, pitch_terms(plant, delays, omega))
    terms = depth_terms(P, plant, delays, gains.pitch, gains.depth.rate_bandwidth, omega)
    return open_loop(gains.depth, terms)


def test_an_integrator_with_delay_has_the_margins_of_the_textbook():
    k, delay = 0.8, 0.5
    found = margins(k * np.exp(-1j * OMEGA * delay) / (1j * OMEGA))
    assert found.crossover == pytest.approx(k, rel=1e-4)
    assert found.phase == pytest.approx(90.0 - math.degrees(k * delay), abs=1e-2)
    assert found.gain == pytest.approx(math.pi / (2.0 * k * delay), rel=1e-4)
    assert found.delay == pytest.approx((math.pi / 2.0) / k - delay, rel=1e-4)
    assert found.gain_down == 0.0


def test_a_loop_that_may_not_lose_gain_says_so():
    """(s + 1)^2 k / s^3 is stable for k > 1/2 only: at k = 2 the gain may fall by four."""
    s = 1j * OMEGA
    found = margins(2.0 * (s + 1.0) ** 2 / s**3)
    assert found.gain == math.inf
    assert found.gain_down == pytest.approx(0.25, rel=1e-3)


def test_a_loop_below_one_never_crosses():
    found = margins(0.1 / (1j * OMEGA + 1.0))
    assert math.isnan(found.crossover)
    assert found.delay == math.inf


@pytest.mark.parametrize("loop", ["pitch", "depth"])
@pytest.mark.parametrize("trim", TRIMS, ids=lambda trim: trim.name)
def test_frequency_response_and_margins_are_python_controls(vehicle, board, trim, loop):
    """Another wiring, Pade for the delays: the same curve, and python-control's margins of it."""
    import control

    P, plant = vehicle.vector(), linearise(vehicle.vector(), trim)
    theirs = opened(P, plant, Delays.of(board), Control(), loop)
    few = np.geomspace(0.05, 20.0, 50)
    assert theirs(1j * few) == pytest.approx(loop_of(vehicle, board, trim, loop, omega=few), rel=1e-6)
    mine = margins(loop_of(vehicle, board, trim, loop))
    curve = control.frd(theirs(1j * np.geomspace(0.02, 60.0, 2500)), np.geomspace(0.02, 60.0, 2500))
    gains, phases, _, _, crossovers, _ = control.stability_margins(curve, returnall=True)
    assert mine.crossover == pytest.approx(crossovers.max(), rel=1e-3)
    assert mine.phase == pytest.approx(phases[np.argmin(np.abs(phases))], abs=0.1)
    assert mine.gain == pytest.approx(gains[gains > 1.0].min(), rel=5e-3)


@pytest.mark.parametrize("loop", ["pitch", "depth"])
@pytest.mark.parametrize("trim", [DESIGN_TRIMS[0], OTHER_TRIMS[0]], ids=lambda trim: trim.name)
def test_margins_are_where_the_closed_loop_ends(vehicle, board, trim, loop):
    """The closed loop's poles are left of the axis just within the gain and delay margins, and right of it beyond."""
    P, plant, delays = vehicle.vector(), linearise(vehicle.vector(), trim), Delays.of(board)
    found, wire = margins(loop_of(vehicle, board, trim, loop)), FACTOR[loop]
    # the depth loop is open for pitch: its own wire is cut
    rest = {"ballast": 0.0} if loop == "pitch" else {}

    def worst_pole(**wiring):
        poles = closed(P, plant, delays, Control(), **{**rest, **wiring}).poles()
        moving = poles[np.abs(poles) > 0.02]  # what is cut off, or drifts at rest, stays at the origin
        return moving.real.max()

    assert worst_pole() < 0.0
    assert worst_pole(**{wire: 0.97 * found.gain}) < 0.0 < worst_pole(**{wire: 1.03 * found.gain})
    assert worst_pole(further={wire: 0.97 * found.delay}) < 0.0 < worst_pole(further={wire: 1.03 * found.delay})


def test_delays_are_the_way_to_the_tick_and_half_the_hold(board):
    assert Delays.of(board) == Delays(imu=0.01, beacon=0.04, plunger=0.04)
    for delay, wanted in ((0.0, 0.01), (0.01, 0.02), (0.011, 0.03)):
        imu = msgspec.structs.replace(board.sensors.imu, rate_hz=100.0, delay_s=delay)
        sensors = msgspec.structs.replace(board.sensors, imu=imu)
        assert Delays.of(msgspec.structs.replace(board, sensors=sensors)).imu == pytest.approx(wanted)


def test_terms_are_linear_in_the_gains(vehicle, board):
    omega = np.geomspace(0.1, 10.0, 5)
    plant, gains = linearise(vehicle.vector(), DESIGN_TRIMS[0]), Control().pitch
    double = msgspec.structs.replace(gains, kp=2 * gains.kp, ki=2 * gains.ki, kd=2 * gains.kd)
    terms = pitch_terms(plant, Delays.of(board), omega)
    assert open_loop(double, terms) == pytest.approx(2.0 * open_loop(gains, terms))
    both = np.array([terms, 3.0 * terms])
    assert open_loop(gains, both)[1] == pytest.approx(3.0 * open_loop(gains, terms))
