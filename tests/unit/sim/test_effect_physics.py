"""Effects on actuators, hull and mass: each against its closed form or the equation with other numbers."""

import math

import numpy as np
import pytest

from glider.firmware.core.maths.rotations import quaternion_from_euler, rotation_nb
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.water import water_wrench
from glider.sim_backend.core.effect_plant import effect_derivative, effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.actuation import BALLAST_DRIVEN, SLIDER_DRIVEN, backlash
from glider.sim_backend.core.effects.catalogue import apply_effects
from glider.sim_backend.core.effects.hydrodynamics import extra_wrench, tether_wrench
from tests.support.effect_flights import VEHICLE, flown, held, quiet

P = VEHICLE.vector()
SERVO, SLIDER, BALLAST = (VEHICLE.actuators.servo, VEHICLE.actuators.slider, VEHICLE.actuators.ballast)
GRAVITY = 9.80665


class Plain:
    """What an effect can be added to: a vector."""

    def __init__(self, **effects):
        self.F = np.zeros(ef.N_F)
        apply_effects(self, effects)


def vector(**effects):
    return Plain(**effects).F


def effective(vehicle=P, **effects):
    out = np.zeros(layout.N_P)
    effective_parameters(vehicle, vector(**effects), out)
    return out


def a_state(depth=6.0):
    x = np.zeros(ef.N_XF)
    x[2] = depth
    x[3:7] = quaternion_from_euler(0.2, -0.3, 0.7)
    x[7:16] = 0.31, 0.02, -0.03, 0.05, -0.04, 0.03, 0.3, -0.015, 0.12
    x[ef.X_GEAR_SERVO], x[ef.X_GEAR_SLIDER] = x[13], x[14]
    return x


def rates(F, x, mode=0, command=(0.3, -0.015, 0.12), since=0.0, vehicle=P):
    """dx/dt with effects F."""
    whole, out = np.zeros(layout.N_P), np.zeros(layout.N_X)
    effective_parameters(vehicle, F, whole)
    effect_derivative(whole, F, x, mode, *command, since, np.zeros(6), 0.0, np.zeros(3), out)
    return out


SCALED = {
    ("drag", "scale"): layout.K_D0, ("drag", "induced"): layout.K_D, ("lift", "scale"): layout.K_L,
    ("added_mass", "heave"): layout.A_Z, ("added_mass", "sway"): layout.A_Y, ("side_force", "scale"): layout.K_BETA,
    ("pitch_damping", "scale"): layout.K_Q, ("weathercock", "scale"): layout.K_MY, ("yaw_damping", "scale"): layout.K_R,
    ("inertia", "pitch"): layout.J_YY, ("inertia", "yaw"): layout.J_ZZ,
}  # fmt: skip
ADDED = {
    ("pitch_trim", "k"): layout.K_M0, ("net_buoyancy", "mass"): layout.NET_MASS,
    ("cg_longitudinal", "offset"): layout.CG_X, ("cg_lateral", "offset"): layout.CG_Y,
    ("cg_vertical", "offset"): layout.CG_Z,
}  # fmt: skip


@pytest.mark.parametrize(("name", "place"), SCALED.items())
def test_a_share_of_a_coefficient_is_that_share(name, place):
    changed = effective(**{name[0]: {name[1]: 0.25}})
    wanted = P.copy()
    wanted[place] *= 1.25
    if name[0] == "lift":
        wanted[layout.K_L0] *= 1.25
    assert np.array_equal(changed, wanted)


@pytest.mark.parametrize(("name", "place"), ADDED.items())
def test_what_is_added_to_a_parameter_is_added(name, place):
    wanted = P.copy()
    wanted[place] += 0.01
    assert np.array_equal(effective(**{name[0]: {name[1]: 0.01}}), wanted)


# --- actuators ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("label", "index", "actuator"), [("servo_slow", 13, SERVO), ("slider_slow", 14, SLIDER), ("pump_slow", 15, BALLAST)]
)
def test_a_slow_actuator_moves_at_its_lower_rate_and_follows_with_its_longer_lag(label, index, actuator):
    far, near = np.zeros(3), np.zeros(3)
    far[index - 13] = actuator.range[1]
    states, _ = flown(quiet({label: {"rate": 1.2}}), 3.0, held(*far))
    assert states[10:, index] == pytest.approx(actuator.rate * math.exp(-1.2) * 0.1 * np.arange(10, 30), rel=1e-9)
    near[index - 13] = 0.5 * actuator.rate * actuator.time_constant
    states, _ = flown(quiet({label: {"lag": 0.8}}), 3.0, held(*near))
    t, lag = 0.1 * np.arange(30), actuator.time_constant * math.exp(0.8)
    assert states[:, index] == pytest.approx(near[index - 13] * (1.0 - np.exp(-t / lag)), abs=1e-6 * actuator.rate)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("loss", "left"), [(0.4, SERVO.range[1] - 0.4), (1.0, SERVO.range[1] - 1.0)])
