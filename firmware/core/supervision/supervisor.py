"""The supervisor, last before the ports: of all reactions asked for the highest wins, and limits have the last word.

`screen` (core/screening) runs before the autopilot's tick, `guard` after it. From ABORT on a reaction is latched.
"""

import math

from firmware.core.control import control_layout as ctl
from firmware.core.control.guidance import abort
from firmware.core.jit import kernel
from firmware.core.supervision import supervisor_layout as at
from firmware.core.supervision.detectors import (
    ABSURD,
    ask,
    watch_ascent,
    watch_attitude,
    watch_depth,
    watch_law,
    watch_loop,
    watch_move,
    watch_sensors,
    watch_states,
)
from firmware.core.supervision.limits import limited
from firmware.core.supervision.screening import start_place
from firmware.core.vehicle.layout import (
    BALLAST_MIN,
    BALLAST_RATE,
    BALLAST_TAU,
    PLUNGER_AREA,
    SERVO_MIN,
    SERVO_RATE,
    SLIDER_MIN,
    SLIDER_RATE,
    SLIDER_TAU,
)

MINS, RATES = (SERVO_MIN, SLIDER_MIN, BALLAST_MIN), (SERVO_RATE, SLIDER_RATE, BALLAST_RATE)
ROUNDING = 1e-9


@kernel
def highest(asked, enabled, before):
    """The highest reaction asked for by an enabled row, and the first row that did; latched from ABORT on.

    asked, enabled (N_ROWS,); before: the reaction until now. Returns reaction, row; row 0 where `before` stands.
    """
    reaction, row = at.NOTHING, 0
    for i in range(1, at.N_ROWS):
        if enabled[i] == 1.0 and asked[i] > reaction:
            reaction, row = asked[i], i
    if before >= at.ABORT and before >= reaction:
        return before, 0
    return reaction, row


@kernel
def settle(G, t):
    """This tick's reaction and who asked for it; what each row asked for first and at most."""
    G[at.CHANGED] = 0.0
    for row in range(1, at.N_ROWS):
        asked = G[at.ASKED + row] * G[at.ENABLED + row]
        if asked > G[at.WORST + row]:
            if G[at.FIRST + row] < 0.0:
                G[at.FIRST + row] = t
            G[at.WORST + row] = asked
            G[at.CHANGED] = 1.0
    reaction, row = highest(G[at.ASKED : at.ASKED + at.N_ROWS], G[at.ENABLED : at.ENABLED + at.N_ROWS], G[at.REACTION])
    if row > 0 or reaction < at.ABORT:
        G[at.ROW] = row
    G[at.REACTION] = reaction


@kernel
def goal(P, G, cmd, ap, i):
    """Where actuator i (servo, slider, ballast) is to go under this tick's reaction; NaN: it is left alone."""
    if i > 0 and G[at.STOPPED + i - 1] == 1.0:
        return G[at.SENT + i]
    if G[at.REACTION] >= at.ABORT:
        return 0.0 if i == 0 else P[MINS[i]]
    if (i == 0 and ap[ctl.MODE] == ctl.WAITING) or (i > 0 and G[at.PLACED + i - 1] == 0.0):
        return math.nan
    if G[at.REACTION] == at.HOLD:
        return G[at.SENT + i]
    if i == 0 and G[at.ASKED + 5] * G[at.ENABLED + 5] > 0.0:
        return 0.0
    return cmd[i] if math.isfinite(cmd[i]) else G[at.SENT + i]


