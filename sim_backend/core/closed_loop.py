"""A whole closed-loop flight in compiled code: world, sensors, autopilot and limits.

The kernels are the ones that the real runtime calls; only the Python around them is gone. Many flights side by side:
closed_loop_lanes.
"""

import numpy as np

from glider.firmware.core.control.autopilot import reset, tick
from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle.layout import N_P, N_X, X_ACT, X_DOWN, X_EAST, X_NORTH
from glider.firmware.core.vehicle.state import euler_angles
from glider.hal.ports import FRAME_SIZE
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effect_plant import set_effects
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.world import deliver, move, move_with_effects

# what is kept of each logged tick
TRACE = (
    "t", "depth", "pitch", "roll", "ref_depth", "ref_pitch", "ref_roll", "servo", "slider", "ballast",
    "true_x", "true_y", "true_depth", "true_pitch", "true_roll", "true_yaw", "controller", "leg",
)  # fmt: skip
N_TRACE = 18
# what is kept of each flight: how it ended, and over the time flown
END_MODE, END_REASON, END_TIME, END_LEG = 0, 1, 2, 3
END_ERROR_DEPTH, END_ERROR_ROLL, END_ERROR_PITCH = 4, 5, 6  # mean |measured - reference|, m and rad; 0: never flew
END_TRAVEL_SERVO, END_TRAVEL_SLIDER, END_TRAVEL_BALLAST = 7, 8, 9  # way that the actuators went, rad, m, kg
N_END = 10


@kernel
def write_trace(t, est, ap, cmd, x, out):
    """One logged tick: estimates, references, commands and the plant's truth, in the order of TRACE."""
    out[0] = t
    out[1], out[2], out[3] = est[ctl.EST_DEPTH], est[ctl.EST_PITCH], est[ctl.EST_ROLL]
    out[4], out[5], out[6] = ap[ctl.REF_DEPTH], ap[ctl.REF_PITCH], ap[ctl.REF_ROLL]
    out[7], out[8], out[9] = cmd[0], cmd[1], cmd[2]
    out[10], out[11], out[12] = x[X_NORTH], x[X_EAST], x[X_DOWN]
    out[14], out[13], out[15] = euler_angles(x)
    out[16], out[17] = ap[ctl.ACTIVE], ap[ctl.LEG]


@kernel
def add_up(est, ap, x, last, end):
    """One tick into the sums of end: errors against the newest samples, ways from last (3,), which is moved on."""
    end[END_ERROR_DEPTH] += abs(est[ctl.NEW_DEPTH] - ap[ctl.REF_DEPTH])
    end[END_ERROR_ROLL] += abs(est[ctl.NEW_ROLL] - ap[ctl.REF_ROLL])
    end[END_ERROR_PITCH] += abs(est[ctl.NEW_PITCH] - ap[ctl.REF_PITCH])
    for i in range(3):
        end[END_TRAVEL_SERVO + i] += abs(x[X_ACT + i] - last[i])
        last[i] = x[X_ACT + i]


@kernel
def sum_up(ap, t, flown, end):
    """How the flight that ended at t (s) did, and the means of its errors over the ticks flown, into end."""
    end[END_MODE], end[END_REASON], end[END_TIME], end[END_LEG] = ap[ctl.MODE], ap[ctl.REASON], t, ap[ctl.LEG]
    for i in range(END_ERROR_DEPTH, END_TRAVEL_SERVO):
        end[i] /= max(flown, 1)


@allocating_kernel
def fly(P_plant, P, C, legs, nav, E, F, waves, sensors, errors, seed, x, dt, max_ticks, every, trace, end):
    """Fly one mission from state x (N_XF, in place) until it ends or max_ticks are over; returns the ticks flown.

    P_plant is the vehicle in the water, with effects F (N_F,), P the autopilot's model; nav (N_NAV,) is as
    Autopilot makes it and is not changed. Every `every`-th tick goes into trace (rows, N_TRACE) while it has rows; end
    (N_END,) says how the flight ended and how well it kept to its references.
    """
    cmd, acc, frame = np.zeros(3), np.zeros(6), np.full(FRAME_SIZE, np.nan)
    frame[:] = 0.0
    counters = np.zeros(wl.N_COUNTERS, dtype=np.int64)
    counters[wl.C_HOLD] = -1
    ring = np.zeros((wl.N_SAMPLED, wl.DELAY_SLOTS, wl.DELAY_WIDTH))
    queue = np.zeros((int(F[ef.COMMAND_DELAY] / dt) + 3, 3))
    effective, work = np.zeros(N_P), np.zeros((wl.N_WORK, wl.WORK_WIDTH))
    effects = set_effects(P_plant, F, effective)
    est, ap = np.zeros(ctl.N_EST), np.zeros(ctl.N_AP)
    memory = nav.copy()
    reset(est, ap, memory)
    last = x[X_ACT : X_ACT + 3].copy()
    end[:] = 0.0
    ticks, flown, t = 0, 0, 0.0
    while ticks < max_ticks and ap[ctl.MODE] < ctl.COMPLETED:
        t = ticks * C[ctl.DT]
        if effects:
            move_with_effects(
                effective, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, queue, work, dt, t
            )  # fmt: skip
        else:
            move(P_plant, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, work, dt, t)
        deliver(P_plant, E, sensors, errors, seed, counters[wl.C_STEP] * dt, counters, ring, frame)
        if C[ctl.ESTIMATOR] == ctl.GIVEN:
            memory[ctl.NAV_GIVEN : ctl.NAV_GIVEN + N_X] = x[:N_X]
        tick(P, C, legs, frame, est, ap, memory, cmd, t)
        if ap[ctl.MODE] == ctl.FLYING:
            add_up(est, ap, x, last, end)
            flown += 1
        if ticks % every == 0 and ticks // every < trace.shape[0]:
            write_trace(t, est, ap, cmd, x, trace[ticks // every])
        ticks += 1
    sum_up(ap, t, flown, end)
    return ticks
