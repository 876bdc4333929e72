"""Chunks: what is kept of a flight, and that neither chunks nor processes change it."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.sim_backend.core.closed_loop import TRACE
from glider.sim_backend.fleet import fly_fleet
from glider.tools.data.errors import InputError
from glider.tools.study.campaign.conduct import fly_campaign
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.flights import (
    COLUMNS,
    PAST_LIMITS,
    STILL_FLYING,
    TUMBLED,
    UNSEEN_DEPTH,
    FlightJob,
    _ending,
    _past_limits,
    _worst_attitude,
    cut,
    fly_chunk,
    trace_every,
)
from glider.tools.study.campaign.worlds import draw_world


def test_chunks_cover_every_flight_once(plan_of):
    for seeds, flights in ((1, 1), (7, 6), (7, 100), (10, 4)):
        plan = plan_of(missions=["sawtooth", "spiral"], seeds=seeds, first_seed=5)
        chunks = cut(plan, flights)
        assert [chunk.number for chunk in chunks] == list(range(len(chunks)))
        flown = [(c.mission, s) for c in chunks for s in range(c.first_seed, c.first_seed + c.seeds)]
        assert flown == [(mission, seed) for mission in (0, 1) for seed in range(5, 5 + seeds)]


def test_a_campaigns_flight_is_the_fleets(plan_of):
    plan = plan_of(controllers=["hybrid", "pid"])
    table = fly_campaign(plan, jobs=1).table
    worlds, pilots = [], []
    for seed in range(2):
        for controller in plan.campaign.controllers:
            worlds.append(draw_world(plan, 0, seed).world)
            pilots.append(plan.pilot(0, controller))
    fleet = fly_fleet(worlds, pilots, max_seconds=605.0, trace_every=0.02)
    assert np.array_equal(table[:, COLUMNS.index("seconds")], fleet.seconds)
    assert np.array_equal(table[:, COLUMNS.index("completed")], fleet.completed)
    assert np.array_equal(table[:, COLUMNS.index("pitch_error_rad")], fleet.ends[:, 6])
    assert np.array_equal(table[:, COLUMNS.index("deepest_m")], np.nanmax(fleet.column("true_depth"), axis=1))
    assert np.isnan(table[:, COLUMNS.index("depth_error_m")]).all()  # the spiral holds its ballast


def test_a_chunk_of_another_version_is_refused(plan_of):
    plan = plan_of()
    with pytest.raises(InputError, match="another version"):
        fly_chunk(FlightJob(plan, "0" * 16), cut(plan)[0])
    assert len(fly_chunk(FlightJob(plan, fingerprint(plan)), cut(plan, 1)[0])) == 3


def end(mode, reason=ctl.REASON_NONE):
    return np.array([mode, reason, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("flight", "deepest", "over", "attitude", "ending"),
    [
        (end(ctl.COMPLETED), 5.0, (0.0, 0.0), 0.3, ctl.REASON_NONE),
        (end(ctl.COMPLETED), 6.1, (0.0, 0.0), 0.3, UNSEEN_DEPTH),
        (end(ctl.COMPLETED), np.nan, (0.0, 0.0), 0.3, UNSEEN_DEPTH),
        (end(ctl.COMPLETED), 5.0, (1e-3, 0.0), 0.3, PAST_LIMITS),
        (end(ctl.COMPLETED), 5.0, (0.0, 1e-3), 0.3, PAST_LIMITS),
        (end(ctl.COMPLETED), 5.0, (np.nan, 0.0), 0.3, PAST_LIMITS),
        (end(ctl.COMPLETED), 5.0, (0.0, 0.0), 1.1, TUMBLED),
        (end(ctl.COMPLETED), 5.0, (0.0, 0.0), np.nan, TUMBLED),
        (end(ctl.COMPLETED), 6.1, (0.0, 0.0), 3.0, UNSEEN_DEPTH),
        (end(ctl.ABORTED, ctl.REASON_LEG_TIME), 9.0, (0.0, 0.0), 3.0, ctl.REASON_LEG_TIME),
        (end(ctl.FLYING), 5.0, (0.0, 0.0), 0.3, STILL_FLYING),
    ],
)
def test_endings(flight, deepest, over, attitude, ending):
    assert _ending(flight, deepest, 6.0, over, attitude) == ending


def test_a_roll_through_half_a_turn_is_measured_the_short_way():
    flown = np.zeros((3, len(TRACE)))
    flown[:, TRACE.index("ref_roll")] = 3.1
    flown[:, TRACE.index("true_roll")] = [3.0, -3.1, -3.0]
    assert _worst_attitude(flown) == pytest.approx(2.0 * np.pi - 6.1)
    flown[1, TRACE.index("true_pitch")] = -1.2
    assert _worst_attitude(flown) == pytest.approx(1.2)
    flown[2, TRACE.index("true_pitch")] = np.nan
    assert np.isnan(_worst_attitude(flown))


def test_commands_past_range_or_rate_are_seen(plan_of):
    P = plan_of().vehicle.vector()
    still = np.zeros((5, 3))
    assert _past_limits(P, still, 0.02) == (0.0, 0.0)
    wide = still.copy()
    wide[2:, 1] = 0.07  # m, of 0.06
    over_range, over_rate = _past_limits(P, wide, 0.02)
    assert over_range == pytest.approx(0.01 / 0.12)
    assert over_rate == pytest.approx(0.07 / (0.02 * 0.02) - 1.0)
    at_rate = np.outer(np.arange(1, 6), [0.0, 0.0, 0.03 * 0.02])
    assert _past_limits(P, at_rate, 0.02)[1] < 1e-9
    lost = still.copy()
    lost[3, 0] = np.nan
    assert np.isnan(_past_limits(P, lost, 0.02)[0])


@pytest.mark.parametrize(("seconds", "ticks"), [(60.0, 1), (600.0, 1), (700.0, 2), (6000.0, 10)])
def test_long_missions_are_watched_more_coarsely(plan_of, seconds, ticks):
    plan = plan_of()
    long = msgspec.structs.replace(plan.missions[0], time_limit_s=seconds)
    assert trace_every(replace(plan, missions=(long,)), 0) == ticks
