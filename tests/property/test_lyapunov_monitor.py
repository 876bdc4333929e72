"""The watch over V in flight: what it promises the plant keeps, and what it asks of k2 is the bound's."""

import math

import numpy as np
import pytest

from glider.firmware.core.control.law import k2_to_cover
from glider.firmware.core.control.lyapunov_monitor import WATCH_EVERY
from glider.firmware.core.control.telemetry import N_RECORD, REC_LYAPUNOV, fill_record
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle import layout
from glider.tools.flight.compose import build_flight
from tests.support.law_flights import Gains, Law, Reference, lyapunov_rate, plant_rates
from tests.support.law_states import SPREAD

SIGMA = SPREAD / 3.0
VALUES = slice(ctl.K2_NEED_PITCH, ctl.MARGIN_DEPTH + 1)


def flight(controller, seed=1, mission="sawtooth", shaken=True):
    built = build_flight(mission=mission, seed=seed)
    built.autopilot.C[ctl.CONTROLLER] = controller
    if not shaken:
        built.board.world.E[6] = built.board.world.E[7] = 0.0
    return built.board.world, built.autopilot


def step(world, pilot, tick, given=False):
    """One tick on the simulated vehicle; with `given`, from its true state."""
    t = 0.02 * tick
    world.advance(t)
    pilot.frame[...] = world.frame
    if given:
        pilot.C[ctl.ESTIMATOR] = ctl.GIVEN
        pilot.nav[ctl.NAV_GIVEN : ctl.NAV_GIVEN + layout.N_X] = world.x[: layout.N_X]
    sent = pilot.commands.copy()
    pilot.tick(t)
    return sent


def law_of(pilot) -> Law:
    gains = [Gains(*pilot.C[start : start + 4]) for start in (ctl.PITCH_K1, ctl.DEPTH_K1)]
    return Law(pilot.P, *gains)


@pytest.mark.parametrize("controller", [ctl.LAW, ctl.LAW_PLUS])
def test_where_the_margin_is_positive_V_falls_by_it_in_every_vehicle_of_the_box(controller):
    """True states, vehicles at corners of one sigma: V_dot of the plant under the commands in force <= -|s| margin.

    Every ten seconds the references jump, for V to have far to fall.
    """
    looked, promised = np.zeros(2), np.zeros(2)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        world, pilot = flight(controller, seed, shaken=False)
        world.P[:] = world.P + SIGMA * rng.choice([-1.0, 1.0], layout.N_P)
        for tick in range(4000):
            if tick % 500 == 100:
                pilot.ap[ctl.REF_PITCH] += rng.choice([-0.3, 0.3])
                pilot.ap[ctl.REF_DEPTH] += rng.choice([-0.6, 0.6])
            sent = step(world, pilot, tick, given=True)
            if pilot.finished:
                break
            if pilot.ap[ctl.MONITORED] == 0.02 * tick:
                references = Reference(*pilot.ap[ctl.REF_PITCH :][:3]), Reference(*pilot.ap[ctl.REF_DEPTH :][:3])
                V_dot = lyapunov_rate(law_of(pilot), world.P, world.x, references, sent)
                for axis in (0, 1):
                    margin, s = pilot.ap[ctl.MARGIN_PITCH + axis], pilot.ap[ctl.S_PITCH + axis]
                    if math.isfinite(margin):
                        looked[axis] += 1
                        if margin > 0.0:
                            promised[axis] += 1
                            assert V_dot[axis] <= -abs(s) * margin + 1e-9
            world.cmd[...] = pilot.commands
    assert (looked > 500).all()
    assert (promised > 0.2 * looked).all()


def test_the_need_is_the_model_error_bound_and_the_disturbance_seen():
    world, pilot = flight(ctl.LAW)
    looked = 0
    for tick in range(1500):
        sent = step(world, pilot, tick, given=True)
        world.cmd[...] = pilot.commands
        if pilot.ap[ctl.MONITORED] != 0.02 * tick:
            continue
        looked += 1
        law, speeds = law_of(pilot), plant_rates(pilot.P, world.x, sent)[layout.X_ACT :]
        bound = law.error_bound(world.x, SIGMA, speeds)
        seen = pilot.nav[ctl.NAV_NOISE_SCALE] * 0.003
        _, _, g = law(world.x, (Reference(0.0), Reference(0.0)), speeds)
        for axis, index in enumerate((ctl.K2_NEED_PITCH, ctl.K2_NEED_DEPTH)):
            assert pilot.ap[index] == pytest.approx(k2_to_cover(bound[axis], seen, g[axis], law.eps[axis]), rel=1e-9)
    assert looked > 100


def test_rough_water_asks_for_more_and_leaves_less():
    need, margin = [], []
    for strength in (0.003, 0.1):
        world, pilot = flight(ctl.LAW)
        world.E[6] = world.E[7] = strength
        rows = []
        for tick in range(3000):
            step(world, pilot, tick)
            world.cmd[...] = pilot.commands
            rows.append(pilot.ap[VALUES].copy())
        rows = np.array(rows)[1000:]
        need.append(np.nanmedian(rows[:, 0]))
        margin.append(np.nanmedian(rows[:, 2]))
    assert need[1] > 3.0 * need[0]
    assert margin[1] < margin[0] < 0.0  # in the layer, where flights that keep to their references are


def test_it_is_silent_where_the_law_does_not_fly_and_of_an_axis_the_leg_holds():
    world, pilot = flight(ctl.PID)
    for tick in range(500):
        step(world, pilot, tick)
        world.cmd[...] = pilot.commands
        assert np.isnan(pilot.ap[VALUES]).all()
    pilot.C[ctl.CONTROLLER] = ctl.LAW
    for tick in range(500, 540):
        step(world, pilot, tick)
    assert np.isfinite(pilot.ap[VALUES]).all()
    pilot.legs[int(pilot.ap[ctl.LEG]), ctl.LEG_BALLAST] = 0.1
    for tick in range(540, 560):
        step(world, pilot, tick)
    assert np.isnan(pilot.ap[VALUES]).tolist() == [False, True, False, True]
    pilot.C[ctl.CONTROLLER] = ctl.PID
    step(world, pilot, 560)
    assert np.isnan(pilot.ap[VALUES]).all()


def test_it_looks_five_times_a_second_and_the_record_has_what_it_saw():
    world, pilot = flight(ctl.LAW)
    out, times = np.zeros(N_RECORD), set()
    for tick in range(400):
        step(world, pilot, tick)
        world.cmd[...] = pilot.commands
        times.add(float(pilot.ap[ctl.MONITORED]))
        fill_record(pilot.frame, pilot.est, pilot.ap, np.zeros(sup.N_G), pilot.commands, 0.02 * tick, 0.0, 0.0, out)
        assert np.array_equal(out[REC_LYAPUNOV : REC_LYAPUNOV + 4], pilot.ap[VALUES], equal_nan=True)
    gaps = np.diff(sorted(times - {-math.inf}))
    assert gaps == pytest.approx(WATCH_EVERY, abs=1e-9)


def test_a_state_that_is_no_number_promises_nothing():
    world, pilot = flight(ctl.LAW)
    for tick in range(300):
        step(world, pilot, tick, given=True)
        world.cmd[...] = pilot.commands
    for tick in range(300, 320):
        world.advance(0.02 * tick)
        pilot.frame[...] = world.frame
        pilot.nav[ctl.NAV_GIVEN + layout.X_NU] = math.nan
        pilot.tick(0.02 * tick)
        assert not (pilot.ap[[ctl.MARGIN_PITCH, ctl.MARGIN_DEPTH]] > 0.0).any()
