"""The supervisor, last before the ports: of all reactions asked for the highest wins, and limits have the last word.

`screen` (core/screening) runs before the autopilot's tick, `guard` after it. From ABORT on a reaction is latched.
"""

import math

from glider.firmware.core.control.guidance import abort
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.supervision import detectors
from glider.firmware.core.supervision.screening import start_place
from glider.firmware.core.supervision.surface import watch_surface
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_table, limited

ROUNDING = 1e-9


@kernel
def highest(asked, enabled, before):
    """The highest reaction asked for by an enabled row, and the first row that did; latched from ABORT on.

    asked, enabled (N_ROWS,); before: the reaction until now. Returns reaction, row; row 0 where `before` stands.
    """
    reaction, row = sup.NOTHING, 0
    for i in range(1, sup.N_ROWS):
        if enabled[i] == 1.0 and asked[i] > reaction:
            reaction, row = asked[i], i
    if before >= sup.ABORT and before >= reaction:
        return before, 0
    return reaction, row


@kernel
def standing(G, row, t):
    """Return what a row requests: below ABORT a reaction stands for its clear time (s) after its condition has ended.

    Until that time a milder request of the same row does not replace it. From ABORT on `highest` latches a reaction.
    """
    asked, kept = G[sup.ASKED + row], t < G[sup.KEPT_UNTIL + row]
    if asked == sup.NOTHING and not kept:
        return sup.NOTHING
    if asked >= sup.ABORT:
        return asked
    if kept and asked < G[sup.KEPT + row]:
        return G[sup.KEPT + row]
    G[sup.KEPT + row], G[sup.KEPT_UNTIL + row] = asked, t + G[sup.CLEARS + row]
    return asked


@kernel
def stands(G, row):
    """Return whether an enabled row requests a reaction in this tick, or requested one that still stands."""
    return G[sup.ASKED + row] * G[sup.ENABLED + row] > 0.0


@kernel
def arbitrate(G, t):
    """This tick's reaction and who asked for it; what each row asked for first and at most."""
    G[sup.CHANGED] = 0.0
    for row in range(1, sup.N_ROWS):
        G[sup.ASKED + row] = standing(G, row, t)
        asked = G[sup.ASKED + row] * G[sup.ENABLED + row]
        if asked > G[sup.WORST + row]:
            if G[sup.FIRST + row] < 0.0:
                G[sup.FIRST + row] = t
            G[sup.WORST + row] = asked
            G[sup.CHANGED] = 1.0
    reaction, row = highest(
        G[sup.ASKED : sup.ASKED + sup.N_ROWS], G[sup.ENABLED : sup.ENABLED + sup.N_ROWS], G[sup.HIGHEST]
    )
    if row > 0 or reaction < sup.ABORT:
        G[sup.HIGHEST_ROW] = row
    G[sup.HIGHEST] = reaction


@kernel
def goal(P, G, cmd, ap, i):
    """Where actuator i (servo, slider, ballast) is to go under this tick's reaction; NaN: it is left alone."""
    if i > 0 and G[sup.STOPPED + i - 1] == 1.0:
        return G[sup.SENT + i]
    if G[sup.HIGHEST] >= sup.ABORT:
        return 0.0 if i == 0 else P[layout.ACTUATORS[i]]
    if (i == 0 and ap[ctl.MODE] == ctl.WAITING) or (i > 0 and G[sup.PLACED + i - 1] == 0.0):
        return math.nan
    if G[sup.HIGHEST] == sup.HOLD:
        return G[sup.SENT + i]
    if i == 0 and stands(G, sup.FAULT_SERVO_LOST):
        return 0.0
    return cmd[i] if math.isfinite(cmd[i]) else G[sup.SENT + i]


