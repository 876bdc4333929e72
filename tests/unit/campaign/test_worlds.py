"""Worlds of a campaign: paired, within their limits, and moved only by what is changed."""

import dataclasses

import msgspec
import numpy as np
import pytest

from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects.effect_layout import DRAG_0
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.worlds import draw_world


def arrays(world):
    return (world.P, world.E, world.F, world.waves, world.sensors, world.errors, np.array(world.seed), world.x)


def test_a_seed_is_a_world(plan_of):
    plan = plan_of()
    first, again, other = (draw_world(plan, 0, seed).world for seed in (1, 1, 2))
    for a, b in zip(arrays(first), arrays(again), strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(first.P, other.P)
    assert first.seed != other.seed


def test_missions_have_worlds_of_their_own(plan_of):
    plan = plan_of(missions=["sawtooth", "spiral"])
    assert draw_world(plan, 0, 0).current != draw_world(plan, 1, 0).current
    alone = plan_of(missions=["spiral"])
    assert draw_world(plan, 1, 0).current == draw_world(alone, 0, 0).current


def test_draws_keep_to_their_limits_and_fill_them(plan_of):
    plan = plan_of(**{"environment.disturbance": (0.01, 0.03), "start.depth_m": (0.5, 1.0)})
    drawn = [draw_world(plan, 0, seed) for seed in range(200)]
    for values, low, high in (
        ([d.current for d in drawn], 0.0, 0.2),
        ([d.wave_height for d in drawn], 0.0, 0.2),
        ([d.wave_period for d in drawn], 3.0, 8.0),
        ([d.disturbance for d in drawn], 0.01, 0.03),
        ([d.start_depth for d in drawn], 0.5, 1.0),
    ):
        assert low <= min(values) < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < max(values) <= high
    for d in drawn:
        assert np.hypot(d.world.E[wl.ENV_CURRENT_N], d.world.E[wl.ENV_CURRENT_E]) == pytest.approx(d.current)
        assert d.world.waves[0, wl.WAVE_AMPLITUDE] == pytest.approx(0.5 * d.wave_height)
        assert d.world.E[wl.ENV_ACC_LINEAR] == d.world.E[wl.ENV_ACC_ANGULAR] == d.disturbance
        assert d.world.x[2] == d.start_depth
    headings = np.arctan2([d.world.E[wl.ENV_CURRENT_E] for d in drawn], [d.world.E[wl.ENV_CURRENT_N] for d in drawn])
    assert {1, 2, 3, 4} == set(np.ceil((headings + np.pi) / (0.5 * np.pi)).astype(int))


def test_one_limit_changed_leaves_the_other_draws(plan_of):
    calm, rough = plan_of(**{"environment.current_m_s": 0.0}), plan_of()
    for seed in range(5):
        a, b = draw_world(calm, 0, seed), draw_world(rough, 0, seed)
        assert a.current == 0.0
        assert b.current > 0.0
        assert np.array_equal(a.world.P, b.world.P)
        assert np.array_equal(a.world.waves, b.world.waves)
        assert np.array_equal(a.world.errors, b.world.errors)


def test_spreads_scale(plan_of):
    one = plan_of(**{"spread.parameters": 1.0})
    three = plan_of(**{"spread.sensor_bias": 2.0, "spread.sensor_noise": 0.0})
    nominal = one.vehicle.vector()
    a, b = draw_world(one, 0, 0).world, draw_world(three, 0, 0).world
    np.testing.assert_allclose(b.P - nominal, 3.0 * (a.P - nominal), atol=1e-12)
    np.testing.assert_allclose(b.errors[0], 2.0 * a.errors[0])
    assert not b.errors[1].any()


def test_effects_of_the_board_come_on_top_of_the_drawn_vehicle(plan_of):
    plain, plan = plan_of(), plan_of()
    effects = {"drag": {"scale": 0.2}, "turbulence": {"scale": 1.0}}
    plan = dataclasses.replace(plan, board=msgspec.structs.replace(plan.board, effects=effects))
    a, b = draw_world(plain, 0, 0).world, draw_world(plan, 0, 0).world
    assert np.array_equal(a.P, b.P)
    assert np.flatnonzero(b.F).tolist() == [DRAG_0]
    assert b.E[wl.ENV_ACC_LINEAR] == 2.0 * a.E[wl.ENV_ACC_LINEAR] > 0.0
    assert fingerprint(plan) != fingerprint(plain)
