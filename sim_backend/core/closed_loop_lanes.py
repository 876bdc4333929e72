"""Closed-loop flights side by side: as closed_loop.fly, LANES of them at a time (firmware/core/maths/wide).

What is arithmetic is wide: the plant's steps, what the sensors read without noise, the filter. What branches goes lane
by lane through the kernels of one flight: noise, samples and their delays, guidance, controller, limits. A flight does
not depend on its lane, nor on what flies beside it: nothing goes from lane to lane, and a lane whose flight has ended
idles until the last one has. Sines and arcs of wide numbers differ from the C library's in the last place, so a flight
differs from that of closed_loop.fly by what the loop makes of that (tests/unit/campaign/test_lanes.py).
"""

import numpy as np

from glider.firmware.core.control.autopilot import decide, reset
from glider.firmware.core.estimation.navigation import (
    is_finite,
    restart_filter,
    start_filter,
    step_filter,
    write_estimate,
)
from glider.firmware.core.estimation.sensing import sense, take_as_measured
from glider.firmware.core.jit import allocating_kernel, kernel, parallel_kernel, prange
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts.estimator_layout import S_ANGULAR, S_LINEAR
from glider.firmware.core.maths.wide import LANES, as_wide
from glider.firmware.core.vehicle.batch import put_lane, take_lane
from glider.firmware.core.vehicle.layout import N_P, N_X, X_ACT
from glider.hal.ports import FRAME_SIZE
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.closed_loop import add_up, sum_up, write_trace
from glider.sim_backend.core.effect_plant import commands_in_force, effect_sea_step, set_effects
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.plant import hold_disturbance, hold_number, plant_step
from glider.sim_backend.core.world import deliver, read_world, sample_reading


@kernel
def wide_step(effects, P, F, E, waves, x, cmd, acc, work, y, t, dt):
    """One step of the plant in every lane from time t on, and what its sensors then read into y; tables (.., LANES)."""
    xw, Fw = as_wide(x), as_wide(F)
    if effects:
        effect_sea_step(
            as_wide(P), Fw, as_wide(E), as_wide(waves), xw, as_wide(cmd), t, dt, as_wide(acc), as_wide(work)
        )  # fmt: skip
    else:
        plant_step(as_wide(P), as_wide(E), as_wide(waves), xw, as_wide(cmd), t, dt, as_wide(acc), as_wide(work))
    read_world(Fw, effects, xw, as_wide(y))


@kernel
def sample_lanes(members, flying, sensors, y, readings, t, counters, ring):
    """Sample the sensors whose time has come, in every lane that flies: y (N_Y, LANES) is what they read at t."""
    for lane in range(LANES):
        if flying[lane]:
            take_lane(y, lane, readings[lane])
            sample_reading(sensors[members[lane]], readings[lane], t, counters[lane], ring[lane])


@kernel
def disturb_lanes(members, flying, Es, seeds, counters, t, accs, acc):
    """The disturbance from time t on, of every lane that flies, into acc (6, LANES); accs has a row a lane."""
    for lane in range(LANES):
        if flying[lane]:
            hold_disturbance(Es[members[lane]], seeds[members[lane]], counters[lane], t, accs[lane])
            put_lane(accs[lane], lane, acc)


@kernel
def command_lanes(members, flying, Fs, cmds, step, dt, queue, wanted, cmd):
    """The commands that a step flies by, late where effects say so, into cmd (3, LANES)."""
    for lane in range(LANES):
        if flying[lane]:
            commands_in_force(Fs[members[lane]], cmds[lane], step, dt, queue[lane], wanted[lane])
            put_lane(wanted[lane], lane, cmd)


@allocating_kernel
def start_lanes(members, P_plants, Es, Fs, waves, xs, P, E, F, sea, x):
    """What the plant flies by and where it begins, of flight members[lane] into each lane. Returns whether F is set.

    Flights of one group all have effects, or none has.
    """
    effective, effects = np.zeros(N_P), False
    for lane in range(LANES):
        flight = members[lane]
        effects = set_effects(P_plants[flight], Fs[flight], effective)
        put_lane(effective if effects else P_plants[flight], lane, P)
        put_lane(Es[flight], lane, E)
        put_lane(Fs[flight], lane, F)
        put_lane(xs[flight], lane, x)
        for row in range(waves.shape[1]):
            put_lane(waves[flight, row], lane, sea[row])
    return effects