@kernel
def act(P, G, cmd, ap, t):
    """Limits last: into cmd (3,) what may be sent, and what was sent into every memory."""
    for i in range(3):
        low, high, rate, _ = actuator_table(P, layout.ACTUATORS[i])
        wanted = goal(P, G, cmd, ap, i)
        if i > 0 and t < G[sup.REST_UNTIL + i - 1] and G[sup.HIGHEST] < sup.HOLD:
            wanted = G[sup.MARK + i - 1]  # where it stands
        last = G[sup.SENT + i]
        beyond = abs(ap[ctl.WANTED_SERVO + i]) > detectors.IMPOSSIBLE * (high - low)
        if G[sup.ENABLED + sup.FAULT_NO_ANSWER] == 1.0 and beyond and G[sup.HIGHEST] < sup.ABORT:
            wanted = last
        sent = limited(wanted, last, low, high, rate, G[sup.TICK])
        cmd[i] = math.nan if math.isnan(wanted) else sent
        G[sup.SENT + i] = ap[ctl.SENT_SERVO + i] = sent


@kernel
def watch_limits(P, G, cmd):
    """Row 15: asked to go past a limit; clamped in `act`."""
    for i in range(3):
        if cmd[i] < P[layout.ACTUATORS[i]] - ROUNDING or cmd[i] > P[layout.ACTUATORS[i] + 1] + ROUNDING:
            detectors.request(G, sup.FAULT_SOFT_LIMIT, sup.LEVEL_1)


@kernel
def watch_moves(P, G, frame, scale, t):
    """Row 14, as the draw-wires see it; a wire that is lost says nothing."""
    G[sup.RING_AT] = (G[sup.RING_AT] + 1.0) % sup.N_RING
    for i in range(2):
        start, place = sup.STARTS[sup.SENSOR_SLIDER + i], i * sup.N_RING + int(G[sup.RING_AT])
        low, high, rate, tau = actuator_table(P, layout.ACTUATORS[i + 1])
        factor, span = 1.0 if i == 0 else scale, high - low
        start_place(G, frame, i, factor, 0.03 * span)
        G[sup.RING + place], G[sup.SENT_RING + place] = math.nan, G[sup.SENT + 1 + i]
        if frame[start + 1] == sup.VALID and G[sup.PLACED + i] == 1.0:
            G[sup.RING + place] = factor * frame[start + 2]
            detectors.watch_move(G, i, G[sup.RING + place], rate, tau, span, t)
        elif G[sup.PLACED + i] == 0.0 and t - G[sup.BEGAN] > G[sup.LOST_AFTER + sup.SENSOR_SLIDER + i]:
            G[sup.PLACED + i] = 1.0  # no wire: from where it was sent last, as far as is known


@kernel
def guard(P, C, G, frame, est, ap, cmd, t):
    """All detectors, the reaction, the limits: cmd (3,) servo rad, slider m, ballast kg, in and out, at time t (s).

    P (N_P,), C (N_C,), G (N_G,), frame (FRAME_SIZE,), est (N_EST,), ap (N_AP,).
    """
    for row in range(sup.N_ROWS):
        G[sup.ASKED + row] = sup.NOTHING
    scale = P[layout.PLUNGER_AREA] * (est[ctl.EST_DENSITY] if est[ctl.EST_DENSITY] > 0.0 else 1000.0)
    detectors.watch_sensors(G, frame, t)
    detectors.watch_states(G, frame, t)
    watch_moves(P, G, frame, scale, t)
    if est[ctl.EST_BEACON_TIME] >= 0.0:
        detectors.watch_depth(G, est, ap, t)
    detectors.watch_ascent(G, est, ap, t)
    detectors.watch_attitude(G, est, ap, t)
    detectors.watch_law(P, C, G, ap)
    detectors.watch_estimate(G, ap)
    detectors.watch_loop(G, t)
    watch_limits(P, G, cmd)
    arbitrate(G, t)
    act(P, G, cmd, ap, t)
    watch_surface(P, G, est, ap, scale, t)
    cautious = stands(G, sup.FAULT_DISAGREE) or stands(G, sup.FAULT_STEEP) or stands(G, sup.FAULT_NO_ANSWER)
    ap[ctl.CAUTIOUS] = 1.0 if cautious else 0.0
    if G[sup.HIGHEST] >= sup.ABORT and ap[ctl.MODE] < ctl.COMPLETED:
        abort(ap, ctl.REASON_FAULT + G[sup.HIGHEST_ROW])
    ap[ctl.SUPERVISED] = 1.0
    ap[ctl.AP_REACTION], ap[ctl.AP_FAULT_ROW] = G[sup.HIGHEST], G[sup.HIGHEST_ROW]
