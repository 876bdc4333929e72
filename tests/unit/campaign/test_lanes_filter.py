"""Filters side by side: one that is not finite is restarted as that of a single flight, and its neighbours fly on."""

import math

import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.maths.wide import LANES
from glider.firmware.core.vehicle.layout import N_X, X_NU
from glider.sim_backend.core.closed_loop_lanes import estimate_lanes
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.sources import load_mission, load_vehicle

DT = 0.02
BROKEN = 2


def estimates(broken: bool) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (LANES, N_EST) and restarts (LANES,) after twenty ticks; at the tenth, a number of one lane is none."""
    vehicle, (_, source, mission) = load_vehicle("roughie"), load_mission("sawtooth")
    C = configuration(vehicle, mission, dt=DT, periods={"imu": DT, "beacon": DT, "wires": DT})
    pilot = Autopilot(vehicle, mission, C, source)
    Cs, members, flying = np.tile(pilot.C, (LANES, 1)), np.arange(LANES), np.ones(LANES, dtype=np.bool_)
    ests, aps, navs = (np.tile(row, (LANES, 1)) for row in (pilot.est, pilot.ap, pilot.nav))
    x, est, nav = np.zeros((ef.N_XF, LANES)), np.zeros((ctl.N_EST, LANES)), np.zeros((ctl.N_NAV, LANES))
    assert x.shape[0] >= N_X
    for tick in range(20):
        ests[:, ctl.NEW_DEPTH], ests[:, ctl.NEW_PITCH] = 1.0 + 0.1 * np.arange(LANES), -0.2
        ests[:, ctl.EST_IMU_TIME : ctl.EST_PLUNGER_TIME + 1] = tick * DT
        ests[:, ctl.EST_STARTED], ests[:, ctl.EST_DENSITY] = 1.0, 998.0
        if broken and tick == 10:
            nav[ctl.NAV_X + X_NU, BROKEN] = math.nan
        estimate_lanes(pilot.P, Cs, members, flying, ests, aps, navs, x, est, nav, np.zeros((3, LANES)), tick * DT)
    return ests, aps[:, ctl.FILTER_RESTARTS]


def test_a_filter_that_is_not_finite_is_restarted_in_its_lane_alone():
    well, none = estimates(broken=False)
    found, restarts = estimates(broken=True)
    assert not none.any()
    assert list(restarts) == [float(lane == BROKEN) for lane in range(LANES)]
    others = [lane for lane in range(LANES) if lane != BROKEN]
    np.testing.assert_array_equal(found[others], well[others])
    assert np.isfinite(found[BROKEN]).all()
    assert abs(found[BROKEN, ctl.EST_DEPTH] - 1.2) < 0.02
