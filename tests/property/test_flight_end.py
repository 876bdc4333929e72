"""Nobody loses the vehicle at a flight's end: whenever and whyever a dive is given up, and with the board closed, the
plant is at the surface five minutes later. By the plant's truth, never by what the flight says of itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle.layout import NET_MASS
from glider.firmware.faults import Reaction
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.compose import build_flight
from glider.tools.verify.faults.cases import FaultCase
from glider.tools.verify.faults.flights import flown
from glider.tools.verify.faults.scene import SURFACED_M, fly, set_scene
from tests.support.examples import examples

pytestmark = pytest.mark.computes(seconds=55)

MISSIONS = {"sawtooth": 9600, "spiral": 4200, "circle_to_s": 12_000}  # ticks, generously
START_M = 0.1  # floats, and is heavier from the first leg on
ADRIFT = "deep five minutes after the end"


def operator(scene):
    scene.pilot.give_up()


ABORTS = [
    FaultCase(sup.FAULT_EXCEPTION, "operator", operator, Reaction.NOTHING, 0.0),
    *[case for case in flown() if case.expected >= Reaction.ABORT],
]


def depth_after(mission: str, case: FaultCase, tick: int, sigmas: float) -> float:
    """Depth of the plant (m) five minutes after the end of a flight that a case befell at a tick."""
    flight = build_flight(mission=mission, effects=case.setting.effects)
    scene = set_scene(flight, "", case.begin, case.setting, at_s=tick / flight.board.loop_hz)
    scene.world.P[NET_MASS] += sigmas * load_vehicle("roughie").uncertainty.net_mass
    scene.world.x[2] = START_M
    scene.late = case.late
    fly(scene, case.row, allowed_s=0.0)
    scene.finish()
    assert scene.left is not None
    return scene.left


@examples(250)
@given(
    mission=st.sampled_from(sorted(MISSIONS)),
    case=st.sampled_from(ABORTS),
    share=st.floats(0.0, 1.0),
    sigmas=st.floats(0.0, 3.0),
)
def test_given_up_at_any_tick_for_any_reason_it_floats_five_minutes_later(mission, case, share, sigmas):
    tick = round(share * MISSIONS[mission])
    assert depth_after(mission, case, tick, sigmas) < SURFACED_M, ADRIFT


@pytest.mark.parametrize("mission", sorted(MISSIONS))
@pytest.mark.parametrize("tick", [0, 1, 60, 81, 110, 200, 10**6])
@pytest.mark.parametrize("sigmas", [0.0, 3.0])
def test_the_first_seconds_and_the_very_end(mission, tick, sigmas):
    """Given up before it has sunk, when the ballast is still heavy; and never (10**6): the mission's own end."""
    assert depth_after(mission, ABORTS[0], tick, sigmas) < SURFACED_M, ADRIFT