@kernel
def estimate_lanes(P, Cs, members, flying, ests, aps, navs, x, est, nav, sent, t):
    """The estimate of this tick in every lane that flies: the filter, started where its first samples are there.

    ests, aps, navs: a row a lane; est, nav, sent: tables (.., LANES) for what is wide. Flights of one group have the
    same kind of estimate.
    """
    kind, running = Cs[members[0], ctl.ESTIMATOR], False
    for lane in range(LANES):
        nav[ctl.NAV_TIME, lane] = t if navs[lane, ctl.NAV_RUNNING] == 0.0 else nav[ctl.NAV_TIME, lane]
        if not flying[lane]:
            continue
        if kind == ctl.MEASURED:
            take_as_measured(ests[lane])
        elif ests[lane, ctl.EST_STARTED] == 1.0:
            running = True
            if navs[lane, ctl.NAV_RUNNING] == 0.0:
                start_filter(P, navs[lane], ests[lane], t)
                put_lane(navs[lane], lane, nav)
            put_lane(ests[lane, : ctl.EST_U], lane, est)  # the samples, and before them what the filter writes
            put_lane(aps[lane, ctl.SENT_SERVO : ctl.SENT_SERVO + 3], lane, sent)
            for i in range(N_X):
                nav[ctl.NAV_GIVEN + i, lane] = x[i, lane]
    if not running:
        return
    step_filter(P, as_wide(nav), as_wide(est), as_wide(sent), kind == ctl.GIVEN, t)
    for lane in range(LANES):
        if flying[lane] and ests[lane, ctl.EST_STARTED] == 1.0:
            north, east = ests[lane, ctl.EST_X], ests[lane, ctl.EST_Y]
            take_lane(est, lane, ests[lane])
            if not is_finite(nav[:, lane]):
                take_lane(nav, lane, navs[lane])
                restart_filter(P, navs[lane], ests[lane], north, east, t)
                write_estimate(navs[lane], ests[lane], kind == ctl.GIVEN)
                put_lane(navs[lane], lane, nav)
                aps[lane, ctl.FILTER_RESTARTS] += 1.0
            for i in (S_LINEAR, S_ANGULAR):  # what the controllers' watch sees of the filter
                navs[lane, ctl.NAV_SETTINGS + i] = nav[ctl.NAV_SETTINGS + i, lane]