def test_a_servo_stops_short_of_its_range(side, loss, left):
    states, _ = flown(quiet({"servo_limit": {"loss": loss}}), 15.0, held(side * 2.0, 0.0, 0.0))
    assert states[-1, 13] == pytest.approx(side * left, abs=1e-6)
    assert (np.abs(states[:, 13]) <= left + 1e-12).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("beyond", [-0.2, 0.15, 0.35, 5.0])
def test_a_stop_that_gives_way_lets_the_servo_go_by_a_share(side, beyond):
    low, high = SERVO.range
    stop = {1.0: high, -1.0: -low}[side] - 0.4
    states, _ = flown(quiet({"servo_limit": {"loss": 0.4, "give": 0.25}}), 25.0, held(side * (stop + beyond), 0.0, 0.0))
    reached = stop + (0.25 * min(beyond, 0.4) if beyond > 0.0 else beyond)
    assert states[-1, 13] == pytest.approx(side * reached, abs=1e-6)


def test_a_servo_that_loses_more_than_it_has_stands_in_the_middle():
    weak = P.copy()
    weak[layout.SERVO_MIN], weak[layout.SERVO_MAX] = -0.6, 0.8
    changed = effective(weak, servo_limit={"loss": 1.0})
    assert changed[layout.SERVO_MIN] == changed[layout.SERVO_MAX] == pytest.approx(0.1)


def test_play_holds_until_it_is_taken_up():
    follower, width = 0.0, 0.2
    way = [0.05, 0.1, 0.3, 0.25, 0.11, 0.1, 0.05, -0.1, -0.1, 0.09, 0.2]
    stands = [0.0, 0.0, 0.2, 0.2, 0.2, 0.2, 0.15, 0.0, 0.0, 0.0, 0.1]
    for leader, wanted in zip(way, stands, strict=True):
        follower = backlash(follower, leader, width)
        assert follower == pytest.approx(wanted, abs=1e-12)
    assert backlash(0.3, 0.7, 0.0) == 0.7


def test_a_servo_within_its_play_leaves_the_rail_hanging():
    def wagging(t):
        return 0.09 * math.sin(t), 0.0, 0.0

    states, _ = flown(quiet({"servo_backlash": {"width": 0.2}}), 20.0, wagging)
    assert np.ptp(states[:, 13]) > 0.12
    assert not states[:, ef.X_GEAR_SERVO].any()
    assert np.abs(states[:, 7:13]).max() < 1e-12  # nothing stirs
    free, _ = flown(quiet(), 20.0, wagging)
    assert np.abs(free[:, 10]).max() > 1e-3


def test_a_servo_that_turns_back_takes_up_its_play_first():
    states, _ = flown(quiet({"servo_backlash": {"width": 0.2}}), 30.0, lambda t: (0.5 if t < 15.0 else 0.2, 0.0, 0.0))
    assert states[149, ef.X_GEAR_SERVO] == pytest.approx(0.4, abs=1e-4)
    assert states[-1, ef.X_GEAR_SERVO] == pytest.approx(0.3, abs=1e-4)
    behind = states[:, 13] - states[:, ef.X_GEAR_SERVO]
    assert np.abs(behind).max() <= 0.1 + 1e-12


def test_the_mass_hangs_behind_the_sliders_play_and_the_draw_wire_on_the_mass():
    states, frames = flown(quiet({"slider_backlash": {"width": 0.01}}), 30.0, held(0.0, 0.03, 0.0))
    assert states[-1, 14] == pytest.approx(0.03, abs=1e-5)
    assert states[-1, ef.X_GEAR_SLIDER] == pytest.approx(0.025, abs=1e-5)
    assert frames[-1, 14] == pytest.approx(0.025, abs=1e-5)
    hanging, there = a_state(), a_state()
    hanging[14], hanging[ef.X_GEAR_SLIDER], there[14] = 0.02, 0.016, 0.016
    F = vector(slider_backlash={"width": 0.01})
    moved = rates(F, hanging, mode=SLIDER_DRIVEN, command=(0.3, 0.01, 0.12))
    assert moved[:13] == pytest.approx(rates(vector(), there, mode=SLIDER_DRIVEN, command=(0.3, 0.0, 0.12))[:13])


def test_a_drooping_pump_is_slower_where_it_expels_at_depth():
    F = vector(pump_droop={"droop": 0.05})
    for depth in (0.0, 10.0, 40.0):
        expelling, taking = (rates(F, a_state(depth), command=(0.3, -0.015, to))[15] for to in (-0.2, 0.2))
        assert expelling == pytest.approx(-BALLAST.rate * math.exp(-0.05 * depth))
        assert taking == pytest.approx(rates(vector(), a_state(depth), command=(0.3, -0.015, 0.2))[15])