@kernel
def act(P, G, cmd, ap, t):
    """Limits last: into cmd (3,) what may be sent, and what was sent into every memory."""
    for i in range(3):
        low, high = P[MINS[i]], P[MINS[i] + 1]
        wanted = goal(P, G, cmd, ap, i)
        if i > 0 and t < G[at.REST_UNTIL + i - 1] and G[at.REACTION] < at.HOLD:
            wanted = G[at.MARK + i - 1]  # where it stands
        last = G[at.SENT + i]
        beyond = abs(ap[ctl.WANTED_SERVO + i]) > ABSURD * (high - low)
        if G[at.ENABLED + 22] == 1.0 and beyond and G[at.REACTION] < at.ABORT:
            wanted = last
        sent = limited(wanted, last, low, high, P[RATES[i]], G[at.TICK])
        cmd[i] = math.nan if math.isnan(wanted) else sent
        G[at.SENT + i] = ap[ctl.SENT_SERVO + i] = sent


@kernel
def watch_limits(P, G, cmd):
    """Row 15: asked to go past a limit; clamped in `act`."""
    for i in range(3):
        if cmd[i] < P[MINS[i]] - ROUNDING or cmd[i] > P[MINS[i] + 1] + ROUNDING:
            ask(G, 15, at.LOG)


@kernel
def watch_moves(P, G, frame, scale, t):
    """Row 14, as the draw-wires see it; a wire that is lost says nothing."""
    G[at.RING_AT] = (G[at.RING_AT] + 1.0) % at.N_RING
    for i in range(2):
        start, place = at.STARTS[at.S_SLIDER + i], i * at.N_RING + int(G[at.RING_AT])
        factor, span = 1.0 if i == 0 else scale, P[MINS[i + 1] + 1] - P[MINS[i + 1]]
        start_place(G, frame, i, factor, 0.03 * span)
        G[at.RING + place], G[at.SENT_RING + place] = math.nan, G[at.SENT + 1 + i]
        rate, tau = (P[SLIDER_RATE], P[SLIDER_TAU]) if i == 0 else (P[BALLAST_RATE], P[BALLAST_TAU])
        if frame[start + 1] == at.VALID and G[at.PLACED + i] == 1.0:
            G[at.RING + place] = factor * frame[start + 2]
            watch_move(G, i, G[at.RING + place], rate, tau, span, t)
        elif G[at.PLACED + i] == 0.0 and t - G[at.BEGAN] > G[at.LOST_AFTER + at.S_SLIDER + i]:
            G[at.PLACED + i] = 1.0  # no wire: from where it was sent last, as far as is known


@kernel
def guard(P, C, G, frame, est, ap, cmd, t):
    """All detectors, the reaction, the limits: cmd (3,) servo rad, slider m, ballast kg, in and out, at time t (s).

    P (N_P,), C (N_C,), G (N_G,), frame (FRAME_SIZE,), est (N_EST,), ap (N_AP,).
    """
    for row in range(at.N_ROWS):
        G[at.ASKED + row] = at.NOTHING
    scale = est[ctl.EST_DENSITY] * P[PLUNGER_AREA] if est[ctl.EST_DENSITY] > 0.0 else 1000.0 * P[PLUNGER_AREA]
    watch_sensors(G, frame, t)
    watch_states(G, frame, t)
    watch_moves(P, G, frame, scale, t)
    if est[ctl.EST_BEACON_TIME] >= 0.0:
        watch_depth(G, est, ap, t)
        watch_ascent(G, est, ap, t)
    watch_attitude(G, est, ap, t)
    watch_law(P, C, G, ap, t)
    watch_loop(G, t)
    watch_limits(P, G, cmd)
    settle(G, t)
    act(P, G, cmd, ap, t)
    doubtful = G[at.ASKED + 13] * G[at.ENABLED + 13] + G[at.ASKED + 21] * G[at.ENABLED + 21] > 0.0
    lawless = G[at.ENABLED + 22] == 1.0 and t < G[at.PID_UNTIL]
    ap[ctl.CAUTIOUS] = 1.0 if doubtful or lawless else 0.0
    if G[at.REACTION] >= at.ABORT and ap[ctl.MODE] < ctl.COMPLETED:
        abort(ap, ctl.REASON_FAULT + G[at.ROW])
    ap[ctl.REACTION], ap[ctl.FAULT_ROW] = G[at.REACTION], G[at.ROW]
