"""A filter that is not finite: restarted from the measured values in the same tick, and counted."""

import math

import numpy as np
import pytest

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.vehicle.layout import X_DOWN, X_NU, X_QUAT
from glider.hal.ports import BEACON, IMU, PLUNGER_WIRE, SLIDER_WIRE
from glider.tools.data.sources import load_mission, load_vehicle

DT = 0.02
DEPTH, ROLL, PITCH = 1.5, 0.05, -0.3
BROKEN = {
    "depth": ctl.NAV_X + X_DOWN,
    "attitude": ctl.NAV_X + X_QUAT,
    "speed": ctl.NAV_X + X_NU,
    "model error": ctl.NAV_X + kf.X_ERR,
    "variance": ctl.NAV_COV + kf.E_NU * (kf.N_E + 1),
    "covariance": ctl.NAV_COV + kf.E_NU * kf.N_E + kf.E_ATT,
}


def feed(pilot: Autopilot, tick: int) -> None:
    """One tick of samples that are new and steady."""
    for start, values in (
        (IMU, (ROLL, PITCH, 0.0, 0.01, 0.02, 0.03)),
        (BEACON, (101325.0 + 998.2 * 9.80665 * DEPTH, 20.0)),
        (SLIDER_WIRE, (0.01,)),
        (PLUNGER_WIRE, (0.002,)),
    ):
        pilot.frame[start], pilot.frame[start + 1] = tick * DT, 1.0
        pilot.frame[start + 2 : start + 2 + len(values)] = values
    pilot.tick(tick * DT)


@pytest.fixture
def pilot() -> Autopilot:
    """Two seconds into a dive."""
    vehicle, (_, source, mission) = load_vehicle("roughie"), load_mission("sawtooth")
    periods = {"imu": 0.02, "beacon": 0.02, "wires": 0.02}
    pilot = Autopilot(vehicle, mission, configuration(vehicle, mission, dt=DT, periods=periods), source)
    for tick in range(100):
        feed(pilot, tick)
    assert pilot.ap[ctl.FILTER_RESTARTS] == 0.0
    return pilot


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("place", BROKEN)
def test_the_estimate_is_the_measured_values_and_goes_on_from_them(pilot, place, value):
    calm = pilot.nav[ctl.NAV_CALM]
    pilot.nav[BROKEN[place]] = value
    for tick in range(100, 103):  # a covariance shows in a variance one step later
        feed(pilot, tick)
        assert np.isfinite(pilot.est).all()
        assert pilot.est[ctl.EST_DEPTH] == pytest.approx(DEPTH, abs=0.03)
        assert pilot.est[ctl.EST_PITCH] == pytest.approx(PITCH, abs=0.03)
        assert pilot.est[ctl.EST_ROLL] == pytest.approx(ROLL, abs=0.03)
    assert pilot.ap[ctl.FILTER_RESTARTS] >= 1.0
    restarts = pilot.ap[ctl.FILTER_RESTARTS]
    for tick in range(103, 200):
        feed(pilot, tick)
    assert pilot.ap[ctl.FILTER_RESTARTS] == restarts
    assert np.isfinite(pilot.nav[ctl.NAV_X : ctl.NAV_X + kf.N_XE]).all()
    assert pilot.nav[ctl.NAV_CALM] == calm


def test_the_tick_of_a_restart_has_the_measured_values_and_the_last_position(pilot):
    place = pilot.est[[ctl.EST_X, ctl.EST_Y]].copy()
    pilot.nav[ctl.NAV_X + X_NU] = math.nan
    feed(pilot, 100)
    est = pilot.est
    assert est[ctl.EST_DEPTH] == est[ctl.NEW_DEPTH]
    assert est[ctl.EST_ROLL : ctl.EST_R + 1] == pytest.approx(est[ctl.NEW_ROLL : ctl.NEW_R + 1], abs=1e-12)
    assert est[[ctl.EST_SLIDER, ctl.EST_BALLAST]] == pytest.approx(est[[ctl.NEW_SLIDER, ctl.NEW_BALLAST]])
    assert (est[[ctl.EST_X, ctl.EST_Y]] == place).all()
    assert place.any()
    assert est[ctl.NOISE_SCALE] == 1.0


def test_a_restart_forgets_the_roughness_of_the_water(pilot):
    linear = ctl.NAV_SETTINGS + kf.S_LINEAR
    pilot.nav[linear] = 100.0 * pilot.nav[ctl.NAV_CALM]
    pilot.nav[ctl.NAV_X + X_NU] = math.nan
    feed(pilot, 100)
    assert pilot.nav[linear] == pilot.nav[ctl.NAV_CALM]