def test_a_leak_is_water_in_the_tank_that_the_draw_wire_does_not_show():
    x, since = a_state(), 40.0
    full = x.copy()
    full[15] += 0.0005 * since
    leaking = rates(vector(ballast_leak={"rate": 0.0005}), x, since=since)
    driven = rates(vector(), full, mode=BALLAST_DRIVEN, command=(0.3, -0.015, 0.0005))
    assert leaking[:15] == pytest.approx(driven[:15], abs=1e-14)
    states, frames = flown(quiet({"ballast_leak": {"rate": 0.0005}}), 40.0, held(0.0, 0.0, 0.0))
    assert states[-1, 2] > 8.5
    assert not states[:, 15].any()
    assert np.nanmax(np.abs(frames[:, 17])) == 0.0


def test_a_tank_of_another_size_is_another_mass_behind_the_same_reading():
    x = a_state()
    other = x.copy()
    other[15] *= 1.15
    speed = 0.004
    scaled = rates(vector(ballast_scale={"scale": 0.15}), x, mode=BALLAST_DRIVEN, command=(0.3, -0.015, speed))
    wanted = rates(vector(), other, mode=BALLAST_DRIVEN, command=(0.3, -0.015, 1.15 * speed))
    assert scaled[:13] == pytest.approx(wanted[:13], abs=1e-14)


def test_a_slider_of_another_scale_is_another_position_behind_the_same_reading():
    x = a_state()
    other = x.copy()
    other[14] *= 1.15
    scaled = rates(vector(slider_scale={"scale": 0.15}), x, mode=SLIDER_DRIVEN, command=(0.3, 0.01, 0.12))
    wanted = rates(vector(), other, mode=SLIDER_DRIVEN, command=(0.3, 0.0115, 0.12))
    assert scaled[:13] == pytest.approx(wanted[:13], abs=1e-14)


def test_a_servo_offset_turns_the_rail_and_not_the_servo():
    x = a_state()
    other = x.copy()
    other[13] += 0.15
    offset = rates(vector(servo_offset={"angle": 0.15}), x)
    wanted = rates(vector(), other, command=(0.45, -0.015, 0.12))
    assert offset[:13] == pytest.approx(wanted[:13], abs=1e-14)


# --- water on the hull ----------------------------------------------------------------------------------------------


