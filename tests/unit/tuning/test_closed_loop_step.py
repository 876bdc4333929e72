"""The linear loops, delays and all, against flights: the difference that a small step of a target makes."""

import msgspec
import numpy as np
import pytest
from test_plant import flight_state

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.vehicle.layout import N_X, X_POS
from glider.firmware.guidance.mission import Leg, Mission, Site
from glider.firmware.model.gains import Control
from glider.sim_backend.core.closed_loop import N_END, N_TRACE, TRACE, fly
from glider.sim_backend.world import Environment, Start, build_world
from glider.tools.study.tuning.linear_plant import DESIGN_TRIMS, OTHER_TRIMS, linearise, steady_glide
from glider.tools.study.tuning.loops import Delays
from tests.independent.loops import closed

SECONDS = 30.0
QUIET = Environment(surface=False, disturbance_linear=0.0, disturbance_angular=0.0)
PERIODS = {"imu": 0.02, "beacon": 0.04, "wires": 0.04}


def flown(vehicle, board, trim, leg, column):
    """A column of the trace of a flight that starts in the trim, sensors exact."""
    control_ = msgspec.structs.replace(Control(), estimator="measured")
    site = Site(name="deep", depth_m=200.0)
    mission = Mission(format=1, name="step", time_limit_s=900.0, site=site, leg=[leg], control=control_)
    pilot = Autopilot(vehicle, mission, configuration(vehicle, mission, dt=0.02, periods=PERIODS))
    world = build_world(vehicle, QUIET, board.sensors, Start(depth_m=30.0), 0)
    world.errors[:] = 0.0
    world.x[:N_X] = flight_state(steady_glide(world.P, trim))
    world.x[X_POS + 2] = 30.0
    ticks = round(SECONDS / 0.02)
    trace = np.zeros((ticks, N_TRACE))
    fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
        world.errors, world.seed, world.x, world.dt, ticks, 1, trace, np.zeros(N_END),
    )  # fmt: skip
    return trace[:, TRACE.index(column)]


def predicted(vehicle, board, trim, step, wn, output):
    """The same difference by the linear loops, behind the reference filter (zeta = 1)."""
    import control

    t = np.arange(round(SECONDS / 0.02)) * 0.02
    t = np.maximum(t - 0.02, 0.0)  # the first depth arrives a tick late, and the mission waits for it
    position, rate = step * (1.0 - np.exp(-wn * t) * (1.0 + wn * t)), step * wn * wn * t * np.exp(-wn * t)
    inputs = np.zeros((4, len(t)))
    inputs[[0, 1] if output == "pitch" else [2, 3]] = position, rate
    loops = closed(
        vehicle.vector(), linearise(vehicle.vector(), trim), Delays.of(board), Control(), outputs=[output],
        ballast=0.0 if output == "pitch" else 1.0,
    )  # fmt: skip
    return control.forced_response(loops, np.arange(len(t)) * 0.02, inputs).outputs.view(np.ndarray)


@pytest.mark.parametrize("trim", DESIGN_TRIMS, ids=lambda trim: trim.name)
def test_a_step_of_pitch_in_a_glide(vehicle, board, trim):
    before = np.degrees(trim.pitch)
    legs = [Leg(pitch_deg=before + step, duration_s=2 * SECONDS, ballast_kg=trim.ballast) for step in (0.0, 0.5)]
    still, stepped = (flown(vehicle, board, trim, leg, "true_pitch") for leg in legs)
    wanted = predicted(vehicle, board, trim, np.radians(0.5), Control().pitch.reference.wn, "pitch")
    assert np.abs(stepped - still - wanted).max() < 0.02 * np.radians(0.5)


def test_a_step_of_depth_from_rest(vehicle, board):
    rest = OTHER_TRIMS[0]
    legs = [Leg(pitch_deg=0.0, depth_m=30.0 + step, time_limit_s=900.0, hold_s=900.0) for step in (0.0, 0.05)]
    still, stepped = (flown(vehicle, board, rest, leg, "true_depth") for leg in legs)
    wanted = predicted(vehicle, board, rest, 0.05, Control().depth.reference.wn, "depth")
    assert np.abs(stepped - still - wanted).max() < 0.02 * 0.05
