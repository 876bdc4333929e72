"""Flights side by side: as each flies alone, in whatever lane and beside whatever others, and as the scalar loop's."""

import numpy as np
import pytest

from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts.estimator_layout import MAX_STEP
from glider.firmware.core.maths.steps import MIDPOINT
from glider.firmware.core.maths.wide import LANES
from glider.firmware.core.vehicle.layout import K_P, X_NU
from glider.firmware.core.vehicle.time_constants import nominal_parts
from glider.sim_backend.core.closed_loop import N_END, N_TRACE, fly
from glider.sim_backend.fleet import fly_group, groups_of
from glider.tools.flight.compose import build_flight

TICKS = 400  # 8 s: the filter runs, and the dive begins
EFFECTS = {
    "command_delay": {"delay": 0.355}, "slider_backlash": {"width": 0.004}, "current_shear": {"north": 0.02},
    "waves": {"amplitude": 0.05, "period": 4.0}, "depth_lag": {"time": 0.3}, "compass": {"s1": 0.1},
}  # fmt: skip
# Sines that differ by a unit in the last place, through a loop that forgets: 1e-14 to 5e-12 m and rad were seen over
# whole dives. What is more than a thousand times that is another flight.
BOUND = 1e-9


def flight(mission, seed, controller="pid", effects=None):
    made = build_flight(mission=mission, seed=seed, effects=effects)
    made.autopilot.C[ctl.CONTROLLER] = CONTROLLERS[controller].number
    return made.board.world, made.autopilot


def several(effects):
    """More flights than lanes: missions, controllers and waves of their own; one that is given up, one that is lost."""
    flights = [
        flight("sawtooth", 0, "pid", effects), flight("spiral", 1, "law", effects),
        flight("spiral", 2, "law+", effects), flight("sawtooth", 3, "pid", effects),
        flight("spiral", 4, "hybrid", effects),
        flight("sawtooth", 5, "law", {"waves": {"amplitude": 0.1, "period": 3.0}} | effects),
    ]  # fmt: skip
    flights[0][1].C[ctl.MISSION_TIME_LIMIT] = 2.0  # s
    flights[3][0].x[X_NU] = np.nan
    return flights


def flown(flights, ticks=TICKS):
    traces = np.full((len(flights), ticks, N_TRACE), np.nan)
    ends, took = fly_group(*zip(*flights, strict=True), ticks, 1, traces)
    return [(end, tick, trace) for end, tick, trace in zip(ends, took, traces, strict=True)]


@pytest.mark.parametrize("effects", [{}, EFFECTS], ids=["nominal", "with effects"])
def test_a_flight_is_the_same_in_every_lane_and_beside_any_others(effects):
    flights = several(effects)
    kinds = {bool(world.F.any()) for world, _ in flights}
    assert kinds == {bool(effects)}
    alone = [flown([one])[0] for one in flights]
    assert alone[0][1] < TICKS  # given up, and its lane idles
    assert np.isnan(alone[3][2][1:, 10]).all()
    assert alone[1][1] == alone[2][1] == TICKS
    rng = np.random.default_rng(0)
    for shift in range(len(flights)):  # each is in every lane once
        beside = np.roll(rng.permutation(len(flights)) if shift % 2 else np.arange(len(flights)), shift)[:LANES]
        for number, together in zip(beside, flown([flights[i] for i in beside]), strict=True):
            for here, there in zip(together, alone[number], strict=True):
                np.testing.assert_array_equal(here, there)


@pytest.mark.parametrize(
    ("mission", "controller", "effects"),
    [("spiral", "pid", {}), ("spiral", "law+", {}), ("sawtooth", "hybrid", {}), ("spiral", "pid", EFFECTS)],
)
def test_a_dive_is_that_of_the_scalar_loop_but_for_the_last_places(mission, controller, effects):
    flights = [flight(mission, seed, controller, effects) for seed in range(LANES)]
    for (end, ticks, trace), (world, pilot) in zip(flown(flights, 15_000), flights, strict=True):
        scalar, ended = np.full((15_000, N_TRACE), np.nan), np.zeros(N_END)
        alone = fly(
            world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
            world.errors, world.seed, world.x, world.dt, len(scalar), 1, scalar, ended,
        )  # fmt: skip
        assert ended[0] == ctl.COMPLETED
        assert ticks == alone
        np.testing.assert_allclose(end, ended, rtol=0.0, atol=BOUND)
        np.testing.assert_allclose(trace, scalar, rtol=0.0, atol=BOUND)


def test_flights_of_real_wings_are_those_of_the_scalar_loop():
    """K_p of -40: plant and filter divide their steps, each lane for itself (firmware/core/vehicle/time_constants)."""
    flights = [flight("spiral", seed, controller) for seed, controller in enumerate(("pid", "law+"))]
    for world, pilot in flights:
        world.P, pilot.P = world.P.copy(), pilot.P.copy()
        world.P[K_P] = pilot.P[K_P] = -40.0
    ticks, fastest = 2000, 0.0
    for (_, took, trace), (world, pilot) in zip(flown(flights, ticks), flights, strict=True):
        scalar, ended = np.full((ticks, N_TRACE), np.nan), np.zeros(N_END)
        alone = fly(
            world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
            world.errors, world.seed, world.x, world.dt, len(scalar), 1, scalar, ended,
        )  # fmt: skip
        assert took == alone
        np.testing.assert_allclose(trace, scalar, rtol=0.0, atol=BOUND)
        fastest = max(fastest, nominal_parts(MIDPOINT, pilot.P, world.x, 0, MAX_STEP))
    assert fastest > 1.0


def test_groups_hold_flights_of_one_kind():
    flights = [flight("spiral", seed, "pid", EFFECTS if seed % 2 else None) for seed in range(LANES + 3)]
    flights[2][1].C[ctl.ESTIMATOR] = ctl.GIVEN
    groups, counts = groups_of(*zip(*flights, strict=True))
    assert sorted(number for row, count in zip(groups, counts, strict=True) for number in row[:count]) == list(
        range(len(flights))
    )
    for row in groups:
        assert len({(bool(flights[i][0].F.any()), flights[i][1].C[ctl.ESTIMATOR]) for i in row}) == 1
