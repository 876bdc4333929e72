"""The foreign ocean glider: against the steady glide of the observer's model, mirrored, and what its dives are."""

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as at
from glider.sim_backend.ocean.core import layout
from glider.sim_backend.ocean.core.glide import steady_speed
from glider.tools.data.runs import columns as names
from glider.tools.verify.challenge import ocean_cases
from glider.tools.verify.challenge.ocean_cases import flown, fly_mission, legs, shipped_vehicle, shown, with_change
from glider.tools.verify.challenge.ocean_design import CRAFTS, THRUSTER, MissionDesign, draw_mission


def mission(vehicle_class: str = "slocum", dives: int = 2) -> MissionDesign:
    return draw_mission(np.random.default_rng(4), CRAFTS[vehicle_class], shipped_vehicle(vehicle_class), dives)


@pytest.mark.parametrize("pitch", [-0.45, -0.3, 0.4])
def test_it_settles_where_the_observers_glide_is(pitch):
    vehicle = shipped_vehicle("slocum")
    P, weight, density = vehicle.vector(), np.copysign(1.8, -pitch), 1026.0
    V = mission().V.copy()
    V[[at.DRAG, at.INDUCED, at.LIFT]] = P[[layout.DRAG_0, layout.DRAG_ALPHA, layout.LIFT_SLOPE]]
    V[[at.DRAG_POWER, at.LIFT_BEND, at.CLIMB_DRAG]] = 0.0
    state = np.array([0.1, 0.0, 0.0])
    for _ in range(4000):
        du, dv, dw, rate = at.rates(V, weight, density, pitch, 0.0, 0.0, *state)
        state += 0.1 * np.array([du, dv, dw])
    speed, path = steady_speed(P, np.zeros(layout.N_F), pitch, density, -weight)
    assert np.hypot(*state[[0, 2]]) == pytest.approx(speed, rel=0.01)
    assert rate == pytest.approx(-speed * np.sin(path), rel=0.01)


def test_climbing_mirrors_diving_but_for_its_drag():
    V = mission().V.copy()
    V[at.CLIMB_DRAG] = 0.0
    down = at.rates(V, 1.5, 1026.0, -0.4, 0.01, 0.1, 0.3, 0.01, 0.02)
    up = at.rates(V, -1.5, 1026.0, 0.4, -0.01, 0.1, 0.3, -0.01, -0.02)
    assert up == pytest.approx((down[0], -down[1], -down[2], -down[3]), rel=1e-12)
    V[at.CLIMB_DRAG] = 0.1
    assert at.rates(V, -1.5, 1026.0, 0.4, -0.01, 0.1, 0.3, -0.01, -0.02)[0] < up[0]


@pytest.mark.parametrize("vehicle_class", sorted(CRAFTS))
def test_a_dive_goes_to_its_depth_and_back(vehicle_class):
    made = mission(vehicle_class, 2)
    runs, truth = fly_mission(made, [(None, 0.0)] * 2, speed=True)
    for run, D, fast in zip(runs, made.dives, truth, strict=True):
        depth = run.columns[names.DEPTH]
        assert D[at.DEPTH] - 2.0 < depth.max() < D[at.DEPTH] + 150.0  # it sinks on while the pump begins
        assert depth[-1] < 10.0
        assert np.all(np.diff(run.t) > 0.0)
        assert 0.1 < np.mean(fast) < 0.8
        speed = run.columns[names.SPEED]
        assert np.nanmean(speed) == pytest.approx(np.mean(fast) / np.cos(0.5), rel=0.15)


def test_the_sea_is_the_same_and_the_vehicle_another_behind_a_change():
    made = mission()
    bare, _ = fly_mission(made, [(None, 0.0), ("drag", 0.0)], speed=False)
    changed, _ = fly_mission(made, [(None, 0.0), ("drag", 0.5)], speed=False)
    assert np.array_equal(bare[0].columns[names.DEPTH], changed[0].columns[names.DEPTH])
    assert changed[1].t[-1] > 1.05 * bare[1].t[-1]


