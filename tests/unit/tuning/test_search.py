"""The search: better than where it began, repeatable, and what it ships is no worse than the rule."""

import msgspec
import numpy as np
import pytest

from glider.firmware.model.gains import BEST_TUNED, Control, DepthGains, PitchGains
from glider.sim_backend.core.closed_loop import (
    END_ERROR_DEPTH,
    END_ERROR_PITCH,
    END_TRAVEL_SLIDER,
    N_END,
    N_TRACE,
    TRACE,
    fly,
)
from glider.tools.flight.compose import build_flight
from glider.tools.study.tuning import manoeuvres, search

BAD = Control(pitch=PitchGains(kp=0.02, ki=0.002, kd=0.03), depth=DepthGains(kp=0.1), estimator="measured")
FEW = search.TuningFlights(range(1), (0.03,))


def test_a_small_search_improves_on_a_bad_start_and_repeats(vehicle):
    first, again, other = (search.search_loop(vehicle, "pitch", BAD, seed, 15, FEW) for seed in (3, 3, 4))
    assert first.cost < 0.8 * first.cost_before
    assert first == again
    assert other.control != first.control
    assert other.cost_before == first.cost_before
    assert 14 <= first.candidates <= 20
    # what was not searched stays
    assert first.control.depth == BAD.depth
    assert first.control.pitch.reference == BAD.pitch.reference


def test_a_vehicle_that_flies_the_law_keeps_it(vehicle):
    found = search.search_loop(vehicle, "depth", Control(controller="law"), 0, 6, FEW)
    assert found.control.controller == "law"
    assert found.control.estimator == "filter"
    assert found.cost <= found.cost_before


def test_every_strength_counts_alike_and_travel_little(vehicle):
    error = np.ones((6, 3, 2)) * np.array([1.0, 2.0, 4.0])[:, None]
    still = search.cost(vehicle, "pitch", manoeuvres.ManoeuvreScore(error, np.zeros((6, 3, 2, 3))))
    assert still == pytest.approx(2.0)
    one_more_percent = error.copy()
    one_more_percent[:, 0] *= 1.01
    moved = manoeuvres.ManoeuvreScore(one_more_percent, np.zeros((6, 3, 2, 3)))
    one_more_percent_there = error.copy()
    one_more_percent_there[:, 2] *= 1.01
    there = manoeuvres.ManoeuvreScore(one_more_percent_there, np.zeros((6, 3, 2, 3)))
    assert search.cost(vehicle, "pitch", moved) == pytest.approx(search.cost(vehicle, "pitch", there))
    travel = np.zeros((6, 3, 2, 3))
    travel[..., 1] = 0.12  # a full stroke of the slider a minute
    assert search.cost(vehicle, "pitch", manoeuvres.ManoeuvreScore(error, travel)) == pytest.approx(2.0 * 1.002)


def test_gains_have_three_digits_and_only_their_loop_changes():
    made = search.with_gains(Control(), "depth", np.array([0.123456, 0.0098765, 1.23456]))
    assert (made.depth.kp, made.depth.ki, made.depth.kd) == (0.123, 0.00988, 1.23)
    assert made.depth.rate_bandwidth == Control().depth.rate_bandwidth
    assert made.pitch == Control().pitch


@pytest.mark.parametrize("loop", ["pitch", "depth"])
def test_the_best_tuned_set_tracks_better_than_the_rule_and_does_not_chatter(vehicle, loop):
    """On flights that no search has seen; chatter would be an actuator that runs at its rate all the time."""
    ruled, best = manoeuvres.fly(vehicle, loop, [Control(), BEST_TUNED], range(50, 52), (0.003, 0.03))
    assert best.error.mean() < 0.9 * ruled.error.mean()
    limits = [60.0 * vehicle.actuators.slider.rate, 60.0 * vehicle.actuators.ballast.rate]
    calm = best.travel[:, 0, :, 1:].mean(axis=(0, 1))
    assert (calm < 0.5 * np.array(limits)).all()


def test_references_of_both_sets_are_the_same():
    """They belong to the task, not to the tuning."""
    assert BEST_TUNED.pitch.reference == Control().pitch.reference
    assert BEST_TUNED.depth.reference == Control().depth.reference


def test_the_sums_kept_of_a_flight_are_those_of_its_trace():
    """Mean errors and ways in `end` against a trace of every tick, whose pitch is as measured without the filter."""
    flight = build_flight(mission="sawtooth", seed=5)
    world, pilot = flight.board.world, flight.autopilot
    pilot.C[:] = measured_configuration(flight)
    ticks = 1500
    trace, end = np.zeros((ticks, N_TRACE)), np.zeros(N_END)
    fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
        world.errors, world.seed, world.x, world.dt, ticks, 1, trace, end,
    )  # fmt: skip
    column = {name: trace[1:, TRACE.index(name)] for name in TRACE}  # the first tick waits for the first depth
    assert end[END_ERROR_PITCH] == pytest.approx(np.abs(column["pitch"] - column["ref_pitch"]).mean(), rel=1e-9)
    # the trace has the observer's depth, `end` the samples: apart by noise and the observer's lag
    assert end[END_ERROR_DEPTH] == pytest.approx(np.abs(column["depth"] - column["ref_depth"]).mean(), abs=0.01)
    # the slider under its commands, each in force from its tick to the next, by small steps of its own equation
    slider, way, table = 0.0, 0.0, flight.vehicle.actuators.slider
    for wanted in trace[:-1, TRACE.index("slider")]:
        before = slider
        for _ in range(20):
            slider += 0.001 * np.clip((wanted - slider) / table.time_constant, -table.rate, table.rate)
        way += abs(slider - before)
    assert end[END_TRAVEL_SLIDER] == pytest.approx(way, rel=0.01)


def measured_configuration(flight):
    from glider.firmware.autopilot import configuration

    mission = msgspec.structs.replace(flight.mission, control=Control(estimator="measured"))
    board = flight.board
    return configuration(
        flight.vehicle, mission, dt=0.02, periods=board.periods, surface_pressure=board.surface_pressure
    )