def wrench(F, u, v, w, pitch=0.0):
    return np.array(extra_wrench(P, F, -math.sin(pitch), 0.0, u, v, w, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("alpha", [-0.3, -0.05, 0.0, 0.04, 0.1, 0.25])
@pytest.mark.parametrize("printed", [False, True])
def test_stall_caps_the_lift_and_only_the_lift(alpha, printed):
    vehicle = P.copy()
    vehicle[layout.LIFT_PRINTED] = float(printed)
    speed, most = 0.4, 1.0 / 15.0
    u, w = speed * math.cos(alpha), speed * math.sin(alpha)
    F = vector(stall={"inverse": 15.0})
    moving = (u, 0.0, w, 0.0, 0.0, 0.0)
    force = np.array(water_wrench(vehicle, *moving)) + extra_wrench(vehicle, F, 0.0, 0.0, *moving)
    lift = force[0] * math.sin(alpha) - force[2] * math.cos(alpha)
    drag = -force[0] * math.cos(alpha) - force[2] * math.sin(alpha)
    held_ = max(-most, min(most, alpha))
    slope = held_ * held_ if printed else held_
    assert lift == pytest.approx((P[layout.K_L0] + P[layout.K_L] * slope) * speed**2, abs=1e-12)
    assert drag == pytest.approx((P[layout.K_D0] + P[layout.K_D] * alpha**2) * speed**2)


@pytest.mark.parametrize("rate", [0.3, -0.3])
@pytest.mark.parametrize(
    ("label", "coefficient", "moment"), [("pitch_damping", layout.K_Q, 4), ("yaw_damping", layout.K_R, 5)]
)
def test_damping_across_the_flow_is_against_the_turn_and_squared(rate, label, coefficient, moment):
    q, r = (rate, 0.0) if moment == 4 else (0.0, rate)
    wanted = np.zeros(6)
    wanted[moment] = 0.5 * P[coefficient] * abs(rate) * rate
    extra = extra_wrench(P, vector(**{label: {"across": 0.5}}), 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, q, r)
    assert extra == pytest.approx(wanted)
    assert wanted[moment] * rate < 0.0


@pytest.mark.parametrize(("pitch", "sign"), [(0.4, 1.0), (0.0, 0.0), (-0.4, -1.0)])
def test_climbing_drags_more_and_diving_less(pitch, sign):
    u, v, w = 0.4, 0.02, 0.03
    drag = (P[layout.K_D0] + P[layout.K_D] * math.atan2(w, u) ** 2) * (u * u + v * v + w * w)
    extra = wrench(vector(climb_dive_asymmetry={"share": 0.3}), u, v, w, pitch=pitch)
    along = extra[:3] @ np.array([u, v, w]) / math.sqrt(u * u + v * v + w * w)
    assert along == pytest.approx(-sign * 0.3 * drag, rel=1e-3, abs=1e-12)
    assert np.linalg.norm(extra[:3]) == pytest.approx(abs(along))
    assert not extra[3:].any()


def test_linear_drag_is_proportional_and_against_the_motion():
    assert wrench(vector(linear_drag={"k": 2.0}), 0.4, -0.1, 0.05) == pytest.approx([-0.8, 0.2, -0.1, 0, 0, 0])


@pytest.mark.parametrize("u", [0.4, -0.3])
def test_a_line_pulls_at_the_tail_against_its_way(u):
    tied, omega = np.array([ef.TAIL, 0.0, -ef.TAIL_TOP]), np.array([0.0, 0.2, -0.1])
    tail = np.array([u, -0.05, 0.03]) + np.cross(omega, [ef.TAIL, 0.0, 0.0])
    F = vector(tether={"k": 1.5, "growth": 0.2, "across": 0.5})
    force = -(1.5 + 0.2 * 4.0) * np.linalg.norm(tail) * tail * [1.0, 0.5, 0.5]
    X, Y, Z, M, N = tether_wrench(F, 4.0, u, -0.05, 0.03, omega[1], omega[2])
    assert np.array([X, Y, Z]) == pytest.approx(force)
    along, across = np.cross(tied, force * [1.0, 0.0, 0.0]), np.cross([ef.TAIL, 0.0, 0.0], force)
    assert np.array([M, N]) == pytest.approx([along[1] + across[1], across[2]])


@pytest.mark.parametrize(("label", "axis"), [("roll_trim", 0), ("yaw_trim", 2)])
def test_a_trim_moment_grows_with_the_square_of_the_speed(label, axis):
    slow, fast = (wrench(vector(**{label: {"k": 0.1}}), speed, 0.0, 0.0) for speed in (0.2, 0.6))
    assert slow[3 + axis] == pytest.approx(0.1 * 0.04)
    assert fast == pytest.approx(9.0 * slow)
    assert np.count_nonzero(slow) == 1


# --- mass -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [0.03, -0.03])
def test_a_net_mass_ends_in_a_steady_balance_of_weight_and_water(mass):
    """Far from the start, the water's force in NED is the net weight, straight up or down."""
    made = quiet({"net_buoyancy": {"mass": mass}}, depth=200.0)
    states, _ = flown(made, 600.0, held(0.0, 0.0, 0.0))
    x = states[-1]
    assert np.abs(x[7:13] - states[-50, 7:13]).max() < 1e-6
    R = np.array(rotation_nb(*x[3:7])).reshape(3, 3)
    force = R @ np.array(water_wrench(P, *x[7:13])[:3])
    assert force == pytest.approx([0.0, 0.0, -mass * GRAVITY], abs=1e-5)


@pytest.mark.parametrize(("label", "slope"), [("compressibility", 0.002), ("stratification", -0.002)])
def test_a_mass_that_changes_with_depth_is_a_net_mass_at_each_depth(label, slope):
    for depth in (0.0, 5.0, 50.0):
        x = a_state(depth)
        wanted = rates(vector(net_buoyancy={"mass": slope * depth}), x)
        assert rates(vector(**{label: {"slope": slope}}), x) == pytest.approx(wanted, abs=1e-13)


def test_a_mixed_layer_is_of_one_density_and_denser_water_lies_below_it():
    stratified = vector(stratification={"slope": -0.002, "mixed": 4.0})
    for depth, mass in ((0.5, 0.0), (4.0, 0.0), (5.5, -0.003), (24.0, -0.04)):
        x = a_state(depth)
        assert rates(stratified, x) == pytest.approx(rates(vector(net_buoyancy={"mass": mass}), x), abs=1e-13)


def test_a_vehicle_in_denser_water_below_oscillates_about_its_depth():
    """Stratification makes a spring, compressibility the opposite: light above and heavy below runs away."""
    at_depth = {"net_buoyancy": {"mass": 0.05}, "stratification": {"slope": -0.005}}
    stable, _ = flown(quiet(at_depth, depth=10.5), 300.0, held(0.0, 0.0, 0.0))
    assert abs(stable[-600:, 2].mean() - 10.0) < 0.25
    unstable = {"net_buoyancy": {"mass": -0.05}, "compressibility": {"slope": 0.005}}
    away, _ = flown(quiet(unstable, depth=10.5), 300.0, held(0.0, 0.0, 0.0))
    assert away[-1, 2] > 14.0
