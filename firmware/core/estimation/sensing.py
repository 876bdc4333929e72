"""From the sample frame to measured quantities: freshness, depth, depth rate, net ballast mass (paper 3.1)."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle.layout import GRAVITY, PLUNGER_AREA
from glider.firmware.core.vehicle.seawater import water_density
from glider.hal.ports import BEACON, IMU, MAX_AGE_PERIODS, PLUNGER_WIRE, SLIDER_WIRE


@kernel
def longest_age(period, tick):
    """Age (s) past which a sample counts for nothing: MAX_AGE_PERIODS of its sensor, and the tick that looks at it."""
    return MAX_AGE_PERIODS * period + tick


@kernel
def usable(frame, start, width, newest, now, max_age):
    """True if the slot at `start` holds a valid, finite sample newer than `newest` and not older than max_age (s)."""
    time = frame[start]
    if frame[start + 1] != 1.0 or not time > newest or time > now + 1e-6 or now - time > max_age:
        return False
    finite = True
    for i in range(width):
        finite = finite and math.isfinite(frame[start + 2 + i])
    return finite


@kernel
def ballast_mass(density, plunger_area, plunger):
    """Net ballast mass (kg) from the plunger's travel (m): m_b = rho A_p dr_b."""
    return density * plunger_area * plunger


@kernel
def track_depth(est, depth, h, wn):
    """Depth and its rate by a critically damped second-order observer, a step of h (s) from sample to sample."""
    gain = min(wn * h, 1.0)
    predicted = est[ctl.EST_DEPTH] + est[ctl.EST_DEPTH_RATE] * h
    innovation = depth - predicted
    # double pole at exp(-gain): the discrete alpha-beta filter with the same two real poles
    z = math.exp(-gain)
    est[ctl.EST_DEPTH] = predicted + (1.0 - z * z) * innovation
    est[ctl.EST_DEPTH_RATE] += (1.0 - z) * (1.0 - z) / h * innovation


@kernel
def sense_beacon(C, frame, est):
    """Water density, depth and, where nothing better filters it, depth rate from a new beacon sample."""
    gauge = frame[BEACON + 2] - C[ctl.SURFACE_PRESSURE]
    # the mean of the column above is half way between the surface's density and this one
    density = water_density(gauge, frame[BEACON + 3], C[ctl.SALINITY])
    column = 0.5 * (density + water_density(0.0, frame[BEACON + 3], C[ctl.SALINITY]))
    depth = gauge / (column * GRAVITY)
    est[ctl.EST_DENSITY] = density
    est[ctl.NEW_DEPTH] = depth
    if est[ctl.EST_BEACON_TIME] < 0.0:
        est[ctl.EST_DEPTH], est[ctl.EST_DEPTH_RATE] = depth, 0.0
    elif C[ctl.ESTIMATOR] == ctl.MEASURED:
        track_depth(est, depth, frame[BEACON] - est[ctl.EST_BEACON_TIME], C[ctl.DEPTH_FILTER_WN])
    est[ctl.EST_BEACON_TIME] = frame[BEACON]


@kernel
def sense(P, C, frame, est, now):
    """Take every new, valid sample of the frame into `est`; what is missing, late or not finite leaves it as it was."""
    if usable(frame, IMU, 6, est[ctl.EST_IMU_TIME], now, C[ctl.MAX_AGE_IMU]):
        est[ctl.EST_IMU_TIME] = frame[IMU]
        for i in range(6):
            est[ctl.NEW_ROLL + i] = frame[IMU + 2 + i]
    if usable(frame, BEACON, 2, est[ctl.EST_BEACON_TIME], now, C[ctl.MAX_AGE_BEACON]):
        sense_beacon(C, frame, est)
    if usable(frame, SLIDER_WIRE, 1, est[ctl.EST_SLIDER_TIME], now, C[ctl.MAX_AGE_WIRE]):
        est[ctl.EST_SLIDER_TIME] = frame[SLIDER_WIRE]
        est[ctl.NEW_SLIDER] = frame[SLIDER_WIRE + 2]
    if est[ctl.EST_DENSITY] > 0.0 and usable(
        frame, PLUNGER_WIRE, 1, est[ctl.EST_PLUNGER_TIME], now, C[ctl.MAX_AGE_WIRE]
    ):
        est[ctl.EST_PLUNGER_TIME] = frame[PLUNGER_WIRE]
        est[ctl.NEW_BALLAST] = ballast_mass(est[ctl.EST_DENSITY], P[PLUNGER_AREA], frame[PLUNGER_WIRE + 2])
    if est[ctl.EST_IMU_TIME] >= 0.0 and est[ctl.EST_BEACON_TIME] >= 0.0:
        est[ctl.EST_STARTED] = 1.0


@kernel
def take_as_measured(est):
    """The estimate without a filter: the newest samples as they are (depth and its rate come from the observer)."""
    for i in range(6):
        est[ctl.EST_ROLL + i] = est[ctl.NEW_ROLL + i]
    est[ctl.EST_SLIDER] = est[ctl.NEW_SLIDER]
    est[ctl.EST_BALLAST] = est[ctl.NEW_BALLAST]