def test_each_change_is_what_its_label_says():
    V, S = mission().V, mission().seas[0]
    heavier = at.net_weight(with_change(V, "net_buoyancy", 0.1), S, 50.0, 0.0) - at.net_weight(V, S, 50.0, 0.0)
    assert heavier == pytest.approx(0.1 * V[at.GRAVITY], rel=0.02)
    assert with_change(V, "drag", 0.2)[at.DRAG] == pytest.approx(1.2 * V[at.DRAG])
    assert with_change(V, "lift", -0.5)[at.LIFT] == pytest.approx(0.5 * V[at.LIFT])
    assert with_change(V, "attitude_scale", 0.1)[at.PITCH_SCALE] == pytest.approx(V[at.PITCH_SCALE] + 0.1)
    assert with_change(V, "density_bias", 0.4)[at.DENSITY_BIAS] == pytest.approx(V[at.DENSITY_BIAS] + 0.4)
    with pytest.raises(ValueError, match="tether"):
        with_change(V, "tether", 1.0)


def test_what_no_label_names_acts_where_it_says():
    made = mission("seaglider")
    V, S, D = made.V, made.calm(0), made.dives[0]
    bare = flown(made, 0, V, S)
    upper = D[at.DEPTH] * THRUSTER

    def leg_times(rows, shallow, deep):
        """Seconds between two depths on the way down and on the way up."""
        found = []
        for leg in legs(rows):
            t = leg[(leg[:, at.R_DEPTH] > shallow) & (leg[:, at.R_DEPTH] < deep), at.R_TIME]
            found.append(t[-1] - t[0])
        return np.array(found)

    def slower(label, size, shallow=0.0, deep=1.0):
        ends = shallow * D[at.DEPTH], deep * D[at.DEPTH]
        return leg_times(flown(made, 0, with_change(V, label, size), S), *ends) / leg_times(bare, *ends)

    down, up = slower("x_thruster", 0.3, 0.05, 0.35)
    assert down < 0.95
    assert up < 0.95
    assert upper == pytest.approx(V[at.THRUST_DEPTH], rel=0.1)
    assert slower("x_thruster", 0.3, 0.5, 0.9) == pytest.approx([1.0, 1.0], abs=0.02)
    near, far = slower("x_line", 1e-3, 0.05, 0.2), slower("x_line", 1e-3, 0.7, 0.9)
    assert np.all(far > near + 0.05)
    down, up = slower("x_mud", 0.1, 0.5, 0.9)
    assert down == pytest.approx(1.0, abs=0.01)
    assert up > 1.05
    down, up = slower("x_fouled_wing", 0.1)
    assert abs(down - up) > 0.05
    flipped = slower("x_fouled_wing", -0.1)
    assert (flipped[0] - flipped[1]) * (down - up) < 0.0


def test_of_what_no_label_names_only_that_shows_which_the_nearest_leaves(monkeypatch):
    made = mission("seaglider")
    assert shown(made, "x_thruster", 0.3)[0] > 1.0
    monkeypatch.setattr(ocean_cases, "OUTSIDE_CHANGES", ("drag",))
    assert shown(made, "drag", 0.3)[1] < 1e-4 < ocean_cases.MATERIAL_SPEED


def test_evidence_goes_with_the_square_of_the_change_and_against_that_of_the_water():
    made = mission()
    (small, slower), (large, slowest) = shown(made, "drag", 0.05), shown(made, "drag", 0.1)
    assert large == pytest.approx(4.0 * small, rel=0.25)
    assert slowest == pytest.approx(2.0 * slower, rel=0.13)
    made.seas[0][at.WATER] *= 2.0
    assert shown(made, "drag", 0.05) == pytest.approx((small / 4.0, slower), rel=1e-9)


def steady_share(V: np.ndarray, roll: float) -> np.ndarray:
    state = np.array([0.3, 0.0, 0.02])
    for _ in range(4000):
        state += 0.1 * np.array(at.rates(V, 1.8, 1026.0, -0.4, 0.0, roll, *state)[:3])
    return state


def test_on_its_side_it_slips_to_the_low_side_and_is_slower_by_little():
    V = mission().V
    upright, heeled = steady_share(V, 0.0), steady_share(V, 0.3)
    assert upright[1] == 0.0
    assert 0.003 < heeled[1] < 0.05
    assert 0.95 < heeled[0] / upright[0] < 1.05
