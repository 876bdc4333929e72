"""Has the flight ended? A vehicle counts as surfaced once it floats there by measurement, and will go on to.

After the mission's end, or once the dive was given up: every depth measured in the last surfaced_s shallower than
surface_m, one at least, and the ballast measured at its light end. A ballast that makes no progress towards that end
for the time of the whole way (times stall_factor) is given up: at the surface the flight then hands the pump over to
the out-of-band process.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.supervision.detectors import held_for, lost
from glider.firmware.core.vehicle.actuators import actuator_table
from glider.firmware.core.vehicle.layout import ACTUATORS

LIGHT_RANGE_SHARE = 0.05  # of the ballast's range: nearer to its light end, it is there


@kernel
def measured_ballast(G, scale):
    """Net ballast mass (kg) by the newest fit sample of the plunger's draw-wire; scale: kg per metre of wire."""
    return scale * G[sup.LAST + sup.PLACES[sup.SENSOR_PLUNGER]]


@kernel
def watch_surface(P, G, est, ap, scale, t):
    """Write G[ENDING] at time t (s): UNDER_WAY, AT_SURFACE, PUMP_GIVEN_UP or NO_WAY_LEFT; scale: kg per metre of wire.

    P (N_P,), G (N_G,), est (N_EST,), ap (N_AP,).
    """
    G[sup.ENDING], G[sup.CLOCK] = sup.UNDER_WAY, t
    over = ap[ctl.MODE] >= ctl.COMPLETED
    known = t - G[sup.TAKEN + sup.SENSOR_BEACON] < G[sup.SURFACED_TIME]
    shallow = over and known and est[ctl.NEW_DEPTH] < G[sup.SURFACE_DEPTH]
    held = held_for(G, sup.T_SURFACE, shallow, t) >= G[sup.SURFACED_TIME]
    if not over:
        return
    low, high, rate, tau = actuator_table(P, ACTUATORS[2])
    near = LIGHT_RANGE_SHARE * (high - low)
    ballast = math.nan if lost(G, sup.SENSOR_PLUNGER, t) else measured_ballast(G, scale)
    if math.isnan(G[sup.PUMP_SINCE]) or ballast < G[sup.PUMP_MARK] - 0.1 * near:
        G[sup.PUMP_MARK], G[sup.PUMP_SINCE] = ballast if math.isfinite(ballast) else math.inf, t
    if held and ballast <= low + near:
        G[sup.ENDING] = sup.AT_SURFACE
    elif G[sup.HIGHEST] >= sup.HW:
        G[sup.ENDING] = sup.NO_WAY_LEFT
    elif held and t - G[sup.PUMP_SINCE] > G[sup.STALL_FACTOR] * ((high - low) / rate + tau):
        G[sup.ENDING] = sup.PUMP_GIVEN_UP