@allocating_kernel
def fly_lanes(
    members, count, P_plants, P, Cs, legs, rows, nav, Es, Fs, waves, sensors, errors, seeds, xs, dt, max_ticks, every,
    traces, ends, ticks,
):  # fmt: skip
    """Fly the first `count` of members (LANES,), numbers of flights, side by side; the others fill lanes unlooked at.

    All of them have effects, or none; the same kind of estimate; the same step. Of each flight as in fly_batch. Where
    that step is longer than the filter's (MAX_STEP), a filter that starts later than its neighbour's may differ in the
    last place.
    """
    Pw, Ew, Fw = np.zeros((N_P, LANES)), np.zeros((wl.N_ENV, LANES)), np.zeros((ef.N_F, LANES))
    sea, x = np.zeros((waves.shape[1], wl.N_WAVE, LANES)), np.zeros((ef.N_XF, LANES))
    cmd, acc, y = np.zeros((3, LANES)), np.zeros((6, LANES)), np.zeros((ef.N_Y, LANES))
    work = np.zeros((wl.N_WORK, wl.WORK_WIDTH, LANES))
    est, filters, sent = np.zeros((ctl.N_EST, LANES)), np.zeros((ctl.N_NAV, LANES)), np.zeros((3, LANES))
    effects = start_lanes(members, P_plants, Es, Fs, waves, xs, Pw, Ew, Fw, sea, x)
    # of each lane, a row
    counters = np.zeros((LANES, wl.N_COUNTERS), dtype=np.int64)
    counters[:, wl.C_HOLD] = -1
    ring = np.zeros((LANES, wl.N_SAMPLED, wl.DELAY_SLOTS, wl.DELAY_WIDTH))
    queue = np.zeros((LANES, int(wl.LONGEST_DELAY / dt) + 3 if effects else 1, 3))
    frames, ests, aps, navs = (
        np.zeros((LANES, FRAME_SIZE)), np.zeros((LANES, ctl.N_EST)), np.zeros((LANES, ctl.N_AP)),
        np.zeros((LANES, ctl.N_NAV)),
    )  # fmt: skip
    cmds, wanted, accs, last = np.zeros((LANES, 3)), np.zeros((LANES, 3)), np.zeros((LANES, 6)), np.zeros((LANES, 3))
    readings, states = np.zeros((LANES, ef.N_Y)), np.zeros((LANES, ef.N_XF))
    flying, flown = np.zeros(LANES, dtype=np.bool_), np.zeros(LANES, dtype=np.int64)
    for lane in range(LANES):
        flying[lane] = lane < count and max_ticks > 0
        navs[lane] = nav
        reset(ests[lane], aps[lane], navs[lane])
        last[lane] = xs[members[lane], X_ACT : X_ACT + 3]
    for lane in range(count):
        ends[members[lane]] = 0.0
        ticks[members[lane]] = 0
    tick, step, hold, t = 0, 0, -1, 0.0
    read_world(as_wide(Fw), effects, as_wide(x), as_wide(y))
    sample_lanes(members, flying, sensors, y, readings, 0.0, counters, ring)
    while flying.any():
        t = tick * Cs[members[0], ctl.DT]
        while step * dt < t - 0.5 * dt:
            if hold_number(step * dt) != hold:
                hold = hold_number(step * dt)
                disturb_lanes(members, flying, Es, seeds, counters, step * dt, accs, acc)
            if effects:
                command_lanes(members, flying, Fs, cmds, step, dt, queue, wanted, cmd)
            wide_step(effects, Pw, Fw, Ew, sea, x, cmd, acc, work, y, step * dt, dt)
            step += 1
            sample_lanes(members, flying, sensors, y, readings, step * dt, counters, ring)
        for lane in range(LANES):
            if flying[lane]:
                flight = members[lane]
                deliver(
                    P_plants[flight], Es[flight], sensors[flight], errors[flight], seeds[flight], step * dt,
                    counters[lane], ring[lane], frames[lane],
                )  # fmt: skip
                sense(P, Cs[flight], frames[lane], ests[lane], t)
        estimate_lanes(P, Cs, members, flying, ests, aps, navs, x, est, filters, sent, t)
        for lane in range(LANES):
            if not flying[lane]:
                continue
            flight, state, ap = members[lane], states[lane], aps[lane]
            end = ends[flight]
            decide(P, Cs[flight], legs[flight, : rows[flight]], ests[lane], ap, navs[lane], cmds[lane], t)
            put_lane(cmds[lane], lane, cmd)
            take_lane(x, lane, state)
            if ap[ctl.MODE] == ctl.FLYING:
                add_up(ests[lane], ap, state, last[lane], end)
                flown[lane] += 1
            if tick % every == 0 and tick // every < traces.shape[1]:
                write_trace(t, ests[lane], ap, cmds[lane], state, traces[flight, tick // every])
            flying[lane] = tick + 1 < max_ticks and ap[ctl.MODE] < ctl.COMPLETED
            if not flying[lane]:
                ticks[flight] = tick + 1
                xs[flight] = state
                sum_up(ap, t, flown[lane], end)
        tick += 1


@parallel_kernel
def fly_batch(
    groups, counts, P_plants, P, Cs, legs, rows, nav, Es, Fs, waves, sensors, errors, seeds, xs, dt, max_ticks, every,
    traces, ends, ticks,
):  # fmt: skip
    """Flights in groups (groups, LANES) of their numbers, of which counts (groups,) count, shared out over all cores.

    Shared: P and nav (the autopilots' model and filter), dt, max_ticks, every. Of each flight: P_plants (n, N_P),
    Cs (n, N_C), legs (n, most, N_LEG) of which rows (n,) count, Es (n, N_E), Fs (n, N_F),
    waves (n, components, N_WAVE), sensors (n, N_SENSORS, N_SENSOR_FIELDS), errors (n, 2, N_ERRORS),
    seeds (n,) uint64, xs (n, N_XF) in place,
    traces (n, lines, N_TRACE), ends (n, N_END), ticks (n,) int64. Groups are as fly_lanes wants them.
    """
    for g in prange(len(groups)):
        fly_lanes(
            groups[g], counts[g], P_plants, P, Cs, legs, rows, nav, Es, Fs, waves, sensors, errors, seeds, xs, dt,
            max_ticks, every, traces, ends, ticks,
        )  # fmt: skip
